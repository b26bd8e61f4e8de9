"""Conjugate gradients with an incomplete factorisation, for large nets of springs."""

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.linear import incomplete_kernels as kernels
from tripod_sim.linear.cg import ConjugateGradients
from tripod_sim.linear.cg_kernels import SOLVED, gather
from tripod_sim.linear.solver import Pattern

PROBE = 1e-2
"""Relative residual to which a right-hand side is solved to find negative curvature."""


class IncompleteConjugateGradients(ConjugateGradients):
    """Solves as `ConjugateGradients`, in a fifth of the iterations where most off-diagonal blocks are negative.

    A solution is accepted at a relative residual |b - A x| / |b| of `tolerance`.
    """

    def __init__(self, pattern: Pattern, blocks: IndexArray, tolerance: float = 1e-8) -> None:
        """As `ConjugateGradients`."""
        super().__init__(pattern, blocks, tolerance)
        count = pattern.shape[0] // 3
        self._rows, self._pivot, self._inverse = np.zeros((3, count, 9))
        self._scratch = np.zeros((5, count, 3))

    def factor(self) -> bool:
        """Take over the present values and factor the preconditioner; return False if a value is not finite."""
        if not gather(self._data, self._source, self._values):
            return False
        self._blocks_positive = bool(
            kernels.factor(self._indices, self._indptr, self._values, self._rows, self._pivot, self._inverse)
        )
        self._scale = np.sqrt(np.abs(self._data[self._diagonal]))
        return True

    def is_positive(self) -> bool:
        """Return whether a rough solution for a right-hand side that excites all modes met no negative curvature.

        What escapes that, `solve` raises where it meets it.
        """
        if not self._blocks_positive:
            return False
        return self._iterate(self._scale * self._probe, PROBE)[0] == SOLVED

    def _run(self, b: FloatArray) -> tuple[int, FloatArray, float]:
        return self._iterate(b, self.tolerance)

    def _iterate(self, b: FloatArray, tolerance: float) -> tuple[int, FloatArray, float]:
        x = np.empty_like(b)
        state, self.iterations, residual = kernels.conjugate_gradients(
            self._indices, self._indptr, self._values, self._pivot, self._inverse, b.reshape(-1, 3), tolerance,
            self._limit, self._scratch, x.reshape(-1, 3),
        )  # fmt: skip
        return int(state), x, float(residual)
