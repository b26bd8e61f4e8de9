"""Stable neo-Hookean solid [SmithEtAl2018]: finite for every F, also flat or inside out, and stiff against inversion.

    psi = m/2 (I1 - 3) - m/2 log((I1 + 1) / 4) + l/2 (J - a)^2 - l/2 (1 - a)^2,   a = 1 + 3 m / (4 l)

with m = 4 mu / 3 and l = lambda + 5 mu / 6, so that small strains see Lame's lambda and mu; I1 = |F|^2, J = det F.

    P = m (1 - 1 / (I1 + 1)) F + l (J - a) cof F
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.materials.laws import KAPPA, REST, SHEAR
from tripod_sim.materials.spectral import cofactor, squared
from tripod_sim.materials.volume import RATIO

PARAMETERS = ()
VOLUME = RATIO


def volume_term(lam: float, mu: float) -> tuple[float, float]:
    """Return kappa [Pa] and c: l and a."""
    kappa = lam + 5 * mu / 6
    return kappa, 1 + 0.75 * (4 * mu / 3) / kappa


@njit(cache=True, error_model="numpy")
def stress(F: Array, p: Array, P: Array) -> float:
    """Write P [Pa] and return psi [J/m³]."""
    m, k, a = 4 * p[SHEAR] / 3, p[KAPPA], p[REST]
    I1, J = squared(F), cofactor(F, P)
    c, d = m * (1 - 1 / (I1 + 1)), k * (J - a)
    for i in range(3):
        for j in range(3):
            P[i, j] = c * F[i, j] + d * P[i, j]
    return 0.5 * m * (I1 - 3 - np.log((I1 + 1) / 4)) + 0.5 * k * ((J - a) ** 2 - (1 - a) ** 2)


@njit(cache=True, error_model="numpy")
def tangent(F: Array, p: Array, project: bool, C: Array) -> bool:
    """Write d²psi/dF², shape (9, 9), index 3 i + J; return False where it is to be projected."""
    if project:
        return False
    m, k, a = 4 * p[SHEAR] / 3, p[KAPPA], p[REST]
    H = np.empty((3, 3))
    I1, J = squared(F), cofactor(F, H)
    c, e, d = m * (1 - 1 / (I1 + 1)), 2 * m / (I1 + 1) ** 2, k * (J - a)
    for i in range(3):
        for j in range(3):
            r = 3 * i + j
            for n in range(3):
                for q in range(3):
                    C[r, 3 * n + q] = e * F[i, j] * F[n, q] + k * H[i, j] * H[n, q]
            C[r, r] += c
            i1, i2, j1, j2 = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            C[r, 3 * i1 + j1] += d * F[i2, j2]  # d cof_ij / dF
            C[r, 3 * i2 + j2] += d * F[i1, j1]
            C[r, 3 * i1 + j2] -= d * F[i2, j1]
            C[r, 3 * i2 + j1] -= d * F[i1, j2]
    return True


@njit(cache=True, error_model="numpy")
def stretches(s: Array, p: Array, first: Array, second: Array) -> None:
    """Add dpsi_0/ds [Pa], shape (3,), and d²psi_0/ds² [Pa], shape (3, 3)."""
    I1, m = s[0] ** 2 + s[1] ** 2 + s[2] ** 2, 4 * p[SHEAR] / 3
    c, e = m * (1 - 1 / (I1 + 1)), 2 * m / (I1 + 1) ** 2
    for i in range(3):
        first[i] += c * s[i]
        second[i, i] += c
        for k in range(3):
            second[i, k] += e * s[i] * s[k]
