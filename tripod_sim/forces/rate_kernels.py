"""Rate of the solid's forces: the exact tangent times a velocity, element by element, without a matrix.

With v the velocities of the nodes and r those of the incompatible modes, at each point dF/dt = sum_a v_a (x) G_a,
dP/dt = C : dF/dt, and

    f_u' = K_uu v + K_ua r,   f_a' = K_au v + K_aa r.

The modes are in equilibrium throughout where f_a' = 0. As in `solid_kernels` what is left of it is condensed with the X
and K_aa^-1 of the last stiffness, g' = f_u' - X^T f_a', so that g' is wrong only by the product of f_a' and of what X
lags behind.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.forces.solid_arrays import SolidArrays
from tripod_sim.forces.solid_kernels import condense_forces, constants, gather
from tripod_sim.materials import calls
from tripod_sim.materials.laws import KAPPA

_tangent, _volume_slope, _tangent_at_mean = calls.tangent, calls.volume_slope, calls.tangent_at_mean


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def add_solid_rates(
    x: Array, v: Array, modes: Array, rates: Array, solid: SolidArrays, factor: float, y: Array, g: Array
) -> float:
    """Add factor g' [N/s times the factor's unit] to `g` (n, 3); write y = K_aa^-1 f_a' (m, 3k); return |f_a'|².

    Args:
        x, v: Positions [m] and velocities [m/s] of nodes, shape (n, 3).
        modes, rates: Amplitudes [m] of the modes and their rates [m/s], shape (m, k, 3).
        factor: b of stiffness damping [s].
    """
    elements, G, weight, law, p, mean = constants(solid)
    count = G.shape[3]
    xe, ve, f = np.empty((3, count)), np.empty((3, count)), np.empty((3, count))
    F, D, C = np.empty((3, 3)), np.empty((3, 3)), np.empty((9, 9))
    P, slope = np.empty((3, 3)), np.empty((3, 3))
    B, kappa, unbalanced = np.empty((3, count)), p[KAPPA], 0.0
    project = bool(0)  # `False` is a type of its own, for which the laws would be compiled once more
    for e in range(elements.shape[0]):
        gather(e, x, modes, elements, xe)
        gather(e, v, rates, elements, ve)
        f[:] = 0.0
        shared = size = swelling = 0.0
        if mean:
            B[:] = 0.0
            for q in range(G.shape[1]):
                _two_sums(xe, ve, G[e, q], F, D)
                w = weight[e, q]
                shared += w * _volume_slope(law, F, slope)
                size += w
                for i in range(3):
                    for j in range(3):
                        swelling += w * slope[i, j] * D[i, j]
                    for a in range(count):
                        B[i, a] += w * (
                            slope[i, 0] * G[e, q, 0, a]
                            + slope[i, 1] * G[e, q, 1, a]
                            + slope[i, 2] * G[e, q, 2, a]
                        )
            shared /= size
        for q in range(G.shape[1]):
            Ge, w = G[e, q], weight[e, q]
            _two_sums(xe, ve, Ge, F, D)
            if mean:
                _tangent_at_mean(law, F, shared, p, project, C)
            else:
                _tangent(law, F, p, project, C)
            for i in range(3):
                for j in range(3):
                    total = 0.0
                    for k in range(3):
                        for m in range(3):
                            total += C[3 * i + j, 3 * k + m] * D[k, m]
                    P[i, j] = w * total
            for i in range(3):
                for a in range(count):
                    f[i, a] += P[i, 0] * Ge[0, a] + P[i, 1] * Ge[1, a] + P[i, 2] * Ge[2, a]
        if mean:
            for i in range(3):
                for a in range(count):
                    f[i, a] += kappa / size * swelling * B[i, a]
        unbalanced += condense_forces(e, f, solid, factor, y, g)
    return unbalanced


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def _two_sums(xe: Array, ve: Array, Ge: Array, F: Array, D: Array) -> None:
    """Write F = sum_a xe_a (x) G_a and D = sum_a ve_a (x) G_a."""
    for i in range(3):
        for j in range(3):
            first = second = 0.0
            for a in range(xe.shape[1]):
                first += xe[i, a] * Ge[j, a]
                second += ve[i, a] * Ge[j, a]
            F[i, j], D[i, j] = first, second
