"""Element loops of the solid: energy with gradient, and condensed stiffness of all elements, compiled.

Arrays: x (n, 3) positions [m]; modes (m, k, 3) amplitudes of the incompatible modes [m]; G (m, q, 3, c) reference
gradients of the 8 shape functions and then the k modes [1/m], c = 8 + k; weight (m, q) volumes [m³]; law (5,) and p
functions of a law and its parameters (`materials.calls`). Within an element, components come first, (3, c): the inner
loops then run over contiguous numbers.

Condensation: with f_u, f_a the gradients with respect to nodes and modes and K_ua, K_aa the blocks of the tangent,

    X = K_aa^-1 K_au,   y = K_aa^-1 f_a,   g = f_u - X^T f_a,   K = K_uu - K_ua X,   d_modes = -y - X d_x.

A damper has the gradient h_u, h_a and the tangent of its own (see `damper_kernels`), which are added to these before
they are condensed: modes are where E and D together are least.

Mean dilatation (`mean`; v, kappa: see `materials.laws`): with v* = sum_q w v / sum_q w the density at a point becomes
psi - kappa/2 (v - v*)^2, its stress P + kappa (v* - v) dv/dF, and the tangent of an element gains
kappa b b^T / sum_q w, b = sum_q w dv/dx.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.forces.damper_kernels import (
    add_damper_tangent,
    add_swelling,
    damper_stress,
    damps,
    strain_rate,
    switch_off,
    volume_rate,
)
from tripod_sim.forces.solid_arrays import SolidArrays
from tripod_sim.materials import calls
from tripod_sim.materials.laws import KAPPA
from tripod_sim.materials.spectral import determinant

ELASTIC, DAMPER, BOTH = 1, 2, 3
"""What a gradient is of."""

_stress, _tangent = calls.stress, calls.tangent
_volume_slope, _tangent_at_mean = calls.volume_slope, calls.tangent_at_mean


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def deformation(xe: Array, Ge: Array, F: Array) -> None:
    """Write F = sum_a xe_a (x) G_a; the rest shape is part of the node positions."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for a in range(xe.shape[1]):
                total += xe[i, a] * Ge[j, a]
            F[i, j] = total


@njit(cache=True, error_model="numpy", inline="always")
def constants(solid: SolidArrays) -> tuple[Array, Array, Array, Array, Array, bool]:
    """Return what does not change of a solid: its elements, G, weight, law, p, mean."""
    return solid.elements, solid.G, solid.weight, solid.law, solid.p, solid.mean


@njit(cache=True, error_model="numpy", inline="always")
def gather(e: int, x: Array, modes: Array, elements: Array, xe: Array) -> None:
    """Write values of nodes `x` and modes of element e, shape (3, c)."""
    for a in range(elements.shape[1]):
        for i in range(3):
            xe[i, a] = x[elements[e, a], i]
    for k in range(modes.shape[1]):
        for i in range(3):
            xe[i, elements.shape[1] + k] = modes[e, k, i]


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def _condense_forces(e: int, f: Array, h: Array, solid: SolidArrays, of: int, g: Array, d: Array) -> float:
    """Add f_u - X^T f_a of one element to `g` and the same of h to `d`, f and h (3, c) being destroyed; write y.

    f_a is that at hand where `of` is the damper alone. Returns |f_a + h_a|².
    """
    elements, X, K_aa_inverse, y = solid.elements, solid.X, solid.inverse, solid.y
    nodes, size, square = elements.shape[1], solid.y.shape[1], 0.0
    for r in range(size):
        y[e, r] = 0.0
    for c in range(size):
        i, k = c % 3, nodes + c // 3
        if of & ELASTIC:
            solid.pull[e, c] = f[i, k]
        total = solid.pull[e, c]
        if of & DAMPER:
            solid.push[e, c] = h[i, k]
            total += h[i, k]
        square += total * total
        for r in range(size):
            y[e, r] += K_aa_inverse[e, c, r] * total
    if of & ELASTIC:
        scatter(e, f, elements, X, g)
    if of & DAMPER:
        scatter(e, h, elements, X, d)
    return square


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def scatter(e: int, f: Array, elements: Array, X: Array, g: Array) -> None:
    """Add f_u - X^T f_a of one element to `g`; f (3, c) is destroyed."""
    nodes = elements.shape[1]
    for c in range(X.shape[1]):
        fa = f[c % 3, nodes + c // 3]
        for a in range(nodes):
            for i in range(3):
                f[i, a] -= X[e, c, 3 * a + i] * fa
    for a in range(nodes):
        for i in range(3):
            g[elements[e, a], i] += f[i, a]


@njit(cache=True, error_model="numpy")
def mean_volume(xe: Array, G: Array, weight: Array, law: Array, F: Array, slope: Array) -> float:
    """Return v* of one element, G (q, 3, c) and weight (q,) its own; F and slope are scratch."""
    total = size = 0.0
    for q in range(G.shape[0]):
        deformation(xe, G[q], F)
        total += weight[q] * _volume_slope(law, F, slope)
        size += weight[q]
    return total / size


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def solid_gradient(
    x: Array, modes: Array, solid: SolidArrays, of: int, g: Array, d: Array
) -> tuple[float, float, float]:
    """Add the condensed dE/dx [N] to `g` and dD/dx to `d` (n, 3), with the X and K_aa^-1 of the last stiffness; write
    y.

    Args:
        x, modes, solid: See the module.
        of: ELASTIC, DAMPER or BOTH; what is left out is not touched, and f_a is then that at hand.
        g, d: Output.

    Returns:
        The strain energy [J], infinite if a point has none (then `g` is not to be used), D [J], |f_a + h_a|² [N²].
    """
    elements, G, weight, law, p, mean = constants(solid)
    count, rate = G.shape[3], solid.rate[0]
    xe, f, h = np.empty((3, count)), np.empty((3, count)), np.empty((3, count))
    F, P, slope, A = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    shared, kappa, swelling = 0.0, p[KAPPA], 0.0
    total = damped = unbalanced = 0.0
    elastic, damper = of & ELASTIC != 0, of & DAMPER != 0
    for e in range(elements.shape[0]):
        gather(e, x, modes, elements, xe)
        f[:] = 0.0
        h[:] = 0.0
        if mean and elastic:
            shared = mean_volume(xe, G[e], weight[e], law, F, slope)
        acts = damper and damps(solid.before[e])
        if mean and acts:
            swelling = solid.viscosity[2] * _mean_rate(e, xe, solid, F)
        for q in range(G.shape[1]):
            Ge, w = G[e, q], weight[e, q]
            deformation(xe, Ge, F)
            if elastic:
                density = _stress(law, F, p, P)
                if not np.isfinite(density):
                    return np.inf, 0.0, np.inf
                if mean:
                    excess = _volume_slope(law, F, slope) - shared
                    density -= 0.5 * kappa * excess * excess
                    for i in range(3):
                        for j in range(3):
                            P[i, j] -= kappa * excess * slope[i, j]
                total += w * density
                add_point(w, P, Ge, f)
            if damper:
                strain_rate(F, rate, solid.before[e, q], solid.strain[e, q], A)
            if acts:
                damped += 0.5 * w / rate * damper_stress(F, A, solid.viscosity, swelling, P)
                add_point(w, P, Ge, h)
        unbalanced += _condense_forces(e, f, h, solid, of, g, d)
    return total, damped, unbalanced


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def add_point(w: float, P: Array, Ge: Array, f: Array) -> None:
    """Add w P G of a point to `f`, shape (3, c)."""
    for i in range(3):
        p0, p1, p2 = w * P[i, 0], w * P[i, 1], w * P[i, 2]
        for a in range(f.shape[1]):
            f[i, a] += p0 * Ge[0, a] + p1 * Ge[1, a] + p2 * Ge[2, a]


@njit(cache=True, error_model="numpy")
def _mean_rate(e: int, xe: Array, solid: SolidArrays, F: Array) -> float:
    """Return the mean of tr A, A the rate of strain, of one element; F is scratch."""
    total = size = 0.0
    for q in range(solid.G.shape[1]):
        deformation(xe, solid.G[e, q], F)
        total += solid.weight[e, q] * volume_rate(F, solid.rate[0], solid.before[e, q])
        size += solid.weight[e, q]
    return total / size


@njit(cache=True, error_model="numpy")
def _still_damps(e: int, xe: Array, solid: SolidArrays, F: Array) -> bool:
    """Return whether an element has a damper; switch it off where it is inside out. F is scratch."""
    for q in range(solid.G.shape[1]):
        deformation(xe, solid.G[e, q], F)
        if not determinant(F) > 0.0:
            switch_off(solid.before[e])
    return damps(solid.before[e])


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def write_strains(x: Array, modes: Array, solid: SolidArrays) -> None:
    """Write Green's strain at every point to `solid.strain`."""
    elements, G = solid.elements, solid.G
    xe, F, A = np.empty((3, G.shape[3])), np.empty((3, 3)), np.empty((3, 3))
    for e in range(elements.shape[0]):
        gather(e, x, modes, elements, xe)
        for q in range(G.shape[1]):
            deformation(xe, G[e, q], F)
            strain_rate(F, 1.0, solid.before[e, q], solid.strain[e, q], A)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def solid_stiffness(x: Array, modes: Array, solid: SolidArrays, of: int, project: bool) -> int:
    """Write the condensed stiffness (m, 24, 24) [N/m], X (m, 3k, 24) and K_aa^-1 (m, 3k, 3k) of every element.

    Args:
        x, modes, solid: See the module.
        of: ELASTIC or BOTH.
        project: Lift the negative eigenvalues of the tangent of each point to (almost) zero.

    Returns:
        -1, or the first element whose K_aa is not positive definite.
    """
    elements, G, weight, law, p, mean = constants(solid)
    nodes, count = elements.shape[1], G.shape[3]
    xe, B, F, slope = np.empty((3, count)), np.empty((3, count)), np.empty((3, 3)), np.empty((3, 3))
    C, CB, K = np.empty((9, 9)), np.empty((3, 3, 3 * count)), np.empty((3, count, 3 * count))
    S, swell = np.empty((3, 3)), np.empty((3, count))
    shared, kappa, swelling = 0.0, p[KAPPA], 0.0
    coupling = np.empty((3 * (count - nodes), 3 * nodes))
    for e in range(elements.shape[0]):
        gather(e, x, modes, elements, xe)
        K[:] = 0.0
        B[:] = 0.0
        if mean:
            shared = mean_volume(xe, G[e], weight[e], law, F, slope)
        acts = of & DAMPER != 0 and _still_damps(e, xe, solid, F)
        if mean and acts:
            swell[:] = 0.0
            swelling = solid.viscosity[2] * _mean_rate(e, xe, solid, F)
        for q in range(G.shape[1]):
            Ge, w = G[e, q], weight[e, q]
            deformation(xe, Ge, F)
            if mean:
                _tangent_at_mean(law, F, shared, p, project, C)
                _volume_slope(law, F, slope)
                for i in range(3):
                    for a in range(count):
                        B[i, a] += w * (
                            slope[i, 0] * Ge[0, a] + slope[i, 1] * Ge[1, a] + slope[i, 2] * Ge[2, a]
                        )
            else:
                _tangent(law, F, p, project, C)
            if acts:
                add_damper_tangent(
                    F, solid.rate[0], solid.before[e, q], solid.viscosity, swelling, project, S, C
                )
                if mean:
                    add_swelling(w, F, Ge, swell)
            for i in range(3):
                for j in range(3):
                    for k in range(i + 1):
                        c0, c1, c2 = (
                            w * C[3 * i + j, 3 * k],
                            w * C[3 * i + j, 3 * k + 1],
                            w * C[3 * i + j, 3 * k + 2],
                        )
                        for b in range(count):
                            CB[i, j, k * count + b] = c0 * Ge[0, b] + c1 * Ge[1, b] + c2 * Ge[2, b]
                for a in range(count):  # K is symmetric: blocks of components on and below the diagonal
                    g0, g1, g2 = Ge[0, a], Ge[1, a], Ge[2, a]
                    for c in range((i + 1) * count):
                        K[i, a, c] += g0 * CB[i, 0, c] + g1 * CB[i, 1, c] + g2 * CB[i, 2, c]
        if mean:
            _add_volume_stiffness(B, kappa / weight[e].sum(), K)
            if acts:
                _add_volume_stiffness(swell, solid.rate[0] * solid.viscosity[2] / weight[e].sum(), K)
        if not _condense(K, nodes, count, solid.X[e], solid.inverse[e], solid.matrices[e], coupling):
            return e
    return -1


@njit(cache=True, error_model="numpy")
def _add_volume_stiffness(b: Array, factor: float, K: Array) -> None:
    """Add factor b b^T, b (3, c), to the lower component blocks of K, shape (3, c, 3c)."""
    count = b.shape[1]
    for i in range(3):
        for a in range(count):
            for k in range(i + 1):
                for c in range(count):
                    K[i, a, k * count + c] += factor * b[i, a] * b[k, c]


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _condense(
    K: Array, nodes: int, count: int, X: Array, inverse: Array, out: Array, coupling: Array
) -> bool:
    """Write K_aa^-1, X and K_uu - K_ua X, numbered node by node; return False if K_aa is not positive.

    Args:
        K: Lower component blocks, shape (3, c, 3c).
        nodes, count: 8 and c.
        X, inverse, out: Outputs, shapes (3k, 24), (3k, 3k), (24, 24).
        coupling: Scratch for K_au, shape (3k, 24).
    """
    size = 3 * (count - nodes)
    for i in range(3):
        for k in range(i + 1):
            for a in range(nodes):
                for b in range(nodes):
                    out[3 * a + i, 3 * b + k] = out[3 * b + k, 3 * a + i] = K[i, a, k * count + b]
            for a in range(count - nodes):
                r = 3 * a + i
                for b in range(nodes):
                    coupling[r, 3 * b + k] = K[i, nodes + a, k * count + b]
                    coupling[3 * a + k, 3 * b + i] = K[i, b, k * count + nodes + a]
                for b in range(count - nodes):
                    inverse[r, 3 * b + k] = inverse[3 * b + k, r] = K[i, nodes + a, k * count + nodes + b]
    if not invert(inverse):
        return False
    X[:] = 0.0
    for r in range(size):
        for k in range(size):
            factor = inverse[r, k]
            for c in range(3 * nodes):
                X[r, c] += factor * coupling[k, c]
    for r in range(3 * nodes):
        for k in range(size):
            factor = coupling[k, r]
            for c in range(3 * nodes):
                out[r, c] -= factor * X[k, c]
    return True


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def invert(matrix: Array) -> bool:
    """Invert a symmetric matrix in place (Gauss-Jordan); return False if it is not positive definite."""
    size, scale = matrix.shape[0], 0.0
    for p in range(size):
        scale = max(scale, abs(matrix[p, p]))
    for p in range(size):
        pivot = matrix[p, p]
        if not pivot > 1e-13 * scale:
            return False
        matrix[p, p] = 1.0
        reciprocal = 1.0 / pivot
        for c in range(size):
            matrix[p, c] *= reciprocal
        for r in range(size):
            if r != p:
                factor = matrix[r, p]
                matrix[r, p] = 0.0
                for c in range(size):
                    matrix[r, c] -= factor * matrix[p, c]
    return True


@njit(cache=True, error_model="numpy")
def update_modes(
    modes: Array, elements: Array, X: Array, y: Array, dx: Array, scale: float, out: Array
) -> None:
    """Write modes + scale (-y - X dx) to `out` (m, k, 3); dx (n, 3) is the move of the nodes [m]."""
    for e in range(elements.shape[0]):
        for r in range(X.shape[1]):
            total = y[e, r]
            for a in range(elements.shape[1]):
                for i in range(3):
                    total += X[e, r, 3 * a + i] * dx[elements[e, a], i]
            out[e, r // 3, r % 3] = modes[e, r // 3, r % 3] - scale * total


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def add_element_products(
    matrices: Array, elements: Array, which: Array, dx: Array, factor: float, g: Array
) -> float:
    """Add factor * (sum of the element matrices `which`) dx to `g` (n, 3); return factor/2 dx^T (sum) dx."""
    total, size = 0.0, 3 * elements.shape[1]
    local = np.empty(size)
    for e in which:
        for b in range(elements.shape[1]):
            for j in range(3):
                local[3 * b + j] = dx[elements[e, b], j]
        for r in range(size):
            value = 0.0
            for c in range(size):
                value += matrices[e, r, c] * local[c]
            g[elements[e, r // 3], r % 3] += factor * value
            total += value * local[r]
    return 0.5 * factor * total


@njit(cache=True, error_model="numpy")
def smallest_volume_ratio(x: Array, modes: Array, solid: SolidArrays) -> tuple[int, float]:
    """Return the element with the smallest det F at a point, and that determinant."""
    elements, G = solid.elements, solid.G
    xe, F = np.empty((3, G.shape[3])), np.empty((3, 3))
    worst, smallest = 0, np.inf
    for e in range(elements.shape[0]):
        gather(e, x, modes, elements, xe)
        for q in range(G.shape[1]):
            deformation(xe, G[e, q], F)
            J = determinant(F)
            if not smallest <= J:
                worst, smallest = e, J
    return worst, smallest
