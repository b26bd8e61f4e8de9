"""Parameters that are the same in every node that follows commands."""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, Final

from tripod_graph import names
from tripod_graph.command import CommandLimits
from tripod_graph.joint import Joint
from tripod_graph.parameters import Parameter

_DEFAULTS = CommandLimits()

LIMIT_PARAMETERS: Final = (
    Parameter("angle_min", _DEFAULTS.angle_min, "Smallest servo angle", "rad", low=-3.2, high=3.2),
    Parameter("angle_max", _DEFAULTS.angle_max, "Largest servo angle", "rad", low=-3.2, high=3.2),
    Parameter(
        "angle_speed",
        _DEFAULTS.angle_speed,
        "Slew rate of a servo",
        "rad/s",
        low=0.01,
        high=50.0,
        dynamic=True,
    ),
    Parameter("slide_max", _DEFAULTS.slide_max, "Largest inward slide", "m", low=0.0, high=0.1),
    Parameter(
        "slide_speed",
        _DEFAULTS.slide_speed,
        "Slew rate of the slide",
        "m/s",
        low=0.001,
        high=10.0,
        dynamic=True,
    ),
    Parameter(
        "timeout",
        _DEFAULTS.timeout,
        "Silence after which the joints hold",
        "s",
        low=0.02,
        high=60.0,
        dynamic=True,
    ),
    Parameter(
        "park_after",
        _DEFAULTS.park_after,
        "Holding after which they park",
        "s",
        low=0.0,
        high=3600.0,
        dynamic=True,
    ),
    Parameter("park", [], "Park position: the angle of each servo [rad] and the slide [m]; empty: all 0"),
)
"""To be part of a node's table; `limits_from` reads the values."""

RANGE_TIME_PARAMETER: Final = Parameter(
    "range_time",
    1.0,
    "Time in which a cable, chamber or force may pass through its range",
    "s",
    low=0.01,
    high=600.0,
    dynamic=True,
)
"""Of nodes that follow commands of other joints than servos."""

JOINT_STATES_PARAMETER: Final = Parameter(
    "joint_states",
    False,
    f"Tell the joint states on `{names.JOINT_STATES}`, too, where other programs look: of one robot let one node",
)


def limits_from(
    values: Mapping[str, Any], count: int | None = None, others: tuple[Joint, ...] = ()
) -> CommandLimits:
    """Return the limits that the parameters set for `count` servos, None: as many as the park position has, or three.

    The slew rates of `others`, joints that are no servos, are those of the parameter `range_time`.

    Raises CommandError if they contradict each other.
    """
    park = tuple(values["park"])
    servos = count if count is not None else len(park) - 1 if park else _DEFAULTS.count
    others = tuple(replace(joint, speed=joint.span / values["range_time"]) for joint in others)
    own = {parameter.name for parameter in LIMIT_PARAMETERS}
    chosen = {
        field.name: values[field.name] for field in fields(CommandLimits) if field.name in own & set(values)
    }
    return CommandLimits(**{**chosen, "park": park, "count": servos, "others": others})
