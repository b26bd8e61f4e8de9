"""What Newton's method asks of a linear solver."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class LinearError(RuntimeError):
    """A linear system was not solved to the tolerance asked for; the message says why."""


class LinearSolver(Protocol):
    """Solves A x = b for symmetric A of one fixed pattern.

    It is built on the pattern: the upper triangle of A as a scipy CSC matrix with a full diagonal. The caller writes
    new values into the pattern's `data` and calls `factor`; answers belong to the values at that call.
    """

    def factor(self) -> bool:
        """Prepare to solve with the present values; return False if this solver cannot, with them.

        No solver can where a pivot is zero or a value is not finite; `cholmod` cannot either where A is indefinite.
        """

    def is_positive(self) -> bool:
        """Return whether the A of the last `factor`, which returned True, is positive definite."""

    def solve(self, b: FloatArray) -> FloatArray:
        """Return A^-1 b, a new array; `b` is contiguous, shape (n,). Raises LinearError (iterative solvers only)."""


def solve_columns(linear: LinearSolver, b: FloatArray) -> FloatArray:
    """Return A^-1 b for k right-hand sides, both of shape (n, k), at once where `linear` can. Raises LinearError."""
    many: Callable[[FloatArray], FloatArray] | None = getattr(linear, "solve_many", None)
    return many(b) if many else np.stack([linear.solve(column) for column in b.T.copy()], axis=1)


Pattern = Any
"""scipy.sparse.csc_matrix: scipy has no types."""
