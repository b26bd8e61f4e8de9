"""A servo script for the robot: what `tripod run --servo` simulates, `tripod up --servo` plays to all who listen."""

from collections.abc import Sequence

import numpy as np

from tripod_play.joint_path import JointPath

HELD = 0.1
"""How long a script of a single pose lasts [s]."""


def joint_path(
    scene: str, overrides: Sequence[str], servo: str | None, slide: str | None
) -> JointPath | None:
    """Return the motion that the options `--servo` and `--slide` ask for, None where they ask for none.

    Raises:
        SceneError: they cannot be read, go beyond the limits of the scene, or it has no servos; it is a ValueError.
    """
    if servo is None and slide is None:
        return None
    from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help
    from tripod_sim.scene.file import load_scene  # noqa: PLC0415
    from tripod_sim.scene.script import script_of  # noqa: PLC0415
    from tripod_sim.tables.short_forms import joints_of  # noqa: PLC0415

    found = load_scene(scene, overrides)
    if servo is None:
        raise SceneError("--slide needs --servo: the robot is moved to both")
    joints = joints_of(found)
    if joints and joints.others:
        raise SceneError(
            f"--servo: scene {found.name!r} has {', '.join(a.name for a in joints.others)}, which it does not move; "
            "leave it out, and command all joints by a joint_trajectory, `tripod teleop` or the page"
        )
    script = script_of(found, servo, slide)
    angles, slides = script.angles, script.slides
    assert angles
    times = np.union1d(angles.times, slides.times if slides else [])
    if len(times) == 1:
        times = np.append(times, times + HELD)
    places = [np.append(angles.at(t), slides.at(t) if slides else []) for t in times]
    return JointPath(times, np.array(places), angles.values.shape[1])
