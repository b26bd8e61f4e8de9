"""Hits: contacts at which a velocity jumps within a stage."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.contact.contact_set import Contacts
from tripod_sim.contact.response_kernels import relative

HELD = 0.999
"""Share of its limit below which friction holds."""


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
