"""Sparse L D L^T factorisation of symmetric matrices with a fixed pattern: multifrontal, compiled, without pivoting.

The order of elimination is AMD's [AmestoyEtAl1996], found once. Without pivoting, L D L^T exists for definite matrices
and for almost all indefinite ones; what is asked of those here is only the signs of D and a rough answer.
"""

from collections.abc import Sequence
from copy import copy
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.threads import together
from tripod_sim.linear import ldl_kernels as kernels
from tripod_sim.linear.ldl_symbolic import PIECES, SHARED, analyse, operations
from tripod_sim.linear.solver import LinearSolver, Pattern

OPERATIONS = 23
"""Of a factorisation, in the time in which a solution reads a number of L: 23e9 and 1e9 in a second, one thread."""

LARGE = 20_000_000
"""Operations from which a front is eliminated by all threads: it then takes a millisecond."""

BLOCK = 64
"""Pivots that are eliminated from each other by one thread, after those before them by all."""


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
        self.solves_a_factor = operations(self._plan).sum() / (OPERATIONS * self.entries)
        self._numbers: kernels.Numbers | None = None  # until needed: some only ask how many entries there are
        self._shares: list[kernels.Share] = []
        self._large = list[int]()  # fronts of the last share that all threads eliminate, one after the other
        self._type: type[np.floating[Any]] = np.float64

    def sibling(self, data: FloatArray | None = None) -> "Ldl":
        """Return another solver of the same pattern and values, with a factor of its own and the same analysis.

        `data`: where it takes its values from instead.
        """
        other = copy(self)
        if data is not None:
            other._data = data
        other.negative, other._numbers = -1, None
        return other

    def rough(self) -> "Ldl":
        """As `LinearSolver.rough`: a large factor is rounded to single precision; solutions read half as much."""
        other = self.sibling()
        if self.entries >= SHARED:
            other._type = np.float32
            other.solves_a_factor *= 2.0
        return other

    def factor(self) -> bool:
        """Factor the present values; return False at a pivot that is zero or not finite."""
        if self._numbers is None:
            self._numbers, self._shares = kernels.numbers(self._plan, self._data, self._type)
            top = self._shares[-1]
            large = (operations(self._plan)[top.fronts] >= LARGE) & (top.held < 0) & (len(self._shares) > 1)
            self._large = np.flatnonzero(large).tolist()
        *parts, top = self._shares
        if not parts:
            top.depth[:] = 0, top.base
            self.negative = kernels.factor(self._plan, self._numbers, top, 0, len(top.fronts))
            return self.negative >= 0
        found = together([partial(self._factor, share) for share in parts])
        if min(found, default=0) >= 0:
            found.append(self._factor(top))
        self.negative = min(found) if min(found) < 0 else sum(found)
        return self.negative >= 0

    def _factor(self, share: kernels.Share) -> int:
        """As `kernels.factor`, of all fronts of a share; all threads eliminate the large ones above subtrees."""
        plan, A, negative, begin = self._plan, self._numbers, 0, 0
        share.depth[:] = 0, share.base
        large = self._large if share is self._shares[-1] else []
        for end in (*large, len(share.fronts)):
            for found in (
                kernels.factor(plan, A, share, begin, end),
                self._factor_together(share, end) if end in large else 0,
            ):
                if found < 0:
                    return int(found)
                negative += found
            begin = end + 1
        return negative

    def _factor_together(self, share: kernels.Share, number: int) -> int:
        """As `kernels.factor`, of one large front."""
        plan, A, s, F = self._plan, self._numbers, share.fronts[number], share.front
        assert A
        own, size = plan.pivots[s], int(plan.first_row[s + 1] - plan.first_row[s])
        width, negative = int(plan.pivots[s + 1] - own), 0
        inverse = A.inverse[own : own + width]

        def eliminate(rows: Sequence[int], pivots: int) -> None:
            runs = pairwise(rows)
            together([partial(kernels.eliminate_below, F, size, a, b, pivots, inverse) for a, b in runs])

        kernels.open_front(plan, A, share, s)
        for begin in range(0, width, BLOCK):
            end = min(begin + BLOCK, width)
            eliminate(range(begin, end + 1, BLOCK // 4) if end == begin + BLOCK else (begin, end), begin)
            found = kernels.eliminate_pivots(F, size, begin, end, inverse)
            if found < 0:
                return int(found - own)
            negative += found
        part = 1.0 - np.sqrt(1.0 - np.arange(PIECES) / PIECES)  # rows have fewer numbers the lower they are
        rows = width + ((size - width) * part).astype(int) // kernels.ROWS * kernels.ROWS
        eliminate([*rows.tolist(), size], width)
        kernels.close_front(plan, A, share, s)
        return negative

    def is_positive(self) -> bool:
        """Return whether the factored matrix is positive definite."""
        return self.negative == 0

    def solve(self, b: FloatArray) -> FloatArray:
        """Return A^-1 b, shape (n,)."""
        plan, A, shares = self._plan, self._numbers, self._shares
        out = np.empty(len(plan.order))
        if len(shares) == 1:
            kernels.solve(b, plan, A, shares[0], out)
            return out
        assert A
        *parts, top = shares
        np.take(b, plan.order, out=A.y)
        together([partial(kernels.forward, plan, A, share) for share in parts])
        for share in parts:
            kernels.add_beyond(plan, A, share)
        kernels.forward(plan, A, top)
        kernels.backward(plan, A, top)
        together([partial(kernels.backward, plan, A, share) for share in parts])
        out[plan.order] = A.y
        return out

    def solve_many(self, b: FloatArray) -> FloatArray:
        """As `LinearSolver.solve_many`, faster than one by one."""
        out = np.empty(b.shape)
        kernels.solve_many(b, self._plan, self._numbers, out)
        return out
