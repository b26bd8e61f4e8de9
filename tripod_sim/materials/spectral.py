"""Spectral tools for isotropic materials: singular values, rotations, projected tangents of 3x3 gradients.

An isotropic energy is a function psi(s1, s2, s3) of the singular values of F = U diag(s) V^T. Its second derivative
d²psi/dF² has nine eigen-directions in the frame of U and V: three that scale (a 3x3 problem), and for each pair (i, j)
a twist with eigenvalue (psi_i + psi_j) / (s_i + s_j) and a flip with eigenvalue (psi_i - psi_j) / (s_i - s_j). Clamping
the negative ones to (almost) zero gives the nearest positive definite tangent [SmithEtAl2019].
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array


@njit(cache=True, error_model="numpy", inline="always")
def determinant(F: Array) -> float:
    """Return det F."""
    return (
        F[0, 0] * (F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1])
        - F[0, 1] * (F[1, 0] * F[2, 2] - F[1, 2] * F[2, 0])
        + F[0, 2] * (F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0])
    )


@njit(cache=True, error_model="numpy", inline="always")
def cofactor(F: Array, H: Array) -> float:
    """Write the cofactor matrix H = J F^-T and return J = det F."""
    H[0, 0] = F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1]
    H[0, 1] = F[1, 2] * F[2, 0] - F[1, 0] * F[2, 2]
    H[0, 2] = F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0]
    H[1, 0] = F[2, 1] * F[0, 2] - F[2, 2] * F[0, 1]
    H[1, 1] = F[2, 2] * F[0, 0] - F[2, 0] * F[0, 2]
    H[1, 2] = F[2, 0] * F[0, 1] - F[2, 1] * F[0, 0]
    H[2, 0] = F[0, 1] * F[1, 2] - F[0, 2] * F[1, 1]
    H[2, 1] = F[0, 2] * F[1, 0] - F[0, 0] * F[1, 2]
    H[2, 2] = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    return F[0, 0] * H[0, 0] + F[0, 1] * H[0, 1] + F[0, 2] * H[0, 2]


@njit(cache=True, error_model="numpy", inline="always")
def squared(F: Array) -> float:
    """Return |F|² = tr(F^T F)."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += F[i, j] * F[i, j]
    return total


@njit(cache=True, error_model="numpy")
def keep_positive(S: Array) -> None:
    """Lift the negative eigenvalues of a symmetric matrix to zero, in place (Jacobi's rotations, to rounding)."""
    V, size = np.empty((3, 3)), 0.0
    for i in range(3):
        for j in range(3):
            V[i, j] = 1.0 if i == j else 0.0
            size = max(size, abs(S[i, j]))
    for _ in range(12):
        largest = 0.0
        for p in range(2):
            for q in range(p + 1, 3):
                c = S[p, q]
                if abs(c) <= 1e-16 * size:
                    continue
                largest = max(largest, abs(c))
                z = (S[q, q] - S[p, p]) / (2 * c)
                t = (1.0 if z >= 0 else -1.0) / (abs(z) + np.sqrt(1 + z * z))
                cs = 1 / np.sqrt(1 + t * t)
                sn = cs * t
                for i in range(3):
                    S[i, p], S[i, q] = cs * S[i, p] - sn * S[i, q], sn * S[i, p] + cs * S[i, q]
                for i in range(3):
                    S[p, i], S[q, i] = cs * S[p, i] - sn * S[q, i], sn * S[p, i] + cs * S[q, i]
                    V[i, p], V[i, q] = cs * V[i, p] - sn * V[i, q], sn * V[i, p] + cs * V[i, q]
        if largest <= 1e-15 * size:
            break
    s0, s1, s2 = max(S[0, 0], 0.0), max(S[1, 1], 0.0), max(S[2, 2], 0.0)
    for i in range(3):
        for j in range(3):
            S[i, j] = s0 * V[i, 0] * V[j, 0] + s1 * V[i, 1] * V[j, 1] + s2 * V[i, 2] * V[j, 2]


@njit(cache=True, error_model="numpy")
def svd3(F: Array, U: Array, s: Array, V: Array) -> None:
    """Write F = U diag(s) V^T with rotations U and V (both of determinant +1); s[2] carries the sign of det F.

    One-sided Jacobi: columns of B = F V are made orthogonal by plane rotations, to rounding. s falls in magnitude.
    """
    B = np.empty((3, 3))
    scale = 0.0
    for i in range(3):
        for j in range(3):
            scale = max(scale, abs(F[i, j]))
    for i in range(3):
        for j in range(3):
            V[i, j] = 1.0 if i == j else 0.0
            B[i, j] = F[i, j] / scale if scale > 0 else 0.0
    for _ in range(12):
        largest = 0.0
        for p in range(2):
            for q in range(p + 1, 3):
                a = b = c = 0.0
                for i in range(3):
                    a += B[i, p] * B[i, p]
                    b += B[i, q] * B[i, q]
                    c += B[i, p] * B[i, q]
                size = np.sqrt(a * b)
                if abs(c) <= 1e-16 * size or size == 0.0:
                    continue
                largest = max(largest, abs(c) / size)
                z = (b - a) / (2 * c)
                t = (1.0 if z >= 0 else -1.0) / (abs(z) + np.sqrt(1 + z * z))
                cs = 1 / np.sqrt(1 + t * t)
                sn = cs * t
                for i in range(3):
                    B[i, p], B[i, q] = cs * B[i, p] - sn * B[i, q], sn * B[i, p] + cs * B[i, q]
                    V[i, p], V[i, q] = cs * V[i, p] - sn * V[i, q], sn * V[i, p] + cs * V[i, q]
        if largest < 1e-15:
            break
    for i in range(3):
        s[i] = np.sqrt(B[0, i] * B[0, i] + B[1, i] * B[1, i] + B[2, i] * B[2, i])
    for p, q in ((0, 1), (0, 2), (1, 2)):  # sort; a swap with one sign change keeps det V = 1
        if s[p] < s[q]:
            s[p], s[q] = s[q], s[p]
            for i in range(3):
                B[i, p], B[i, q] = B[i, q], -B[i, p]
                V[i, p], V[i, q] = V[i, q], -V[i, p]
    _rotation_from_columns(B, s, U)
    sign = 0.0
    for i in range(3):
        sign += U[i, 2] * B[i, 2]
    if sign < 0:
        s[2] = -s[2]
    for i in range(3):
        s[i] *= scale


@njit(cache=True, error_model="numpy")
def _rotation_from_columns(B: Array, s: Array, U: Array) -> None:
    """Write the rotation whose first columns are the normalised columns of B, completed where those vanish."""
    tiny = 1e-300
    if s[0] > tiny:
        for i in range(3):
            U[i, 0] = B[i, 0] / s[0]
    else:
        U[0, 0], U[1, 0], U[2, 0] = 1.0, 0.0, 0.0
    norm = 0.0
    if s[1] > 1e-14 * s[0]:
        d = 0.0
        for i in range(3):
            d += U[i, 0] * B[i, 1]
        for i in range(3):
            U[i, 1] = B[i, 1] - d * U[i, 0]
            norm += U[i, 1] * U[i, 1]
    if norm <= tiny:  # any unit vector across the first
        k = 0
        for i in range(1, 3):
            if abs(U[i, 0]) < abs(U[k, 0]):
                k = i
        norm = 0.0
        for i in range(3):
            U[i, 1] = (1.0 if i == k else 0.0) - U[k, 0] * U[i, 0]
            norm += U[i, 1] * U[i, 1]
    norm = np.sqrt(norm)
    for i in range(3):
        U[i, 1] /= norm
    U[0, 2] = U[1, 0] * U[2, 1] - U[2, 0] * U[1, 1]
    U[1, 2] = U[2, 0] * U[0, 1] - U[0, 0] * U[2, 1]
    U[2, 2] = U[0, 0] * U[1, 1] - U[1, 0] * U[0, 1]


@njit(cache=True, error_model="numpy")
def eigen3(A: Array, w: Array, Q: Array) -> None:
    """Write the eigenvalues w and orthonormal eigenvectors (columns of Q) of the symmetric A; A is destroyed."""
    for i in range(3):
        for j in range(3):
            Q[i, j] = 1.0 if i == j else 0.0
    for _ in range(12):
        scale = abs(A[0, 0]) + abs(A[1, 1]) + abs(A[2, 2])
        if abs(A[0, 1]) + abs(A[0, 2]) + abs(A[1, 2]) <= 1e-15 * scale:
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if A[p, q] == 0.0:
                    continue
                z = (A[q, q] - A[p, p]) / (2 * A[p, q])
                t = (1.0 if z >= 0 else -1.0) / (abs(z) + np.sqrt(1 + z * z))
                cs = 1 / np.sqrt(1 + t * t)
                sn = cs * t
                for i in range(3):
                    A[i, p], A[i, q] = cs * A[i, p] - sn * A[i, q], sn * A[i, p] + cs * A[i, q]
                for i in range(3):
                    A[p, i], A[q, i] = cs * A[p, i] - sn * A[q, i], sn * A[p, i] + cs * A[q, i]
                for i in range(3):
                    Q[i, p], Q[i, q] = cs * Q[i, p] - sn * Q[i, q], sn * Q[i, p] + cs * Q[i, q]
    for i in range(3):
        w[i] = A[i, i]


@njit(cache=True, error_model="numpy")
def add_power_sum(
    s: Array, alpha: float, slope: float, curvature: float, first: Array, second: Array
) -> None:
    """Add the derivatives by s of an energy W(m), m = b_1^alpha + b_2^alpha + b_3^alpha with b_i = J^(-1/3) s_i.

    Args:
        s: Singular values, of a product J > 0.
        alpha: Of the sum; 2 makes it the first invariant without change of volume, -2 the second.
        slope, curvature: dW/dm and d²W/dm² [Pa].
        first, second: dW/ds and d²W/ds² are added, shapes (3,) and (3, 3).
    """
    scale = (s[0] * s[1] * s[2]) ** (-alpha / 3)
    if alpha == 2.0:
        part = (scale * s[0] * s[0], scale * s[1] * s[1], scale * s[2] * s[2])
    else:
        part = (scale * s[0] ** alpha, scale * s[1] ** alpha, scale * s[2] ** alpha)
    third = (part[0] + part[1] + part[2]) / 3
    slopes = (
        alpha * (part[0] - third) / s[0],
        alpha * (part[1] - third) / s[1],
        alpha * (part[2] - third) / s[2],
    )
    for i in range(3):
        first[i] += slope * slopes[i]
        second[i, i] += slope * (alpha * alpha * part[i] - alpha * (part[i] - third)) / (s[i] * s[i])
        for k in range(3):
            mixed = alpha * alpha * (third - part[i] - part[k]) / (3 * s[i] * s[k])
            second[i, k] += slope * mixed + curvature * slopes[i] * slopes[k]


@njit(cache=True, error_model="numpy")
def tangent_from_stretches(
    U: Array, s: Array, V: Array, first: Array, second: Array, clamp: bool, floor: float, C: Array
) -> None:
    """Write d²psi/dF² into C, shape (9, 9), rows and columns F_iJ with index 3 i + J.

    Args:
        U, s, V: Singular value decomposition of F by `svd3`.
        first: dpsi/ds, shape (3,).
        second: d²psi/ds², shape (3, 3); destroyed.
        clamp: Whether eigenvalues below `floor` become `floor`.
        floor: A small positive stiffness [Pa].
        C: Output.
    """
    C[:] = 0.0
    direction = np.empty(9)
    for i in range(2):
        for j in range(i + 1, 3):
            total, gap = s[i] + s[j], s[i] - s[j]
            limit = second[i, i] - second[i, j]
            twist = (first[i] + first[j]) / total if abs(total) > 1e-9 else limit
            flip = (first[i] - first[j]) / gap if abs(gap) > 1e-6 * (abs(s[i]) + 1e-9) else limit
            for sign, value in ((-1.0, twist), (1.0, flip)):
                for a in range(3):
                    for b in range(3):
                        direction[3 * a + b] = (U[a, i] * V[b, j] + sign * U[a, j] * V[b, i]) / np.sqrt(2.0)
                _add_rank_one(max(value, floor) if clamp else value, direction, C)
    w = np.empty(3)
    Q = np.empty((3, 3))
    eigen3(second, w, Q)
    for k in range(3):
        for a in range(3):
            for b in range(3):
                direction[3 * a + b] = U[a, 0] * Q[0, k] * V[b, 0] + U[a, 1] * Q[1, k] * V[b, 1]
                direction[3 * a + b] += U[a, 2] * Q[2, k] * V[b, 2]
        _add_rank_one(max(w[k], floor) if clamp else w[k], direction, C)


@njit(cache=True, error_model="numpy")
def _add_rank_one(value: float, d: Array, C: Array) -> None:
    for a in range(9):
        for b in range(9):
            C[a, b] += value * d[a] * d[b]
