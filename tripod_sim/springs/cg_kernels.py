"""Conjugate gradients for one implicit stage of a spring body, preconditioned by an incomplete factorisation.

The matrix is H = diag(w) + springs' Hessian, over free nodes; w_i [N/m] multiplies the identity of node i. With blocks
of nodes, H = L + C + L^T, L strictly lower: a spring with block B between the free nodes i < j puts -B at (j, i), and B
to C at both. The preconditioner is

    M = (D + L) D^-1 (D + L^T),   D_i = C_i - sum_{j < i} L_ij D_j^-1 S_j,   S_j = (1 - a) L_ij^T + a sum_k L_kj^T,

the modified incomplete factorisation without fill [Gustafsson1978]: with a = 1 M moves a body that moves as a whole
as H does. Where a block D_i would not be positive definite it is C_i, as in symmetric successive over-relaxation.

Since M has the off-diagonal blocks of H, the iterations run on (D + L)^-1 H (D + L^T)^-1, whose product costs a solve
with D + L^T and one with D + L and no product with H [Eisenstat1981].
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put

MODIFIED = 0.97
"""a: a little below one, so that rounding and turned blocks do no harm."""

NEAR = 4.0
"""Square of the residual, as guessed, over that asked for below which it is computed."""


class Sweep(NamedTuple):
    """Order of the off-diagonal blocks, and numbers; all empty where the direct solver works. Of f free nodes and p
    springs between two of them:

    spring: the springs, by their smaller node, (p,); other: the larger node of each, as a place among the free ones,
    (p,); first: where each node's springs begin, (f + 1,); block: B, xx xy xz yy yz zz, (p, 6); middle: C, (f, 6);
    pivot: D, (f, 6); inverse: of D, (f, 6); x, r, z, d, t, s: scratch, (f, 3).
    """

    spring: Array
    other: Array
    first: Array
    block: Array
    middle: Array
    pivot: Array
    inverse: Array
    x: Array
    r: Array
    z: Array
    d: Array
    t: Array
    s: Array


def sweep(ends: Array, number: Array, count: int) -> Sweep:
    """Return the order of the springs with `ends` (m, 2); number: place of a node among `count` free ones, or -1."""
    low, high = np.sort(number[ends], axis=1).T
    inside = np.flatnonzero(low >= 0)
    spring = inside[np.lexsort((high[inside], low[inside]))]
    first = np.searchsorted(low[spring], np.arange(count + 1))
    blocks, nodes = np.zeros((len(spring), 6)), np.zeros((3, count, 6))
    return Sweep(spring, high[spring], first, blocks, *nodes, *np.zeros((6, count, 3)))


@njit(cache=True, error_model="numpy", inline="always")
def _inverted(a: Array, out: Array) -> bool:
    """Write the inverse of a symmetric block; return whether it is positive definite."""
    p, b, c, d, e, f = a[0], a[1], a[2], a[3], a[4], a[5]
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    det = p * A + b * B + c * C
    if not (p > 0.0 and p * d - b * b > 0.0 and det > 0.0):
        return False
    r = 1.0 / det
    out[0], out[1], out[2] = A * r, B * r, C * r
    out[3], out[4], out[5] = (p * f - c * c) * r, (b * c - p * e) * r, (p * d - b * b) * r
    return True


@njit(cache=True, error_model="numpy")
def prepare(ends: Array, blocks: Array, weight: Array, free: Array, number: Array, A: Sweep) -> bool:
    """Write the numbers of `A` for the springs' blocks (m, 6); return False where a block of C is not definite.

    free: nodes of the unknowns, (f,); number: place of a node in `free`, -1 if fixed; weight: w of nodes, (n,).
    """
    C, D = A.middle, A.pivot
    for k in range(free.shape[0]):
        w = weight[free[k]]
        C[k, 0] = C[k, 3] = C[k, 5] = w
        C[k, 1] = C[k, 2] = C[k, 4] = 0.0
    for m in range(ends.shape[0]):
        for side in range(2):
            k = number[ends[m, side]]
            if k >= 0:
                for c in range(6):
                    C[k, c] += blocks[m, c]
    for e in range(A.spring.shape[0]):
        for c in range(6):
            A.block[e, c] = blocks[A.spring[e], c]
    put(D, C)
    total = np.empty(6)
    G = np.empty((3, 3))
    for j in range(free.shape[0]):
        if not _inverted(D[j], A.inverse[j]):
            for c in range(6):
                D[j, c] = C[j, c]
            if not _inverted(D[j], A.inverse[j]):
                return False
        total[:] = 0.0
        for e in range(A.first[j], A.first[j + 1]):
            for c in range(6):
                total[c] += A.block[e, c]
        v = A.inverse[j]
        for e in range(A.first[j], A.first[j + 1]):
            b = A.block[e]
            for i in range(3):  # G = B D^-1
                p, q, r = (
                    (b[0], b[1], b[2]) if i == 0 else (b[1], b[3], b[4]) if i == 1 else (b[2], b[4], b[5])
                )
                G[i, 0] = p * v[0] + q * v[1] + r * v[2]
                G[i, 1] = p * v[1] + q * v[3] + r * v[4]
                G[i, 2] = p * v[2] + q * v[4] + r * v[5]
            s0, s1, s2 = (1.0 - MODIFIED) * b[0], (1.0 - MODIFIED) * b[1], (1.0 - MODIFIED) * b[2]
            s3, s4, s5 = (1.0 - MODIFIED) * b[3], (1.0 - MODIFIED) * b[4], (1.0 - MODIFIED) * b[5]
            s0, s1, s2 = s0 + MODIFIED * total[0], s1 + MODIFIED * total[1], s2 + MODIFIED * total[2]
            s3, s4, s5 = s3 + MODIFIED * total[3], s4 + MODIFIED * total[4], s5 + MODIFIED * total[5]
            d = D[A.other[e]]
            xy = G[0, 0] * s1 + G[0, 1] * s3 + G[0, 2] * s4
            yx = G[1, 0] * s0 + G[1, 1] * s1 + G[1, 2] * s2
            xz = G[0, 0] * s2 + G[0, 1] * s4 + G[0, 2] * s5
            zx = G[2, 0] * s0 + G[2, 1] * s1 + G[2, 2] * s2
            yz = G[1, 0] * s2 + G[1, 1] * s4 + G[1, 2] * s5
            zy = G[2, 0] * s1 + G[2, 1] * s3 + G[2, 2] * s4
            d[0] -= G[0, 0] * s0 + G[0, 1] * s1 + G[0, 2] * s2
            d[1] -= 0.5 * (xy + yx)
            d[2] -= 0.5 * (xz + zx)
            d[3] -= G[1, 0] * s1 + G[1, 1] * s3 + G[1, 2] * s4
            d[4] -= 0.5 * (yz + zy)
            d[5] -= G[2, 0] * s2 + G[2, 1] * s4 + G[2, 2] * s5
    return True


@njit(cache=True, error_model="numpy", inline="always")
def _times(b: Array, p0: float, p1: float, p2: float) -> tuple[float, float, float]:
    """Return a symmetric block times a vector."""
    return (
        b[0] * p0 + b[1] * p1 + b[2] * p2,
        b[1] * p0 + b[3] * p1 + b[4] * p2,
        b[2] * p0 + b[4] * p1 + b[5] * p2,
    )


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _backward(A: Sweep, d: Array, t: Array) -> None:
    """Write t = (D + L^T)^-1 d."""
    first, other, block, inverse = A.first, A.other, A.block, A.inverse
    for i in range(d.shape[0] - 1, -1, -1):
        a0, a1, a2 = d[i, 0], d[i, 1], d[i, 2]
        for e in range(first[i], first[i + 1]):
            j = other[e]
            f0, f1, f2 = _times(block[e], t[j, 0], t[j, 1], t[j, 2])
            a0, a1, a2 = a0 + f0, a1 + f1, a2 + f2
        t[i, 0], t[i, 1], t[i, 2] = _times(inverse[i], a0, a1, a2)


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _forward(A: Sweep, s: Array) -> None:
    """Replace s by (D + L)^-1 s."""
    first, other, block, inverse = A.first, A.other, A.block, A.inverse
    for i in range(s.shape[0]):
        w0, w1, w2 = _times(inverse[i], s[i, 0], s[i, 1], s[i, 2])
        s[i, 0], s[i, 1], s[i, 2] = w0, w1, w2
        for e in range(first[i], first[i + 1]):
            j = other[e]
            f0, f1, f2 = _times(block[e], w0, w1, w2)
            s[j, 0] += f0
            s[j, 1] += f1
            s[j, 2] += f2


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _residual(A: Sweep, r: Array, z: Array, out: Array) -> float:
    """Write (D + L) r, with z = D r; return the square of its norm [N²]."""
    first, other, block = A.first, A.other, A.block
    put(out, z)
    for i in range(r.shape[0]):
        for e in range(first[i], first[i + 1]):
            j = other[e]
            f0, f1, f2 = _times(block[e], r[i, 0], r[i, 1], r[i, 2])
            out[j, 0] -= f0
            out[j, 1] -= f1
            out[j, 2] -= f2
    square = 0.0
    for i in range(r.shape[0]):
        square += out[i, 0] * out[i, 0] + out[i, 1] * out[i, 1] + out[i, 2] * out[i, 2]
    return square


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _start(A: Sweep, g: Array, free: Array, p: Array) -> float:
    """Write x = p and s = -g - H p of free nodes; return the square of the norm of g [N²]."""
    x, s, C = A.x, A.s, A.middle
    square, guessed = 0.0, False
    for k in range(free.shape[0]):
        n = free[k]
        for i in range(3):
            x[k, i], s[k, i] = p[n, i], -g[n, i]
            square += g[n, i] * g[n, i]
            guessed |= p[n, i] != 0.0
    if guessed:
        for i in range(free.shape[0]):
            f0, f1, f2 = _times(C[i], x[i, 0], x[i, 1], x[i, 2])
            for e in range(A.first[i], A.first[i + 1]):
                j = A.other[e]
                h0, h1, h2 = _times(A.block[e], x[j, 0], x[j, 1], x[j, 2])
                f0, f1, f2 = f0 - h0, f1 - h1, f2 - h2
                h0, h1, h2 = _times(A.block[e], x[i, 0], x[i, 1], x[i, 2])
                s[j, 0] += h0
                s[j, 1] += h1
                s[j, 2] += h2
            s[i, 0] -= f0
            s[i, 1] -= f1
            s[i, 2] -= f2
    return square


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def conjugate_gradients(A: Sweep, g: Array, free: Array, tolerance: float, limit: int, p: Array) -> int:
    """Write p = -H^-1 g of free nodes until |g + H p| <= tolerance |g|; return the iterations, or -1 where that failed.

    It begins with the `p` given, and fails at negative curvature, at a number that is not finite, and after `limit`
    iterations. g, p: shape (n, 3).
    """
    x, r, z, d, t, s, C, D = A.x, A.r, A.z, A.d, A.t, A.s, A.middle, A.pivot
    count = free.shape[0]
    goal = tolerance * tolerance * _start(A, g, free, p)
    now = 0.0
    for i in range(count):
        now += s[i, 0] * s[i, 0] + s[i, 1] * s[i, 1] + s[i, 2] * s[i, 2]
    put(r, s)
    _forward(A, r)
    rho = 0.0
    for i in range(count):
        z0, z1, z2 = _times(D[i], r[i, 0], r[i, 1], r[i, 2])
        z[i, 0], z[i, 1], z[i, 2] = d[i, 0], d[i, 1], d[i, 2] = z0, z1, z2
        rho += r[i, 0] * z0 + r[i, 1] * z1 + r[i, 2] * z2
    ratio = now / rho if rho > 0.0 else 0.0  # of the norm that counts to the one that comes for free
    done = 0
    while now > goal:
        if done == limit:
            return -1
        _backward(A, d, t)
        for i in range(count):
            d0, d1, d2, t0, t1, t2 = d[i, 0], d[i, 1], d[i, 2], t[i, 0], t[i, 1], t[i, 2]
            u0, u1, u2 = _times(D[i], t0, t1, t2)
            c0, c1, c2 = _times(C[i], t0, t1, t2)
            s[i, 0], s[i, 1], s[i, 2] = d0 - 2.0 * u0 + c0, d1 - 2.0 * u1 + c1, d2 - 2.0 * u2 + c2
        _forward(A, s)
        curvature = 0.0
        for i in range(count):
            s[i, 0] += t[i, 0]
            s[i, 1] += t[i, 1]
            s[i, 2] += t[i, 2]
            curvature += d[i, 0] * s[i, 0] + d[i, 1] * s[i, 1] + d[i, 2] * s[i, 2]
        if not 0.0 < curvature < np.inf:
            return -1
        step, following = rho / curvature, 0.0
        for i in range(count):
            for c in range(3):
                x[i, c] += step * t[i, c]
                r[i, c] -= step * s[i, c]
            z0, z1, z2 = _times(D[i], r[i, 0], r[i, 1], r[i, 2])
            z[i, 0], z[i, 1], z[i, 2] = z0, z1, z2
            following += r[i, 0] * z0 + r[i, 1] * z1 + r[i, 2] * z2
        done += 1
        now = ratio * following
        if now <= NEAR * goal:
            now = _residual(A, r, z, s)
            ratio = now / following if following > 0.0 else 0.0
        share = following / rho
        rho = following
        for i in range(count):
            for c in range(3):
                d[i, c] = z[i, c] + share * d[i, c]
    if not now <= goal:  # not a number
        return -1
    for k in range(count):
        for c in range(3):
            p[free[k], c] = x[k, c]
    return done
