"""Loops over the coordinates of the estimate of the error of time steps (see `time_error`), compiled.

Arrays of coordinates have the shape (n, k): of nodes (n, 3), of modes (n, 1); pairs of them, for positions and
velocities, (2, n, k).
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array


@njit(cache=True, error_model="numpy")
def accelerations(end: Array, u: Array, s: float, moving: Array, out: Array) -> None:
    """Write (end - u) / s of nodes that move by themselves, else zero, to `out`, all of shape (n, 3)."""
    for n in range(end.shape[0]):
        for i in range(3):
            out[n, i] = (end[n, i] - u[n, i]) / s if moving[n] else 0.0


@njit(cache=True, error_model="numpy")
def differences(h: float, before: Array, length: float, known: int, found: Array) -> bool:
    """Write j and dj/dt beside a in `found` (3, n, k), zero where unknown; return whether all three are zero.

    Args:
        h: Length of the step [s].
        before: Accelerations of the last two steps [m/s²], the latest first, shape (2, n, k); those of this step come
            in as the latest.
        length: Time between these two [s].
        known: How many of them are known.
        found: Accelerations in the first; output in the others.
    """
    steady = True
    for n in range(found.shape[1]):
        for i in range(found.shape[2]):
            a = found[0, n, i]
            j = rate = 0.0
            if known >= 1:
                j = (a - before[0, n, i]) / h
                if known >= 2:
                    rate = 2 * (j - (before[0, n, i] - before[1, n, i]) / length) / (h + length)
            found[1, n, i], found[2, n, i] = j, rate
            before[1, n, i] = before[0, n, i]
            before[0, n, i] = a
            steady &= a == 0.0 and j == 0.0 and rate == 0.0
    return steady


@njit(cache=True, error_model="numpy")
def load(
    p: Array,
    q: Array,
    x: float,
    v: float,
    mass: Array,
    weight: Array,
    s_force: float,
    begun: Array,
    force: Array,
) -> None:
    """Add tau_x and tau_v to what a stage starts from, and write the forces [N] that load A.

    Args:
        p, q: Times `x` and `v` they are tau_x and tau_v.
        x, v: See there.
        mass, weight: m [kg] and w [N/m], shape (n,).
        s_force: Of the stage [s].
        begun: e_z and e_u; output y = e_z + tau_x and e_u + tau_v.
        force: Output.
    """
    for n in range(force.shape[0]):
        per_speed, per_move = mass[n] / s_force, weight[n]
        for i in range(force.shape[1]):
            begun[0, n, i] += x * p[n, i]
            begun[1, n, i] += v * q[n, i]
            force[n, i] = per_speed * begun[1, n, i] + per_move * begun[0, n, i]


@njit(cache=True, error_model="numpy")
def finish(move: Array, begun: Array, s: float, out: Array) -> None:
    """Write e_x' = move and e_v' = (e_x' - y) / s to `out`."""
    for n in range(move.shape[0]):
        for i in range(move.shape[1]):
            out[0, n, i] = x = move[n, i]
            out[1, n, i] = (x - begun[0, n, i]) / s


@njit(cache=True, error_model="numpy")
def vanish(
    errors: Array, before: Array, p: Array, q: Array, dx: float, dv: float, h: float, limit: float
) -> bool:
    """Zero errors that are below a limit, as are those that a step of `h` [s] adds; return whether they are.

    Args:
        errors: A pair.
        before: What is remembered of them, any shape.
        p, q: Times `dx` and `dv` they are the step's defects tau_x and tau_v.
        dx, dv: See there.
        h: [s].
        limit: [m].
    """
    for n in range(errors.shape[1]):
        for i in range(errors.shape[2]):
            x, v = abs(errors[0, n, i]), abs(errors[1, n, i])
            if not x + h * v + abs(dx) * abs(p[n, i]) + h * abs(dv) * abs(q[n, i]) < limit:
                return False
    errors[:] = 0.0
    before[:] = 0.0
    return True


@njit(cache=True, error_model="numpy")
def furthest(x: Array) -> tuple[float, int]:
    """Return the largest length of a row of `x`, and which; NaN counts as largest."""
    most, which = -1.0, 0
    for n in range(x.shape[0]):
        square = x[n, 0] ** 2 + x[n, 1] ** 2 + x[n, 2] ** 2
        if not square <= most:
            most, which = square, n
            if np.isnan(square):
                break
    return np.sqrt(most), which
