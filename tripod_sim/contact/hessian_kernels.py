"""Loops of the Hessian of the contact terms (see `response_kernels`), and of products with it."""

from typing import Any

import numpy as np
from numba import njit

from tripod_sim.contact.contact_set import Contacts
from tripod_sim.contact.response_kernels import relative

Array = Any


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
        t0 = c.friction[k, 0] - sigma * (d0 - along * n[0])
        t1 = c.friction[k, 1] - sigma * (d1 - along * n[1])
        t2 = c.friction[k, 2] - sigma * (d2 - along * n[2])
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
def _fits(c: Contacts, k: int, indptr: Array, indices: Array) -> bool:
    """Return whether the pattern has a place for every pair of unknowns of contact k."""
    for b in range(4):
        if c.base[k, b] < 0:
            break
        for a in range(b):
            row, column = c.base[k, a], c.base[k, b]
            if _find(indptr, indices, min(row, column), max(row, column)) < 0:
                return False
    return True


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

    Of a contact for which the pattern has not all places, everything between its two sides (weights of unlike sign)
    goes there: what each side has with itself is positive, some of what is between them without the rest is not.

    Args:
        c, count, u: Contacts and unknowns.
        indptr, indices, data: The matrix; blocks of a node or body are full.
        outside: Blocks (first, second), first unknown smaller, shape (room, 6, 6).
        places: First unknowns and widths of each: first, second, width of first, of second, shape (room, 4).

    Returns:
        How many blocks are outside, beyond the room if it does not suffice.
    """
    H, A, B, HB, M = np.empty((3, 3)), np.empty((3, 6)), np.empty((3, 6)), np.empty((3, 6)), np.empty((6, 6))
    base, lump, moment, width, normal = c.base, c.lump, c.moment, c.width, c.normal
    pressure, stiffness, gap, limit = c.pressure, c.stiffness, c.gap, c.limit
    found = 0
    for k in range(count):
        d = relative(base, lump, moment, width, k, u)
        along = normal[k, 0] * d[0] + normal[k, 1] * d[1] + normal[k, 2] * d[2]
        if pressure[k] - stiffness[k, 0] * (gap[k] + along) <= 0.0 and limit[k] <= 0.0:
            continue  # it has none
        curvature(c, k, d, H)
        fits = _fits(c, k, indptr, indices)
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
                jacobian(c, k, a, A)
                tall = c.width[k, a]
                for i in range(tall):
                    for j in range(wide):
                        M[i, j] = A[0, i] * HB[0, j] + A[1, i] * HB[1, j] + A[2, i] * HB[2, j]
                between = not fits and c.lump[k, a] * c.lump[k, b] < 0.0
                at = -1 if between else _find(indptr, indices, row, column)
                if at < 0:
                    if found < outside.shape[0]:
                        outside[found, :tall, :wide] = M[:tall, :wide]
                        places[found, 0], places[found, 1], places[found, 2], places[found, 3] = (
                            row, column, tall, wide,
                        )  # fmt: skip
                    found += 1
                    continue
                at -= indptr[column]  # the same in all columns of a block: blocks above each other are full
                for j in range(wide):
                    first = indptr[column + j] + at
                    for i in range(min(tall, j + 1) if row == column else tall):
                        data[first + i] += M[i, j]
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
