"""Conjugate gradients with a block-Jacobi preconditioner, for meshes whose factors would be too large."""

from copy import copy
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.linear import cg_kernels as kernels
from tripod_sim.linear.solver import LinearError, LinearSolver, Pattern

MEANING = {
    kernels.UNSOLVED: "did not converge: an ill-conditioned matrix, or a tolerance below its rounding",
    kernels.INDEFINITE: "failed: the matrix is not positive definite",
    kernels.BROKEN: "failed: a number is not finite",
}


ROUGH = 1e-2
"""Relative residual that is enough for a step of a quasi-Newton method: it then takes as many as with 1e-8."""


class ConjugateGradients(LinearSolver):
    """Solves A x = b of one pattern by iteration (see `LinearSolver`) [HestenesStiefel1952].

    The preconditioner M has A's diagonal blocks: 3 x 3 of nodes, 6 x 6 of rigid bodies. A solution is accepted at a
    relative residual sqrt(r^T M^-1 r / b^T M^-1 b) of `tolerance`; what is not accepted raises LinearError.

    Attributes:
        iterations: Of the last `solve` or `is_positive`.
    """

    iterates = True

    def __init__(self, pattern: Pattern, blocks: IndexArray, tolerance: float = 1e-8) -> None:
        """Analyse the pattern.

        Args:
            pattern: Upper triangle, CSC; the caller writes new values into its `data` before each `factor`.
            blocks: First unknown of each diagonal block, ascending, then the number of unknowns; sizes 3 or 6.
            tolerance: Relative residual.
        """
        n = pattern.shape[0]
        self._data, self._blocks, self.tolerance = pattern.data, np.asarray(blocks, dtype=np.int64), tolerance
        self._limit, self.iterations = max(1000, 4 * n), 0
        self._indices, self._indptr, self._source = _block_pattern(pattern)
        self._slots = _diagonal_slots(pattern, self._blocks)
        self._values = np.zeros(self._source.shape)
        self._L = np.zeros((len(blocks) - 1, 6, 6))
        self._r, self._z, self._p, self._q = np.zeros((4, n))
        self._blocks_positive = False
        diagonal = pattern.indptr[1:] - 1
        self._diagonal, self._probe = diagonal, np.random.default_rng(0).standard_normal(n)

    def factor(self) -> bool:
        """Take over the present values and factor the preconditioner; return False if a value is not finite."""
        if not kernels.gather(self._data, self._source, self._values):
            return False
        self._blocks_positive = bool(kernels.factor_blocks(self._data, self._blocks, self._slots, self._L))
        self._scale = np.sqrt(np.abs(self._data[self._diagonal]))
        return True

    def is_positive(self) -> bool:
        """Return whether a right-hand side that excites all modes was solved for without negative curvature.

        A negative eigenvalue whose mode has no part in that solution within the tolerance escapes; `solve` raises where
        it meets one. A matrix too ill-conditioned to tell counts as not positive definite.
        """
        if not self._blocks_positive:
            return False
        return self._run(self._scale * self._probe)[0] == kernels.SOLVED

    def solve(self, b: FloatArray) -> FloatArray:
        """Return A^-1 b, shape (n,). Raises LinearError."""
        if not self._blocks_positive:
            raise LinearError(
                "conjugate gradients need a positive definite matrix, and this one is not; set solver.linear "
                "= 'ldl'"
            )
        state, x, residual = self._run(b)
        if state != kernels.SOLVED:
            raise self._error(state, residual)
        return x

    def rough(self) -> "ConjugateGradients":
        """As `LinearSolver.rough`: it stops at a relative residual of `ROUGH`, after a third of the iterations."""
        other = copy(self)
        other.tolerance = max(self.tolerance, ROUGH)
        return other

    def _run(self, b: FloatArray) -> tuple[int, FloatArray, float]:
        return self._run_at_most(b, self._limit)

    def _run_at_most(self, b: FloatArray, limit: int) -> tuple[int, FloatArray, float]:
        x = np.empty_like(self._r)
        state, self.iterations, residual = kernels.conjugate_gradients(
            self._indices, self._indptr, self._values, self._blocks, self._L, b, self.tolerance, limit,
            self._r, self._z, self._p, self._q, x,
        )  # fmt: skip
        return int(state), x, float(residual)

    def _error(self, state: int, residual: float) -> LinearError:
        return LinearError(
            f"conjugate gradients {MEANING[state]} (relative residual {residual:.2g} after {self.iterations} "
            f"iterations, tolerance {self.tolerance:g}); solver.linear = 'ldl' solves directly"
        )


def _block_pattern(pattern: Pattern) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Return the upper 3 x 3 blocks by columns (indices, indptr) and the entry of the pattern of each number, or -1.

    Diagonal blocks come last in their column and are completed from the upper triangle.
    """
    count = pattern.shape[0] // 3
    rows = np.asarray(pattern.indices, dtype=np.int64)
    columns = np.repeat(np.arange(3 * count), np.diff(pattern.indptr))
    keys, which = np.unique(columns // 3 * count + rows // 3, return_inverse=True)
    source = np.full((len(keys), 9), -1, dtype=np.int64)
    entries = np.arange(len(rows))
    source[which, 3 * (rows % 3) + columns % 3] = entries
    inner = rows // 3 == columns // 3
    source[which[inner], (3 * (columns % 3) + rows % 3)[inner]] = entries[inner]
    return keys % count, np.searchsorted(keys, np.arange(count + 1) * count), source


def _diagonal_slots(pattern: Pattern, blocks: IndexArray) -> IndexArray:
    """Return the entry of the pattern at (row, column) of each diagonal block's upper triangle, or -1."""
    slots: Any = np.full((len(blocks) - 1, 6, 6), -1, dtype=np.int64)
    rows, columns = pattern.indices, np.repeat(np.arange(pattern.shape[0]), np.diff(pattern.indptr))
    owner = np.searchsorted(blocks, columns, side="right") - 1
    own = np.flatnonzero(rows >= blocks[owner])
    b = owner[own]
    slots[b, rows[own] - blocks[b], columns[own] - blocks[b]] = own
    return slots
