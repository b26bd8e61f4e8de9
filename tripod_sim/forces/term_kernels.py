"""Compiled loops of `term.LinearTerm`, how nodes of a block couple, and how forces between two nodes are added."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array


@njit(cache=True, error_model="numpy", inline="always")
def add_pair(out: Array, i: int, j: int, f0: float, f1: float, f2: float) -> None:
    """Add a vector to row i and take it from row j."""
    out[i, 0] += f0
    out[i, 1] += f1
    out[i, 2] += f2
    out[j, 0] -= f0
    out[j, 1] -= f1
    out[j, 2] -= f2


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def couple(c: Array, d: Array, f: Array) -> float:
    """Write f_a = sum_b c_ab d_b of one block, c of shape (n, n), d and f (3, n), and return sum_a d_a . f_a."""
    total = 0.0
    for a in range(c.shape[0]):
        f0 = f1 = f2 = 0.0
        for b in range(c.shape[0]):
            f0 += c[a, b] * d[0, b]
            f1 += c[a, b] * d[1, b]
            f2 += c[a, b] * d[2, b]
        f[0, a], f[1, a], f[2, a] = f0, f1, f2
        total += f0 * d[0, a] + f1 * d[1, a] + f2 * d[2, a]
    return total


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def add_couplings(couplings: Array, elements: Array, x: Array, g: Array) -> float:
    """Add dV/dx of V = 1/2 sum_ab c_ab d_a . d_b, d the places of nodes from their others, to `g`; return V.

    Args:
        couplings: c [N/m], shape (m, n, n).
        elements: Nodes and then their others, shape (m, 2 n).
        x: Positions [m], shape (nodes, 3).
        g: [N], shape (nodes, 3).
    """
    size, total = couplings.shape[1], 0.0
    d, f = np.empty((3, size)), np.empty((3, size))
    for e in range(elements.shape[0]):
        for a in range(size):
            node, other = elements[e, a], elements[e, size + a]
            for i in range(3):
                d[i, a] = x[node, i] - x[other, i]
        total += couple(couplings[e], d, f)
        for a in range(size):
            add_pair(g, elements[e, a], elements[e, size + a], f[0, a], f[1, a], f[2, a])
    return 0.5 * total
