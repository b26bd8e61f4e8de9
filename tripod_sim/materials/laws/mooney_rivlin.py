"""Mooney and Rivlin's solid [Mooney1940], [Rivlin1948]: rubber at stretches up to about two.

    psi = c10 (I - 3) + c01 (II - 3) + K/2 (J - 1)^2,   J = det F,  C = F^T F

    I = J^(-2/3) I1,  II = J^(-4/3) I2,   I1 = tr C,  I2 = (I1^2 - tr C^2) / 2

    P = dpsi/dF = a (F - I1/3 F^-T) + b (I1 F - F C - 2 I2/3 F^-T) + K (J - 1) J F^-T

with a = 2 c10 J^(-2/3), b = 2 c01 J^(-4/3). Initial shear modulus mu = 2 (c10 + c01) > 0; with c01 = 0 it is
`neo_hooke`. J <= 0 has no energy: it is infinite [BonetWood2008, section 6.5].
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.materials.laws import KAPPA, OWN
from tripod_sim.materials.spectral import add_power_sum, cofactor, squared
from tripod_sim.materials.volume import RATIO, bulk_term

PARAMETERS, COUNTS = ("c10 [Pa]", "c01 [Pa]"), (2,)
VOLUME, volume_term = RATIO, bulk_term


def shear(own: tuple[float, ...]) -> float:
    """Return the initial shear modulus [Pa]."""
    return 2 * (own[0] + own[1])


@njit(cache=True, error_model="numpy")
def stress(F: Array, p: Array, P: Array) -> float:
    """Write P [Pa] and return psi [J/m³]; J must be positive, else psi is infinite."""
    C, J, I1 = np.empty((3, 3)), cofactor(F, P), squared(F)
    if not J > 0:
        return np.inf
    for i in range(3):
        for j in range(3):
            C[i, j] = F[0, i] * F[0, j] + F[1, i] * F[1, j] + F[2, i] * F[2, j]
    I2, scale = 0.5 * (I1 * I1 - squared(C)), J ** (-2 / 3)
    a, b = 2 * p[OWN] * scale, 2 * p[OWN + 1] * scale * scale
    c = p[KAPPA] * (J - 1) - (a * I1 + 2 * b * I2) / (3 * J)
    for i in range(3):
        for j in range(3):
            squeezed = F[i, 0] * C[0, j] + F[i, 1] * C[1, j] + F[i, 2] * C[2, j]
            P[i, j] = (a + b * I1) * F[i, j] - b * squeezed + c * P[i, j]
    own = p[OWN] * (scale * I1 - 3) + p[OWN + 1] * (scale * scale * I2 - 3)
    return own + 0.5 * p[KAPPA] * (J - 1) ** 2


@njit(cache=True, error_model="numpy")
def stretches(s: Array, p: Array, first: Array, second: Array) -> None:
    """Add dpsi_0/ds [Pa], shape (3,), and d²psi_0/ds² [Pa], shape (3, 3)."""
    add_power_sum(s, 2.0, p[OWN], 0.0, first, second)
    add_power_sum(s, -2.0, p[OWN + 1], 0.0, first, second)
