"""Corotational solid: linear elasticity in the frame of the polar rotation.

    psi = mu |F - R|^2 + lambda/2 (tr(R^T F) - 3)^2,   F = R S

    P = 2 mu (F - R) + lambda tr(S - I) R

R is the nearest rotation (determinant +1), so an element turned inside out is pulled back
[MullerGross2004], [McAdamsEtAl2011]. With T_k = R [e_k]x and G = tr(S) 1 - S,

    dR/dF = sum_kl T_k (G^-1)_kl T_l,   d²psi/dF² = 2 mu 1 + lambda R R - (2 mu - lambda tr(S - 1)) dR/dF,

of which only the three twists of dR/dF can be negative. Where F is neither inverted nor crushed R comes from Newton's
iteration [Higham1986], which takes a third of the time of a singular value decomposition.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.materials.laws import KAPPA, SHEAR
from tripod_sim.materials.spectral import cofactor, eigen3, svd3
from tripod_sim.materials.volume import STRETCH

PARAMETERS = ()
VOLUME = STRETCH


def volume_term(lam: float, mu: float) -> tuple[float, float]:
    """Return kappa [Pa] and c."""
    return lam, 3.0


@njit(cache=True, error_model="numpy")
def polar_rotation(F: Array, R: Array) -> bool:
    """Write the rotation R of F = R S by X <- (X + X^-T) / 2 from X = F; return False where F is too near singular.

    The iteration converges quadratically, to rounding; R is not to be used after False.
    """
    a, b, c = F[0, 0], F[0, 1], F[0, 2]  # X, in nine numbers: an array of them takes twice as long
    d, e, f = F[1, 0], F[1, 1], F[1, 2]
    g, h, i = F[2, 0], F[2, 1], F[2, 2]
    size = a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + i * i
    A, B, C = e * i - f * h, f * g - d * i, d * h - e * g  # first row of the cofactors of X
    det = a * A + b * B + c * C
    if not det > 1e-2 * size * np.sqrt(size):  # a third of the limit is 0.19, for F = 1
        return False
    for _ in range(12):
        half = 0.5 / det
        A, B, C = half * A - 0.5 * a, half * B - 0.5 * b, half * C - 0.5 * c  # change of the first row
        D = half * (c * h - b * i) - 0.5 * d
        E = half * (a * i - c * g) - 0.5 * e
        G = half * (b * g - a * h) - 0.5 * f
        P = half * (b * f - c * e) - 0.5 * g
        Q = half * (c * d - a * f) - 0.5 * h
        S = half * (a * e - b * d) - 0.5 * i
        a, b, c, d, e, f, g, h, i = a + A, b + B, c + C, d + D, e + E, f + G, g + P, h + Q, i + S
        change = A * A + B * B + C * C + D * D + E * E + G * G + P * P + Q * Q + S * S
        if change < 1e-16:  # its root is 1e-8, the square of which is rounding
            R[0, 0], R[0, 1], R[0, 2] = a, b, c
            R[1, 0], R[1, 1], R[1, 2] = d, e, f
            R[2, 0], R[2, 1], R[2, 2] = g, h, i
            return True
        A, B, C = e * i - f * h, f * g - d * i, d * h - e * g
        det = a * A + b * B + c * C
    return False


@njit(cache=True, error_model="numpy")
def _rotation(F: Array, R: Array) -> None:
    """Write the nearest rotation of any F."""
    if polar_rotation(F, R):
        return
    U, V, s = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    svd3(F, U, s, V)
    for i in range(3):
        for j in range(3):
            R[i, j] = U[i, 0] * V[j, 0] + U[i, 1] * V[j, 1] + U[i, 2] * V[j, 2]


@njit(cache=True, error_model="numpy")
def stress(F: Array, p: Array, P: Array) -> float:
    """Write P [Pa] and return psi [J/m³]."""
    _rotation(F, P)
    lam, mu, trace = p[KAPPA], p[SHEAR], -3.0
    for i in range(3):
        for j in range(3):
            trace += P[i, j] * F[i, j]
    distance = 0.0
    for i in range(3):
        for j in range(3):
            d = F[i, j] - P[i, j]
            distance += d * d
            P[i, j] = 2 * mu * d + lam * trace * P[i, j]
    return mu * distance + 0.5 * lam * trace * trace


@njit(cache=True, error_model="numpy")
def tangent(F: Array, p: Array, project: bool, C: Array) -> bool:
    """Write d²psi/dF², shape (9, 9), index 3 i + J; return False where F is too near singular for its quick rotation.

    `project` lifts its negative eigenvalues to 1e-6 mu.
    """
    R = np.empty((3, 3))
    if polar_rotation(F, R):
        _add_twists(F, R, p[KAPPA], p[SHEAR], project, C)
        return True
    return False


@njit(cache=True, error_model="numpy")
def _add_twists(F: Array, R: Array, lam: float, mu: float, project: bool, C: Array) -> None:
    """Write the tangent with the rotation R of F."""
    G, H, T = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 9))
    for i in range(3):  # G = tr(S) 1 - S; S is symmetric to rounding
        for j in range(i + 1):
            s = 0.0
            for k in range(3):
                s += 0.5 * (R[k, i] * F[k, j] + R[k, j] * F[k, i])
            G[i, j] = G[j, i] = -s
    trace = -(G[0, 0] + G[1, 1] + G[2, 2])
    for i in range(3):
        G[i, i] += trace
    weight = 2 * mu - lam * (trace - 3)
    if project and _has_negative_twist(G, 2 * weight / (2 * mu - 1e-6 * mu)):
        _clamp_twists(G, weight, mu, H)
    else:
        scale = weight / cofactor(G, H)
        for i in range(3):
            for j in range(3):
                H[i, j] *= scale
    for i in range(3):
        for j in range(3):
            k, m = (j + 1) % 3, (j + 2) % 3  # [e_j]x has -1 at (k, m) and 1 at (m, k)
            T[j, 3 * i + j] = 0.0
            T[j, 3 * i + k] = R[i, m]
            T[j, 3 * i + m] = -R[i, k]
    for r in range(9):
        y0 = H[0, 0] * T[0, r] + H[0, 1] * T[1, r] + H[0, 2] * T[2, r]
        y1 = H[1, 0] * T[0, r] + H[1, 1] * T[1, r] + H[1, 2] * T[2, r]
        y2 = H[2, 0] * T[0, r] + H[2, 1] * T[1, r] + H[2, 2] * T[2, r]
        own = lam * R[r // 3, r % 3]
        for c in range(9):
            C[r, c] = own * R[c // 3, c % 3] - (y0 * T[0, c] + y1 * T[1, c] + y2 * T[2, c])
        C[r, r] += 2 * mu


@njit(cache=True, error_model="numpy", inline="always")
def _has_negative_twist(G: Array, limit: float) -> bool:
    """Return whether an eigenvalue of G (all positive) is below `limit`: a leading minor of G - limit 1 then is."""
    if limit <= 0:
        return False
    a, b, c = G[0, 0] - limit, G[1, 1] - limit, G[2, 2] - limit
    minor = a * b - G[0, 1] * G[0, 1]
    determinant = (
        c * minor - G[0, 2] * (b * G[0, 2] - G[0, 1] * G[1, 2]) + G[1, 2] * (G[0, 1] * G[0, 2] - a * G[1, 2])
    )
    return not (a > 0 and minor > 0 and determinant > 0)


@njit(cache=True, error_model="numpy")
def _clamp_twists(G: Array, weight: float, mu: float, H: Array) -> None:
    """Write weight G^-1, lowered so that no twist 2 mu - 2 weight / g is below 1e-6 mu; G is destroyed."""
    g, Q, h = np.empty(3), np.empty((3, 3)), np.empty(3)
    eigen3(G, g, Q)
    for k in range(3):
        h[k] = min(weight / g[k], mu - 0.5e-6 * mu)
    for i in range(3):
        for j in range(3):
            H[i, j] = Q[i, 0] * h[0] * Q[j, 0] + Q[i, 1] * h[1] * Q[j, 1] + Q[i, 2] * h[2] * Q[j, 2]


@njit(cache=True, error_model="numpy")
def stretches(s: Array, p: Array, first: Array, second: Array) -> None:
    """Add dpsi_0/ds [Pa], shape (3,), and d²psi_0/ds² [Pa], shape (3, 3)."""
    for i in range(3):
        first[i] += 2 * p[SHEAR] * (s[i] - 1)
        second[i, i] += 2 * p[SHEAR]
