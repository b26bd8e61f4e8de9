"""Rotations by matrix, rotation vector and quaternion, compiled."""

from math import cos, sin, sqrt, tan

import numpy as np
from numba import njit

from tripod_host.arrays import Array


@njit(cache=True, error_model="numpy")
def cross(a: Array, b: Array, out: Array) -> None:
    """Write a x b."""
    c0, c1, c2 = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    out[0], out[1], out[2] = c0, c1, c2


@njit(cache=True, error_model="numpy")
def rotate(rotation: Array, vector: Array, out: Array) -> None:
    """Write R a, shape (3,); `out` is not `vector`."""
    for i in range(3):
        out[i] = rotation[i, 0] * vector[0] + rotation[i, 1] * vector[1] + rotation[i, 2] * vector[2]


@njit(cache=True, error_model="numpy")
def rotate_back(rotation: Array, vector: Array, out: Array) -> None:
    """Write R^T a, shape (3,); `out` is not `vector`."""
    for i in range(3):
        out[i] = rotation[0, i] * vector[0] + rotation[1, i] * vector[1] + rotation[2, i] * vector[2]


@njit(cache=True, error_model="numpy")
def carried(rotation: Array, tensor: Array, vector: Array, out: Array) -> None:
    """Write R T R^T a, shape (3,): the tensor T, shape (3, 3), is carried along by the rotation R."""
    own, of = np.empty(3), np.empty(3)
    rotate_back(rotation, vector, own)
    rotate(tensor, own, of)
    rotate(rotation, of, out)


@njit(cache=True, error_model="numpy")
def turned(rotation: Array, R: Array, out: Array) -> None:
    """Write exp([p]x) R, shape (3, 3), p a rotation vector [rad], by Rodrigues' formula; `out` is not `R`."""
    x, y, z = rotation[0], rotation[1], rotation[2]
    square = x * x + y * y + z * z
    if square < 1e-8:
        s, d = 1 - square / 6, 0.5 - square / 24
    else:
        angle = sqrt(square)
        s, d = sin(angle) / angle, (1 - cos(angle)) / square
    for j in range(3):
        a, b, c = R[0, j], R[1, j], R[2, j]
        u, v, w = y * c - z * b, z * a - x * c, x * b - y * a
        out[0, j] = a + s * u + d * (y * w - z * v)
        out[1, j] = b + s * v + d * (z * u - x * w)
        out[2, j] = c + s * w + d * (x * v - y * u)


@njit(cache=True, error_model="numpy")
def rotation_rate(rotation: Array, w: Array, out: Array) -> None:
    """Write the rate p' of a rotation vector p while exp([p]x) turns with the spin w.

    p' = w - p x w / 2 + c p x (p x w), c = (1 - (a / 2) cot(a / 2)) / a², a = |p|
    [HairerLubichWanner2006, chapter IV.8].
    """
    square = rotation[0] ** 2 + rotation[1] ** 2 + rotation[2] ** 2
    if square < 1e-6:
        c = 1 / 12 + square / 720
    else:
        half = 0.5 * sqrt(square)
        c = (1 - half / tan(half)) / square
    first, second = np.empty(3), np.empty(3)
    cross(rotation, w, first)
    cross(rotation, first, second)
    for i in range(3):
        out[i] = w[i] - 0.5 * first[i] + c * second[i]


@njit(cache=True, error_model="numpy")
def turn(quaternion: Array, w: Array, time: float) -> None:
    """Turn a unit quaternion (x, y, z, w) by the constant angular velocity `w` [rad/s] for `time` [s], in place."""
    size = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    if size * time == 0.0:
        return
    half = 0.5 * size * time
    f, e = sin(half) / size, cos(half)
    a, b, c = f * w[0], f * w[1], f * w[2]
    x, y, z, u = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    quaternion[0] = e * x + a * u + b * z - c * y
    quaternion[1] = e * y + b * u + c * x - a * z
    quaternion[2] = e * z + c * u + a * y - b * x
    quaternion[3] = e * u - a * x - b * y - c * z
    length = sqrt(quaternion[0] ** 2 + quaternion[1] ** 2 + quaternion[2] ** 2 + quaternion[3] ** 2)
    for i in range(4):
        quaternion[i] /= length
