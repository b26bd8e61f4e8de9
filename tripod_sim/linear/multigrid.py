"""Conjugate gradients with algebraic multigrid, for stiff bodies whose factors would be too large.

Smoothed aggregation [VanekEtAl1996], by PyAMG: nodes are joined to aggregates, whose moves as rigid bodies are the
unknowns of a coarser matrix, and so on. So the number of iterations hardly grows with the mesh, as it does where only
the diagonal blocks precondition; where inertia is most of the matrix, these need few and are faster.
"""

from typing import Any

import numpy as np
from scipy import sparse

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.linear import cg_kernels as kernels
from tripod_sim.linear.cg import ConjugateGradients
from tripod_sim.linear.solver import Pattern

EASY = 250
"""Iterations up to which the diagonal blocks serve as preconditioner: as long as one solution with multigrid takes."""

SETUP = 40
"""Iterations with multigrid that take as long as to set it up: 3.0 s and 70 ms for 200,000 unknowns of t4."""

SMOOTHER = ("chebyshev", {"degree": 3})


class Multigrid(ConjugateGradients):
    """Solves as `ConjugateGradients`, and where that takes more than `EASY` iterations, with multigrid from then on.

    What has been set up serves later matrices, too, until their extra iterations have taken as long as a new set-up.
    """

    def __init__(self, pattern: Pattern, blocks: IndexArray, tolerance: float = 1e-8) -> None:
        """As `ConjugateGradients`."""
        super().__init__(pattern, blocks, tolerance)
        self.places = self._places = np.zeros((pattern.shape[0] // 3, 3))
        self._pattern, self._stiff, self._cycle = pattern, False, None
        self._first: int | None = None  # iterations of the first solution with what was set up
        self._extra = 0  # those of later ones beyond that

    def _run(self, b: FloatArray) -> tuple[int, FloatArray, float]:
        spent = 0
        for attempt in (
            self._run_briefly,
            self._run_with_cycles,
            super()._run,
        ):  # in the end as without multigrid
            found = attempt(b)
            spent += self.iterations
            if found[0] in (kernels.SOLVED, kernels.INDEFINITE):
                break
        self.iterations = spent
        return found

    def _run_briefly(self, b: FloatArray) -> tuple[int, FloatArray, float]:
        """Try with the diagonal blocks, unless they have been found to be too little."""
        if self._stiff:
            self.iterations = 0
            return kernels.UNSOLVED, b, np.inf
        found = self._run_at_most(b, EASY)
        self._stiff = found[0] == kernels.UNSOLVED
        return found

    def _run_with_cycles(self, b: FloatArray) -> tuple[int, FloatArray, float]:
        self.iterations = 0
        if self._cycle is None or self._extra >= SETUP:
            self._cycle, self._first, self._extra = self._set_up(), None, 0
        if self._cycle is None:
            return kernels.INDEFINITE, b, np.inf
        state, x, residual = self._iterate(b, self._cycle)
        if state in (kernels.BROKEN, kernels.UNSOLVED):
            self._extra = SETUP
        elif self._first is None:
            self._first = self.iterations
        else:
            self._extra += max(0, self.iterations - self._first)
        return state, x, residual

    def _iterate(self, b: FloatArray, cycle: Any) -> tuple[int, FloatArray, float]:
        """As `kernels.conjugate_gradients`, preconditioned by `cycle`; residuals have the same norm."""
        x, r, p, q = np.zeros_like(b), b.copy(), np.zeros_like(b), np.empty_like(b)
        start, descent = self._size(r), 0.0
        best, self.iterations = start, 0
        while True:
            now = self._size(r)
            if not now < np.inf:
                return kernels.BROKEN, x, np.inf
            if now <= self.tolerance * start:
                self._product(x, q)  # the residual itself, not that of the recurrence
                np.subtract(b, q, out=r)
                now, descent = self._size(r), 0.0
                if now <= self.tolerance * start:
                    return kernels.SOLVED, x, now / start if start else 0.0
                if now > 0.5 * best:
                    return kernels.UNSOLVED, x, now / start
                best = now
            if self.iterations >= self._limit:
                return kernels.UNSOLVED, x, now / start
            z = cycle @ r
            before, descent = descent, float(r @ z)
            if not descent > 0.0:
                return kernels.BROKEN, x, now / start
            p = z + (descent / before if before else 0.0) * p
            self._product(p, q)
            self.iterations += 1
            curvature = float(p @ q)
            if not curvature > 0.0:
                return kernels.INDEFINITE if curvature <= 0.0 else kernels.BROKEN, x, now / start
            x += descent / curvature * p
            r -= descent / curvature * q

    def _product(self, x: FloatArray, out: FloatArray) -> None:
        kernels.product(self._indices, self._indptr, self._values, x, out)

    def _size(self, r: FloatArray) -> float:
        return float(np.sqrt(kernels.precondition(self._blocks, self._L, r, self._z)))

    def _set_up(self) -> Any:
        """Return what a V-cycle for the present values is, to be multiplied by; None if they are found indefinite."""
        from pyamg import smoothed_aggregation_solver  # noqa: PLC0415 - optional, for large meshes

        upper = sparse.csc_matrix((self._data, self._pattern.indices, self._pattern.indptr))
        matrix = (upper + sparse.triu(upper, 1).T).tobsr((3, 3))
        before = np.random.get_state()
        np.random.seed(0)
        try:
            levels = smoothed_aggregation_solver(
                matrix, B=self._rigid_moves(), strength=("symmetric", {"theta": 0.0}), max_coarse=300,
                presmoother=SMOOTHER, postsmoother=SMOOTHER, coarse_solver="splu",
            )  # fmt: skip
            np.linalg.cholesky(levels.levels[-1].A.toarray())  # of moves by which the body gives way most
            cycle = levels.aspreconditioner()
            cycle @ np.zeros(len(self._r))  # the coarsest matrix is factored when it is first needed
        except np.linalg.LinAlgError:
            return None
        finally:
            np.random.set_state(before)
        return cycle

    def _rigid_moves(self) -> FloatArray:
        """Return what moves and turns as one rigid body do to the unknowns, shape (n, 6 or fewer)."""
        moves = np.zeros((len(self._places), 3, 6))
        turns = self._blocks[:-1][np.diff(self._blocks) == 6] // 3 + 1  # of bodies; all others are places
        where = np.ones(len(moves), dtype=bool)
        where[turns] = False
        x = self._places - self._places.mean(axis=0)
        moves[where, :, :3] = np.eye(3)
        moves[:, :, 3:][~where] = np.eye(3)
        moves[where, :, 3:] = np.cross(np.eye(3)[None, :, :], x[where][:, None, :]).transpose(0, 2, 1)
        scale = float(np.abs(x).max()) or 1.0
        moves[:, :, 3:] /= scale
        found = moves.reshape(-1, 6)
        return np.ascontiguousarray(found[:, found.any(axis=0)])
