"""Compressible neo-Hookean solid.

    psi = mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2,   I1 = |F|^2,  J = det F,  K = lambda + 2 mu / 3

    P = dpsi/dF = a (F - I1/3 F^-T) + K (J - 1) J F^-T,   a = mu J^(-2/3)

An element turned inside out (J <= 0) has no energy: it is infinite, so that a line search turns back
[Holzapfel2000, section 6.5].
"""

from typing import Any

import numpy as np
from numba import njit

from tripod_sim.materials.spectral import svd3, tangent_from_stretches

Array = Any


@njit(cache=True, error_model="numpy", inline="always")
def determinant(F: Array) -> float:
    """Return det F."""
    return (
        F[0, 0] * (F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1])
        - F[0, 1] * (F[1, 0] * F[2, 2] - F[1, 2] * F[2, 0])
        + F[0, 2] * (F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0])
    )


@njit(cache=True, error_model="numpy", inline="always")
def cofactor(F: Array, H: Array) -> None:
    """Write the cofactor matrix H = J F^-T."""
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            c, d = (j + 1) % 3, (j + 2) % 3
            H[i, j] = F[a, c] * F[b, d] - F[a, d] * F[b, c]


@njit(cache=True, error_model="numpy", inline="always")
def squared(F: Array) -> float:
    """Return |F|² = tr(F^T F)."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += F[i, j] * F[i, j]
    return total


@njit(cache=True, error_model="numpy")
def energy(F: Array, lam: float, mu: float) -> float:
    """Return psi [J/m³], infinite where J <= 0."""
    J = determinant(F)
    if not J > 0:
        return np.inf
    bulk = lam + 2 * mu / 3
    return 0.5 * mu * (squared(F) * J ** (-2 / 3) - 3) + 0.5 * bulk * (J - 1) ** 2


@njit(cache=True, error_model="numpy")
def stress(F: Array, lam: float, mu: float, P: Array) -> float:
    """Write P [Pa] and return psi [J/m³]; J must be positive, else psi is infinite and P untouched."""
    J = determinant(F)
    if not J > 0:
        return np.inf
    bulk = lam + 2 * mu / 3
    I1 = squared(F)
    a = mu * J ** (-2 / 3)
    cofactor(F, P)
    b = (bulk * (J - 1) * J - a * I1 / 3) / J
    for i in range(3):
        for j in range(3):
            P[i, j] = a * F[i, j] + b * P[i, j]
    return 0.5 * (a * I1 - 3 * mu) + 0.5 * bulk * (J - 1) ** 2


@njit(cache=True, error_model="numpy")
def tangent(F: Array, lam: float, mu: float, project: bool, C: Array) -> None:
    """Write d²psi/dF², shape (9, 9), index 3 i + J; `project` lifts its negative eigenvalues to 1e-6 mu. J > 0."""
    if project:
        U, V, s = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
        svd3(F, U, s, V)
        first, second = np.empty(3), np.empty((3, 3))
        _stretch_derivatives(s, lam, mu, first, second)
        tangent_from_stretches(U, s, V, first, second, project, 1e-6 * mu, C)
        return
    J = determinant(F)
    bulk = lam + 2 * mu / 3
    I1 = squared(F)
    a = mu * J ** (-2 / 3)
    B = np.empty((3, 3))  # F^-T
    cofactor(F, B)
    for i in range(3):
        for j in range(3):
            B[i, j] /= J
    c2 = -2 * a / 3
    c3 = 2 * a * I1 / 9 + bulk * (2 * J - 1) * J
    c4 = a * I1 / 3 - bulk * (J - 1) * J
    for i in range(3):
        for j in range(3):
            r = 3 * i + j
            for k in range(3):
                for m in range(3):
                    C[r, 3 * k + m] = (
                        c2 * (F[i, j] * B[k, m] + B[i, j] * F[k, m])
                        + c3 * B[i, j] * B[k, m]
                        + c4 * B[i, m] * B[k, j]
                    )
            C[r, r] += a


@njit(cache=True, error_model="numpy")
def _stretch_derivatives(s: Array, lam: float, mu: float, first: Array, second: Array) -> None:
    """Write dpsi/ds and d²psi/ds² of psi(s) = mu/2 (J^(-2/3) |s|² - 3) + K/2 (J - 1)², J = s1 s2 s3 > 0."""
    bulk = lam + 2 * mu / 3
    J = s[0] * s[1] * s[2]
    I1 = s[0] ** 2 + s[1] ** 2 + s[2] ** 2
    a = mu * J ** (-2 / 3)
    p = bulk * (J - 1) * J - a * I1 / 3
    for i in range(3):
        first[i] = a * s[i] + p / s[i]
        for j in range(3):
            second[i, j] = -2 * a / 3 * (s[i] / s[j] + s[j] / s[i]) + (
                2 * a * I1 / 9 + bulk * (2 * J - 1) * J
            ) / (s[i] * s[j])
        second[i, i] += a - p / s[i] ** 2
