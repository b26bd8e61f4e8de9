"""The matrix of a rotation vector, compiled."""

import math
from typing import Any

from numba import njit

Array = Any


@njit(cache=True, error_model="numpy")
def write_rotation(x: float, y: float, z: float, out: Array) -> None:
    """Write exp([p]x), shape (3, 3), of the rotation vector p = (x, y, z) [rad] (Rodrigues' formula).

    With a = |p| and n = p / a: cos(a) I + (1 - cos(a)) n n^T + sin(a) [n]x; the identity where a is 0.
    """
    angle = math.sqrt(x * x + y * y + z * z)
    if angle > 0.0:
        x, y, z = x / angle, y / angle, z / angle
    c, s = math.cos(angle), math.sin(angle)
    d = 1 - c
    out[0, 0], out[0, 1], out[0, 2] = c + d * x * x, d * x * y - s * z, d * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = d * x * y + s * z, c + d * y * y, d * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = d * x * z - s * y, d * y * z + s * x, c + d * z * z
