"""Stress, deformation and energy at the integration points of a solid, compiled."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.forces.solid_arrays import SolidArrays
from tripod_sim.forces.solid_kernels import constants, deformation, gather, mean_volume
from tripod_sim.materials import calls
from tripod_sim.materials.laws import KAPPA
from tripod_sim.materials.spectral import determinant

STRESS, GRADIENT, PIOLA, ENERGY, VALUES = 0, 6, 15, 24, 25
"""First columns of the values of a point, and their number."""

_stress, _volume_slope = calls.stress, calls.volume_slope


@njit(cache=True, error_model="numpy")
def write_points(x: Array, modes: Array, solid: SolidArrays, out: Array) -> None:
    """Write the state of each integration point to `out`, shape (m, q, 25).

    The columns are the Cauchy stress P F^T / det F [Pa] as xx, yy, zz, xy, yz, zx, then F by rows, P by rows [Pa], and
    the strain energy per undeformed volume [J/m³]. Mean dilatation counts (see `solid_kernels`), stress of dampers
    does not. An element with a point that has no energy, or is inside out, has NaN throughout.

    Args:
        x, modes, solid: See `solid_kernels`.
        out: Output.
    """
    elements, G, weight, law, p, mean = constants(solid)
    xe, F, P, slope = np.empty((3, G.shape[3])), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    kappa, shared = p[KAPPA], 0.0
    for e in range(elements.shape[0]):
        gather(e, x, modes, elements, xe)
        if mean:
            shared = mean_volume(xe, G[e], weight[e], law, F, slope)
        for q in range(G.shape[1]):
            deformation(xe, G[e, q], F)
            J, density = determinant(F), _stress(law, F, p, P)
            if not (np.isfinite(density) and J > 0.0):
                out[e] = np.nan
                break
            if mean:
                excess = _volume_slope(law, F, slope) - shared
                density -= 0.5 * kappa * excess * excess
                for i in range(3):
                    for j in range(3):
                        P[i, j] -= kappa * excess * slope[i, j]
            for k in range(3):
                for c in range(2):
                    i, j = (k, k) if c == 0 else (k, (k + 1) % 3)
                    out[e, q, STRESS + 3 * c + k] = (
                        P[i, 0] * F[j, 0] + P[i, 1] * F[j, 1] + P[i, 2] * F[j, 2]
                    ) / J
            for i in range(3):
                for j in range(3):
                    out[e, q, GRADIENT + 3 * i + j] = F[i, j]
                    out[e, q, PIOLA + 3 * i + j] = P[i, j]
            out[e, q, ENERGY] = density
