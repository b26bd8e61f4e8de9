"""Parameters of the page, and what they describe together."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tripod_graph.names import WORKING_POSE
from tripod_graph.parameters import Parameter, ParameterError
from tripod_view.arm import ArmGeometry
from tripod_view.control import Limits
from tripod_view.target import TargetHandle

GEOMETRY = ArmGeometry()

PARAMETERS: tuple[Parameter, ...] = (
    Parameter(
        "port",
        8080,
        "port of the page; the next free one if it is taken, any free one for 0",
        low=0,
        high=65535,
    ),
    Parameter("rate", 30.0, "pictures a second", "Hz", low=1.0, high=60.0),
    Parameter("angle_min", -2.1, "smallest angle of the sliders", "rad", low=-3.2, high=3.2),
    Parameter("angle_max", 0.6, "largest angle of the sliders", "rad", low=-3.2, high=3.2),
    Parameter(
        "move_speed", 0.4, "mean speed of the servos on the way to a pose", "rad/s", low=0.01, high=4.0
    ),
    Parameter("park", [0.0, 0.0, 0.0, 0.0], "park pose: three angles [rad] and the slide [m]"),
    Parameter("target_low", [-0.02, -0.02, -0.03], "lower corner of the box for the target", "m"),
    Parameter("target_high", [0.02, 0.02, 0.015], "upper corner of that box", "m"),
    Parameter(
        "axis_radius", GEOMETRY.axis_radius, "radius of the servo axes at slide 0", "m", low=0.001, high=1.0
    ),
    Parameter(
        "axis_depth", GEOMETRY.axis_depth, "depth of the axes below the mid-plane", "m", low=0.001, high=1.0
    ),
    Parameter("clamp_inner", GEOMETRY.clamp_inner, "radius where the clamps begin", "m", low=0.001, high=1.0),
    Parameter("clamp_outer", GEOMETRY.clamp_outer, "radius of the strips' tips", "m", low=0.001, high=1.0),
    Parameter("strip_width", GEOMETRY.strip_width, "width of a strip", "m", low=0.001, high=1.0),
    Parameter("thickness", GEOMETRY.thickness, "thickness of the silicone", "m", low=0.0001, high=0.1),
    Parameter(
        "effector_radius", GEOMETRY.effector_radius, "radius of the effector", "m", low=0.0001, high=0.5
    ),
)


@dataclass(frozen=True)
class Settings:
    """The checked parameters.

    Attributes:
        port: Port asked for.
        rate: Pictures a second [Hz].
        limits: Of what the page may ask the joints.
        park: Park pose: three angles [rad] and the slide [m].
        geometry: Of the robot that is drawn.
        target: The handle, with its box.
    """

    port: int
    rate: float
    limits: Limits
    park: tuple[float, float, float, float]
    geometry: ArmGeometry
    target: TargetHandle


def checked_settings(values: dict[str, Any]) -> Settings:
    """Return what the parameters `values` describe; raise ParameterError if they do not fit together."""
    park = values["park"]
    try:
        limits = Limits(values["angle_min"], values["angle_max"], values["move_speed"])
        geometry = ArmGeometry(**{name: values[name] for name in ArmGeometry.__dataclass_fields__})
        target = TargetHandle(values["target_low"], values["target_high"])
    except ValueError as error:  # of the three; their messages begin with the name of the parameter
        raise ParameterError(f"parameter {error}") from None
    if len(park) != len(WORKING_POSE) or not np.isfinite(park).all():
        raise ParameterError(f"parameter 'park' is {park!r}; it takes three angles and the slide, all finite")
    if not limits.allow(park):
        raise ParameterError(
            f"parameter 'park' is {park!r}; its angles must be within angle_min and angle_max"
        )
    return Settings(values["port"], values["rate"], limits, tuple(park), geometry, target)
