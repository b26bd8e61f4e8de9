"""The motion of a plate within a step, and of a ball that turns freely."""

from math import cos, sin, sqrt

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.constraints.rotation_kernels import turned


@njit(cache=True, error_model="numpy")
def rotate(rotation: Array, vector: Array, out: Array) -> None:
    """Write R a, shape (3,)."""
    for i in range(3):
        out[i] = rotation[i, 0] * vector[0] + rotation[i, 1] * vector[1] + rotation[i, 2] * vector[2]


@njit(cache=True, error_model="numpy")
def rotate_back(rotation: Array, vector: Array, out: Array) -> None:
    """Write R^T a, shape (3,)."""
    for i in range(3):
        out[i] = rotation[0, i] * vector[0] + rotation[1, i] * vector[1] + rotation[2, i] * vector[2]


@njit(cache=True, error_model="numpy")
def plate_at(plate: Array, s: float, dt: float, pose: Array) -> None:
    """Write where a plate is and how it moves at the fraction `s` of a step.

    Cubic Hermite in the centre and in the rotation vector from the start: the pose is exact at both ends, and the
    velocity is continuous from one step to the next.

    Args:
        plate: Centre at the start, its move over the step [m], rotation vector over the step [rad], velocity at the
            start and at the end [m/s], angular velocity at the start and at the end [rad/s], then the rotation matrix
            at the start: shape (10, 3).
        s: 0 to 1.
        dt: [s].
        pose: Centre, velocity, angular velocity, then the rotation matrix, shape (6, 3), written.
    """
    a, b, c = s * s * (3 - 2 * s), s * (1 - s) * (1 - s), -s * s * (1 - s)
    da, db, dc = 6 * s * (1 - s), (1 - s) * (1 - 3 * s), s * (3 * s - 2)
    way = np.empty(3)
    for i in range(3):
        pose[0, i] = plate[0, i] + a * plate[1, i] + dt * (b * plate[3, i] + c * plate[4, i])
        pose[1, i] = da * plate[1, i] / dt + db * plate[3, i] + dc * plate[4, i]
        way[i] = a * plate[2, i] + dt * (b * plate[5, i] + c * plate[6, i])
        pose[2, i] = da * plate[2, i] / dt + db * plate[5, i] + dc * plate[6, i]
    turned(way, plate[7:], pose[3:])


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
