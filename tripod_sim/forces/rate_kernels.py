"""The force of a solid's damper at given velocities, element by element, without a matrix.

With v the velocities of the nodes, dF/dt = sum_a v_a (x) G_a and A = sym(F^T dF/dt) (see `damper_kernels`) at each
point. Incompatible modes have the rates r at which the power A : S is least: their own force h_a + K_aa r is then zero.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.forces.damper_kernels import damper_stress
from tripod_sim.forces.solid_arrays import SolidArrays
from tripod_sim.forces.solid_kernels import add_point, gather, invert


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def add_solid_rates(x: Array, v: Array, modes: Array, solid: SolidArrays, factor: float, g: Array) -> None:
    """Add `factor` C v to `g` (n, 3), C v the gradient that the damper has at the velocities v.

    Args:
        x, v: Positions [m] and velocities [m/s] of nodes, shape (n, 3).
        modes: Amplitudes of the modes [m], shape (m, k, 3).
        solid: See there.
        factor: See there.
        g: Output.
    """
    elements, count = solid.elements, solid.G.shape[3]
    nodes = elements.shape[1]
    size = 3 * (count - nodes)
    xe, ve, h = np.empty((3, count)), np.empty((3, count)), np.empty((3, count))
    K = np.empty((size, size))
    for e in range(elements.shape[0]):
        gather(e, x, modes, elements, xe)
        ve[:] = 0.0
        for a in range(nodes):
            for i in range(3):
                ve[i, a] = v[elements[e, a], i]
        _add_element(e, xe, ve, solid, h)
        if size > 0:
            _write_mode_matrix(e, xe, solid, nodes, K)
            if invert(K):
                for r in range(size):
                    rate = 0.0
                    for c in range(size):
                        rate -= K[r, c] * h[c % 3, nodes + c // 3]
                    ve[r % 3, nodes + r // 3] = rate
                _add_element(e, xe, ve, solid, h)
        for a in range(nodes):
            for i in range(3):
                g[elements[e, a], i] += factor * h[i, a]


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _add_element(e: int, xe: Array, ve: Array, solid: SolidArrays, h: Array) -> None:
    """Write the damper's force on nodes and modes of one element that have the velocities `ve`, both (3, c)."""
    G, F, D = solid.G, np.empty((3, 3)), np.empty((3, 3))
    A, P = np.empty((3, 3)), np.empty((3, 3))
    h[:] = 0.0
    swelling = 0.0
    if solid.mean:
        volume = 0.0
        for q in range(G.shape[1]):
            _two_sums(xe, ve, G[e, q], F, D)
            for i in range(3):
                for j in range(3):
                    swelling += solid.weight[e, q] * F[i, j] * D[i, j]
            volume += solid.weight[e, q]
        swelling *= solid.viscosity[2] / volume
    for q in range(G.shape[1]):
        _two_sums(xe, ve, G[e, q], F, D)
        for i in range(3):
            for j in range(i + 1):
                total = 0.0
                for k in range(3):
                    total += F[k, i] * D[k, j] + D[k, i] * F[k, j]
                A[i, j] = A[j, i] = 0.5 * total
        damper_stress(F, A, solid.viscosity, swelling, P)
        add_point(solid.weight[e, q], P, G[e, q], h)


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _write_mode_matrix(e: int, xe: Array, solid: SolidArrays, nodes: int, K: Array) -> None:
    """Write K_aa of the damper of one element, of no mean dilatation: forces of modes for their rates, (3k, 3k)."""
    G, lam, mu = solid.G, solid.viscosity[0], solid.viscosity[1]
    count = G.shape[3] - nodes
    F, left, b = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, count))
    K[:] = 0.0
    for q in range(G.shape[1]):
        w = solid.weight[e, q]
        _two_sums(xe, xe, G[e, q], F, left)
        for i in range(3):
            for j in range(3):
                left[i, j] = F[i, 0] * F[j, 0] + F[i, 1] * F[j, 1] + F[i, 2] * F[j, 2]
            for k in range(count):
                b[i, k] = (
                    F[i, 0] * G[e, q, 0, nodes + k]
                    + F[i, 1] * G[e, q, 1, nodes + k]
                    + F[i, 2] * G[e, q, 2, nodes + k]
                )
        for k in range(count):
            for m in range(count):
                product = 0.0
                for j in range(3):
                    product += G[e, q, j, nodes + k] * G[e, q, j, nodes + m]
                for i in range(3):
                    for j in range(3):
                        K[3 * k + i, 3 * m + j] += w * (
                            lam * b[i, k] * b[j, m] + mu * (left[i, j] * product + b[i, m] * b[j, k])
                        )


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
