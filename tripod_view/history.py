"""The last seconds of a few values, for the plots."""

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

SPAN = 20.0
"""What the plots show [s]."""


class History:
    """Rows of values over the last `span` seconds, at most one per `period`."""

    def __init__(self, columns: int, *, span: float = SPAN, period: float = 0.1) -> None:
        """`columns`: values per row; `span`, `period` in [s]."""
        self.columns, self.span, self.period = columns, span, period
        self._rows: deque[tuple[float, tuple[float, ...]]] = deque()

    def add(self, now: float, values: Sequence[float] | FloatArray) -> None:
        """Note `values` at `now` [s]; too soon after the last row it is dropped."""
        if self._rows and now - self._rows[-1][0] < 0.99 * self.period:
            return
        self._rows.append((now, tuple(float(v) for v in values)))
        while now - self._rows[0][0] > self.span:
            self._rows.popleft()

    def series(self, now: float) -> tuple[FloatArray, ...]:
        """Return ages (negative, [s]) and one array per column, all of the same length, oldest first."""
        rows = [(t, v) for t, v in self._rows if now - t <= self.span]
        if not rows:
            return tuple(np.zeros(0) for _ in range(1 + self.columns))
        ages = np.array([t for t, _ in rows]) - now
        return (ages, *np.array([v for _, v in rows]).T.copy())
