"""Where a servo arm stands: forward kinematics of one rigid arm from its angle and the slide."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tripod_view.pose import Pose

FloatArray = NDArray[np.float64]

ARMS = 3


class GeometryError(ValueError):
    """A dimension that no robot can have; the message names it, its value and what is allowed."""


@dataclass(frozen=True)
class ArmGeometry:
    """Dimensions of the robot that the page draws.

    Attributes:
        axis_radius: Distance of a servo axis from the centre, slide 0 [m].
        axis_depth: Depth of the axes below the mid-plane of the flat piece [m].
        clamp_inner: Radius at which the clamp begins when flat [m].
        clamp_outer: Radius at which it ends, the tip of the strip [m].
        strip_width: Width of a strip [m].
        thickness: Thickness of the silicone [m].
        effector_radius: Radius of the effector's disc [m].
    """

    axis_radius: float = 0.060
    axis_depth: float = 0.02885
    clamp_inner: float = 0.045
    clamp_outer: float = 0.055
    strip_width: float = 0.030
    thickness: float = 0.005
    effector_radius: float = 0.0075

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (np.isfinite(value) and value > 0):
                raise GeometryError(f"{field.name} is {value}; it must be positive and finite")
        if not self.clamp_inner < self.clamp_outer:
            raise GeometryError(
                f"clamp_inner {self.clamp_inner:g} m must be below clamp_outer {self.clamp_outer:g} m"
            )


def azimuth(arm: int) -> float:
    """Return the azimuth of strip `arm` from +X, 2 pi arm / 3 [rad]."""
    return 2 * np.pi * arm / ARMS


def carriage_pose(arm: int, slide: float, geometry: ArmGeometry) -> Pose:
    """Return the frame of servo body `arm`: it slides inward by `slide` [m] and never turns.

    The origin is on the servo's axis, x points outward along the strip, z up.
    """
    phi, radius = azimuth(arm), geometry.axis_radius - slide
    position = np.array([radius * np.cos(phi), radius * np.sin(phi), -geometry.axis_depth])
    return Pose.of(position, [0.0, 0.0, np.sin(phi / 2), np.cos(phi / 2)])


def arm_pose(arm: int, angle: float, slide: float, geometry: ArmGeometry) -> Pose:
    """Return the frame of arm `arm` at servo angle `angle` [rad] and `slide` [m].

    At angle 0 it is the frame of the servo body. A negative angle turns it about its own +y, which carries
    the tip of the arm (above the axis, on +z) outward and then down.
    """
    carriage = carriage_pose(arm, slide, geometry)
    _, _, s, c = carriage.quaternion  # about z
    turn_s, turn_c = np.sin(-angle / 2), np.cos(-angle / 2)  # about y
    return Pose.of(carriage.position, [-s * turn_s, c * turn_s, s * turn_c, c * turn_c])


def clamp_corners(geometry: ArmGeometry) -> FloatArray:
    """Return the corners of the clamped end of the strip in the frame of its arm [m], shape (2, 2, 2, 3).

    Indices: inner or outer edge, left or right, lower or upper face.
    """
    x = np.array([geometry.clamp_inner, geometry.clamp_outer]) - geometry.axis_radius
    y = np.array([-0.5, 0.5]) * geometry.strip_width
    z = geometry.axis_depth + np.array([-0.5, 0.5]) * geometry.thickness
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
