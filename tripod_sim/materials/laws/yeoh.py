"""Yeoh's solid [Yeoh1993]: rubber whose stiffness falls at first and rises where the stretch is large.

    psi = c10 (I - 3) + c20 (I - 3)^2 + c30 (I - 3)^3 + K/2 (J - 1)^2,   I = J^(-2/3) |F|^2,   J = det F

    P = dpsi/dF = a (F - |F|^2/3 F^-T) + K (J - 1) J F^-T,   a = 2 J^(-2/3) (c10 + 2 c20 (I - 3) + 3 c30 (I - 3)^2)

Initial shear modulus mu = 2 c10, so c10 > 0; carbon-filled rubber has c20 < 0 < c30. With c20 = c30 = 0 it is
`neo_hooke`. J <= 0 has no energy: it is infinite.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.materials.laws import KAPPA, OWN
from tripod_sim.materials.spectral import add_power_sum, cofactor, squared
from tripod_sim.materials.volume import RATIO, bulk_term

PARAMETERS, COUNTS = ("c10 [Pa]", "c20 [Pa]", "c30 [Pa]"), (3,)
VOLUME, volume_term = RATIO, bulk_term


def shear(own: tuple[float, ...]) -> float:
    """Return the initial shear modulus [Pa]."""
    return 2 * own[0]


@njit(cache=True, error_model="numpy")
def stress(F: Array, p: Array, P: Array) -> float:
    """Write P [Pa] and return psi [J/m³]; J must be positive, else psi is infinite."""
    J = cofactor(F, P)
    if not J > 0:
        return np.inf
    scale, I1 = J ** (-2 / 3), squared(F)
    more = scale * I1 - 3
    a = 2 * scale * (p[OWN] + more * (2 * p[OWN + 1] + more * 3 * p[OWN + 2]))
    b = p[KAPPA] * (J - 1) - a * I1 / (3 * J)
    for i in range(3):
        for j in range(3):
            P[i, j] = a * F[i, j] + b * P[i, j]
    return more * (p[OWN] + more * (p[OWN + 1] + more * p[OWN + 2])) + 0.5 * p[KAPPA] * (J - 1) ** 2


@njit(cache=True, error_model="numpy")
def stretches(s: Array, p: Array, first: Array, second: Array) -> None:
    """Add dpsi_0/ds [Pa], shape (3,), and d²psi_0/ds² [Pa], shape (3, 3)."""
    more = (s[0] ** 2 + s[1] ** 2 + s[2] ** 2) * (s[0] * s[1] * s[2]) ** (-2 / 3) - 3
    slope = p[OWN] + more * (2 * p[OWN + 1] + more * 3 * p[OWN + 2])
    add_power_sum(s, 2.0, slope, 2 * p[OWN + 1] + 6 * more * p[OWN + 2], first, second)
