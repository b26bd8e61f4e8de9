"""Compiled direct solver for one implicit stage of a spring body: multifrontal L D L^T.

The matrix is H = diag(w) + springs' Hessian, over free nodes; w_i [N/m] multiplies the identity of node i.
"""

from typing import NamedTuple

from numba import njit

from tripod_host.arrays import Array
from tripod_sim.linear import ldl_kernels
from tripod_sim.linear.ldl_symbolic import Symbolic


class Slots(NamedTuple):
    """Where the numbers of a Hessian go.

    data: upper triangle, CSC; diagonal: where column c of a free node's block begins in it, (f, 3); off: the same for
    each spring, -1 where an end is fixed, (m, 3).
    """

    data: Array
    diagonal: Array
    off: Array


class Factor(NamedTuple):
    """The direct solver: places, plan and numbers, and vectors of its unknowns, shape (3 f,)."""

    slots: Slots
    plan: Symbolic
    numbers: ldl_kernels.Numbers
    b: Array
    out: Array


@njit(cache=True, error_model="numpy")
def assemble(ends: Array, blocks: Array, weight: Array, free: Array, number: Array, A: Slots) -> None:
    """Write H into `A.data`. free: nodes of the unknowns, (f,); number: place of a node in `free`, -1 if fixed."""
    data, diagonal, off = A.data, A.diagonal, A.off
    data[:] = 0.0
    for k in range(free.shape[0]):
        w, s = weight[free[k]], diagonal[k]
        data[s[0]] = data[s[1] + 1] = data[s[2] + 2] = w
    for m in range(ends.shape[0]):
        b = blocks[m]
        for side in range(2):
            k = number[ends[m, side]]
            if k >= 0:
                s = diagonal[k]
                data[s[0]] += b[0]
                data[s[1]] += b[1]
                data[s[1] + 1] += b[3]
                data[s[2]] += b[2]
                data[s[2] + 1] += b[4]
                data[s[2] + 2] += b[5]
        s = off[m]
        if s[0] >= 0:
            data[s[0]] -= b[0]
            data[s[0] + 1] -= b[1]
            data[s[0] + 2] -= b[2]
            data[s[1]] -= b[1]
            data[s[1] + 1] -= b[3]
            data[s[1] + 2] -= b[4]
            data[s[2]] -= b[2]
            data[s[2] + 1] -= b[4]
            data[s[2] + 2] -= b[5]


@njit(cache=True, error_model="numpy")
def factorise(A: Factor) -> int:
    """Factor the matrix; return the number of negative pivots, below zero where one vanishes or is not finite."""
    return ldl_kernels.factor(A.plan, A.numbers)


@njit(cache=True, error_model="numpy")
def solve_direct(A: Factor, g: Array, free: Array, p: Array) -> None:
    """Write p = -H^-1 g of free nodes, (n, 3), with the last factorisation."""
    for k in range(free.shape[0]):
        for i in range(3):
            A.b[3 * k + i] = g[free[k], i]
    ldl_kernels.solve(A.b, A.plan, A.numbers, A.out)
    for k in range(free.shape[0]):
        for i in range(3):
            p[free[k], i] = -A.out[3 * k + i]
