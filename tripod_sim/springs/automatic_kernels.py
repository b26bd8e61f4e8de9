"""Compiled explicit steps of springs as long as the error that they add and their stability allow.

The acceleration a at the end of a part is that at the start of the next, a'. A part of h is made by one of

    Verlet   x' = x + h v + h² / 2 a,   v' = v + h / 2 (a + a'),   a' = M^-1 f(x', v + h a):   one force, order 2,
    RK4      the classical scheme: four forces, order 4,

[HairerLubichWanner2006]. Verlet takes the acceleration of a part as constant, RK4 as a parabola. What a part adds to a
position is estimated by what they differ in from a straight line, which costs no force,

    Verlet   h² / 6 |a' - a|,   RK4   h² / 6 |a - 2 m + a'|,   m = (a_2 + a_3) / 2 that of the two stages halfway;

the first is the leading term, the second of a lower order than RK4's error and on the safe side.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put
from tripod_sim.forces.spring_kernels import Links
from tripod_sim.integrators.scheme import Tableau
from tripod_sim.springs.explicit_kernels import FINE, OVERFLOW, Load, accelerations, runge_kutta

VERLET, RK4 = 2, 4
"""The schemes by their order."""

SAFETY, SHRINK, GROW, LEAST = 0.9, 0.1, 4.0, 1e-4
"""Of the controller, as in `added_error_control`, but without its second term: lengths need not recur here."""

SPARE = 0.1
"""Part of the tolerance that Verlet may add: its estimate is the error itself, that of RK4 far above it."""

CHEAPER = 1.2
"""Verlet takes over where it needs so many times fewer forces than RK4."""


@njit(cache=True, error_model="numpy")
def _verlet(
    x: Array, v: Array, a: Array, h: float, links: Links, load: Load, xn: Array, vn: Array, b: Array
) -> float:
    """Write x', v' and a' to `xn`, `vn` and `b`; return the largest |a' - a|² [m²/s⁴], NaN if one is."""
    for n in range(x.shape[0]):
        free = load.inverse_mass[n] > 0.0
        for i in range(3):
            xn[n, i] = x[n, i] + h * (v[n, i] + 0.5 * h * a[n, i]) if free else x[n, i]
            vn[n, i] = v[n, i] + h * a[n, i]
    accelerations(xn, vn, links, load, b)
    most = 0.0
    for n in range(x.shape[0]):
        for i in range(3):
            vn[n, i] += 0.5 * h * (b[n, i] - a[n, i])
        square = (b[n, 0] - a[n, 0]) ** 2 + (b[n, 1] - a[n, 1]) ** 2 + (b[n, 2] - a[n, 2]) ** 2
        if not square <= most:
            most = square
            if np.isnan(square):
                break
    return most


@njit(cache=True, error_model="numpy")
def _runge_kutta(
    scheme: Tableau,
    x: Array,
    v: Array,
    a: Array,
    h: float,
    links: Links,
    load: Load,
    xn: Array,
    vn: Array,
    b: Array,
    xs: Array,
    vs: Array,
    k: Array,
) -> tuple[float, float]:
    """Write x', v' and a' to `xn`, `vn` and `b`; return the largest |a - 2 m + a'|², NaN if one is, and |a' - a|²."""
    runge_kutta(scheme, x, v, a, h, links, load, xn, vn, xs, vs, k)
    accelerations(xn, vn, links, load, b)
    most = jump = 0.0
    for n in range(x.shape[0]):
        square = first = 0.0
        for i in range(3):
            square += (a[n, i] - xs[n, i] + b[n, i]) ** 2
            first += (b[n, i] - a[n, i]) ** 2
        jump = max(jump, first)
        if not square <= most:
            most = square
            if np.isnan(square):
                break
    return most, jump


@njit(cache=True, error_model="numpy")
def automatic_steps(
    count: int,
    dt: float,
    tolerance: float,
    shortest: float,
    verlet: float,
    runge_kutta: float,
    rk4: Tableau,
    order: int,
    length: float,
    x: Array,
    v: Array,
    links: Links,
    load: Load,
    scratch: Array,
) -> tuple[int, int, int, int, int, float, int, float]:
    """Advance `x` and `v` by `count` intervals of `dt` [s] in parts.

    Verlet takes over where its parts would be more than a quarter of RK4's, which has four times the forces: mostly
    where stability holds those back and not their error. It gives way where its own fall below that; and at the
    start of an interval, to see whether RK4's have grown, unless its own are as long as they may be.

    Args:
        count, dt: Intervals and their length [s].
        tolerance: Distance that a part may add to the position of a node [m].
        shortest: Length of a part that is accepted whatever it adds [s].
        verlet, runge_kutta: Longest stable parts of the schemes [s].
        rk4: The latter.
        order, length: Scheme and length [s] of the next part; length 0 at the start.
        x, v: State, (n, 3), in place; if a number leaves the range of floating point that before its interval.
        links, load: The forces.
        scratch: (9, n, 3).

    Returns:
        FINE or OVERFLOW; intervals and parts made, parts taken back, evaluations of the forces; the largest distance
        that a part added [m]; order and length of the next part.
    """
    xs, vs, k, x_keep, v_keep = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4]
    a, b = scratch[5], scratch[6]
    short, long = min(verlet, dt), min(runge_kutta, dt)
    if length == 0.0:
        order, length = RK4, long
    parts, rejected, forces, worst = 0, 0, 0, 0.0
    for interval in range(count):
        put(x_keep, x)
        put(v_keep, v)
        x0, v0, x1, v1 = x, v, scratch[7], scratch[8]
        accelerations(x, v, links, load, a)
        forces += 1
        done, again, before = 0.0, False, long
        if order == VERLET and length < short:
            order, length = RK4, min(4.0 * length, long)
        while done < dt:
            left = dt - done
            pieces = max(1.0, np.ceil(left / length - 1e-9))
            h = left / pieces
            if order == VERLET:
                square, jump = _verlet(x0, v0, a, h, links, load, x1, v1, b), 0.0
                power, allowed = 1.0 / 3.0, SPARE * tolerance
                forces += 1
            else:
                square, jump = _runge_kutta(rk4, x0, v0, a, h, links, load, x1, v1, b, xs, vs, k)
                power, allowed = 0.25, tolerance
                forces += 4
            added = h * h / 6.0 * np.sqrt(square)
            ratio = added / allowed
            change = max(SAFETY * max(ratio, LEAST) ** -power, SHRINK) if np.isfinite(ratio) else 0.5
            fine = ratio <= 1.0 or not h > shortest * (1.0 + 1e-9)  # so that NaN counts as too much
            if fine:
                if not np.isfinite(ratio):
                    put(x, x_keep)
                    put(v, v_keep)
                    return OVERFLOW, interval, parts, rejected, forces, worst, order, length
                x0, v0, x1, v1, a, b = x1, v1, x0, v0, b, a
                parts, worst = parts + 1, max(worst, added)
                done = dt if pieces == 1.0 else done + h
                length = h * min(change, 1.0 if again else GROW)
            else:
                rejected += 1
                length = h * change
            again = not fine
            length = max(length, shortest)
            if order == VERLET and length < 0.25 * before:
                order, length = RK4, 4.0 * length
                accelerations(x0, v0, links, load, a)  # of v', where dampers were taken at v + h a
                forces += 1
            elif order == RK4 and fine:
                length, reach = min(length, long), short
                if jump > 0.0:
                    reach = min(
                        short, SAFETY * h * (6.0 * SPARE * tolerance / (h * h * np.sqrt(jump))) ** (1.0 / 3.0)
                    )
                if reach >= CHEAPER * 0.25 * length:
                    order, length, before = VERLET, reach, length
            length = min(length, short if order == VERLET else long)
        put(x, x0)
        put(v, v0)
    return FINE, count, parts, rejected, forces, worst, order, length
