"""Sparse L D L^T factorisation of symmetric matrices with a fixed pattern: multifrontal, compiled, without pivoting.

The order of elimination is AMD's [AmestoyEtAl1996], found once. Without pivoting, L D L^T exists for definite matrices
and for almost all indefinite ones; what is asked of those here is only the signs of D and a rough answer.
"""

from copy import copy

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.linear import ldl_kernels as kernels
from tripod_sim.linear.ldl_symbolic import analyse
from tripod_sim.linear.solver import LinearSolver, Pattern

OPERATIONS = 23
"""Of a factorisation, in the time in which a solution reads a number of L: 23e9 and 1e9 in a second, one thread."""


class Ldl(LinearSolver):
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
        self.solves_a_factor = self._plan.operations / (OPERATIONS * self.entries)
        self._numbers: kernels.Numbers | None = None  # until needed: some only ask how many entries there are

    def sibling(self, data: FloatArray | None = None) -> "Ldl":
        """Return another solver of the same pattern and values, with a factor of its own and the same analysis.

        `data`: where it takes its values from instead.
        """
        other = copy(self)
        if data is not None:
            other._data = data
        other.negative, other._numbers = -1, None
        return other

    def factor(self) -> bool:
        """Factor the present values; return False at a pivot that is zero or not finite."""
        if self._numbers is None:
            self._numbers = kernels.numbers(self._plan, self._data)
        self.negative = kernels.factor(self._plan, self._numbers)
        return self.negative >= 0

    def is_positive(self) -> bool:
        """Return whether the factored matrix is positive definite."""
        return self.negative == 0

    def solve(self, b: FloatArray) -> FloatArray:
        """Return A^-1 b, shape (n,)."""
        out = np.empty(len(self._plan.order))
        kernels.solve(b, self._plan, self._numbers, out)
        return out

    def solve_many(self, b: FloatArray) -> FloatArray:
        """As `LinearSolver.solve_many`, faster than one by one."""
        out = np.empty(b.shape)
        kernels.solve_many(b, self._plan, self._numbers, out)
        return out
