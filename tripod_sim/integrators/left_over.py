"""What steps of one linear solve leave over, carried to the next step.

A solve with the matrix A0 of an earlier pose ends where the unbalanced force is not zero but

    r = g + A dx = (A - A0) dx,   A0 dx = -g,

and to the body r is an outside force. With implicit Euler, where A - A0 = (1 + b / h) (K - K0), it is
(h + b) (K - K0) v: a drag where the body has become softer since A0 was factored, a push where it has become stiffer.
However slow a motion is, that keeps the body behind its equilibrium, or ahead of it, by a part of what it moves in a
step; and r may be small beside g, which holds the inertia and the move of the driven nodes, too, and yet shift a soft
body far. Therefore what was left over is summed and carried along,

    A0 dx = -(g + c),   r = g + A dx,   c' = c + GAIN (r + r_before) / 2,

so that nothing is left over in a steady motion: c then is (A - A0) dx, what the next solve would leave. It costs a few
sums of vectors, no solve and no evaluation.

A mode whose stiffness is k in A and k0 in A0 is multiplied by 1 - k / k0 in a step, and stable for k < 2 k0. There r
changes its sign from step to step, and a sum of r alone would lower the bound to 4 / (2 + GAIN) k0; the mean of two
steps is zero there, and leaves it at 2 k0.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

GAIN = 0.25
"""Part of r that is carried. A motion is steady enough if it is so for 1 / GAIN steps."""


class LeftOver:
    """Carries c from one solve to the next, in the unknowns of a system."""

    def __init__(self, unknowns: int) -> None:
        """Begin with nothing; `unknowns`: size of a residual."""
        self._sum, self._before = np.zeros(unknowns), np.zeros(unknowns)
        self._length, self._first = 0.0, True

    def drop(self) -> None:
        """Begin anew: the factorisation is another one, or the last step was solved to the end."""
        self._sum[:] = 0.0
        self._first = True

    def add_to(self, residual: FloatArray, length: float | None) -> None:
        """Add c to g in `residual`, shape (unknowns,); none where the steps before were not of `length` [s]."""
        if length != self._length:
            self._length = length or 0.0
            self.drop()
        residual += self._sum

    def note(self, residual: FloatArray) -> None:
        """Carry what a solve has left over, r in `residual`, shape (unknowns,)."""
        if self._first:
            self._before[:] = residual
            self._first = False
        _add_mean(self._sum, self._before, residual, GAIN)


@njit(cache=True, error_model="numpy")
def _add_mean(total: FloatArray, before: FloatArray, residual: FloatArray, gain: float) -> None:
    """Add gain (residual + before) / 2 to `total`, and let `residual` be `before` from now on."""
    for k in range(len(total)):
        total[k] += 0.5 * gain * (residual[k] + before[k])
        before[k] = residual[k]
