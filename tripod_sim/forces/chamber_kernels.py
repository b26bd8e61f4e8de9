"""Compiled loops over the determinants of an enclosed volume, V(x) = sum of w det(x_a, x_b, x_c).

The sum does not depend on the origin, since the surface is closed. All loops put it at the first node, which keeps the
rounding small wherever the body is.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def add_volume_gradient(triples: Array, weights: Array, x: Array, factor: float, g: Array) -> float:
    """Add factor dV/dx to `g`; return V [m³].

    Args:
        triples: Nodes a, b, c, shape (m, 3).
        weights: w, shape (m,).
        x: Positions [m], shape (n, 3).
        factor: A pressure [Pa], or 1.
        g: Shape (n, 3).
    """
    first, total = triples[0, 0], 0.0
    o0, o1, o2 = x[first, 0], x[first, 1], x[first, 2]
    for m in range(triples.shape[0]):
        a, b, c, w = triples[m, 0], triples[m, 1], triples[m, 2], weights[m]
        a0, a1, a2 = x[a, 0] - o0, x[a, 1] - o1, x[a, 2] - o2
        b0, b1, b2 = x[b, 0] - o0, x[b, 1] - o1, x[b, 2] - o2
        c0, c1, c2 = x[c, 0] - o0, x[c, 1] - o1, x[c, 2] - o2
        n0, n1, n2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
        total += w * (a0 * n0 + a1 * n1 + a2 * n2)
        f = factor * w
        g[a, 0] += f * n0
        g[a, 1] += f * n1
        g[a, 2] += f * n2
        g[b, 0] += f * (c1 * a2 - c2 * a1)
        g[b, 1] += f * (c2 * a0 - c0 * a2)
        g[b, 2] += f * (c0 * a1 - c1 * a0)
        g[c, 0] += f * (a1 * b2 - a2 * b1)
        g[c, 1] += f * (a2 * b0 - a0 * b2)
        g[c, 2] += f * (a0 * b1 - a1 * b0)
    return total


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def write_volume_blocks(
    triples: Array, weights: Array, pairs: Array, x: Array, factor: float, matrices: Array
) -> None:
    """Write factor d²V/dx² as blocks of pairs of nodes, in the order in which a triple has them.

    d²V/dx_a dx_b = [v]×, the matrix of v × ..., with v = -w x_c of each triple a, b, c summed over those with the pair.

    Args:
        triples: Nodes a, b, c, shape (m, 3).
        weights: w, shape (m,).
        pairs: The blocks of (a, b), (b, c), (a, c), shape (m, 3).
        x: Positions [m], shape (n, 3).
        factor: A pressure [Pa], or 1.
        matrices: Shape (k, 6, 6).
    """
    first = triples[0, 0]
    vectors = np.zeros((matrices.shape[0], 3))
    for m in range(triples.shape[0]):
        a, b, c, f = triples[m, 0], triples[m, 1], triples[m, 2], factor * weights[m]
        ab, bc, ac = pairs[m, 0], pairs[m, 1], pairs[m, 2]
        for i in range(3):
            vectors[ab, i] -= f * (x[c, i] - x[first, i])
            vectors[bc, i] -= f * (x[a, i] - x[first, i])
            vectors[ac, i] += f * (x[b, i] - x[first, i])
    for k in range(matrices.shape[0]):
        for i in range(3):
            j, r = (i + 1) % 3, (i + 2) % 3
            v = vectors[k, r]
            matrices[k, i, 3 + j] = matrices[k, 3 + j, i] = -v
            matrices[k, j, 3 + i] = matrices[k, 3 + i, j] = v
