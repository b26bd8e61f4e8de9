"""What a kept factorisation gets wrong in a step, foreseen from the steps before.

A solve with the matrix A0 of an earlier pose moves the unknowns by -A0^-1 g and misses their solution by

    m = A0^-1 (g + A dx) = A0^-1 (A - A0) dx,

to first order: a drag where the body has become softer since A0 was factored, a push where it has become stiffer. In a
smooth motion m is smooth, too, so that a forecast p of it is taken along,

    dx = -(A0^-1 g + p),   m = A0^-1 (g + A dx),   l' = p + LEVEL m,   s' = s + SLOPE m,   p' = l' + s',

with a level and a slope, as in the filters of that name. The step corrects by m what the forecast leaves, so
a mode whose stiffness is k in A and k0 in A0 stays stable for 0 < k < 2 k0, as it is without a forecast. It costs a few
sums of vectors.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import FloatArray

LEVEL, SLOPE = 0.8, 0.2
"""Parts of m that go into level and slope: with more, stiff modes tremble; with less, the forecast lags."""


class ChordPredictor:
    """Carries the forecast p from one solve to the next, in the unknowns of a system."""

    def __init__(self, unknowns: int) -> None:
        """Begin with nothing; `unknowns`: size of a solution."""
        self._forecast, self._slope = np.zeros(unknowns), np.zeros(unknowns)
        self._length, self._known = 0.0, False
        _learn(self._forecast, self._slope, self._forecast, LEVEL, SLOPE)  # compiled before it is needed

    def drop(self) -> None:
        """Begin again: the factorisation is another one."""
        if self._known:
            self._forecast[:] = 0.0
            self._slope[:] = 0.0
            self._known = False

    def forecast(self, length: float | None) -> FloatArray:
        """Return p, shape (unknowns,), an array that `note` overwrites; zero after steps of another `length` [s]."""
        if length != self._length:
            self._length = length or 0.0
            self.drop()
        return self._forecast

    def note(self, missed: FloatArray) -> None:
        """Learn from the m that a step with the last forecast had, shape (unknowns,)."""
        if self._known:
            _learn(self._forecast, self._slope, missed, LEVEL, SLOPE)
        else:
            self._forecast[:] = missed
            self._known = True


@njit(cache=True, error_model="numpy")
def _learn(forecast: FloatArray, slope: FloatArray, missed: FloatArray, level: float, trend: float) -> None:
    """Make the forecast of the next step from that of the last and what it missed."""
    for k in range(len(forecast)):
        slope[k] += trend * missed[k]
        forecast[k] += level * missed[k] + slope[k]
