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
