"""Loops of the response: the contact terms of a step's potential, in the step's unknowns u.

With the relative move d = J u of the two sides over the step, gap g = g_0 + n . d and slip t = d - (n . d) n - t_0, the
augmented Lagrangian of a contact of pressure p and friction f (multipliers, fixed while u is sought) is

    P(u) = max(0, p - rho g)² / (2 rho) + H(f - sigma t) / sigma,

H(s) = s² / 2 for |s| <= c, else c |s| - c² / 2: its derivative is the friction that Coulomb's disc of radius c allows.
Both are convex and once differentiable. Penalty is the same with p = 0. Coulomb's friction is against the velocity at
the end, v' = (x' - z) / s (see `integrators.scheme`): t_0, the tangential part of the move z - x, is the slip of what
ends without any. It is zero but where a scheme looks back on slip.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.contact.contact_set import Contacts


class Freedom(NamedTuple):
    """How vertices follow the unknowns.

    base: first unknown of each vertex, -1 for none, (n,); width: 3 for a node, 6 for a rigid body's vertex, (n,);
    arm: from the centre of its rigid body [m], (n, 3); radius: of the ball about each vertex [m], (n,).
    """

    base: Array
    width: Array
    arm: Array
    radius: Array


@njit(cache=True, error_model="numpy")
def prepare(c: Contacts, count: int, x: Array, free: Freedom, most: float) -> None:
    """Write gap, base, lump, moment and width of contacts for a step that starts at `x`.

    What is deeper than `most` [m] counts as so deep, so that the step does not shoot it out.
    """
    for k in range(count):
        gap = -c.offset[k]
        for m in range(4):
            c.base[k, m], c.lump[k, m], c.width[k, m] = -1, 0.0, 0
            c.moment[k, m] = 0.0
        used = 0
        for m in range(4):
            v, w = c.vertex[k, m], c.weight[k, m]
            for i in range(3):
                gap += c.normal[k, i] * w * x[v, i]
            if free.base[v] < 0 or w == 0.0:
                continue
            at = used
            for j in range(used):
                if c.base[k, j] == free.base[v]:
                    at = j
            if at == used:
                used += 1
                c.base[k, at], c.width[k, at] = free.base[v], free.width[v]
            c.lump[k, at] += w
            if free.width[v] == 6:
                for i in range(3):  # a ball is touched not at its centre
                    c.moment[k, at, i] += w * free.arm[v, i] - abs(w) * free.radius[v] * c.normal[k, i]
        c.gap[k] = max(gap, -most)
        c.drift[k] = 0.0


@njit(cache=True, error_model="numpy")
def set_drift(c: Contacts, count: int, way: Array) -> None:
    """Write t_0 of each contact; `way`: z - x, the moves of the unknowns at whose ends nothing has a velocity."""
    for k in range(count):
        d = relative(c.base, c.lump, c.moment, c.width, k, way)
        n = c.normal[k]
        along = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
        for i in range(3):
            c.drift[k, i] = d[i] - along * n[i]


@njit(cache=True, error_model="numpy")
def set_stiffness(c: Contacts, count: int, give: Array, normal: float, tangential: float) -> None:
    """Write rho and sigma: multiples of 1 / sum of w² / A.

    Args:
        c, count: Contacts.
        give: 1 / diagonal of the Hessian of the step without contacts, for each unknown, shape (u,).
        normal, tangential: The multiples.
    """
    for k in range(count):
        total = 0.0
        for m in range(4):
            b = c.base[k, m]
            if b < 0:
                break
            total += c.lump[k, m] ** 2 * (give[b] + give[b + 1] + give[b + 2]) / 3.0
            if c.width[k, m] == 6:
                arm = c.moment[k, m, 0] ** 2 + c.moment[k, m, 1] ** 2 + c.moment[k, m, 2] ** 2
                total += arm * (give[b + 3] + give[b + 4] + give[b + 5]) / 3.0
        c.stiffness[k, 0], c.stiffness[k, 1] = c.gain[k] * normal / total, tangential / total


@njit(cache=True, error_model="numpy", inline="always")
def relative(
    base: Array, lump: Array, moment: Array, width: Array, k: int, u: Array
) -> tuple[float, float, float]:
    """Return J u of contact k; the arrays are those of `Contacts`, taken out of it before the loop: that is faster."""
    d0 = d1 = d2 = 0.0
    for m in range(4):
        b = base[k, m]
        if b < 0:
            break
        w = lump[k, m]
        d0 += w * u[b]
        d1 += w * u[b + 1]
        d2 += w * u[b + 2]
        if width[k, m] == 6:
            r0, r1, r2 = moment[k, m, 0], moment[k, m, 1], moment[k, m, 2]
            t0, t1, t2 = u[b + 3], u[b + 4], u[b + 5]
            d0 += t1 * r2 - t2 * r1
            d1 += t2 * r0 - t0 * r2
            d2 += t0 * r1 - t1 * r0
    return d0, d1, d2


@njit(cache=True, error_model="numpy", inline="always")
def add_force(
    base: Array, lump: Array, moment: Array, width: Array, k: int, f: tuple[float, float, float], out: Array
) -> None:
    """Add J^T f of contact k to `out`."""
    f0, f1, f2 = f
    for m in range(4):
        b = base[k, m]
        if b < 0:
            break
        w = lump[k, m]
        out[b] += w * f0
        out[b + 1] += w * f1
        out[b + 2] += w * f2
        if width[k, m] == 6:
            r0, r1, r2 = moment[k, m, 0], moment[k, m, 1], moment[k, m, 2]
            out[b + 3] += r1 * f2 - r2 * f1
            out[b + 4] += r2 * f0 - r0 * f2
            out[b + 5] += r0 * f1 - r1 * f0


@njit(cache=True, error_model="numpy")
def add_gradient(c: Contacts, count: int, u: Array, out: Array) -> float:
    """Add the gradient of sum of P to `out` [N, N m] and return the sum of P [J]."""
    base, lump, moment, width, normal = c.base, c.lump, c.moment, c.width, c.normal
    pressure, friction, limits, stiffness, gaps = c.pressure, c.friction, c.limit, c.stiffness, c.gap
    drift = c.drift
    total = 0.0
    for k in range(count):
        d0, d1, d2 = relative(base, lump, moment, width, k, u)
        n0, n1, n2 = normal[k, 0], normal[k, 1], normal[k, 2]
        along = n0 * d0 + n1 * d1 + n2 * d2
        rho, sigma, limit = stiffness[k, 0], stiffness[k, 1], limits[k]
        s = pressure[k] - rho * (gaps[k] + along)
        if s <= 0.0 and limit <= 0.0:
            continue  # most of them: near, but not pressed
        f0 = f1 = f2 = 0.0
        if s > 0.0:
            total += 0.5 * s * s / rho
            f0, f1, f2 = s * n0, s * n1, s * n2
        if limit > 0.0:
            t0 = friction[k, 0] - sigma * (d0 - along * n0 - drift[k, 0])
            t1 = friction[k, 1] - sigma * (d1 - along * n1 - drift[k, 1])
            t2 = friction[k, 2] - sigma * (d2 - along * n2 - drift[k, 2])
            size = np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
            share = 1.0
            if size <= limit:
                total += 0.5 * size * size / sigma
            else:
                total += (limit * size - 0.5 * limit * limit) / sigma
                share = limit / size
            f0, f1, f2 = f0 + share * t0, f1 + share * t1, f2 + share * t2
        add_force(base, lump, moment, width, k, (-f0, -f1, -f2), out)
    return total


@njit(cache=True, error_model="numpy")
def set_limits(c: Contacts, count: int, mu: float) -> None:
    """Write the largest friction that the pressures allow."""
    for k in range(count):
        c.limit[k] = mu * c.pressure[k]


@njit(cache=True, error_model="numpy")
def forces(
    c: Contacts, count: int, u: Array, mu: float, pressure: Array, friction: Array
) -> tuple[float, float, float]:
    """Write the forces that the present moves ask of the contacts, and return how far the multipliers are from them.

    Pressure is max(0, p - rho g), friction f - sigma t within Coulomb's disc of radius mu times the new pressure.

    Returns:
        The largest error of a gap or complementarity [m], of a slip [m], and the smallest gap [m].
    """
    base, lump, moment, width, normal = c.base, c.lump, c.moment, c.width, c.normal
    gap_error = slip_error = 0.0
    smallest = np.inf
    for k in range(count):
        d0, d1, d2 = relative(base, lump, moment, width, k, u)
        n = normal[k]
        along = n[0] * d0 + n[1] * d1 + n[2] * d2
        gap = c.gap[k] + along
        smallest = min(smallest, gap)
        rho, sigma = c.stiffness[k, 0], c.stiffness[k, 1]
        before = c.pressure[k]
        pressure[k] = max(0.0, before - rho * gap)
        if before == 0.0 and pressure[k] == 0.0:  # and so no friction either, before or now
            friction[k] = 0.0
            continue
        gap_error = max(gap_error, abs(pressure[k] - before) / rho)
        limit = mu * pressure[k]
        size = 0.0
        d = (d0, d1, d2)
        for i in range(3):
            friction[k, i] = c.friction[k, i] - sigma * (d[i] - along * n[i] - c.drift[k, i])
            size += friction[k, i] ** 2
        size = np.sqrt(size)
        share = limit / size if size > limit else 1.0
        change = 0.0
        for i in range(3):
            friction[k, i] *= share
            change += (friction[k, i] - c.friction[k, i]) ** 2
        slip_error = max(slip_error, np.sqrt(change) / sigma)
    return gap_error, slip_error, smallest


@njit(cache=True, error_model="numpy")
def spread(c: Contacts, count: int, out: Array) -> None:
    """Add the contacts' forces to those of the vertices [N], shape (n, 3)."""
    for k in range(count):
        for m in range(4):
            for i in range(3):
                out[c.vertex[k, m], i] += c.weight[k, m] * (c.pressure[k] * c.normal[k, i] + c.friction[k, i])


@njit(cache=True, error_model="numpy")
def stiffen(c: Contacts, count: int, u: Array, deepest: float, factor: float) -> int:
    """Multiply rho of contacts deeper than `deepest` [m]; return how many there are."""
    found = 0
    for k in range(count):
        d0, d1, d2 = relative(c.base, c.lump, c.moment, c.width, k, u)
        n = c.normal[k]
        if c.gap[k] + n[0] * d0 + n[1] * d1 + n[2] * d2 < -deepest:
            c.stiffness[k, 0] *= factor
            c.gain[k] *= factor
            found += 1
    return found
