"""Compiled time loops of the explicit schemes for springs: many steps in one call, the same bits as one by one."""

from typing import NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put
from tripod_sim.forces.spring_kernels import Links, add_forces, elastic_energy
from tripod_sim.integrators.scheme import Tableau

FINE, OVERFLOW = 0, 1


class Load(NamedTuple):
    """What acts on the nodes besides the springs.

    force: constant [N], (n, 3); inverse_mass: 1 / m [1/kg], zero of fixed nodes, (n,); drag: a of -a M v [1/s];
    mass: [kg], zero of fixed nodes, (n,).
    """

    force: Array
    inverse_mass: Array
    mass: Array
    drag: float


@njit(cache=True, error_model="numpy")
def accelerations(x: Array, v: Array, links: Links, load: Load, a: Array) -> float:
    """Write M^-1 f(x, v) [m/s²], zero of fixed nodes; return the springs' energy [J]."""
    for n in range(x.shape[0]):
        for i in range(3):
            a[n, i] = load.force[n, i]
    energy = add_forces(x, v, links, a)
    for n in range(x.shape[0]):
        w = load.inverse_mass[n]
        if w > 0.0:
            for i in range(3):
                a[n, i] = w * a[n, i] - load.drag * v[n, i]
        else:
            a[n, 0] = a[n, 1] = a[n, 2] = 0.0
    return energy


@njit(cache=True, error_model="numpy")
def mechanical(x: Array, v: Array, origin: Array, load: Load) -> tuple[float, float]:
    """Return kinetic energy and -force . (x - origin) [J]."""
    kinetic = weight = 0.0
    for n in range(x.shape[0]):
        square = v[n, 0] * v[n, 0] + v[n, 1] * v[n, 1] + v[n, 2] * v[n, 2]
        kinetic += 0.5 * load.mass[n] * square
        for i in range(3):
            weight -= load.force[n, i] * (x[n, i] - origin[n, i])
    return kinetic, weight


@njit(cache=True, error_model="numpy")
def runge_kutta(
    scheme: Tableau,
    x: Array,
    v: Array,
    a: Array,
    h: float,
    links: Links,
    load: Load,
    xn: Array,
    vn: Array,
    xs: Array,
    vs: Array,
    k: Array,
) -> None:
    """Write x' and v' of a scheme of several stages to `xn` and `vn`, shape (n, 3) as all arrays here.

    Args:
        scheme: Which.
        x, v, a: Positions, velocities and their accelerations at the start.
        h: Length of the part [s].
        links, load: The forces.
        xn, vn: Output; at first the sums of rates.
        xs: Output: half the weighted sum of the accelerations of all stages between the first and the last [m/s²], of
            RK4 a_2 + a_3; at first positions of a stage.
        vs, k: Scratch: velocities and accelerations of a stage.
    """
    size, last, share = x.shape[0], scheme.weights.shape[0] - 1, h / scheme.total
    first, final, reach = scheme.weights[0], scheme.weights[last], scheme.reach[0] * h
    for n in range(size):
        for i in range(3):
            xn[n, i], vn[n, i] = first * v[n, i], first * a[n, i]
            xs[n, i], vs[n, i] = x[n, i] + reach * v[n, i], v[n, i] + reach * a[n, i]
    for stage in range(1, last + 1):
        accelerations(xs, vs, links, load, k)
        if stage == last:
            break
        weight, reach = scheme.weights[stage], scheme.reach[stage] * h
        for n in range(size):
            for i in range(3):
                rate = vs[n, i]
                xn[n, i] += weight * rate
                vn[n, i] += weight * k[n, i]
                xs[n, i], vs[n, i] = x[n, i] + reach * rate, v[n, i] + reach * k[n, i]
    for n in range(size):
        free = load.inverse_mass[n] > 0.0
        for i in range(3):
            xs[n, i] = 0.5 * (vn[n, i] - first * a[n, i])
            xn[n, i] = x[n, i] + share * (xn[n, i] + final * vs[n, i]) if free else x[n, i]
            vn[n, i] = v[n, i] + share * (vn[n, i] + final * k[n, i])


@njit(cache=True, error_model="numpy")
def explicit_steps(
    scheme: Tableau,
    count: int,
    h: float,
    parts: int,
    x: Array,
    v: Array,
    origin: Array,
    links: Links,
    load: Load,
    watch: Array,
    scratch: Array,
) -> tuple[int, int]:
    """Advance `x` and `v` by `count` steps of `parts` parts of `h` [s] each.

    After each step the energy is compared with what the inputs justify: it grew if

        E - E_0 > 1/2 max(kinetic + springs) + watch[2],

    half of all motion and tension then came from nothing.

    Args:
        scheme: Which.
        count: Steps.
        h: Length of a part [s].
        parts: Parts of a step.
        x, v: State, (n, 3), in place; at an overflow the state before the step that failed.
        origin: Where the load's potential is zero, (n, 3).
        links, load: The forces.
        watch: E_0, largest kinetic + springs so far, allowance, growth E - E_0 of the last step [J], and the number
            of steps since growth was found, zero if it was not.
        scratch: (8, n, 3).

    Returns:
        FINE, or OVERFLOW where a number is no longer finite, and the steps made.
    """
    a, xs, vs, k, x_keep, v_keep = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4], scratch[5]
    xn, vn, size = scratch[6], scratch[7], x.shape[0]
    for done in range(count):
        put(x_keep, x)
        put(v_keep, v)
        for _ in range(parts):
            accelerations(x, v, links, load, a)
            if scheme.weights.shape[0] > 1:
                runge_kutta(scheme, x, v, a, h, links, load, xn, vn, xs, vs, k)
                put(x, xn)
                put(v, vn)
                continue
            for n in range(size):
                if load.inverse_mass[n] > 0.0:
                    for i in range(3):
                        old = v[n, i]
                        new = old + h * a[n, i]
                        v[n, i] = new
                        x[n, i] += h * (new if scheme.swaps else old)
        springs = elastic_energy(x, links)
        kinetic, weight = mechanical(x, v, origin, load)
        if not np.isfinite(kinetic + springs + weight):
            put(x, x_keep)
            put(v, v_keep)
            return OVERFLOW, done
        watch[1] = max(watch[1], kinetic + springs)
        watch[3] = kinetic + springs + weight - watch[0]
        if watch[4] > 0.0 or watch[3] > 0.5 * watch[1] + watch[2]:
            watch[4] += 1.0
    return FINE, count
