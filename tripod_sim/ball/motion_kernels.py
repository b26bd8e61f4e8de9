"""The motion of a plate within a step."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.rotation_kernels import turned


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
def move_ahead(
    centre: Array,
    rotation: Array,
    start: Array,
    end: Array,
    ahead: float,
    dt: float,
    out_centre: Array,
    out_rotation: Array,
    out_twist: Array,
) -> None:
    """Write the motion of a plate that is ahead of another by a time, to first order: x + ahead v.

    Args:
        centre, rotation: Of the other at the start and at the end of a step, shapes (2, 3) [m] and (2, 3, 3).
        start, end: Its velocity [m/s] and angular velocity [rad/s] there, both (2, 3).
        ahead: [s].
        dt: [s].
        out_centre, out_rotation, out_twist: Written, as `PlateMotion` has them.
    """
    turn = np.empty(3)
    for k in range(2):
        twist = end if k else start
        for i in range(3):
            out_centre[k, i] = centre[k, i] + ahead * twist[0, i]
            turn[i] = ahead * twist[1, i]
            out_twist[k, i] = end[k, i] + ahead / dt * (end[k, i] - start[k, i])
        turned(turn, rotation[k], out_rotation[k])
