"""Sparse L D L^T factorisation of symmetric matrices with a fixed pattern: multifrontal, compiled, without pivoting.

The order of elimination is AMD's [AmestoyEtAl1996], found once. Without pivoting, L D L^T exists for definite matrices
and for almost all indefinite ones; what is asked of those here is only the signs of D and a rough answer.
"""

from copy import copy

import numpy as np
from numpy.typing import NDArray

from tripod_sim.linear import ldl_kernels as kernels
from tripod_sim.linear.ldl_symbolic import analyse
from tripod_sim.linear.solver import Pattern

FloatArray = NDArray[np.float64]


class Ldl:
    """Factors matrices of one pattern (see `LinearSolver`).

    Positive definiteness is read from the signs of D (Sylvester's law of inertia).

    Attributes:
        entries: Numbers that the factor L holds.
        negative: Negative pivots of the last `factor`: as many as negative eigenvalues; less than zero if it failed.
    """

    def __init__(self, pattern: Pattern) -> None:
        """`pattern`: upper triangle, CSC; the caller writes new values into its `data` before each `factor`."""
        self._data, self._plan = pattern.data, analyse(pattern)
        self.entries, self.negative = int(self._plan.panel[-1]), -1
        self._allocated = False

    def sibling(self, data: FloatArray | None = None) -> "Ldl":
        """Return another solver of the same pattern and values, with a factor of its own and the same analysis.

        `data`: where it takes its values from instead.
        """
        other = copy(self)
        if data is not None:
            other._data = data
        other.negative, other._allocated = -1, False
        return other

    def _allocate(self) -> None:
        """Allocate factor and scratch: not before they are needed, for whoever only asks how many entries there are."""
        plan, n = self._plan, len(self._plan.order)
        self._front, self._stack = np.zeros(plan.largest**2), np.zeros(plan.stack)
        self._waiting = np.zeros(len(plan.parent), dtype=np.int64)
        self._factors, self._inverse = np.zeros(self.entries), np.zeros(n)
        self._y, self._x = np.zeros(n), np.zeros(plan.largest)
        self._allocated = True

    def factor(self) -> bool:
        """Factor the present values; return False at a pivot that is zero or not finite."""
        if not self._allocated:
            self._allocate()
        p = self._plan
        self.negative = kernels.factor(
            self._data, p.pivots, p.first_row, p.panel, p.parent, p.place, p.target, p.source, p.first_entry,
            self._front, self._stack, self._waiting, self._factors, self._inverse,
        )  # fmt: skip
        return self.negative >= 0

    def is_positive(self) -> bool:
        """Return whether the factored matrix is positive definite."""
        return self.negative == 0

    def solve(self, b: FloatArray) -> FloatArray:
        """Return A^-1 b, shape (n,)."""
        p, out = self._plan, np.empty(len(self._inverse))
        kernels.solve(
            b,
            p.order,
            p.pivots,
            p.rows,
            p.first_row,
            p.panel,
            self._factors,
            self._inverse,
            self._y,
            self._x,
            out,
        )
        return out

    def solve_many(self, b: FloatArray) -> FloatArray:
        """Return A^-1 b for k right-hand sides, both of shape (n, k), contiguous: faster than one by one."""
        p, out = self._plan, np.empty(b.shape)
        kernels.solve_many(
            b, p.order, p.pivots, p.rows, p.first_row, p.panel, self._factors, self._inverse, p.largest, out
        )
        return out
