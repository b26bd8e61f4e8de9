"""Where a servo arm stands: forward kinematics of one rigid arm from its angle and the slide."""

from dataclasses import dataclass, fields

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.rotations import quaternion_product, vector_quaternion
from tripod_view.pose import Pose


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


@dataclass(frozen=True)
class Stand:
    """Where a servo stands, and what its arm looks like.

    Attributes:
        hub: A point on its axis, slide 0 [m].
        quaternion: Of its body: x points outward along the strip, y against the axis, z along the arm at angle 0.
        inward: Unit vector of a positive slide; zero where it does not slide.
        length: From the axis to the mid-plane of what the arm holds [m].
        grip: How far inward of the axis the clamp begins [m].
        rail: Length of the rail on which the body slides [m].
    """

    hub: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]
    inward: tuple[float, float, float]
    length: float
    grip: float
    rail: float


def stands(count: int, geometry: ArmGeometry) -> tuple[Stand, ...]:
    """Return `count` servos evenly about Z: number i at the azimuth 2 pi i / count from +X."""
    found = []
    for i in range(count):
        phi = 2 * np.pi * i / count
        c, s = float(np.cos(phi)), float(np.sin(phi))
        g = geometry
        found.append(
            Stand(
                (g.axis_radius * c, g.axis_radius * s, -g.axis_depth),
                (0.0, 0.0, float(np.sin(phi / 2)), float(np.cos(phi / 2))),
                (-c, -s, 0.0),
                g.axis_depth,
                g.axis_radius - g.clamp_inner,
                g.axis_radius,
            )
        )
    return tuple(found)


def carriage_pose(stand: Stand, slide: float) -> Pose:
    """Return the frame of a servo's body: it slides inward by `slide` [m] and never turns.

    The origin is on the servo's axis, x points outward along the strip, z along the arm: up.
    """
    return Pose.of(np.array(stand.hub) + slide * np.array(stand.inward), stand.quaternion)


def arm_pose(stand: Stand, angle: float, slide: float) -> Pose:
    """Return the frame of an arm at servo angle `angle` [rad] and `slide` [m].

    At angle 0 it is the frame of the servo body. A negative angle turns it about its own +y, which carries
    the tip of the arm (above the axis, on +z) outward and then down.
    """
    carriage = carriage_pose(stand, slide)
    turn = vector_quaternion([0.0, -angle, 0.0])
    return Pose.of(carriage.position, quaternion_product(carriage.quaternion, turn))


def clamp_corners(stand: Stand, geometry: ArmGeometry) -> FloatArray:
    """Return the corners of the clamped end of the strip in the frame of its arm [m], shape (2, 2, 2, 3).

    Indices: inner or outer edge, left or right, lower or upper face.
    """
    x = -stand.grip + np.array([0.0, geometry.clamp_outer - geometry.clamp_inner])
    y = np.array([-0.5, 0.5]) * geometry.strip_width
    z = stand.length + np.array([-0.5, 0.5]) * geometry.thickness
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
