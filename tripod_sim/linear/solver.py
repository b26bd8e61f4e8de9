"""What Newton's method asks of a linear solver."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray


class LinearError(RuntimeError):
    """A linear system was not solved to the tolerance asked for; the message says why."""


class LinearSolver(ABC):
    """Solves A x = b for symmetric A of one fixed pattern.

    It is built on the pattern: the upper triangle of A as a scipy CSC matrix with a full diagonal. The caller writes
    new values into the pattern's `data` and calls `factor`; answers belong to the values at that call.

    Attributes:
        iterates: Whether it solves by iteration: each solution costs as much as the first.
        iterations: Of the last solution; 0 of direct solvers.
        solves_a_factor: How many solutions take about as long as `factor`; 0 where that is not known.
        places: Where the body is at `factor` [m], shape (n / 3, 3): nodes, then twice the centre of each rigid body;
            None: the solver need not know.
    """

    iterates, iterations, solves_a_factor = False, 0, 0.0
    places: FloatArray | None = None

    @abstractmethod
    def factor(self) -> bool:
        """Prepare to solve with the present values; return False if this solver cannot, with them.

        No solver can where a pivot is zero or a value is not finite; `cholmod` cannot either where A is indefinite.
        """

    @abstractmethod
    def is_positive(self) -> bool:
        """Return whether the A of the last `factor`, which returned True, is positive definite."""

    @abstractmethod
    def solve(self, b: FloatArray) -> FloatArray:
        """Return A^-1 b, a new array; `b` is contiguous, shape (n,). Raises LinearError (iterative solvers only)."""

    def rough(self) -> "LinearSolver":
        """Return a solver of the same pattern and values for whoever corrects by the residual: few digits do.

        This one is then used no more.
        """
        return self

    def solve_many(self, b: FloatArray) -> FloatArray:
        """Return A^-1 b for k right-hand sides, both of shape (n, k), contiguous. Raises LinearError as `solve`."""
        return np.stack([self.solve(column) for column in b.T.copy()], axis=1)


Pattern = Any
"""scipy.sparse.csc_matrix: scipy has no types."""
