"""Rotations as matrix, rotation vector and unit quaternion (x, y, z, w); cross products as matrices."""

import math
from collections.abc import Sequence

import numpy as np

from tripod_host.arrays import FloatArray


def quaternion_matrix(quaternion: Sequence[float] | FloatArray) -> FloatArray:
    """Return the rotation matrix, shape (3, 3), of a quaternion of any length but 0."""
    x, y, z, w = map(float, quaternion)
    s = 2 / (x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ]
    )


def vector_quaternion(rotation: Sequence[float] | FloatArray) -> FloatArray:
    """Return the unit quaternion, shape (4,), of a rotation vector [rad]."""
    x, y, z = map(float, rotation)
    angle = math.hypot(x, y, z)
    s = math.sin(angle / 2) / angle if angle else 0.5
    return np.array([s * x, s * y, s * z, math.cos(angle / 2)])


def rotation_matrix(rotation: Sequence[float] | FloatArray) -> FloatArray:
    """Return the matrix, shape (3, 3), of a rotation vector [rad]."""
    return quaternion_matrix(vector_quaternion(rotation))


def quaternion_product(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the quaternions, shape (..., 4), that turn by `second` and then by `first`, which have such shapes too."""
    (x, y, z, w), (a, b, c, d) = np.moveaxis(first, -1, 0), np.moveaxis(second, -1, 0)
    product = (
        w * a + x * d + y * c - z * b,
        w * b + y * d + z * a - x * c,
        w * c + z * d + x * b - y * a,
        w * d - x * a - y * b - z * c,
    )
    return np.stack(product, axis=-1)


def quaternion_angle(quaternion: Sequence[float] | FloatArray) -> float:
    """Return by how much a quaternion turns [rad], 0 to pi."""
    x, y, z, w = map(float, quaternion)
    return 2 * math.atan2(math.hypot(x, y, z), abs(w))


def rotation_vector(matrix: FloatArray) -> FloatArray:
    """Return the rotation vector [rad], shape (3,), of a rotation matrix; its length is at most pi."""
    x, y, z, w = _quaternion(matrix)
    sine = math.hypot(x, y, z)
    factor = 2 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
    return np.array([factor * x, factor * y, factor * z])


def quaternion(matrix: FloatArray) -> FloatArray:
    """Return the unit quaternion (x, y, z, w), w >= 0, of a rotation matrix [Shepperd1978]."""
    return np.array(_quaternion(matrix))


def _quaternion(matrix: FloatArray) -> list[float]:
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix.tolist()  # numbers: nine are too few for arrays
    squares = 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz
    match squares.index(max(squares)):
        case 0:
            q = squares[0], xy + yx, xz + zx, zy - yz
        case 1:
            q = yx + xy, squares[1], yz + zy, xz - zx
        case 2:
            q = zx + xz, zy + yz, squares[2], yx - xy
        case _:
            q = zy - yz, xz - zx, yx - xy, squares[3]
    norm = math.copysign(math.hypot(*q), q[3])
    return [value / norm for value in q]


def skew(a: FloatArray) -> FloatArray:
    """Return the matrix S with S b = a x b, shape (3, 3)."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def axial(m: FloatArray) -> FloatArray:
    """Return the sum of all a x b of a matrix m, the sum of all a bᵀ, shape (3,)."""
    return np.array([m[1, 2] - m[2, 1], m[2, 0] - m[0, 2], m[0, 1] - m[1, 0]])
