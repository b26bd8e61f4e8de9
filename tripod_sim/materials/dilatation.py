"""The measure of volume v of each law, and its stress and tangent at a volume that an element's points share.

Every law is psi(F) = psi_0(F) + kappa/2 (v(F) - c)^2, with constants left out:

    neo_hooke            v = det F        kappa = lambda + 2 mu / 3    c = 1
    stable_neo_hooke     v = det F        kappa = lambda + 5 mu / 6    c = 1 + mu / kappa
    corotational         v = tr(R^T F)    kappa = lambda               c = 3
    st_venant_kirchhoff  v = tr E         kappa = lambda               c = 0

An element with mean dilatation (see `elements.mean_dilatation`) puts its mean v* in the place of v in the second term.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.materials.spectral import cofactor, determinant, squared, svd3, tangent_from_stretches


@njit(cache=True, error_model="numpy")
def modulus(law: int, lam: float, mu: float) -> float:
    """Return kappa [Pa]."""
    if law == 0:
        return lam + 2 * mu / 3
    return lam + 5 * mu / 6 if law == 2 else lam


@njit(cache=True, error_model="numpy")
def _rest(law: int, kappa: float, mu: float) -> float:
    """Return c."""
    if law == 0:
        return 1.0
    if law == 1:
        return 3.0
    return 1 + mu / kappa if law == 2 else 0.0


@njit(cache=True, error_model="numpy")
def volume(law: int, F: Array) -> float:
    """Return v."""
    if law == 1:
        U, V, s = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
        svd3(F, U, s, V)
        return s[0] + s[1] + s[2]
    return 0.5 * (squared(F) - 3) if law == 3 else determinant(F)


@njit(cache=True, error_model="numpy")
def volume_slope(law: int, F: Array, H: Array) -> float:
    """Write dv/dF, shape (3, 3), and return v."""
    if law == 1:
        U, V, s = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
        svd3(F, U, s, V)
        for i in range(3):
            for j in range(3):
                H[i, j] = U[i, 0] * V[j, 0] + U[i, 1] * V[j, 1] + U[i, 2] * V[j, 2]
        return s[0] + s[1] + s[2]
    if law == 3:
        for i in range(3):
            for j in range(3):
                H[i, j] = F[i, j]
        return 0.5 * (squared(F) - 3)
    return cofactor(F, H)


@njit(cache=True, error_model="numpy")
def tangent_at_mean(law: int, F: Array, mean: float, lam: float, mu: float, project: bool, C: Array) -> None:
    """Write d²psi_0/dF² + kappa (v* - c) d²v/dF² at v* = `mean`, shape (9, 9), index 3 i + J.

    `project` lifts its negative eigenvalues to 1e-6 mu.
    """
    _tangent(law, F, mean, False, lam, mu, project, C)


@njit(cache=True, error_model="numpy")
def spectral_tangent(law: int, F: Array, lam: float, mu: float, project: bool, C: Array) -> None:
    """Write d²psi/dF², shape (9, 9), index 3 i + J; `project` lifts its negative eigenvalues to 1e-6 mu."""
    _tangent(law, F, 0.0, True, lam, mu, project, C)


@njit(cache=True, error_model="numpy", inline="always")
def _tangent(
    law: int, F: Array, mean: float, own: bool, lam: float, mu: float, project: bool, C: Array
) -> None:
    """Write the tangent at the volume `mean`, or, with `own`, at that of F, which then changes with F."""
    U, V, s = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    first, second = np.empty(3), np.empty((3, 3))
    svd3(F, U, s, V)
    kappa, v = modulus(law, lam, mu), _volume_of_stretches(law, s, first)
    for i in range(3):
        for j in range(3):
            second[i, j] = kappa * first[i] * first[j] if own else 0.0
    _add_derivatives(law, s, kappa * ((v if own else mean) - _rest(law, kappa, mu)), mu, first, second)
    tangent_from_stretches(U, s, V, first, second, project, 1e-6 * mu, C)


@njit(cache=True, error_model="numpy")
def _volume_of_stretches(law: int, s: Array, slope: Array) -> float:
    """Write dv/ds and return v."""
    if law == 1:
        slope[:] = 1.0
        return s[0] + s[1] + s[2]
    if law == 3:
        slope[:] = s
        return 0.5 * (s[0] ** 2 + s[1] ** 2 + s[2] ** 2 - 3)
    slope[0], slope[1], slope[2] = s[1] * s[2], s[2] * s[0], s[0] * s[1]
    return s[0] * slope[0]


@njit(cache=True, error_model="numpy")
def _add_derivatives(law: int, s: Array, p: float, mu: float, first: Array, second: Array) -> None:
    """Make dv/ds the first derivatives of psi_0(s) + p v(s), and add the second ones."""
    I1 = s[0] ** 2 + s[1] ** 2 + s[2] ** 2
    a = mu * (s[0] * s[1] * s[2]) ** (-2 / 3) if law == 0 else 4 * mu / 3
    b, c = a * (1 - 1 / (I1 + 1)), 2 * a / (I1 + 1) ** 2
    for i in range(3):
        k, n = (i + 1) % 3, (i + 2) % 3
        first[i] *= p
        mixed = 0.0
        if law == 0:
            first[i] += a * (s[i] - I1 / (3 * s[i]))
            second[i, i] += a * (1 + 5 * I1 / (9 * s[i] ** 2) - 4 / 3)
            mixed = a * (2 * I1 / (9 * s[i] * s[k]) - 2 / 3 * (s[i] / s[k] + s[k] / s[i])) + p * s[n]
        elif law == 1:
            first[i] += 2 * mu * (s[i] - 1)
            second[i, i] += 2 * mu
        elif law == 2:
            first[i] += b * s[i]
            second[i, i] += b + c * s[i] ** 2
            mixed = c * s[i] * s[k] + p * s[n]
        else:
            first[i] += mu * (s[i] ** 2 - 1) * s[i]
            second[i, i] += mu * (3 * s[i] ** 2 - 1) + p
        second[i, k] += mixed
        second[k, i] += mixed
