"""Conjugate gradients on 3 x 3 blocks of the upper triangle, with a block-Jacobi preconditioner, compiled."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put

SOLVED, UNSOLVED, INDEFINITE, BROKEN = 0, 1, 2, 3


@njit(cache=True, error_model="numpy")
def gather(data: Array, source: Array, values: Array) -> bool:
    """Write the blocks' values, zero where `source` is negative; return whether all of `data` is finite."""
    total = 0.0
    for k in range(data.shape[0]):
        total += 0.0 * data[k]  # not a number as soon as one is not finite
    for b in range(source.shape[0]):
        for i in range(9):
            values[b, i] = data[source[b, i]] if source[b, i] >= 0 else 0.0
    return total == 0.0


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def product(indices: Array, indptr: Array, values: Array, p: Array, out: Array) -> None:
    """Write A p. Blocks of a block column lie above its diagonal block, which comes last and is stored whole."""
    out[:] = 0.0
    for c in range(indptr.shape[0] - 1):
        j = 3 * c
        p0, p1, p2 = p[j], p[j + 1], p[j + 2]
        s0 = s1 = s2 = 0.0
        last = indptr[c + 1] - 1
        for b in range(indptr[c], last):
            i, v = 3 * indices[b], values[b]
            q0, q1, q2 = p[i], p[i + 1], p[i + 2]
            out[i] += v[0] * p0 + v[1] * p1 + v[2] * p2
            out[i + 1] += v[3] * p0 + v[4] * p1 + v[5] * p2
            out[i + 2] += v[6] * p0 + v[7] * p1 + v[8] * p2
            s0 += v[0] * q0 + v[3] * q1 + v[6] * q2
            s1 += v[1] * q0 + v[4] * q1 + v[7] * q2
            s2 += v[2] * q0 + v[5] * q1 + v[8] * q2
        v = values[last]
        out[j] += s0 + v[0] * p0 + v[1] * p1 + v[2] * p2
        out[j + 1] += s1 + v[3] * p0 + v[4] * p1 + v[5] * p2
        out[j + 2] += s2 + v[6] * p0 + v[7] * p1 + v[8] * p2


@njit(cache=True, error_model="numpy")
def factor_blocks(data: Array, blocks: Array, slots: Array, L: Array) -> bool:
    """Write the Cholesky factor of each diagonal block to `L`, (blocks, 6, 6), the inverse of its diagonal in place.

    Return whether all are positive definite. slots: entry of `data` of each (row, column), -1 where there is none.
    """
    for b in range(blocks.shape[0] - 1):
        size = blocks[b + 1] - blocks[b]
        for c in range(size):
            for r in range(c, size):
                total = data[slots[b, c, r]] if slots[b, c, r] >= 0 else 0.0
                for k in range(c):
                    total -= L[b, r, k] * L[b, c, k]
                if r > c:
                    L[b, r, c] = total * L[b, c, c]
                elif total > 0.0:
                    L[b, c, c] = 1.0 / np.sqrt(total)
                else:
                    return False
    return True


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def precondition(blocks: Array, L: Array, r: Array, z: Array) -> float:
    """Write z = M^-1 r and return r^T z."""
    total = 0.0
    for b in range(blocks.shape[0] - 1):
        first, size = blocks[b], blocks[b + 1] - blocks[b]
        for i in range(size):
            value = r[first + i]
            for k in range(i):
                value -= L[b, i, k] * z[first + k]
            z[first + i] = value * L[b, i, i]
        for i in range(size - 1, -1, -1):
            value = z[first + i]
            for k in range(i + 1, size):
                value -= L[b, k, i] * z[first + k]
            z[first + i] = value * L[b, i, i]
        for i in range(size):
            total += r[first + i] * z[first + i]
    return total


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def conjugate_gradients(
    indices: Array,
    indptr: Array,
    values: Array,
    blocks: Array,
    L: Array,
    b: Array,
    tolerance: float,
    limit: int,
    r: Array,
    z: Array,
    p: Array,
    q: Array,
    x: Array,
) -> tuple[int, int, float]:
    """Write A^-1 b to `x`; return how it ended, the iterations, and the relative residual |b - A x| / |b|.

    |v|² = v^T M^-1 v, in which forces and torques may be added. The residual is that of `x`, not the recurrence's:
    where rounding has parted the two, the method starts again from `x`, as long as that still halves the residual.
    """
    n = b.shape[0]
    x[:] = 0.0
    put(r, b)
    start = now = precondition(blocks, L, r, z)
    if not 0.0 <= start < np.inf:
        return BROKEN, 0, np.inf
    goal, done = tolerance * tolerance * start, 0
    before = np.inf
    while now > goal:
        if now > 0.25 * before or done >= limit:
            return UNSOLVED, done, np.sqrt(now / start)
        before = now
        put(p, z)
        while now > 0.5 * goal and done < limit:
            product(indices, indptr, values, p, q)
            curvature = 0.0
            for i in range(n):
                curvature += p[i] * q[i]
            done += 1
            if not curvature > 0.0:
                return INDEFINITE if curvature <= 0.0 else BROKEN, done, np.sqrt(now / start)
            step = now / curvature
            for i in range(n):
                x[i] += step * p[i]
                r[i] -= step * q[i]
            following = precondition(blocks, L, r, z)
            ratio = following / now
            now = following
            for i in range(n):
                p[i] = z[i] + ratio * p[i]
        product(indices, indptr, values, x, q)
        for i in range(n):
            r[i] = b[i] - q[i]
        now = precondition(blocks, L, r, z)
        if not now < np.inf:
            return BROKEN, done, np.inf
    return SOLVED, done, np.sqrt(now / start) if start > 0.0 else 0.0
