"""CHOLMOD's supernodal Cholesky factorisation, from the optional extra `cholmod` (the package cvxopt, GPL)."""

import numpy as np
from cvxopt import cholmod, matrix, spmatrix

from tripod_host.arrays import FloatArray
from tripod_sim.linear.solver import LinearSolver, Pattern


class Cholmod(LinearSolver):
    """Factors positive definite matrices of one pattern as L L^T (see `LinearSolver`) [ChenEtAl2008]."""

    def __init__(self, pattern: Pattern) -> None:
        """`pattern`: upper triangle, CSC; the caller writes new values into its `data` before each `factor`."""
        n = pattern.shape[0]
        self._data = pattern.data
        columns = np.repeat(np.arange(n), np.diff(pattern.indptr))
        rows = matrix(np.ascontiguousarray(pattern.indices, dtype=np.int64))
        diagonal = np.where(pattern.indices == columns, 1.0, 0.0)
        self._A = spmatrix(matrix(diagonal), rows, matrix(columns.astype(np.int64)), (n, n))
        self._values = matrix(0.0, (len(pattern.data), 1))
        self._view = np.asarray(self._values)[:, 0]  # shares its memory
        self._b = matrix(0.0, (n, 1))
        self._answer = np.asarray(self._b)[:, 0]
        self._factors = cholmod.symbolic(self._A, uplo="U")

    def factor(self) -> bool:
        """Factor the present values; return False if they are not positive definite or not finite."""
        if not np.isfinite(self._data).all():
            return False
        self._view[:] = self._data
        self._A.V = self._values
        try:
            cholmod.numeric(self._A, self._factors)
        except ArithmeticError:
            return False
        return True

    def is_positive(self) -> bool:
        """Return True: no other matrix is factored."""
        return True

    def solve(self, b: FloatArray) -> FloatArray:
        """Return A^-1 b, shape (n,)."""
        self._answer[:] = b
        cholmod.solve(self._factors, self._b)
        return self._answer.copy()
