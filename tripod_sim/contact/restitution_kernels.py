"""Hits, before and after a step, and restitution: impulses on the masses after it."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.contact.contact_set import Contacts
from tripod_sim.contact.response_kernels import relative

HELD = 0.999
"""Share of its limit below which friction holds."""


@njit(cache=True, error_model="numpy")
def bounces(c: Contacts, count: int, before: Array, slowest: float) -> bool:
    """Return whether any contact was hit so that it bounces; the arguments are those of `restitute`."""
    base, lump, moment, width = c.base, c.lump, c.moment, c.width
    for k in range(count):
        if c.pressure[k] > 0.0:
            n = c.normal[k]
            d0, d1, d2 = relative(base, lump, moment, width, k, before)
            if n[0] * d0 + n[1] * d1 + n[2] * d2 <= -slowest:
                return True
    return False


@njit(cache=True, error_model="numpy")
def restitute(
    c: Contacts, count: int, before: Array, v: Array, give: Array, restitution: float, slowest: float, rounds: int,
    impulse: Array,
) -> None:  # fmt: skip
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
    """
    base, lump, moment, width = c.base, c.lump, c.moment, c.width
    impulse[:count] = 0.0
    for _ in range(rounds):
        for k in range(count):
            if not c.pressure[k] > 0.0:
                continue
            n = c.normal[k]
            d0, d1, d2 = relative(base, lump, moment, width, k, before)
            met = n[0] * d0 + n[1] * d1 + n[2] * d2
            if met > -slowest:
                continue
            d0, d1, d2 = relative(base, lump, moment, width, k, v)
            now = n[0] * d0 + n[1] * d1 + n[2] * d2
            total = 0.0
            for m in range(4):
                b = c.base[k, m]
                if b < 0:
                    break
                for i in range(3):
                    total += (c.lump[k, m] * n[i]) ** 2 * give[b + i]
                if c.width[k, m] == 6:
                    r = c.moment[k, m]
                    x0, x1, x2 = (
                        r[1] * n[2] - r[2] * n[1],
                        r[2] * n[0] - r[0] * n[2],
                        r[0] * n[1] - r[1] * n[0],
                    )
                    total += (x0 * x0 + x1 * x1 + x2 * x2) * give[b + 3]
            if not total > 0.0:
                continue
            add = max((-restitution * met - now) / total, -impulse[k])
            impulse[k] += add
            for m in range(4):
                b = c.base[k, m]
                if b < 0:
                    break
                w = c.lump[k, m] * add
                for i in range(3):
                    v[b + i] += w * n[i] * give[b + i]
                if c.width[k, m] == 6:
                    r = c.moment[k, m]
                    v[b + 3] += (r[1] * n[2] - r[2] * n[1]) * add * give[b + 3]
                    v[b + 4] += (r[2] * n[0] - r[0] * n[2]) * add * give[b + 3]
                    v[b + 5] += (r[0] * n[1] - r[1] * n[0]) * add * give[b + 3]


@njit(cache=True, error_model="numpy")
def hits(
    c: Contacts, count: int, before: Array, after: Array, slowest: float, slow: float, creep: float, mu: float
) -> bool:
    """Return whether sides that press meet or part faster than `slowest` [m/s] before or after a stage.

    Or slip so in the direction in which friction pushes: then it has stopped them within the stage. Of rigid bodies,
    which go on by what a scheme remembers, `slow` and `creep` are the limits, and they may not slip after the stage
    where friction holds, nor the other way than before.

    Args:
        c, count: Contacts, with their forces at the end of the stage.
        before, after: Velocities of unknowns [m/s, rad/s], shape (u,).
        slowest, slow, creep: See above.
        mu: Coulomb's coefficient.
    """
    for k in range(count):
        f, n = c.friction[k], c.normal[k]
        if not c.pressure[k] > 0.0:
            continue
        size = np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
        b0, b1, b2 = relative(c.base, c.lump, c.moment, c.width, k, before)
        a0, a1, a2 = relative(c.base, c.lump, c.moment, c.width, k, after)
        first, last = n[0] * b0 + n[1] * b1 + n[2] * b2, n[0] * a0 + n[1] * a1 + n[2] * a2
        rigid = False
        for m in range(4):
            rigid |= c.width[k, m] == 6
        if max(abs(first), abs(last)) > (slow if rigid else slowest):
            return True
        pushed = max(f[0] * b0 + f[1] * b1 + f[2] * b2, f[0] * a0 + f[1] * a1 + f[2] * a2)
        if pushed > (creep if rigid else slowest) * size:
            return True
        slip = a0 * a0 + a1 * a1 + a2 * a2 - last * last
        stops = size < HELD * mu * c.pressure[k] or a0 * b0 + a1 * b1 + a2 * b2 - last * first < 0.0 < size
        if rigid and stops and slip > creep * creep:
            return True
    return False


@njit(cache=True, error_model="numpy")
def meets(c: Contacts, count: int, before: Array, moves: Array, slowest: float) -> float:
    """Return the share of `moves` after which sides that approach first touch; infinite where none do.

    Args:
        c, count: Contacts.
        before: Velocities of unknowns [m/s, rad/s], shape (u,).
        moves: Of unknowns, shape (u,).
        slowest: What approaches no faster does not count [m/s].
    """
    first = np.inf
    for k in range(count):
        n = c.normal[k]
        d0, d1, d2 = relative(c.base, c.lump, c.moment, c.width, k, moves)
        along = n[0] * d0 + n[1] * d1 + n[2] * d2
        if c.gap[k] + along >= 0.0:
            continue
        d0, d1, d2 = relative(c.base, c.lump, c.moment, c.width, k, before)
        if n[0] * d0 + n[1] * d1 + n[2] * d2 < -slowest:
            first = min(first, max(c.gap[k], 0.0) / max(-along, 1e-300))
    return first
