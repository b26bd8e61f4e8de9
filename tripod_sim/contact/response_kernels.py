"""Loops of the response: the contact terms of a step's potential, in the step's unknowns u.

With the relative move d = J u of the two sides over the step, gap g = g_0 + n . d and slip t = d - (n . d) n, the
augmented Lagrangian of a contact of pressure p and friction f (multipliers, fixed while u is sought) is

    P(u) = max(0, p - rho g)² / (2 rho) + H(f - sigma t) / sigma,

H(s) = s² / 2 for |s| <= c, else c |s| - c² / 2: its derivative is the friction that Coulomb's disc of radius c allows.
Both are convex and once differentiable. Penalty is the same with p = 0.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from tripod_sim.contact.contact_set import Contacts

Array = Any

OPEN, STICKS, SLIDES = 0, 1, 2
"""State of a contact."""


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
def _relative(c: Contacts, k: int, u: Array) -> tuple[float, float, float]:
    """Return J u of contact k."""
    d0 = d1 = d2 = 0.0
    for m in range(4):
        b = c.base[k, m]
        if b < 0:
            break
        w = c.lump[k, m]
        d0 += w * u[b]
        d1 += w * u[b + 1]
        d2 += w * u[b + 2]
        if c.width[k, m] == 6:
            r, t0, t1, t2 = c.moment[k, m], u[b + 3], u[b + 4], u[b + 5]
            d0 += t1 * r[2] - t2 * r[1]
            d1 += t2 * r[0] - t0 * r[2]
            d2 += t0 * r[1] - t1 * r[0]
    return d0, d1, d2


@njit(cache=True, error_model="numpy", inline="always")
def _add_force(c: Contacts, k: int, f0: float, f1: float, f2: float, out: Array) -> None:
    """Add J^T f of contact k to `out`."""
    for m in range(4):
        b = c.base[k, m]
        if b < 0:
            break
        w = c.lump[k, m]
        out[b] += w * f0
        out[b + 1] += w * f1
        out[b + 2] += w * f2
        if c.width[k, m] == 6:
            r = c.moment[k, m]
            out[b + 3] += r[1] * f2 - r[2] * f1
            out[b + 4] += r[2] * f0 - r[0] * f2
            out[b + 5] += r[0] * f1 - r[1] * f0


@njit(cache=True, error_model="numpy")
def add_gradient(c: Contacts, count: int, u: Array, out: Array, state: Array) -> float:
    """Add the gradient of sum of P to `out` [N, N m], write each contact's state and return the sum of P [J]."""
    total = 0.0
    for k in range(count):
        state[k] = OPEN
        d0, d1, d2 = _relative(c, k, u)
        n0, n1, n2 = c.normal[k, 0], c.normal[k, 1], c.normal[k, 2]
        along = n0 * d0 + n1 * d1 + n2 * d2
        rho, sigma, limit = c.stiffness[k, 0], c.stiffness[k, 1], c.limit[k]
        s = c.pressure[k] - rho * (c.gap[k] + along)
        f0 = f1 = f2 = 0.0
        if s > 0.0:
            state[k] = SLIDES
            total += 0.5 * s * s / rho
            f0, f1, f2 = s * n0, s * n1, s * n2
        if limit > 0.0:
            t0 = c.friction[k, 0] - sigma * (d0 - along * n0)
            t1 = c.friction[k, 1] - sigma * (d1 - along * n1)
            t2 = c.friction[k, 2] - sigma * (d2 - along * n2)
            size = np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
            share = 1.0
            if size <= limit:
                total += 0.5 * size * size / sigma
                state[k] += STICKS * 2
            else:
                total += (limit * size - 0.5 * limit * limit) / sigma
                share = limit / size
            f0, f1, f2 = f0 + share * t0, f1 + share * t1, f2 + share * t2
        _add_force(c, k, -f0, -f1, -f2, out)
    return total


@njit(cache=True, error_model="numpy")
def _curvature(c: Contacts, k: int, u: Array, H: Array) -> bool:
    """Write the second derivative of P with respect to d, shape (3, 3); return whether it is not zero."""
    d0, d1, d2 = _relative(c, k, u)
    n = c.normal[k]
    along = n[0] * d0 + n[1] * d1 + n[2] * d2
    rho, sigma, limit = c.stiffness[k, 0], c.stiffness[k, 1], c.limit[k]
    normal = rho if c.pressure[k] - rho * (c.gap[k] + along) > 0.0 else 0.0
    tangential, share = 0.0, 0.0
    t0 = t1 = t2 = 0.0
    if limit > 0.0:
        t0 = c.friction[k, 0] - sigma * (d0 - along * n[0])
        t1 = c.friction[k, 1] - sigma * (d1 - along * n[1])
        t2 = c.friction[k, 2] - sigma * (d2 - along * n[2])
        size = np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
        tangential = sigma
        if size > limit:
            tangential = sigma * limit / size
            share = tangential / (size * size)
    if normal == 0.0 and tangential == 0.0:
        return False
    t = (t0, t1, t2)
    for i in range(3):
        for j in range(3):
            H[i, j] = (normal - tangential) * n[i] * n[j] - share * t[i] * t[j]
        H[i, i] += tangential
    return True


@njit(cache=True, error_model="numpy")
def _jacobian(c: Contacts, k: int, m: int, J: Array) -> None:
    """Write J of block m of contact k, [w I, -[r]x], shape (3, 6)."""
    J[:] = 0.0
    J[0, 0] = J[1, 1] = J[2, 2] = c.lump[k, m]
    if c.width[k, m] == 6:
        r = c.moment[k, m]
        J[0, 4], J[0, 5] = r[2], -r[1]
        J[1, 3], J[1, 5] = -r[2], r[0]
        J[2, 3], J[2, 4] = r[1], -r[0]


@njit(cache=True, error_model="numpy")
def _find(indptr: Array, indices: Array, row: int, column: int) -> int:
    """Return where entry (row, column) of a CSC matrix with sorted rows stands, or -1."""
    low, high = indptr[column], indptr[column + 1]
    while low < high:
        middle = (low + high) // 2
        if indices[middle] < row:
            low = middle + 1
        else:
            high = middle
    return low if low < indptr[column + 1] and indices[low] == row else -1


@njit(cache=True, error_model="numpy")
def add_hessian(
    c: Contacts,
    count: int,
    u: Array,
    indptr: Array,
    indices: Array,
    data: Array,
    outside: Array,
    places: Array,
) -> int:
    """Add the Hessian of sum of P to an upper triangle, CSC; what its pattern has no place for goes to `outside`.

    Args:
        c, count, u: Contacts and unknowns.
        indptr, indices, data: The matrix; blocks of a node or body are full.
        outside: Blocks (first, second), first unknown smaller, shape (room, 6, 6).
        places: First unknowns and widths of each: first, second, width of first, of second, shape (room, 4).

    Returns:
        How many blocks are outside, beyond the room if it does not suffice.
    """
    H, A, B, HB, M = np.empty((3, 3)), np.empty((3, 6)), np.empty((3, 6)), np.empty((3, 6)), np.empty((6, 6))
    found = 0
    for k in range(count):
        if not _curvature(c, k, u, H):
            continue
        for b in range(4):
            if c.base[k, b] < 0:
                break
            _jacobian(c, k, b, B)
            wide = c.width[k, b]
            for i in range(3):
                for j in range(wide):
                    HB[i, j] = H[i, 0] * B[0, j] + H[i, 1] * B[1, j] + H[i, 2] * B[2, j]
            column = c.base[k, b]
            for a in range(4):
                row = c.base[k, a]
                if row < 0:
                    break
                if row > column:
                    continue
                _jacobian(c, k, a, A)
                tall = c.width[k, a]
                for i in range(tall):
                    for j in range(wide):
                        M[i, j] = A[0, i] * HB[0, j] + A[1, i] * HB[1, j] + A[2, i] * HB[2, j]
                if _find(indptr, indices, row, column) < 0:
                    if found < outside.shape[0]:
                        outside[found, :tall, :wide] = M[:tall, :wide]
                        places[found, 0], places[found, 1], places[found, 2], places[found, 3] = (
                            row, column, tall, wide,
                        )  # fmt: skip
                    found += 1
                    continue
                for j in range(wide):
                    at = _find(indptr, indices, row, column + j)
                    for i in range(min(tall, j + 1) if row == column else tall):
                        data[at + i] += M[i, j]
    return found


@njit(cache=True, error_model="numpy")
def product(
    indptr: Array,
    indices: Array,
    data: Array,
    outside: Array,
    places: Array,
    count: int,
    p: Array,
    out: Array,
) -> None:
    """Write (upper triangle and what is below it, and `outside`) times p."""
    out[:] = 0.0
    for j in range(p.shape[0]):
        total = 0.0
        for e in range(indptr[j], indptr[j + 1]):
            i = indices[e]
            total += data[e] * p[i]
            if i != j:
                out[i] += data[e] * p[j]
        out[j] += total
    for k in range(count):
        row, column, tall, wide = places[k]
        for i in range(tall):
            for j in range(wide):
                out[row + i] += outside[k, i, j] * p[column + j]
                out[column + j] += outside[k, i, j] * p[row + i]


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
    gap_error = slip_error = 0.0
    smallest = np.inf
    for k in range(count):
        d0, d1, d2 = _relative(c, k, u)
        n = c.normal[k]
        along = n[0] * d0 + n[1] * d1 + n[2] * d2
        gap = c.gap[k] + along
        smallest = min(smallest, gap)
        rho, sigma = c.stiffness[k, 0], c.stiffness[k, 1]
        pressure[k] = max(0.0, c.pressure[k] - rho * gap)
        gap_error = max(gap_error, abs(pressure[k] - c.pressure[k]) / rho)
        limit = mu * pressure[k]
        size = 0.0
        d = (d0, d1, d2)
        for i in range(3):
            friction[k, i] = c.friction[k, i] - sigma * (d[i] - along * n[i])
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
def stiffen(c: Contacts, count: int, u: Array, deepest: float, factor: float) -> int:
    """Multiply rho of contacts deeper than `deepest` [m]; return how many there are."""
    found = 0
    for k in range(count):
        d0, d1, d2 = _relative(c, k, u)
        n = c.normal[k]
        if c.gap[k] + n[0] * d0 + n[1] * d1 + n[2] * d2 < -deepest:
            c.stiffness[k, 0] *= factor
            c.gain[k] *= factor
            found += 1
    return found


@njit(cache=True, error_model="numpy")
def restitute(
    c: Contacts, count: int, before: Array, v: Array, give: Array, restitution: float, slowest: float, rounds: int,
    impulse: Array,
) -> float:  # fmt: skip
    """Change velocities so that contacts that were hit part at `restitution` times the speed at which they met.

    Impulses along the normals, Gauss-Seidel on the masses [Moreau1988]. Slower hits than `slowest` do not bounce.

    Args:
        c, count: Contacts; those under pressure count.
        before: Velocity of unknowns before the step [m/s, rad/s], shape (u,).
        v: After it; changed.
        give: 1 / mass of each unknown [1/kg]; a rigid body's own axes are taken as isotropic.
        restitution: e, 0 to 1.
        slowest: [m/s].
        rounds: Of Gauss-Seidel.
        impulse: Scratch, shape (c,).

    Returns:
        The largest normal impulse [N s].
    """
    largest = 0.0
    impulse[:count] = 0.0
    for _ in range(rounds):
        for k in range(count):
            if not c.pressure[k] > 0.0:
                continue
            n = c.normal[k]
            d0, d1, d2 = _relative(c, k, before)
            met = n[0] * d0 + n[1] * d1 + n[2] * d2
            if met > -slowest:
                continue
            d0, d1, d2 = _relative(c, k, v)
            now = n[0] * d0 + n[1] * d1 + n[2] * d2
            total = 0.0
            for m in range(4):
                b = c.base[k, m]
                if b < 0:
                    break
                total += c.lump[k, m] ** 2 * give[b]
                if c.width[k, m] == 6:
                    r = c.moment[k, m]
                    x0, x1, x2 = (
                        r[1] * n[2] - r[2] * n[1],
                        r[2] * n[0] - r[0] * n[2],
                        r[0] * n[1] - r[1] * n[0],
                    )
                    total += (x0 * x0 + x1 * x1 + x2 * x2) * give[b + 3]
            add = max((-restitution * met - now) / total, -impulse[k])
            impulse[k] += add
            largest = max(largest, impulse[k])
            for m in range(4):
                b = c.base[k, m]
                if b < 0:
                    break
                w = c.lump[k, m] * add
                for i in range(3):
                    v[b + i] += w * n[i] * give[b]
                if c.width[k, m] == 6:
                    r = c.moment[k, m]
                    v[b + 3] += (r[1] * n[2] - r[2] * n[1]) * add * give[b + 3]
                    v[b + 4] += (r[2] * n[0] - r[0] * n[2]) * add * give[b + 3]
                    v[b + 5] += (r[0] * n[1] - r[1] * n[0]) * add * give[b + 3]
    return largest
