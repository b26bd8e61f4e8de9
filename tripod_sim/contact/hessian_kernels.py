"""Loops of the Hessian of the contact terms (see `response_kernels`)."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.contact.contact_set import Contacts
from tripod_sim.contact.response_kernels import relative


@njit(cache=True, error_model="numpy")
def curvature(c: Contacts, k: int, d: tuple[float, float, float], H: Array) -> None:
    """Write the second derivative of P with respect to d, shape (3, 3), at the move `d`."""
    d0, d1, d2 = d
    n = c.normal[k]
    along = n[0] * d0 + n[1] * d1 + n[2] * d2
    rho, sigma, limit = c.stiffness[k, 0], c.stiffness[k, 1], c.limit[k]
    normal = rho if c.pressure[k] - rho * (c.gap[k] + along) > 0.0 else 0.0
    tangential, share = 0.0, 0.0
    t0 = t1 = t2 = 0.0
    if limit > 0.0:
        t0 = c.friction[k, 0] - sigma * (d0 - along * n[0] - c.drift[k, 0])
        t1 = c.friction[k, 1] - sigma * (d1 - along * n[1] - c.drift[k, 1])
        t2 = c.friction[k, 2] - sigma * (d2 - along * n[2] - c.drift[k, 2])
        size = np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
        tangential = sigma
        if size > limit:
            tangential = sigma * limit / size
            share = tangential / (size * size)
    t = (t0, t1, t2)
    for i in range(3):
        for j in range(3):
            H[i, j] = (normal - tangential) * n[i] * n[j] - share * t[i] * t[j]
        H[i, i] += tangential


@njit(cache=True, error_model="numpy")
def jacobian(c: Contacts, k: int, m: int, J: Array) -> None:
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
def pairs(c: Contacts, count: int, out: Array) -> int:
    """Write the first unknowns of all pairs of blocks of 3 x 3 that contacts join, above the diagonal or on it.

    Args:
        c, count: Contacts.
        out: Row and column of each, shape (64 count, 2).

    Returns:
        How many there are; some repeatedly.
    """
    found = 0
    for k in range(count):
        for b in range(4):
            if c.base[k, b] < 0:
                break
            for a in range(4):
                if c.base[k, a] < 0:
                    break
                for j in range(0, c.width[k, b], 3):
                    for i in range(0, c.width[k, a], 3):
                        row, column = c.base[k, a] + i, c.base[k, b] + j
                        if row < column:
                            out[found, 0], out[found, 1] = row, column
                            found += 1
    return found


@njit(cache=True, error_model="numpy")
def add_hessian(c: Contacts, count: int, u: Array, indptr: Array, indices: Array, data: Array) -> bool:
    """Add the Hessian of sum of P to an upper triangle, CSC; return False as soon as its pattern has no place.

    Args:
        c, count, u: Contacts and unknowns.
        indptr, indices, data: The matrix; blocks of a node or body are full.
    """
    H, A, B, HB = np.empty((3, 3)), np.empty((3, 6)), np.empty((3, 6)), np.empty((3, 6))
    base, lump, moment, width, normal = c.base, c.lump, c.moment, c.width, c.normal
    pressure, stiffness, gap, limit = c.pressure, c.stiffness, c.gap, c.limit
    for k in range(count):
        d = relative(base, lump, moment, width, k, u)
        along = normal[k, 0] * d[0] + normal[k, 1] * d[1] + normal[k, 2] * d[2]
        if pressure[k] - stiffness[k, 0] * (gap[k] + along) <= 0.0 and limit[k] <= 0.0:
            continue  # it has none
        curvature(c, k, d, H)
        for b in range(4):
            if c.base[k, b] < 0:
                break
            jacobian(c, k, b, B)
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
                at = _find(indptr, indices, row, column)
                if at < 0:
                    return False
                jacobian(c, k, a, A)
                tall = c.width[k, a]
                at -= indptr[column]  # the same in all columns of a block: blocks above each other are full
                for j in range(wide):
                    first = indptr[column + j] + at
                    for i in range(min(tall, j + 1) if row == column else tall):
                        data[first + i] += A[0, i] * HB[0, j] + A[1, i] * HB[1, j] + A[2, i] * HB[2, j]
    return True
