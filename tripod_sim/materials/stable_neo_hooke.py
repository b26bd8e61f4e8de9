"""Stable neo-Hookean solid [SmithEtAl2018]: finite for every F, also flat or inside out, and stiff against inversion.

    psi = m/2 (I1 - 3) - m/2 log((I1 + 1) / 4) + l/2 (J - a)^2 - l/2 (1 - a)^2,   a = 1 + 3 m / (4 l)

with m = 4 mu / 3 and l = lambda + 5 mu / 6, so that small strains see Lame's lambda and mu; I1 = |F|^2, J = det F.

    P = m (1 - 1 / (I1 + 1)) F + l (J - a) cof F
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.materials.spectral import cofactor, determinant, squared


@njit(cache=True, error_model="numpy", inline="always")
def _constants(lam: float, mu: float) -> tuple[float, float, float]:
    m, k = 4 * mu / 3, lam + 5 * mu / 6
    return m, k, 1 + 0.75 * m / k


@njit(cache=True, error_model="numpy")
def energy(F: Array, lam: float, mu: float) -> float:
    """Return psi [J/m³], zero at rest."""
    m, k, a = _constants(lam, mu)
    I1, J = squared(F), determinant(F)
    return 0.5 * m * (I1 - 3 - np.log((I1 + 1) / 4)) + 0.5 * k * ((J - a) ** 2 - (1 - a) ** 2)


@njit(cache=True, error_model="numpy")
def stress(F: Array, lam: float, mu: float, P: Array) -> float:
    """Write P [Pa] and return psi [J/m³]."""
    m, k, a = _constants(lam, mu)
    I1, J = squared(F), cofactor(F, P)
    c, d = m * (1 - 1 / (I1 + 1)), k * (J - a)
    for i in range(3):
        for j in range(3):
            P[i, j] = c * F[i, j] + d * P[i, j]
    return 0.5 * m * (I1 - 3 - np.log((I1 + 1) / 4)) + 0.5 * k * ((J - a) ** 2 - (1 - a) ** 2)


@njit(cache=True, error_model="numpy")
def tangent(F: Array, lam: float, mu: float, C: Array) -> None:
    """Write d²psi/dF², shape (9, 9), index 3 i + J."""
    m, k, a = _constants(lam, mu)
    H = np.empty((3, 3))
    I1, J = squared(F), cofactor(F, H)
    c, e, d = m * (1 - 1 / (I1 + 1)), 2 * m / (I1 + 1) ** 2, k * (J - a)
    for i in range(3):
        for j in range(3):
            r = 3 * i + j
            for p in range(3):
                for q in range(3):
                    C[r, 3 * p + q] = e * F[i, j] * F[p, q] + k * H[i, j] * H[p, q]
            C[r, r] += c
            i1, i2, j1, j2 = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            C[r, 3 * i1 + j1] += d * F[i2, j2]  # d cof_ij / dF
            C[r, 3 * i2 + j2] += d * F[i1, j1]
            C[r, 3 * i1 + j2] -= d * F[i2, j1]
            C[r, 3 * i2 + j1] -= d * F[i1, j2]
