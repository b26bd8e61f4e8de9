"""Coordinates and their derivatives, compiled: see `coordinates`."""

from typing import Any

import numpy as np
from numba import njit

Array = Any


@njit(cache=True, error_model="numpy")
def write_values(rest: Array, centres: Array, rotations: Array, joints: Array, out: Array) -> None:
    """Write z without q to `out`, shape (12 b + 2 s + 1,).

    Args:
        rest: c0 of each body [m], shape (b, 3).
        centres: c of each body [m], shape (b, 3).
        rotations: R of each body, shape (b, 3, 3).
        joints: Angles [rad], then the slide [m], shape (s + 1,).
        out: Output.
    """
    k = 0
    for b in range(centres.shape[0]):
        for i in range(3):
            out[k + i] = centres[b, i] - rest[b, i]
            for j in range(3):
                out[k + 3 + 3 * i + j] = rotations[b, i, j] - (1.0 if i == j else 0.0)
        k += 12
    for s in range(joints.shape[0] - 1):
        half = np.sin(0.5 * joints[s])  # 1 - cos a without the cancellation of small angles
        out[k], out[k + 1] = -2.0 * half * half, np.sin(joints[s])
        k += 2
    out[k] = joints[joints.shape[0] - 1]


@njit(cache=True, error_model="numpy")
def write_tangent(rotations: Array, joints: Array, tangent: Array, drive: Array) -> None:
    """Write what changes of dz / d unknowns and of dz / d angles: for a rotation vector, e_k x column j of R.

    Args:
        rotations: R of each body, shape (b, 3, 3).
        joints: Angles [rad], then the slide [m], shape (s + 1,).
        tangent: Output, shape (size, unknowns).
        drive: Output, shape (size, s).
    """
    count = rotations.shape[0]
    for b in range(count):
        R, row, column = rotations[b], 12 * b + 3, 6 * b + 3
        for j in range(3):
            for k in range(3):
                i, m = (k + 1) % 3, (k + 2) % 3
                tangent[row + 3 * k + j, column + k] = 0.0
                tangent[row + 3 * i + j, column + k] = -R[m, j]
                tangent[row + 3 * m + j, column + k] = R[i, j]
    for s in range(joints.shape[0] - 1):
        drive[12 * count + 2 * s, s] = -np.sin(joints[s])
        drive[12 * count + 2 * s + 1, s] = np.cos(joints[s])
