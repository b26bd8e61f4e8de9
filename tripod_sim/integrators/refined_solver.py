"""Linear solves with the Hessian at the end of a stage by a factorisation that lags behind."""

from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray

MOST_REFINEMENTS, REFINED = 4, 0.02
"""Of one solution, and the share of its load at which they end."""


class RefinedSolver:
    """Solves with H = W + K, W the weights of nodes and K all other terms, at the last evaluation of a system.

    With y = W^-1 b the solution is y - H^-1 K y: what the factorisation at hand leaves over is a share of the small
    part alone that K has in it, and iterative refinement takes it away. Needs weights of all free nodes.
    """

    def __init__(self, system: Any) -> None:
        """`system`: a `System`, whose state and factorisation are those at the end of a stage."""
        self._system = system
        n = len(system.rest)
        self._nodes, self._products = np.zeros((2, n, 3))
        self._unused = np.zeros(len(system.torques))
        self._base = np.repeat(system.reduction.free, 3)

    def solve(self, b: FloatArray) -> FloatArray:
        """Return H^-1 b [m], shape (unknowns,). Raises LinearError."""
        system = self._system
        weight = system.weight[self._base]
        y = b / weight
        load = -self._stiffness_times(y)
        move: FloatArray = system.linear.solve(load)
        before, enough = np.inf, REFINED**2 * float(load @ load)
        for _ in range(MOST_REFINEMENTS):
            residual = load - weight * move - self._stiffness_times(move)
            square = float(residual @ residual)
            if not enough < square < before:
                break
            before = square
            move += system.linear.solve(residual)
        y += move
        return y

    def _stiffness_times(self, u: FloatArray) -> FloatArray:
        """Return K u [N], shape (unknowns,)."""
        system, moves, products = self._system, self._nodes, self._products
        system.reduction.moves(u, system.lever, moves)
        products[:] = 0.0
        system.add_present_products(moves, products)
        out = np.empty_like(u)
        system.reduction.gradient(products, out, self._unused)
        return out
