"""Compiled loops of `cable.Cable`."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array


@njit(cache=True, error_model="numpy")
def add_places(nodes: Array, weights: Array, x: Array, out: Array) -> None:
    """Add sum_a N_a x_a of each point to `out` [m], shape (k, 3); nodes, weights: (k, m), x: (n, 3) [m]."""
    for p in range(nodes.shape[0]):
        for a in range(nodes.shape[1]):
            w, n = weights[p, a], nodes[p, a]
            for i in range(3):
                out[p, i] += w * x[n, i]


@njit(cache=True, error_model="numpy")
def directions(places: Array, rounding: float, out: Array, inverse: Array) -> float:
    """Return the length L of the line through `places` [m], shape (k, 3).

    A segment d counts as long as l = (|d|² + e²)^1/2, e the `rounding` [m].

    Args:
        places: Shape (k, 3).
        rounding: e.
        out: Of each segment d / l, shape (k - 1, 3).
        inverse: 1 / l [1/m], shape (k - 1,).
    """
    total = 0.0
    for s in range(out.shape[0]):
        square = rounding * rounding
        for i in range(3):
            out[s, i] = places[s + 1, i] - places[s, i]
            square += out[s, i] * out[s, i]
        length = np.sqrt(square)
        inverse[s] = 1.0 / length
        for i in range(3):
            out[s, i] *= inverse[s]
        total += length
    return total


@njit(cache=True, error_model="numpy")
def add_length_gradient(nodes: Array, weights: Array, direction: Array, factor: float, g: Array) -> None:
    """Add `factor` dL/dx to `g`, shape (n, 3), dL/dp of each point the difference of `directions` beside it."""
    last = nodes.shape[0] - 1
    for p in range(nodes.shape[0]):
        for i in range(3):
            pull = 0.0
            if p > 0:
                pull += direction[p - 1, i]
            if p < last:
                pull -= direction[p, i]
            for a in range(nodes.shape[1]):
                g[nodes[p, a], i] += factor * weights[p, a] * pull


@njit(cache=True, error_model="numpy")
def write_hessian(
    local: Array,
    weights: Array,
    direction: Array,
    inverse: Array,
    slope: Array,
    tension: float,
    stiffness: float,
    out: Array,
) -> None:
    """Write T d²L/dx² + s dL/dx dL/dx^T.

    Args:
        local: Places of the nodes of each point in the block, shape (k, m).
        weights: N_a of them, shape (k, m).
        direction, inverse: Of each segment, as `directions` writes them.
        slope: dL/dx in the block, shape (n, 3).
        tension: T [N].
        stiffness: s [N/m].
        out: [N/m], shape (3 n, 3 n).
    """
    n, m = slope.shape[0], local.shape[1]
    for a in range(n):
        for i in range(3):
            own = stiffness * slope[a, i]
            for b in range(n):
                for j in range(3):
                    out[3 * a + i, 3 * b + j] = own * slope[b, j]
    if tension == 0.0:
        return
    for s in range(direction.shape[0]):
        for q in range(2 * m):
            at, w = local[s + q // m, q % m], weights[s + q // m, q % m]
            w *= tension * inverse[s] if q >= m else -tension * inverse[s]
            if w == 0.0:
                continue
            for r in range(2 * m):
                to, v = local[s + r // m, r % m], weights[s + r // m, r % m]
                v *= w if r >= m else -w
                for i in range(3):
                    for j in range(3):
                        across = -direction[s, i] * direction[s, j]
                        if i == j:
                            across += 1.0
                        out[3 * at + i, 3 * to + j] += v * across
