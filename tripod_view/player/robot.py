"""The robot in a film: base, servos, arms and disc, from angles and slide over time. Pure."""

from collections.abc import Sequence

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.rotations import quaternion_product, vector_quaternion
from tripod_view.arm import ArmGeometry, Stand, clamp_corners
from tripod_view.player.film import Piece, Rgb
from tripod_view.player.shapes import Shape, box, joined
from tripod_view.pose import Pose

SERVO_COLOURS: tuple[Rgb, ...] = (
    (214, 64, 69), (31, 119, 180), (148, 90, 190), (214, 130, 20), (30, 140, 110), (120, 90, 60),
)  # fmt: skip
"""One colour a servo, the same as of its curve."""

EFFECTOR, SERVO_BODY, BASE = (255, 140, 0), (52, 73, 110), (112, 120, 130)

BODY_SIZE = (0.0230, 0.0225, 0.0122)
"""A small hobby servo, its shaft along y [m]."""

BRACKET = 0.003
"""Thickness of brackets and rails [m]."""


def robot_pieces(
    angles: FloatArray, slide: FloatArray, stands: Sequence[Stand], geometry: ArmGeometry
) -> tuple[Piece, ...]:
    """Return base, servo bodies and arms at `angles` [rad], shape (k, servos), and `slide` [m], shape (k,).

    A negative angle tips an arm outward and down: it turns about +y of its servo's frame, x pointing outward.
    """
    pieces = []
    for i, stand in enumerate(stands):
        where = np.array(stand.hub) + slide[:, None] * np.array(stand.inward)
        carriage = np.concatenate([where, np.broadcast_to(stand.quaternion, (len(slide), 4))], axis=1)
        turns = np.array([vector_quaternion([0.0, -angle, 0.0]) for angle in angles[:, i]])
        arm = np.concatenate([where, quaternion_product(np.array(stand.quaternion), turns)], axis=1)
        pieces += [
            _piece(f"rail {i}", rail_shape(stand), BASE, None),
            _piece(f"servo {i}", box(BODY_SIZE), SERVO_BODY, carriage),
            _piece(f"arm {i}", arm_shape(stand, geometry), SERVO_COLOURS[i % len(SERVO_COLOURS)], arm),
        ]
    return tuple(pieces)


def effector_piece(shape: Shape, poses: FloatArray) -> Piece:
    """Return the effector, of any shape, at `poses`, shape (k, 7)."""
    return _piece("effector", shape, EFFECTOR, poses)


def _piece(name: str, shape: Shape, colour: Rgb, poses: FloatArray | None) -> Piece:
    return Piece(name, shape[1], shape[0], colour, poses)


def rail_shape(stand: Stand) -> Shape:
    """Return the rail of a servo in the frame of the world."""
    vertices, triangles = box(
        (stand.rail + 0.018, BODY_SIZE[1] + 0.004, BRACKET),
        ((0.018 - stand.rail) / 2, 0.0, -BODY_SIZE[2] / 2 - BRACKET / 2),
    )
    return Pose.of(stand.hub, stand.quaternion).apply(vertices), triangles


def arm_shape(stand: Stand, g: ArmGeometry) -> Shape:
    """Return an arm in its frame: two cheeks on the axis, and plates under and over the clamped end."""
    corners = clamp_corners(stand, g)
    inner, outer = corners[0, 0, 0, 0], corners[1, 0, 0, 0]
    lower, upper = corners[0, 0, 0, 2], corners[0, 0, 1, 2]
    y = max(g.strip_width, BODY_SIZE[1] + 4 * BRACKET) / 2 - BRACKET / 2
    bottom, top = -2 * BRACKET, lower - BRACKET
    cheek = (2 * BRACKET, BRACKET, top - bottom)
    return joined(
        [
            box((BRACKET - inner, g.strip_width, BRACKET), ((BRACKET + inner) / 2, 0.0, lower - BRACKET / 2)),
            box((outer - inner, g.strip_width, BRACKET), ((outer + inner) / 2, 0.0, upper + BRACKET / 2)),
            box(cheek, (0.0, y, (top + bottom) / 2)),
            box(cheek, (0.0, -y, (top + bottom) / 2)),
        ]
    )
