"""Measures of volume v: of every law psi(F) = psi_0(F) + kappa/2 (v(F) - c)^2 one of

    RATIO      v = det F
    STRETCH    v = tr(R^T F), R the nearest rotation
    STRAIN     v = tr E, E = (F^T F - 1) / 2

An element with mean dilatation (see `elements.mean_dilatation`) puts the mean of its points in the place of v.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.materials.spectral import cofactor, squared, svd3


class Measure(NamedTuple):
    """Compiled functions of a measure.

    slope(F, H) -> v: writes dv/dF, shape (3, 3).
    derivatives(s, first, second) -> v: writes dv/ds, shape (3,), and d²v/ds², shape (3, 3), s the singular values.
    """

    slope: Callable[..., Any]
    derivatives: Callable[..., Any]


@njit(cache=True, error_model="numpy")
def _ratio_slope(F: Array, H: Array) -> float:
    return cofactor(F, H)


@njit(cache=True, error_model="numpy")
def _ratio_derivatives(s: Array, first: Array, second: Array) -> float:
    for i in range(3):
        k, n = (i + 1) % 3, (i + 2) % 3
        first[i] = s[k] * s[n]
        second[i, i] = 0.0
        second[i, k] = second[k, i] = s[n]
    return s[0] * first[0]


@njit(cache=True, error_model="numpy")
def _stretch_slope(F: Array, H: Array) -> float:
    U, V, s = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    svd3(F, U, s, V)
    for i in range(3):
        for j in range(3):
            H[i, j] = U[i, 0] * V[j, 0] + U[i, 1] * V[j, 1] + U[i, 2] * V[j, 2]
    return s[0] + s[1] + s[2]


@njit(cache=True, error_model="numpy")
def _stretch_derivatives(s: Array, first: Array, second: Array) -> float:
    for i in range(3):
        first[i] = 1.0
        for k in range(3):
            second[i, k] = 0.0
    return s[0] + s[1] + s[2]


@njit(cache=True, error_model="numpy")
def _strain_slope(F: Array, H: Array) -> float:
    for i in range(3):
        for j in range(3):
            H[i, j] = F[i, j]
    return 0.5 * (squared(F) - 3)


@njit(cache=True, error_model="numpy")
def _strain_derivatives(s: Array, first: Array, second: Array) -> float:
    for i in range(3):
        first[i] = s[i]
        for k in range(3):
            second[i, k] = 1.0 if i == k else 0.0
    return 0.5 * (s[0] ** 2 + s[1] ** 2 + s[2] ** 2 - 3)


RATIO = Measure(_ratio_slope, _ratio_derivatives)
STRETCH = Measure(_stretch_slope, _stretch_derivatives)
STRAIN = Measure(_strain_slope, _strain_derivatives)


def bulk_term(lam: float, mu: float) -> tuple[float, float]:
    """Return kappa [Pa] and c where psi_0 does not change with the volume: the bulk modulus, and 1 of RATIO."""
    return lam + 2 * mu / 3, 1.0
