"""Rotations as scenes write them."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


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
