"""Rotations as scenes write them, cross products as matrices."""

import numpy as np

from tripod_host.arrays import FloatArray


def turned_by(quaternion: tuple[float, float, float, float]) -> FloatArray:
    """Return the rotation matrix of a quaternion x, y, z, w of norm about 1, shape (3, 3)."""
    x, y, z, w = np.array(quaternion) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def skew(a: FloatArray) -> FloatArray:
    """Return the matrix S with S b = a x b, shape (3, 3)."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def axial(m: FloatArray) -> FloatArray:
    """Return the sum of all a x b of a matrix m, the sum of all a bᵀ, shape (3,)."""
    return np.array([m[1, 2] - m[2, 1], m[2, 0] - m[0, 2], m[0, 1] - m[1, 0]])
