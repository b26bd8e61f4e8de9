"""Dense symmetric systems: Cholesky's factorisation, and Bunch and Kaufman's where that does not exist."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

FloatArray = NDArray[np.float64]


class Dense:
    """Factors one small matrix (see `LinearSolver`).

    Attributes:
        matrix: A, shape (n, n); the caller writes symmetric values into it before each `factor`.
    """

    def __init__(self, size: int) -> None:
        """`size`: n."""
        self.matrix = np.zeros((size, size), order="F")
        self._factor, self._pivots, self._positive = self.matrix, np.zeros(size, dtype=np.int32), False

    def factor(self) -> bool:
        """Factor the present values; return False where a pivot is zero or not finite."""
        if not np.isfinite(self.matrix).all():
            return False
        self._factor, info = lapack.dpotrf(self.matrix)
        self._positive = info == 0
        if not self._positive:
            self._factor, self._pivots, info = lapack.dsytrf(self.matrix)
        return bool(info == 0)

    def is_positive(self) -> bool:
        """Return whether the factored matrix is positive definite."""
        return self._positive

    def solve(self, b: FloatArray) -> FloatArray:
        """Return A^-1 b, shape (n,)."""
        if self._positive:
            x, _ = lapack.dpotrs(self._factor, b)
        else:
            x, _ = lapack.dsytrs(self._factor, self._pivots, b)
        return np.asarray(x)
