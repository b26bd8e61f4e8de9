"""Corotational solid: linear elasticity in the frame of the polar rotation.

    psi = mu |F - R|^2 + lambda/2 (tr(R^T F) - 3)^2,   F = R S

    P = 2 mu (F - R) + lambda tr(S - I) R

R is the nearest rotation (determinant +1), so an element turned inside out is pulled back
[MullerGross2004], [McAdamsEtAl2011].
"""

from typing import Any

import numpy as np
from numba import njit

from tripod_sim.materials.spectral import svd3, tangent_from_stretches

Array = Any


@njit(cache=True, error_model="numpy")
def energy(F: Array, lam: float, mu: float) -> float:
    """Return psi [J/m³]."""
    U, V, s = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    svd3(F, U, s, V)
    return _energy(s, lam, mu)


@njit(cache=True, error_model="numpy", inline="always")
def _energy(s: Array, lam: float, mu: float) -> float:
    a, b, c = s[0] - 1, s[1] - 1, s[2] - 1
    return mu * (a * a + b * b + c * c) + 0.5 * lam * (a + b + c) ** 2


@njit(cache=True, error_model="numpy")
def stress(F: Array, lam: float, mu: float, P: Array) -> float:
    """Write P [Pa] and return psi [J/m³]."""
    U, V, s = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    svd3(F, U, s, V)
    spread = lam * (s[0] + s[1] + s[2] - 3) - 2 * mu
    for i in range(3):
        for j in range(3):
            rotation = U[i, 0] * V[j, 0] + U[i, 1] * V[j, 1] + U[i, 2] * V[j, 2]
            P[i, j] = 2 * mu * F[i, j] + spread * rotation
    return _energy(s, lam, mu)


@njit(cache=True, error_model="numpy")
def tangent(F: Array, lam: float, mu: float, project: bool, C: Array) -> None:
    """Write d²psi/dF², shape (9, 9), index 3 i + J; `project` lifts its negative eigenvalues to 1e-6 mu."""
    U, V, s = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    svd3(F, U, s, V)
    first, second = np.empty(3), np.empty((3, 3))
    trace = lam * (s[0] + s[1] + s[2] - 3)
    for i in range(3):
        first[i] = 2 * mu * (s[i] - 1) + trace
        for j in range(3):
            second[i, j] = lam
        second[i, i] += 2 * mu
    tangent_from_stretches(U, s, V, first, second, project, 1e-6 * mu, C)
