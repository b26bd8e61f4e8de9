"""Parameters of the page, and what they describe together."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tripod_graph.command import CommandLimits
from tripod_graph.limits import LIMIT_PARAMETERS, limits_from
from tripod_graph.parameters import Parameter, ParameterError
from tripod_view.arm import ArmGeometry
from tripod_view.target import TargetHandle

GEOMETRY = ArmGeometry()

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("port", 8080, "Port of the page; 0: any free one", low=0, high=65535),
    Parameter("rate", 30.0, "Pictures a second", "Hz", low=1.0, high=60.0, dynamic=True),
    *LIMIT_PARAMETERS,
    Parameter(
        "move_speed",
        0.4,
        "Mean speed of the servos on the way to a pose",
        "rad/s",
        low=0.01,
        high=4.0,
        dynamic=True,
    ),
    Parameter("target_low", [-0.02, -0.02, -0.03], "Lower corner of the box for the target", "m"),
    Parameter("target_high", [0.02, 0.02, 0.015], "Upper corner of that box", "m"),
    Parameter(
        "axis_radius", GEOMETRY.axis_radius, "Radius of the servo axes, slide 0", "m", low=0.001, high=1.0
    ),
    Parameter(
        "axis_depth", GEOMETRY.axis_depth, "Depth of the axes below mid-plane", "m", low=0.001, high=1.0
    ),
    Parameter("clamp_inner", GEOMETRY.clamp_inner, "Radius where the clamps begin", "m", low=0.001, high=1.0),
    Parameter("clamp_outer", GEOMETRY.clamp_outer, "Radius of the strips' tips", "m", low=0.001, high=1.0),
    Parameter("strip_width", GEOMETRY.strip_width, "Width of a strip", "m", low=0.001, high=1.0),
    Parameter("thickness", GEOMETRY.thickness, "Thickness of the silicone", "m", low=0.0001, high=0.1),
    Parameter("effector_radius", GEOMETRY.effector_radius, "Radius of the disc", "m", low=0.0001, high=0.5),
)


@dataclass(frozen=True)
class Settings:
    """The checked parameters.

    Attributes:
        port: Port asked for.
        rate: Pictures a second [Hz].
        limits: Of what the page may ask the joints.
        move_speed: Mean speed of the servos on the way to a pose [rad/s].
        geometry: Of the robot that is drawn.
        target: The handle, with its box.
    """

    port: int
    rate: float
    limits: CommandLimits
    move_speed: float
    geometry: ArmGeometry
    target: TargetHandle


def check(values: Mapping[str, Any]) -> None:
    """Raise ParameterError where the values do not fit together."""
    checked_settings(values)


def checked_settings(values: Mapping[str, Any]) -> Settings:
    """Return what the parameters `values` describe; raise ParameterError if they do not fit together."""
    try:
        limits = limits_from(values)
        geometry = ArmGeometry(**{name: values[name] for name in ArmGeometry.__dataclass_fields__})
        target = TargetHandle(values["target_low"], values["target_high"])
    except ValueError as error:  # of the three; their messages begin with the name of the parameter
        raise ParameterError(f"parameter {error}") from None
    return Settings(values["port"], values["rate"], limits, values["move_speed"], geometry, target)
