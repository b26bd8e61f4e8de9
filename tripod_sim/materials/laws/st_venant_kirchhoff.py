"""St. Venant-Kirchhoff solid: Hooke's law for the Green strain. For comparison only: it softens under compression.

    psi = mu |E|^2 + lambda/2 (tr E)^2,   E = (F^T F - I) / 2

    P = F (2 mu E + lambda tr(E) I)

Under strong compression its stress falls back to zero; robots that press or bend hard should not use it
[Holzapfel2000, section 6.5].
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.materials.laws import KAPPA, SHEAR
from tripod_sim.materials.volume import STRAIN

PARAMETERS = ()
VOLUME = STRAIN


def volume_term(lam: float, mu: float) -> tuple[float, float]:
    """Return kappa [Pa] and c."""
    return lam, 0.0


@njit(cache=True, error_model="numpy", inline="always")
def _green(F: Array, E: Array) -> float:
    """Write the Green strain and return its trace."""
    for i in range(3):
        for j in range(3):
            E[i, j] = 0.5 * (
                F[0, i] * F[0, j] + F[1, i] * F[1, j] + F[2, i] * F[2, j] - (1.0 if i == j else 0.0)
            )
    return E[0, 0] + E[1, 1] + E[2, 2]


@njit(cache=True, error_model="numpy")
def stress(F: Array, p: Array, P: Array) -> float:
    """Write P [Pa] and return psi [J/m³]."""
    E = np.empty((3, 3))
    trace, lam, mu = _green(F, E), p[KAPPA], p[SHEAR]
    for i in range(3):
        for j in range(3):
            total = lam * trace * F[i, j]
            for k in range(3):
                total += 2 * mu * F[i, k] * E[k, j]
            P[i, j] = total
    return mu * (E * E).sum() + 0.5 * lam * trace * trace


@njit(cache=True, error_model="numpy")
def tangent(F: Array, p: Array, project: bool, C: Array) -> bool:
    """Write d²psi/dF², shape (9, 9), index 3 i + J; return False where it is to be projected."""
    if project:
        return False
    E, B = np.empty((3, 3)), np.empty((3, 3))  # B = F F^T
    trace, lam, mu = _green(F, E), p[KAPPA], p[SHEAR]
    for i in range(3):
        for k in range(3):
            B[i, k] = F[i, 0] * F[k, 0] + F[i, 1] * F[k, 1] + F[i, 2] * F[k, 2]
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    value = lam * F[i, j] * F[k, m] + mu * F[i, m] * F[k, j]
                    if j == m:
                        value += mu * B[i, k]
                    if i == k:
                        value += 2 * mu * E[j, m] + (lam * trace if j == m else 0.0)
                    C[3 * i + j, 3 * k + m] = value
    return True


@njit(cache=True, error_model="numpy")
def stretches(s: Array, p: Array, first: Array, second: Array) -> None:
    """Add dpsi_0/ds [Pa], shape (3,), and d²psi_0/ds² [Pa], shape (3, 3)."""
    for i in range(3):
        first[i] += p[SHEAR] * (s[i] ** 2 - 1) * s[i]
        second[i, i] += p[SHEAR] * (3 * s[i] ** 2 - 1)
