"""Conjugate gradients on 3 x 3 blocks, preconditioned by an incomplete factorisation, compiled.

With blocks A = L + C + L^T, L strictly lower, the preconditioner is

    M = (D + L) D^-1 (D + L^T),   D_j = C_j - sum_{i < j} L_ji D_i^-1 S_ij,   S_ij = (1 - a) L_ji^T + a sum_k L_ki^T,

the modified incomplete factorisation without fill [Gustafsson1978]: with a = 1 M moves a body that moves as a whole
as A does. Where a block D_j would not be positive definite it is C_j, as in symmetric successive over-relaxation.

Since M has the off-diagonal blocks of A, the iterations run on (D + L)^-1 A (D + L^T)^-1, whose product costs a solve
with D + L^T and one with D + L and no product with A [Eisenstat1981].
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put
from tripod_sim.linear.cg_kernels import BROKEN, INDEFINITE, SOLVED, UNSOLVED

MODIFIED = 0.97
"""a: a little below one, so that rounding and turned blocks do no harm."""

NEAR = 4.0
"""Square of the residual, as guessed, over that asked for below which it is computed."""


@njit(cache=True, error_model="numpy", inline="always")
def _inverted(a: Array, out: Array) -> bool:
    """Write the inverse of a symmetric block, 9 numbers; return whether it is positive definite."""
    p, b, c, d, e, f = a[0], a[1], a[2], a[4], a[5], a[8]
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    det = p * A + b * B + c * C
    if not (p > 0.0 and p * d - b * b > 0.0 and det > 0.0):
        return False
    r = 1.0 / det
    out[0], out[4], out[8] = A * r, (p * f - c * c) * r, (p * d - b * b) * r
    out[1] = out[3] = B * r
    out[2] = out[6] = C * r
    out[5] = out[7] = (b * c - p * e) * r
    return True


@njit(cache=True, error_model="numpy")
def factor(indices: Array, indptr: Array, values: Array, rows: Array, pivot: Array, inverse: Array) -> bool:
    """Write D and D^-1, shape (n, 9); return False where a block on the diagonal is not definite.

    indices, indptr, values: blocks of the upper triangle by columns, diagonal blocks last; rows: scratch, (n, 9).
    """
    G, T = np.empty((3, 3)), np.empty((3, 3))
    rows[:] = 0.0
    for j in range(indptr.shape[0] - 1):  # sums over k > i of A_ik
        for e in range(indptr[j], indptr[j + 1] - 1):
            for c in range(9):
                rows[indices[e], c] += values[e, c]
    for j in range(indptr.shape[0] - 1):
        last = indptr[j + 1] - 1
        D = pivot[j]
        for c in range(9):
            D[c] = values[last, c]
        for e in range(indptr[j], last):
            i, A = indices[e], values[e]
            v, total = inverse[i], rows[i]
            for p in range(3):  # G = A^T D_i^-1
                for q in range(3):
                    G[p, q] = A[p] * v[q] + A[3 + p] * v[3 + q] + A[6 + p] * v[6 + q]
            for p in range(3):
                for q in range(3):
                    value = 0.0
                    for k in range(3):
                        value += G[p, k] * ((1.0 - MODIFIED) * A[3 * k + q] + MODIFIED * total[3 * k + q])
                    T[p, q] = value
            for p in range(3):
                for q in range(3):
                    D[3 * p + q] -= 0.5 * (T[p, q] + T[q, p])
        if not _inverted(D, inverse[j]):
            for c in range(9):
                D[c] = values[last, c]
            if not _inverted(D, inverse[j]):
                return False
    return True


@njit(cache=True, error_model="numpy", inline="always")
def _times(b: Array, p0: float, p1: float, p2: float) -> tuple[float, float, float]:
    """Return a block times a vector."""
    return (
        b[0] * p0 + b[1] * p1 + b[2] * p2,
        b[3] * p0 + b[4] * p1 + b[5] * p2,
        b[6] * p0 + b[7] * p1 + b[8] * p2,
    )


@njit(cache=True, error_model="numpy", inline="always")
def _transposed(b: Array, p0: float, p1: float, p2: float) -> tuple[float, float, float]:
    """Return the transpose of a block times a vector."""
    return (
        b[0] * p0 + b[3] * p1 + b[6] * p2,
        b[1] * p0 + b[4] * p1 + b[7] * p2,
        b[2] * p0 + b[5] * p1 + b[8] * p2,
    )


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _backward(indices: Array, indptr: Array, values: Array, inverse: Array, d: Array, t: Array) -> None:
    """Write t = (D + L^T)^-1 d."""
    put(t, d)
    for j in range(indptr.shape[0] - 2, -1, -1):
        t0, t1, t2 = _times(inverse[j], t[j, 0], t[j, 1], t[j, 2])
        t[j, 0], t[j, 1], t[j, 2] = t0, t1, t2
        for e in range(indptr[j], indptr[j + 1] - 1):
            i = indices[e]
            f0, f1, f2 = _times(values[e], t0, t1, t2)
            t[i, 0] -= f0
            t[i, 1] -= f1
            t[i, 2] -= f2


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _forward(indices: Array, indptr: Array, values: Array, inverse: Array, s: Array) -> None:
    """Replace s by (D + L)^-1 s."""
    for j in range(indptr.shape[0] - 1):
        a0, a1, a2 = s[j, 0], s[j, 1], s[j, 2]
        for e in range(indptr[j], indptr[j + 1] - 1):
            i = indices[e]
            f0, f1, f2 = _transposed(values[e], s[i, 0], s[i, 1], s[i, 2])
            a0, a1, a2 = a0 - f0, a1 - f1, a2 - f2
        s[j, 0], s[j, 1], s[j, 2] = _times(inverse[j], a0, a1, a2)


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _residual(indices: Array, indptr: Array, values: Array, r: Array, z: Array) -> float:
    """Return the square of the norm of (D + L) r, with z = D r."""
    square = 0.0
    for j in range(indptr.shape[0] - 1):
        a0, a1, a2 = z[j, 0], z[j, 1], z[j, 2]
        for e in range(indptr[j], indptr[j + 1] - 1):
            i = indices[e]
            f0, f1, f2 = _transposed(values[e], r[i, 0], r[i, 1], r[i, 2])
            a0, a1, a2 = a0 + f0, a1 + f1, a2 + f2
        square += a0 * a0 + a1 * a1 + a2 * a2
    return square


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def conjugate_gradients(
    indices: Array,
    indptr: Array,
    values: Array,
    pivot: Array,
    inverse: Array,
    b: Array,
    tolerance: float,
    limit: int,
    scratch: Array,
    x: Array,
) -> tuple[int, int, float]:
    """Write A^-1 b to `x`; return how it ended, the iterations, and the relative residual |b - A x| / |b|.

    b, x: shape (n, 3); scratch: (5, n, 3).
    """
    r, z, d, t, s = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4]
    count = b.shape[0]
    x[:] = 0.0
    start = 0.0
    for i in range(count):
        start += b[i, 0] * b[i, 0] + b[i, 1] * b[i, 1] + b[i, 2] * b[i, 2]
    if not start < np.inf:
        return BROKEN, 0, np.inf
    if start == 0.0:
        return SOLVED, 0, 0.0
    goal, now = tolerance * tolerance * start, start
    put(r, b)
    _forward(indices, indptr, values, inverse, r)
    rho = 0.0
    for i in range(count):
        z0, z1, z2 = _times(pivot[i], r[i, 0], r[i, 1], r[i, 2])
        z[i, 0], z[i, 1], z[i, 2] = d[i, 0], d[i, 1], d[i, 2] = z0, z1, z2
        rho += r[i, 0] * z0 + r[i, 1] * z1 + r[i, 2] * z2
    ratio = now / rho if rho > 0.0 else 0.0  # of the norm that counts to the one that comes for free
    done = 0
    while now > goal:
        if done == limit:
            return UNSOLVED, done, np.sqrt(now / start)
        _backward(indices, indptr, values, inverse, d, t)
        for i in range(count):
            d0, d1, d2, t0, t1, t2 = d[i, 0], d[i, 1], d[i, 2], t[i, 0], t[i, 1], t[i, 2]
            u0, u1, u2 = _times(pivot[i], t0, t1, t2)
            c0, c1, c2 = _times(values[indptr[i + 1] - 1], t0, t1, t2)
            s[i, 0], s[i, 1], s[i, 2] = d0 - 2.0 * u0 + c0, d1 - 2.0 * u1 + c1, d2 - 2.0 * u2 + c2
        _forward(indices, indptr, values, inverse, s)
        curvature = 0.0
        for i in range(count):
            s[i, 0] += t[i, 0]
            s[i, 1] += t[i, 1]
            s[i, 2] += t[i, 2]
            curvature += d[i, 0] * s[i, 0] + d[i, 1] * s[i, 1] + d[i, 2] * s[i, 2]
        if not 0.0 < curvature < np.inf:
            return INDEFINITE if curvature <= 0.0 else BROKEN, done, np.sqrt(now / start)
        step, following = rho / curvature, 0.0
        for i in range(count):
            for c in range(3):
                x[i, c] += step * t[i, c]
                r[i, c] -= step * s[i, c]
            z0, z1, z2 = _times(pivot[i], r[i, 0], r[i, 1], r[i, 2])
            z[i, 0], z[i, 1], z[i, 2] = z0, z1, z2
            following += r[i, 0] * z0 + r[i, 1] * z1 + r[i, 2] * z2
        done += 1
        now = ratio * following
        if now <= NEAR * goal:
            now = _residual(indices, indptr, values, r, z)
            ratio = now / following if following > 0.0 else 0.0
        share = following / rho
        rho = following
        for i in range(count):
            for c in range(3):
                d[i, c] = z[i, c] + share * d[i, c]
    if not now <= goal:
        return BROKEN, done, np.inf
    return SOLVED, done, np.sqrt(now / start)
