"""Compiled linear solvers for one implicit stage of a spring body: multifrontal L D L^T and conjugate gradients.

The matrix is H = diag(w) + springs' Hessian, over free nodes; w_i [N/m] multiplies the identity of node i.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from tripod_sim.linear import ldl_kernels

Array = Any


class Factor(NamedTuple):
    """Pattern, plan and numbers of the direct solver; all empty where conjugate gradients solve.

    data: upper triangle, CSC; diagonal: where column c of a free node's block begins in it, (f, 3); off: the same for
    each spring, -1 where an end is fixed, (m, 3); the others as in `Symbolic` and `Ldl`.
    """

    data: Array
    diagonal: Array
    off: Array
    order: Array
    pivots: Array
    rows: Array
    first_row: Array
    panel: Array
    parent: Array
    place: Array
    target: Array
    source: Array
    first_entry: Array
    front: Array
    stack: Array
    waiting: Array
    factors: Array
    inverse: Array
    y: Array
    xs: Array
    b: Array
    out: Array


@njit(cache=True, error_model="numpy")
def assemble(ends: Array, blocks: Array, weight: Array, free: Array, number: Array, A: Factor) -> None:
    """Write H into `A.data`. free: nodes of the unknowns, (f,); number: place of a node in `free`, -1 if fixed."""
    data, diagonal, off = A.data, A.diagonal, A.off
    data[:] = 0.0
    for k in range(free.shape[0]):
        w, s = weight[free[k]], diagonal[k]
        data[s[0]] = data[s[1] + 1] = data[s[2] + 2] = w
    for m in range(ends.shape[0]):
        b = blocks[m]
        for side in range(2):
            k = number[ends[m, side]]
            if k >= 0:
                s = diagonal[k]
                data[s[0]] += b[0]
                data[s[1]] += b[1]
                data[s[1] + 1] += b[3]
                data[s[2]] += b[2]
                data[s[2] + 1] += b[4]
                data[s[2] + 2] += b[5]
        s = off[m]
        if s[0] >= 0:
            data[s[0]] -= b[0]
            data[s[0] + 1] -= b[1]
            data[s[0] + 2] -= b[2]
            data[s[1]] -= b[1]
            data[s[1] + 1] -= b[3]
            data[s[1] + 2] -= b[4]
            data[s[2]] -= b[2]
            data[s[2] + 1] -= b[4]
            data[s[2] + 2] -= b[5]


@njit(cache=True, error_model="numpy")
def factorise(A: Factor) -> int:
    """Factor `A.data`; return the number of negative pivots, below zero where one vanishes or is not finite."""
    return ldl_kernels.factor(
        A.data, A.pivots, A.first_row, A.panel, A.parent, A.place, A.target, A.source, A.first_entry,
        A.front, A.stack, A.waiting, A.factors, A.inverse,
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def solve_direct(A: Factor, g: Array, free: Array, p: Array) -> None:
    """Write p = -H^-1 g of free nodes, (n, 3), with the last factorisation."""
    for k in range(free.shape[0]):
        for i in range(3):
            A.b[3 * k + i] = g[free[k], i]
    ldl_kernels.solve(
        A.b, A.order, A.pivots, A.rows, A.first_row, A.panel, A.factors, A.inverse, A.y, A.xs, A.out
    )
    for k in range(free.shape[0]):
        for i in range(3):
            p[free[k], i] = -A.out[3 * k + i]


@njit(cache=True, error_model="numpy")
def invert_diagonal(ends: Array, blocks: Array, weight: Array, free: Array, J: Array) -> bool:
    """Write the inverse of each free node's diagonal block, xx xy xz yy yz zz; return whether all are definite."""
    for n in range(J.shape[0]):
        J[n, 0] = J[n, 3] = J[n, 5] = weight[n]
        J[n, 1] = J[n, 2] = J[n, 4] = 0.0
    for m in range(ends.shape[0]):
        for side in range(2):
            n = ends[m, side]
            for c in range(6):
                J[n, c] += blocks[m, c]
    for k in range(free.shape[0]):
        n = free[k]
        a, b, c, d, e, f = J[n, 0], J[n, 1], J[n, 2], J[n, 3], J[n, 4], J[n, 5]
        A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
        det = a * A + b * B + c * C
        if not (a > 0.0 and a * d - b * b > 0.0 and det > 0.0):
            return False
        r = 1.0 / det
        J[n, 0], J[n, 1], J[n, 2] = A * r, B * r, C * r
        J[n, 3], J[n, 4], J[n, 5] = (a * f - c * c) * r, (b * c - a * e) * r, (a * d - b * b) * r
    return True


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def product(ends: Array, blocks: Array, weight: Array, free: Array, p: Array, out: Array) -> None:
    """Write H p of free nodes, (n, 3); `p` is zero at fixed nodes. Springs with one first end are best in a row."""
    for k in range(free.shape[0]):
        n = free[k]
        w = weight[n]
        out[n, 0], out[n, 1], out[n, 2] = w * p[n, 0], w * p[n, 1], w * p[n, 2]
    i = ends[0, 0]
    p0, p1, p2 = p[i, 0], p[i, 1], p[i, 2]
    a0 = a1 = a2 = 0.0
    for m in range(ends.shape[0]):
        j = ends[m, 1]
        if ends[m, 0] != i:
            out[i, 0] += a0
            out[i, 1] += a1
            out[i, 2] += a2
            i = ends[m, 0]
            p0, p1, p2 = p[i, 0], p[i, 1], p[i, 2]
            a0 = a1 = a2 = 0.0
        d0, d1, d2 = p0 - p[j, 0], p1 - p[j, 1], p2 - p[j, 2]
        b = blocks[m]
        f0 = b[0] * d0 + b[1] * d1 + b[2] * d2
        f1 = b[1] * d0 + b[3] * d1 + b[4] * d2
        f2 = b[2] * d0 + b[4] * d1 + b[5] * d2
        a0 += f0
        a1 += f1
        a2 += f2
        out[j, 0] -= f0
        out[j, 1] -= f1
        out[j, 2] -= f2
    out[i, 0] += a0
    out[i, 1] += a1
    out[i, 2] += a2


@njit(cache=True, error_model="numpy")
def conjugate_gradients(
    ends: Array,
    blocks: Array,
    weight: Array,
    free: Array,
    J: Array,
    g: Array,
    tolerance: float,
    limit: int,
    p: Array,
    r: Array,
    d: Array,
    q: Array,
) -> int:
    """Write p = -H^-1 g until |g + H p| <= tolerance |g|; return the iterations, or -1 where that failed.

    It begins with the `p` given, zero at fixed nodes. It fails at negative curvature, at a number that is not finite,
    and after `limit` iterations. Preconditioned by the diagonal blocks whose inverses are `J`; r, d and q are scratch,
    (n, 3), zero at fixed nodes.
    """
    start = now = rho = 0.0
    product(ends, blocks, weight, free, p, q)
    for k in range(free.shape[0]):
        n = free[k]
        start += g[n, 0] * g[n, 0] + g[n, 1] * g[n, 1] + g[n, 2] * g[n, 2]
        r0, r1, r2 = -g[n, 0] - q[n, 0], -g[n, 1] - q[n, 1], -g[n, 2] - q[n, 2]
        z0 = J[n, 0] * r0 + J[n, 1] * r1 + J[n, 2] * r2
        z1 = J[n, 1] * r0 + J[n, 3] * r1 + J[n, 4] * r2
        z2 = J[n, 2] * r0 + J[n, 4] * r1 + J[n, 5] * r2
        r[n, 0], r[n, 1], r[n, 2] = r0, r1, r2
        d[n, 0], d[n, 1], d[n, 2] = z0, z1, z2
        now += r0 * r0 + r1 * r1 + r2 * r2
        rho += r0 * z0 + r1 * z1 + r2 * z2
    goal = tolerance * tolerance * start
    for done in range(limit):
        if now <= goal:
            return done
        product(ends, blocks, weight, free, d, q)
        curvature = 0.0
        for k in range(free.shape[0]):
            n = free[k]
            curvature += d[n, 0] * q[n, 0] + d[n, 1] * q[n, 1] + d[n, 2] * q[n, 2]
        if not 0.0 < curvature < np.inf:
            return -1
        step = rho / curvature
        now = following = 0.0
        for k in range(free.shape[0]):
            n = free[k]
            for i in range(3):
                p[n, i] += step * d[n, i]
                r[n, i] -= step * q[n, i]
            r0, r1, r2 = r[n, 0], r[n, 1], r[n, 2]
            z0 = J[n, 0] * r0 + J[n, 1] * r1 + J[n, 2] * r2
            z1 = J[n, 1] * r0 + J[n, 3] * r1 + J[n, 4] * r2
            z2 = J[n, 2] * r0 + J[n, 4] * r1 + J[n, 5] * r2
            q[n, 0], q[n, 1], q[n, 2] = z0, z1, z2
            now += r0 * r0 + r1 * r1 + r2 * r2
            following += r0 * z0 + r1 * z1 + r2 * z2
        ratio = following / rho
        rho = following
        for k in range(free.shape[0]):
            n = free[k]
            for i in range(3):
                d[n, i] = q[n, i] + ratio * d[n, i]
    return limit if now <= goal else -1
