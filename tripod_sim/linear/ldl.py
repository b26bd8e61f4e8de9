"""Sparse L D L^T factorisation of symmetric matrices with a fixed pattern (QDLDL, its symbolic analysis reused)."""

import numpy as np
import qdldl
from numpy.typing import NDArray
from scipy import sparse

FloatArray = NDArray[np.float64]


class Ldl:
    """Factors matrices of one pattern.

    Positive definiteness is read from the signs of D (Sylvester's law of inertia).
    """

    def __init__(self, pattern: sparse.csc_matrix) -> None:
        """`pattern`: upper triangle, CSC; the caller writes new values into its `data` before each `factor`."""
        self._matrix = pattern
        self._solver: qdldl.Solver | None = None

    def factor(self) -> bool:
        """Factor the present values; return False if they are singular or not finite."""
        if not np.isfinite(self._matrix.data).all():
            return False
        try:
            if self._solver is None:
                self._solver = qdldl.Solver(self._matrix, upper=True)
            else:
                self._solver.update(self._matrix, upper=True)
        except RuntimeError:  # a zero pivot
            self._solver = None
            return False
        return True

    def is_positive(self) -> bool:
        """Whether the factored matrix is positive definite."""
        assert self._solver is not None
        return bool((self._solver.factors()[1] > 0).all())

    def solve(self, b: FloatArray) -> FloatArray:
        """Return A^-1 b, shape (n,)."""
        assert self._solver is not None
        return np.asarray(self._solver.solve(b))
