"""Compressible neo-Hookean solid.

    psi = mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2,   I1 = |F|^2,  J = det F,  K = lambda + 2 mu / 3

    P = dpsi/dF = a (F - I1/3 F^-T) + K (J - 1) J F^-T,   a = mu J^(-2/3)

An element turned inside out (J <= 0) has no energy: it is infinite, so that a line search turns back
[Holzapfel2000, section 6.5].
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.materials.laws import KAPPA, SHEAR
from tripod_sim.materials.spectral import add_power_sum, cofactor, determinant, squared
from tripod_sim.materials.volume import RATIO, bulk_term

PARAMETERS = ()
VOLUME, volume_term = RATIO, bulk_term


@njit(cache=True, error_model="numpy")
def stress(F: Array, p: Array, P: Array) -> float:
    """Write P [Pa] and return psi [J/m³]; J must be positive, else psi is infinite and P untouched."""
    J = determinant(F)
    if not J > 0:
        return np.inf
    bulk, mu = p[KAPPA], p[SHEAR]
    I1 = squared(F)
    a = mu * J ** (-2 / 3)
    cofactor(F, P)
    b = (bulk * (J - 1) * J - a * I1 / 3) / J
    for i in range(3):
        for j in range(3):
            P[i, j] = a * F[i, j] + b * P[i, j]
    return 0.5 * (a * I1 - 3 * mu) + 0.5 * bulk * (J - 1) ** 2


@njit(cache=True, error_model="numpy")
def tangent(F: Array, p: Array, project: bool, C: Array) -> bool:
    """Write d²psi/dF², shape (9, 9), index 3 i + J; return False where it is to be projected. J > 0."""
    if project:
        return False
    B = np.empty((3, 3))  # F^-T
    J, I1 = cofactor(F, B), squared(F)
    bulk, mu = p[KAPPA], p[SHEAR]
    a = mu * J ** (-2 / 3)
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
    return True


@njit(cache=True, error_model="numpy")
def stretches(s: Array, p: Array, first: Array, second: Array) -> None:
    """Add dpsi_0/ds [Pa], shape (3,), and d²psi_0/ds² [Pa], shape (3, 3)."""
    add_power_sum(s, 2.0, 0.5 * p[SHEAR], 0.0, first, second)
