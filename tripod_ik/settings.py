"""Parameters of the node, and what they make."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tripod_graph import names
from tripod_graph.command import CommandLimits
from tripod_graph.joint import Joint
from tripod_graph.limits import RANGE_TIME_PARAMETER
from tripod_graph.parameters import Parameter
from tripod_ik.errors import IkError
from tripod_ik.feedback import ModelError
from tripod_ik.target import TargetBox
from tripod_ik.tracker_settings import Goal, TrackerSettings

if TYPE_CHECKING:
    from tripod_ik.load import LoadObserver
    from tripod_ik.prediction_interval import ExpectedError
    from tripod_sim.scene import Scene

_COMMAND, _TRACKER = CommandLimits(), TrackerSettings()

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("angle_min", _COMMAND.angle_min, "smallest servo angle commanded", "rad", low=-3.2, high=3.2),
    Parameter("angle_max", _COMMAND.angle_max, "largest servo angle commanded", "rad", low=-3.2, high=3.2),
    Parameter(
        "angle_speed",
        _TRACKER.angle_speed,
        "largest speed of the commanded angles; keep it below the slew rate of those who follow",
        "rad/s",
        low=0.01,
        high=20.0,
        dynamic=True,
    ),
    RANGE_TIME_PARAMETER,
    Parameter(
        "effector_speed",
        _TRACKER.effector_speed,
        "largest speed of the effector that commands ask for; swinging it is up to 2.6 times as fast",
        "m/s",
        low=0.001,
        high=10.0,
        dynamic=True,
    ),
    Parameter(
        "max_step",
        _TRACKER.step,
        "farthest that a command may be ahead of the present angle",
        "rad",
        low=0.01,
        high=3.2,
        dynamic=True,
    ),
    # An SG90 stalls at 0.18 N m and the working pose alone takes 0.14 N m: near the stall torque the limit would
    # rule out much of the workspace in simulation; the default keeps off only what no such servo comes near.
    Parameter(
        "torque_max",
        _TRACKER.torque_max,
        "torque of a servo that the target must not cause, as far as possible; .inf for none",
        "N m",
        low=0.001,
    ),
    Parameter("box_low", [], "smallest x, y, z of the effector at rest; unset for no box", "m"),
    Parameter("box_high", [], "largest x, y, z of the effector at rest; set both or none", "m"),
    Parameter(
        "hard",
        _TRACKER.hard,
        "whether torque_max and the box are hard limits; else the target may pass them a little",
    ),
    Parameter(
        "weights",
        [1.0, 1.0, 1.0],
        "how much x, y and z of the target count; 0 leaves an axis free",
        low=0.0,
        dynamic=True,
    ),
    Parameter(
        "tolerance",
        _TRACKER.tolerance,
        "distance up to which the target counts as reached",
        "m",
        low=1e-7,
        dynamic=True,
    ),
    Parameter(
        "target_low",
        [],
        "smallest x, y, z of a target that is accepted; unset: -0.15, of robots with cables, chambers or forces -1",
        "m",
    ),
    Parameter(
        "target_high",
        [],
        "largest x, y, z of a target that is accepted; unset: 0.15, of robots with cables, chambers or forces 1",
        "m",
    ),
    Parameter(
        "goal",
        "position",
        "what of a target is followed: its position; its roll, pitch and height; or position and tilt, a compromise",
        choices=tuple(Goal),
    ),
    Parameter(
        "lever", _TRACKER.lever, "metres that a radian of tilt counts", "m", low=1e-4, high=1.0, dynamic=True
    ),
    Parameter(
        "lead",
        _TRACKER.lead,
        "how far ahead of itself a moving target is aimed at: the time the robot takes to answer",
        "s",
        low=0.0,
        high=0.5,
        dynamic=True,
    ),
    Parameter(
        "feedback",
        "none",
        f"what closes the loop: nothing, a measured pose ({names.ROBOT_EFFECTOR_POSE}), or the tilt of an IMU "
        f"({names.ROBOT_IMU})",
        choices=("none", "pose", "imu"),
    ),
    Parameter(
        "feedback_time",
        0.4,
        "time in which the feedback removes an error",
        "s",
        low=0.02,
        high=60.0,
        dynamic=True,
    ),
    Parameter(
        "feedback_delay", 0.03, "age of a measurement when it comes in", "s", low=0.0, high=0.5, dynamic=True
    ),
    Parameter(
        "observe_load",
        False,
        "whether the weight on the effector, beyond what was there when the mode became IK, is estimated, told in "
        "/diagnostics and taken into account; needs feedback",
    ),
    Parameter(
        "posterior",
        "",
        "file that `tripod identify --json` printed, of `scene`: the expected error of the pose at rest is then told "
        "in /diagnostics, with 90 % bars; empty for none",
    ),
    Parameter("scene", "tripod", "scene of the own model: of ways around snaps, and without a simulator"),
    Parameter("set", "", "overrides of it, dotted.path=value, separated by semicolons"),
    Parameter(
        "slide",
        names.WORKING_SLIDE,
        "inward shift of the servo bodies, for the own model",
        "m",
        low=0.0,
        high=0.1,
    ),
    Parameter(
        "own_model_rate", 50.0, "how often the own model is asked", "Hz", low=5.0, high=200.0, dynamic=True
    ),
    Parameter(
        "own_model_after",
        1.0,
        "time without a simulator in the graph after which the own model is used",
        "s",
        low=0.1,
        high=60.0,
        dynamic=True,
    ),
    Parameter(
        "stale_after",
        0.2,
        "silence of the simulator after which nothing is commanded, and motion begins again from where it is",
        "s",
        low=0.02,
        high=5.0,
        dynamic=True,
    ),
)


def check(values: Mapping[str, Any]) -> None:
    """Raise ValueError where the values do not fit together, or name no scene or file."""
    command_limits(tracker_settings(values), servos=1)
    scene = scene_of(values)
    target_box(values, scene)
    load_observer(values, scene)
    expected(values, scene)


def scene_of(values: Mapping[str, Any]) -> "Scene":
    """Return the scene of the own model; raise SceneError, which is a ValueError, where it cannot be loaded."""
    from tripod_sim.scene.file import load_scene, override_words  # noqa: PLC0415 - tables of parameters need none

    return load_scene(values["scene"], override_words(values["set"]))


def tracker_settings(values: Mapping[str, Any]) -> TrackerSettings:
    """Return how the tracker moves the robot, from the node's parameters; raise IkError where they do not fit."""
    if len(values["weights"]) != 3:
        raise IkError(f"parameter 'weights' has {len(values['weights'])} values; it needs 3: x, y, z")
    return TrackerSettings(
        angle_min=values["angle_min"],
        angle_max=values["angle_max"],
        angle_speed=values["angle_speed"],
        effector_speed=values["effector_speed"],
        step=values["max_step"],
        torque_max=values["torque_max"],
        box=_box(values["box_low"], values["box_high"]),
        hard=values["hard"],
        weights=(values["weights"][0], values["weights"][1], values["weights"][2]),
        tolerance=values["tolerance"],
        goal=Goal(values["goal"]),
        lever=values["lever"],
        lead=values["lead"],
    )


def target_box(values: Mapping[str, Any], scene: "Scene") -> TargetBox:
    """Return which targets are accepted; raise IkError where the parameters name no box."""
    from tripod_sim.tables.short_forms import joints_of  # noqa: PLC0415 - tables of parameters need none

    joints = joints_of(scene)
    far = 1.0 if joints and joints.others else 0.15
    return TargetBox(
        np.array(values["target_low"] or [-far] * 3), np.array(values["target_high"] or [far] * 3)
    )


def command_limits(settings: TrackerSettings, servos: int, others: tuple[Joint, ...] = ()) -> CommandLimits:
    """Return the tracker's limits as those of commands to so many servos and to `others`; it never parks."""
    still = min(max(0.0, settings.angle_min), settings.angle_max)
    return CommandLimits(
        angle_min=settings.angle_min,
        angle_max=settings.angle_max,
        angle_speed=settings.angle_speed,
        park=(*(still,) * servos, 0.0),
        count=servos,
        others=others,
    )


def model_error(values: Mapping[str, Any]) -> ModelError | None:
    """Return what closes the loop; None where nothing does."""
    if values["feedback"] == "none":
        return None
    return ModelError(values["feedback_time"], values["feedback_delay"])


def load_observer(values: Mapping[str, Any], scene: "Scene") -> "LoadObserver | None":
    """Return what estimates the weight on the effector, None where nobody asks.

    Raises IkError without a measurement, and for a robot with other joints than servos.
    """
    if not values["observe_load"]:
        return None
    if values["feedback"] == "none":
        raise IkError(
            "parameter 'observe_load' needs a measurement: add --set feedback=pose or --set feedback=imu"
        )
    from tripod_ik.load import LoadObserver  # noqa: PLC0415 - an effect that is absent
    from tripod_ik.solvable import not_servos  # noqa: PLC0415

    if reason := not_servos(scene, "parameter 'observe_load'"):
        raise IkError(reason)
    return LoadObserver(values["feedback_delay"])


def expected(values: Mapping[str, Any], scene: "Scene") -> "ExpectedError | None":
    """Return what tells the expected error of poses, None where nobody asks; raise IkError for a file without it."""
    if not values["posterior"]:
        return None
    from tripod_ik.prediction_interval import expected_error  # noqa: PLC0415 - an effect that is absent
    from tripod_ik.solvable import not_servos  # noqa: PLC0415

    if reason := not_servos(scene, "parameter 'posterior'"):
        raise IkError(reason)
    return expected_error(Path(values["posterior"]), scene)


def _box(low: Sequence[float], high: Sequence[float]) -> Any:
    """Return the parameters `box_low` and `box_high` as the tracker's box [m], None where they are unset."""
    if not low and not high:
        return None
    for name, side in (("box_low", low), ("box_high", high)):
        if len(side) != 3:
            raise IkError(f"parameter '{name}' has {len(side)} values; it needs 3: x, y, z")
    return tuple(low), tuple(high)
