"""Element loops of the solid: energy, gradient and condensed stiffness of all elements, compiled.

Arrays: x (n, 3) positions [m]; modes (m, k, 3) amplitudes of the incompatible modes [m]; G (m, q, c, 3) reference
gradients of the 8 shape functions and then the k modes [1/m], c = 8 + k; weight (m, q) volumes [m³].

Condensation: with f_u, f_a the gradients with respect to nodes and modes and K_ua, K_aa the blocks of the tangent,

    X = K_aa^-1 K_au,   y = K_aa^-1 f_a,   g = f_u - X^T f_a,   K = K_uu - K_ua X,   d_modes = -y - X d_x.
"""

from typing import Any

import numpy as np
from numba import njit

from tripod_sim.materials import corotational, neo_hooke

Array = Any

NEO_HOOKE = 0
COROTATIONAL = 1

_neo_energy, _neo_stress, _neo_tangent = neo_hooke.energy, neo_hooke.stress, neo_hooke.tangent
_cor_energy, _cor_stress, _cor_tangent = corotational.energy, corotational.stress, corotational.tangent


@njit(cache=True, error_model="numpy", inline="always")
def _deformation(e: int, q: int, xe: Array, G: Array, F: Array) -> None:
    """Write F = sum_a xe_a (x) G_a (+ I for displacement modes, contained in the node part)."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for a in range(xe.shape[0]):
                total += xe[a, i] * G[e, q, a, j]
            F[i, j] = total


@njit(cache=True, error_model="numpy", inline="always")
def _gather(e: int, x: Array, modes: Array, elements: Array, xe: Array) -> None:
    for a in range(elements.shape[1]):
        for i in range(3):
            xe[a, i] = x[elements[e, a], i]
    for k in range(modes.shape[1]):
        for i in range(3):
            xe[elements.shape[1] + k, i] = modes[e, k, i]


@njit(cache=True, error_model="numpy")
def solid_energy(
    x: Array,
    modes: Array,
    elements: Array,
    G: Array,
    weight: Array,
    law: int,
    lam: float,
    mu: float,
    work: Array,
) -> float:
    """Return the strain energy [J]; infinite as soon as a point has none."""
    xe, F = work[: G.shape[2]], work[G.shape[2] : G.shape[2] + 3]
    total = 0.0
    for e in range(elements.shape[0]):
        _gather(e, x, modes, elements, xe)
        for q in range(G.shape[1]):
            _deformation(e, q, xe, G, F)
            density = _neo_energy(F, lam, mu) if law == NEO_HOOKE else _cor_energy(F, lam, mu)
            total += weight[e, q] * density
        if not np.isfinite(total):
            return np.inf
    return total


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def solid_gradient(
    x: Array,
    modes: Array,
    elements: Array,
    G: Array,
    weight: Array,
    law: int,
    lam: float,
    mu: float,
    X: Array,
    K_aa_inverse: Array,
    y: Array,
    g: Array,
    work: Array,
) -> tuple[float, float]:
    """Add the condensed gradient dE/dx [N] to `g` (n, 3) with the X and K_aa^-1 of the last stiffness; write y.

    Returns:
        The strain energy [J], infinite if a point has none (then `g` is not to be used), and |f_a|² [N²].
    """
    nodes, count = elements.shape[1], G.shape[2]
    xe, F, P, f = (
        work[:count],
        work[count : count + 3],
        work[count + 3 : count + 6],
        work[count + 6 : 2 * count + 6],
    )
    total = unbalanced = 0.0
    for e in range(elements.shape[0]):
        _gather(e, x, modes, elements, xe)
        f[:] = 0.0
        for q in range(G.shape[1]):
            _deformation(e, q, xe, G, F)
            density = _neo_stress(F, lam, mu, P) if law == NEO_HOOKE else _cor_stress(F, lam, mu, P)
            if not np.isfinite(density):
                return np.inf, np.inf
            total += weight[e, q] * density
            for a in range(count):
                for i in range(3):
                    f[a, i] += weight[e, q] * (
                        P[i, 0] * G[e, q, a, 0] + P[i, 1] * G[e, q, a, 1] + P[i, 2] * G[e, q, a, 2]
                    )
        size = 3 * (count - nodes)
        for r in range(size):
            y[e, r] = 0.0
        for c in range(size):
            fa = f[nodes + c // 3, c % 3]
            unbalanced += fa * fa
            for r in range(size):
                y[e, r] += K_aa_inverse[e, c, r] * fa
            for a in range(nodes):
                for i in range(3):
                    f[a, i] -= X[e, c, 3 * a + i] * fa
        for a in range(nodes):
            for i in range(3):
                g[elements[e, a], i] += f[a, i]
    return total, unbalanced


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def solid_stiffness(
    x: Array,
    modes: Array,
    elements: Array,
    G: Array,
    weight: Array,
    law: int,
    lam: float,
    mu: float,
    project: bool,
    X: Array,
    K_aa_inverse: Array,
    stiffness: Array,
    C: Array,
    CB: Array,
    K: Array,
    work: Array,
) -> int:
    """Write the condensed stiffness (m, 24, 24) [N/m], X (m, 3k, 24) and K_aa^-1 (m, 3k, 3k) of every element.

    Args:
        project: Clamp the negative eigenvalues of the tangent of each point to zero.
        C, CB, K, work: Scratch of shapes (9, 9), (3, 3, 3c), (3c, 3c), (2c + 6, 3).

    Returns:
        -1, or the first element whose K_aa is not positive definite.
    """
    nodes, count = elements.shape[1], G.shape[2]
    n_u, n_c = 3 * nodes, 3 * count
    xe, F = work[:count], work[count : count + 3]
    for e in range(elements.shape[0]):
        _gather(e, x, modes, elements, xe)
        K[:] = 0.0
        for q in range(G.shape[1]):
            _deformation(e, q, xe, G, F)
            if law == NEO_HOOKE:
                _neo_tangent(F, lam, mu, project, C)
            else:
                _cor_tangent(F, lam, mu, project, C)
            w = weight[e, q]
            for i in range(3):
                for j in range(3):
                    r = 3 * i + j
                    for b in range(count):
                        g0, g1, g2 = w * G[e, q, b, 0], w * G[e, q, b, 1], w * G[e, q, b, 2]
                        CB[i, j, 3 * b] = C[r, 0] * g0 + C[r, 1] * g1 + C[r, 2] * g2
                        CB[i, j, 3 * b + 1] = C[r, 3] * g0 + C[r, 4] * g1 + C[r, 5] * g2
                        CB[i, j, 3 * b + 2] = C[r, 6] * g0 + C[r, 7] * g1 + C[r, 8] * g2
            for a in range(count):
                g0, g1, g2 = G[e, q, a, 0], G[e, q, a, 1], G[e, q, a, 2]
                for i in range(3):
                    row = K[3 * a + i]
                    for c in range(n_c):
                        row[c] += g0 * CB[i, 0, c] + g1 * CB[i, 1, c] + g2 * CB[i, 2, c]
        if count > nodes and not _condense(K, n_u, n_c, X[e], K_aa_inverse[e]):
            return e
        for r in range(n_u):
            for c in range(n_u):
                stiffness[e, r, c] = K[r, c]
    return -1


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _condense(K: Array, n_u: int, n_c: int, X: Array, inverse: Array) -> bool:
    """Invert K_aa in place (Gauss-Jordan on a positive definite block), write X, reduce K_uu; False if indefinite."""
    size = n_c - n_u
    for r in range(size):
        for c in range(size):
            inverse[r, c] = K[n_u + r, n_u + c]
    for p in range(size):
        pivot = inverse[p, p]
        if not pivot > 1e-12 * abs(K[n_u + p, n_u + p]):
            return False
        inverse[p, p] = 1.0
        for c in range(size):
            inverse[p, c] /= pivot
        for r in range(size):
            if r != p:
                factor = inverse[r, p]
                inverse[r, p] = 0.0
                for c in range(size):
                    inverse[r, c] -= factor * inverse[p, c]
    for r in range(size):
        row = X[r]
        row[:] = 0.0
        for k in range(size):
            factor = inverse[r, k]
            for c in range(n_u):
                row[c] += factor * K[n_u + k, c]
    for k in range(size):
        for r in range(n_u):
            factor = K[n_u + k, r]
            for c in range(n_u):
                K[r, c] -= factor * X[k, c]
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


@njit(cache=True, error_model="numpy")
def add_element_products(matrices: Array, elements: Array, dx: Array, factor: float, g: Array) -> float:
    """Add factor * (sum of element matrices) dx to `g` (n, 3); return factor/2 dx^T (sum) dx."""
    total = 0.0
    for e in range(elements.shape[0]):
        for a in range(elements.shape[1]):
            for i in range(3):
                value = 0.0
                for b in range(elements.shape[1]):
                    for j in range(3):
                        value += matrices[e, 3 * a + i, 3 * b + j] * dx[elements[e, b], j]
                g[elements[e, a], i] += factor * value
                total += value * dx[elements[e, a], i]
    return 0.5 * factor * total


@njit(cache=True, error_model="numpy")
def smallest_volume_ratio(
    x: Array, modes: Array, elements: Array, G: Array, work: Array
) -> tuple[int, float]:
    """Return the element with the smallest det F at a point, and that determinant."""
    xe, F = work[: G.shape[2]], work[G.shape[2] : G.shape[2] + 3]
    worst, smallest = 0, np.inf
    for e in range(elements.shape[0]):
        _gather(e, x, modes, elements, xe)
        for q in range(G.shape[1]):
            _deformation(e, q, xe, G, F)
            J = neo_hooke.determinant(F)
            if not smallest <= J:
                worst, smallest = e, J
    return worst, smallest
