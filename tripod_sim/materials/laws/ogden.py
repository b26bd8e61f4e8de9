"""Ogden's solid [Ogden1997, section 7.2]: powers of the stretches, which follow measured rubber up to its limits.

    psi = sum_k mu_k / alpha_k (b_1^alpha_k + b_2^alpha_k + b_3^alpha_k - 3) + K/2 (J - 1)^2,   b_i = J^(-1/3) s_i

s_i the singular values of F = U diag(s) V^T, J = s_1 s_2 s_3; one to three pairs mu_k [Pa], alpha_k.

    P = dpsi/dF = U diag(g) V^T,   g_i = sum_k mu_k (b_i^alpha_k - m_k/3) / s_i + K (J - 1) J / s_i

with m_k the sum of the three powers. Initial shear modulus mu = sum_k mu_k alpha_k / 2 > 0; alpha = 2 alone is
`neo_hooke`, 2 and -2 `mooney_rivlin`. J <= 0 has no energy: it is infinite.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.materials.laws import KAPPA, OWN
from tripod_sim.materials.spectral import add_power_sum, determinant, svd3
from tripod_sim.materials.volume import RATIO, bulk_term

PARAMETERS = ("mu1 [Pa]", "alpha1", "mu2 [Pa]", "alpha2", "mu3 [Pa]", "alpha3")
COUNTS = (2, 4, 6)
VOLUME, volume_term = RATIO, bulk_term


def shear(own: tuple[float, ...]) -> float:
    """Return the initial shear modulus [Pa]. Raises ValueError where an exponent is 0."""
    if 0 in own[1::2]:
        raise ValueError("an alpha is 0; its term would have no energy: leave the pair out")
    return sum(mu * alpha for mu, alpha in zip(own[::2], own[1::2], strict=True)) / 2


@njit(cache=True, error_model="numpy")
def stress(F: Array, p: Array, P: Array) -> float:
    """Write P [Pa] and return psi [J/m³]; J must be positive, else psi is infinite and P untouched."""
    J = determinant(F)
    if not J > 0:
        return np.inf
    U, V, s, g, power = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    svd3(F, U, s, V)
    psi = 0.5 * p[KAPPA] * (J - 1) ** 2
    for i in range(3):
        g[i] = p[KAPPA] * (J - 1) * J
    for k in range(OWN, len(p), 2):
        mu, alpha = p[k], p[k + 1]
        for i in range(3):
            power[i] = (s[i] * J ** (-1 / 3)) ** alpha
        total = power[0] + power[1] + power[2]
        psi += mu / alpha * (total - 3)
        for i in range(3):
            g[i] += mu * (power[i] - total / 3)
    for i in range(3):
        for j in range(3):
            P[i, j] = (
                U[i, 0] * g[0] / s[0] * V[j, 0]
                + U[i, 1] * g[1] / s[1] * V[j, 1]
                + U[i, 2] * g[2] / s[2] * V[j, 2]
            )
    return psi


@njit(cache=True, error_model="numpy")
def stretches(s: Array, p: Array, first: Array, second: Array) -> None:
    """Add dpsi_0/ds [Pa], shape (3,), and d²psi_0/ds² [Pa], shape (3, 3)."""
    for k in range(OWN, len(p), 2):
        add_power_sum(s, p[k + 1], p[k] / p[k + 1], 0.0, first, second)
