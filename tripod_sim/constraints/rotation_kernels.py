"""Rotations by a rotation vector, compiled."""

import math

from numba import njit

from tripod_host.arrays import Array


@njit(cache=True, error_model="numpy")
def turned(rotation: Array, R: Array, out: Array) -> None:
    """Write exp([p]x) R, shape (3, 3), p a rotation vector [rad], by Rodrigues' formula; `out` is not `R`."""
    x, y, z = rotation[0], rotation[1], rotation[2]
    square = x * x + y * y + z * z
    if square < 1e-8:
        s, d = 1 - square / 6, 0.5 - square / 24
    else:
        angle = math.sqrt(square)
        s, d = math.sin(angle) / angle, (1 - math.cos(angle)) / square
    for j in range(3):
        a, b, c = R[0, j], R[1, j], R[2, j]
        u, v, w = y * c - z * b, z * a - x * c, x * b - y * a
        out[0, j] = a + s * u + d * (y * w - z * v)
        out[1, j] = b + s * v + d * (z * u - x * w)
        out[2, j] = c + s * w + d * (x * v - y * u)
