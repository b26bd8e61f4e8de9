"""Loops of few contacts: a step's potential condensed on the unknowns that contacts touch, dense and small.

With z the m unknowns touched, y where they are without contacts and N = A^-1 at them, the potential in which all other
unknowns have found their rest is

    (z - y)^T N^-1 (z - y) / 2 + sum of P(z)

with P as in `response_kernels`. So W = H N H^T, what each contact does to each other, is never formed.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put
from tripod_sim.contact.contact_set import Contacts
from tripod_sim.contact.hessian_kernels import curvature, jacobian
from tripod_sim.contact.response_kernels import add_gradient, forces, relative, set_limits

STEPS, ROUNDS, MORE = 12, 60, 90
"""Of Newton's method in a round of multipliers; rounds; and with those in which a slow one makes contacts stiffer."""

SHORTEST = 1e-4
"""Smallest fraction of a Newton step."""

SLOW, STIFFER = 0.5, 4.0
"""Share of the error that a slow round leaves, at least, and how many times stiffer that makes contacts: along their
normals if gaps err most, as under a body that is far heavier than the one below, else along the surfaces, as where
friction wedges a ball in a hole."""

NORMAL, TANGENTIAL = 60.0, 5.0
"""Stiffness of contacts over that of the bodies at the contact: the error falls by about this factor a round. Softer
along the surfaces, for then friction is spread over contacts that stick together."""


@njit(cache=True, error_model="numpy")
def choose(
    c: Contacts, count: int, u: Array, least: float, taken: Array, out: Contacts, chosen: Array
) -> int:
    """Copy the contacts that press, or whose gap after the moves `u` is below `least` [m], to `out`.

    Args:
        c, count: All contacts.
        u: Shape (unknowns,).
        least: [m].
        taken: Which contacts are in `out` in any case, shape (c,); those that are come to be marked.
        out: Room for all of them.
        chosen: Their numbers, written, shape (c,).

    Returns:
        How many there are; less than zero if there are no new ones.
    """
    base, lump, moment, width, normal = c.base, c.lump, c.moment, c.width, c.normal
    found = new = 0
    for k in range(count):
        if not taken[k]:
            d = relative(base, lump, moment, width, k, u)
            along = normal[k, 0] * d[0] + normal[k, 1] * d[1] + normal[k, 2] * d[2]
            if not (c.pressure[k] > 0.0 or c.gap[k] + along < least):
                continue
            taken[k] = True
            new += 1
        chosen[found] = k
        found += 1
    if new == 0:
        return -1
    for j in range(found):
        k = chosen[j]
        out.gap[j], out.pressure[j] = c.gap[k], c.pressure[k]
        for i in range(3):
            out.normal[j, i], out.friction[j, i] = c.normal[k, i], c.friction[k, i]
            out.drift[j, i] = c.drift[k, i]
        for m in range(4):
            out.base[j, m], out.lump[j, m], out.width[j, m] = c.base[k, m], c.lump[k, m], c.width[k, m]
            for i in range(3):
                out.moment[j, m, i] = c.moment[k, m, i]
    return found


@njit(cache=True, error_model="numpy")
def give_back(out: Contacts, found: int, chosen: Array, c: Contacts) -> None:
    """Copy the forces of the chosen contacts, and how stiff they are, back."""
    for j in range(found):
        k = chosen[j]
        c.pressure[k] = out.pressure[j]
        for i in range(3):
            c.friction[k, i] = out.friction[j, i]


@njit(cache=True, error_model="numpy")
def touch(c: Contacts, count: int, place: Array, touched: Array) -> int:
    """Write the unknowns that contacts touch to `touched` and let `c.base` be their places there.

    `place`: scratch, -1 everywhere, shape (unknowns,).

    Returns:
        How many there are.
    """
    found = 0
    for k in range(count):
        for m in range(4):
            b = c.base[k, m]
            if b < 0:
                break
            if place[b] < 0:
                place[b] = found
                for i in range(c.width[k, m]):
                    touched[found] = b + i
                    found += 1
            c.base[k, m] = place[b]
    for i in range(found):
        place[touched[i]] = -1
    return found


@njit(cache=True, error_model="numpy")
def condense(columns: Array, row: Array, which: Array, N: Array) -> None:
    """Write N, shape (m, m): entries `which` of the rows `row` of what is known of A^-1, both of shape (m,)."""
    m = N.shape[0]
    for i in range(m):
        for j in range(m):
            N[i, j] = columns[row[i], which[j]]
    for i in range(m):
        for j in range(i):
            N[i, j] = N[j, i] = 0.5 * (N[i, j] + N[j, i])


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def cholesky(K: Array) -> bool:
    """Write L of K = L L^T into the lower triangle; return False where K is not positive definite."""
    m = K.shape[0]
    for i in range(m):
        row = K[i]
        for j in range(i):
            other, total = K[j], row[j]
            for k in range(j):
                total -= row[k] * other[k]
            row[j] = total / other[j]
        total = row[i]
        for k in range(i):
            total -= row[k] * row[k]
        if not total > 0.0:
            return False
        row[i] = np.sqrt(total)
    return True


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def substitute(L: Array, x: Array) -> None:
    """Overwrite x with (L L^T)^-1 x."""
    m = L.shape[0]
    for i in range(m):
        row, total = L[i], x[i]
        for k in range(i):
            total -= row[k] * x[k]
        x[i] = total / row[i]
    for i in range(m - 1, -1, -1):
        row = L[i]
        x[i] /= row[i]
        for k in range(i):
            x[k] -= row[k] * x[i]


@njit(cache=True, error_model="numpy")
def invert(N: Array, S: Array) -> bool:
    """Write S = N^-1 of a positive definite N, which is lost; return False where it is not."""
    m = N.shape[0]
    if not cholesky(N):
        return False
    e = np.empty(m)
    for j in range(m):
        e[:] = 0.0
        e[j] = 1.0
        substitute(N, e)
        for i in range(m):
            S[i, j] = e[i]
    return True


@njit(cache=True, error_model="numpy")
def _all_blocks(c: Contacts, k: int, J: Array, B: Array, at: Array) -> int:
    """Write J of contact k to `B`, shape (3, 24), and the places of its columns to `at`; return their number.

    J: scratch, shape (3, 6).
    """
    wide = 0
    for m in range(4):
        if c.base[k, m] < 0:
            break
        jacobian(c, k, m, J)
        for j in range(c.width[k, m]):
            for i in range(3):
                B[i, wide] = J[i, j]
            at[wide] = c.base[k, m] + j
            wide += 1
    return wide


@njit(cache=True, error_model="numpy")
def stiffen(c: Contacts, count: int, N: Array) -> None:
    """Write rho and sigma: multiples of 1 / (n . J N J^T n) of each contact, and of the same across it."""
    J, B, at = np.empty((3, 6)), np.empty((3, 24)), np.empty(24, dtype=np.int64)
    for k in range(count):
        wide = _all_blocks(c, k, J, B, at)
        along = across = 0.0
        n = c.normal[k]
        for p in range(wide):
            p_n = n[0] * B[0, p] + n[1] * B[1, p] + n[2] * B[2, p]
            for q in range(wide):
                q_n = n[0] * B[0, q] + n[1] * B[1, q] + n[2] * B[2, q]
                value = N[at[p], at[q]]
                along += p_n * value * q_n
                across += (B[0, p] * B[0, q] + B[1, p] * B[1, q] + B[2, p] * B[2, q]) * value
        across = 0.5 * (across - along)
        c.stiffness[k, 0], c.stiffness[k, 1] = NORMAL / along, TANGENTIAL / max(across, 1e-3 * along)


@njit(cache=True, error_model="numpy")
def _add_hessian(c: Contacts, count: int, z: Array, K: Array) -> None:
    """Add the Hessian of sum of P, J^T H J of each contact, to the lower triangle of K."""
    normal, pressure, stiffness, gap, limit = c.normal, c.pressure, c.stiffness, c.gap, c.limit
    H, J, B, at = np.empty((3, 3)), np.empty((3, 6)), np.empty((3, 24)), np.empty(24, dtype=np.int64)
    for k in range(count):
        d = relative(c.base, c.lump, c.moment, c.width, k, z)
        along = normal[k, 0] * d[0] + normal[k, 1] * d[1] + normal[k, 2] * d[2]
        if pressure[k] - stiffness[k, 0] * (gap[k] + along) <= 0.0 and limit[k] <= 0.0:
            continue
        curvature(c, k, d, H)
        wide = _all_blocks(c, k, J, B, at)
        for q in range(wide):
            b0, b1, b2 = B[0, q], B[1, q], B[2, q]
            h0, h1, h2 = (
                H[0, 0] * b0 + H[0, 1] * b1 + H[0, 2] * b2,
                H[1, 0] * b0 + H[1, 1] * b1 + H[1, 2] * b2,
                H[2, 0] * b0 + H[2, 1] * b1 + H[2, 2] * b2,
            )
            for p in range(wide):
                if at[p] >= at[q]:
                    K[at[p], at[q]] += B[0, p] * h0 + B[1, p] * h1 + B[2, p] * h2


@njit(cache=True, error_model="numpy")
def _potential(c: Contacts, count: int, S: Array, y: Array, z: Array, g: Array) -> float:
    """Write the gradient of the condensed potential at z and return it."""
    m = len(z)
    total = 0.0
    for i in range(m):
        row, value = S[i], 0.0
        for j in range(m):
            value += row[j] * (z[j] - y[j])
        g[i] = value
        total += 0.5 * value * (z[i] - y[i])
    return total + add_gradient(c, count, z, g)


@njit(cache=True, error_model="numpy")
def settle(
    c: Contacts, count: int, S: Array, y: Array, z: Array, mu: float, aim: float, pressure: Array,
    friction: Array,
) -> tuple[int, float]:  # fmt: skip
    """Move z to the minimum, and let the contacts take the forces there.

    Args:
        c, count: Contacts; their `base` is the place in z.
        S: N^-1, shape (m, m).
        y: Where z is without contacts, shape (m,).
        z: Where to begin; the result.
        mu: Coulomb's coefficient.
        aim: Error of gaps and slips that is let be [m].
        pressure, friction: As `forces` writes, shapes (c,) and (c, 3).

    Returns:
        Rounds, and the error that is left [m]; not finite where there is no minimum.
    """
    m = len(z)
    K, g, after, p, trial = np.empty((m, m)), np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    error, before = 0.0, np.inf  # the forces that it begins with may be the right ones
    for rounds in range(1, MORE + 1):
        set_limits(c, count, mu)
        phi, size = _potential(c, count, S, y, z, g), np.inf
        for _ in range(STEPS):
            for i in range(m):
                for j in range(i + 1):
                    K[i, j] = S[i, j]
            _add_hessian(c, count, z, K)
            if not cholesky(K):
                return rounds, np.inf
            put(p, g)
            substitute(K, p)
            slope, size = 0.0, 0.0
            for i in range(m):
                slope += p[i] * g[i]
                size = max(size, abs(p[i]))
            if size <= max(0.1 * aim, 0.02 * error):  # no more exact than the multipliers are
                for i in range(m):
                    z[i] -= p[i]
                break
            scale = 1.0
            while scale > SHORTEST:
                for i in range(m):
                    trial[i] = z[i] - scale * p[i]
                lower = _potential(c, count, S, y, trial, after)
                if lower <= phi - 1e-4 * scale * slope + 1e-12 * abs(phi):
                    break
                scale *= 0.5
            put(z, trial)
            put(g, after)
            phi = lower
        gap, slip, _ = forces(c, count, z, mu, pressure, friction)
        error = max(gap, slip)
        put(c.pressure[:count], pressure[:count])
        put(c.friction[:count], friction[:count])
        if not error > aim and size <= max(0.1 * aim, 0.02 * error):
            return rounds, error
        if rounds >= ROUNDS and error > SLOW * before:
            for k in range(count):
                c.stiffness[k, 0] *= STIFFER if gap == error else 1.0
                c.stiffness[k, 1] *= STIFFER if slip == error else 1.0
        before = error
    return MORE, error


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def add_answers(S: Array, offset: Array, columns: Array, row: Array, force: Array, out: Array) -> None:
    """Write the forces S (z - y), `offset` being z - y, shape (m,), and add what they move, A^-1 of them, to `out`.

    columns, row: Rows of A^-1, and which of them belong to z, shape (m,).
    """
    for i in range(len(force)):
        total, own, answer = 0.0, S[i], columns[row[i]]
        for j in range(len(force)):
            total += own[j] * offset[j]
        force[i] = total
        for k in range(len(out)):
            out[k] += total * answer[k]


@njit(cache=True, error_model="numpy")
def smallest_gap(c: Contacts, count: int, u: Array) -> float:
    """Return the smallest gap after the moves `u` [m], infinite without contacts."""
    base, lump, moment, width, normal = c.base, c.lump, c.moment, c.width, c.normal
    least = np.inf
    for k in range(count):
        d = relative(base, lump, moment, width, k, u)
        least = min(least, c.gap[k] + normal[k, 0] * d[0] + normal[k, 1] * d[1] + normal[k, 2] * d[2])
    return least
