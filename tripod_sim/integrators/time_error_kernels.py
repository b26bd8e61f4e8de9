"""Loops over the nodes of the estimate of the error of time steps (see `time_error`), compiled.

Arrays of nodes have the shape (n, 3), pairs of them, for positions and velocities, (2, n, 3).
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array


@njit(cache=True, error_model="numpy")
def differences(
    end: Array,
    u: Array,
    s: float,
    h: float,
    before: Array,
    length: float,
    known: int,
    moving: Array,
    found: Array,
    steps: Array,
) -> None:
    """Write a, j and dj/dt to `found` (3, n, 3), zero where unknown and of nodes that do not move by themselves.

    Args:
        end, u, s: a = (end - u) / s [m/s, m/s, s].
        h: Length of the step [s].
        before: Accelerations of the last two steps [m/s²], the latest first, shape (2, n, 3); those of this step come
            in as the latest.
        length: Time between these two [s].
        known: How many of them are known.
        moving: Whether a node moves by itself, shape (n,).
        found: Output.
        steps: Velocities of the last step [m/s], become `end`.
    """
    for n in range(end.shape[0]):
        for i in range(3):
            a = (end[n, i] - u[n, i]) / s if moving[n] else 0.0
            j = rate = 0.0
            if known >= 1:
                j = (a - before[0, n, i]) / h
                if known >= 2:
                    rate = 2 * (j - (before[0, n, i] - before[1, n, i]) / length) / (h + length)
            found[0, n, i], found[1, n, i], found[2, n, i] = a, j, rate
            before[1, n, i] = before[0, n, i]
            before[0, n, i] = a
            steps[n, i] = end[n, i]


@njit(cache=True, error_model="numpy")
def load(
    first: Array,
    c1: float,
    second: Array,
    c2: float,
    p: Array,
    q: Array,
    factor: float,
    mass: Array,
    weight: Array,
    s: float,
    share: float,
    known: Array,
    y: Array,
    force: Array,
) -> None:
    """Write what a stage starts from: known errors, y = e_z + tau_x [m], and the forces [N] that load A.

    Args:
        first, second: Pairs of errors; c1 times the first and c2 times the second are the `known` ones.
        c1, c2: Their factors.
        p, q: `factor` times these are tau_x and tau_v.
        factor: See there.
        mass, weight: m [kg] and w [N/m] of nodes, shape (n,).
        s: Of the stage [s].
        share: c / (1 + c).
        known, y, force: Output.
    """
    for n in range(y.shape[0]):
        per_speed, per_move = mass[n] / s, (1 - share) * weight[n]
        for i in range(3):
            x = c1 * first[0, n, i] + c2 * second[0, n, i]
            v = c1 * first[1, n, i] + c2 * second[1, n, i]
            known[0, n, i], known[1, n, i] = x, v
            y[n, i] = x + factor * p[n, i]
            force[n, i] = per_speed * (v + factor * q[n, i]) + per_move * y[n, i]


@njit(cache=True, error_model="numpy")
def finish(move: Array, y: Array, share: float, s: float, out: Array) -> None:
    """Write e_x' = share y + move and e_v' = (e_x' - y) / s to `out`."""
    for n in range(y.shape[0]):
        for i in range(3):
            x = share * y[n, i] + move[n, i]
            out[0, n, i] = x
            out[1, n, i] = (x - y[n, i]) / s


@njit(cache=True, error_model="numpy")
def rates(errors: Array, known: Array, p: Array, q: Array, factor: float, s: float, out: Array) -> None:
    """Write the rates of the errors at the end of a stage, (e' - e_known - tau) / s, to `out`."""
    for n in range(p.shape[0]):
        for i in range(3):
            out[0, n, i] = (errors[0, n, i] - known[0, n, i] - factor * p[n, i]) / s
            out[1, n, i] = (errors[1, n, i] - known[1, n, i] - factor * q[n, i]) / s


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
