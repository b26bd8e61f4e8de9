"""What a multistep scheme remembers of its last stage, of one quantity: see `scheme` for the equations."""

from typing import Any

import numpy as np
from numba import njit

from tripod_sim.integrators.scheme import Curve, Stage, Weights


class History:
    """What the next stage may use of the last.

    Attributes:
        change: What the last stage changed the quantity by.
        rate: With which it ended.
        curve: b, of schemes that have one, else zero.
    """

    def __init__(self, shape: tuple[int, ...], velocities: slice) -> None:
        """Begin with nothing.

        Args:
            shape: Of the quantity.
            velocities: Which of it along the first axis are velocities; what stands before them are their positions, as
                many, and all that is none takes the weights of positions.
        """
        self.change, self.rate, self.curve = np.zeros((3, *shape))
        self._velocities, self._before = velocities, slice(0, velocities.start)
        behind = slice(velocities.stop, None)
        self._parts = tuple(
            (part, of)
            for part, of in ((self._before, 0), (velocities, 1), (behind, 0))
            if len(self.rate[part])
        )

    def arrays(self) -> tuple[Any, Any, Any]:
        """Return the arrays that the next stage may use."""
        return self.change, self.rate, self.curve

    def follow(self, other: "History", stage: Stage) -> None:
        """Take what `note` of `stage` needs from `other`, whose next stage this one notes."""
        if other is not self and stage.curves:
            self.rate[:], self.curve[:] = other.rate, other.curve

    def known(self, now: Any, stage: Stage, out: Any) -> None:
        """Write what `stage` starts from, where the quantity is `now`, to `out`."""
        if stage.position == stage.velocity and not stage.position.curve:
            _known(now, self.change, stage.position.change, self.rate, stage.position.rate, out)
            return
        for part, of in self._parts:
            weights = stage.velocity if of else stage.position
            write_known(now[part], self.change[part], self.rate[part], self.curve[part], weights, out[part])

    def note(self, before: Any, known: Any, after: Any, stage: Stage) -> None:
        """Remember a stage that began at `before` and, with what it knew, led to `after`."""
        if not stage.curves:
            _note(before, known, after, stage.s, self.change, self.rate)
            return
        for part, of in self._parts:
            write_history(
                before[part], known[part], after[part], stage.s_force if of else stage.s, stage.curves[of],
                self.change[part], self.rate[part], self.curve[part],
            )  # fmt: skip
        if self._before.stop:
            self.curve[self._before] = self.curve[self._velocities]


@njit(cache=True, error_model="numpy")
def _known(now: Any, change: Any, back: float, rate: Any, lead: float, out: Any) -> None:
    """Write now + back change + lead rate, contiguous arrays of any one shape."""
    x, dx, a, z = now.ravel(), change.ravel(), rate.ravel(), out.ravel()
    for k in range(x.shape[0]):
        z[k] = x[k] + back * dx[k] + lead * a[k]


@njit(cache=True, error_model="numpy")
def write_known(now: Any, change: Any, rate: Any, curve: Any, weights: Weights, out: Any) -> None:
    """Write `Weights` applied to contiguous arrays of any one shape."""
    x, dx, a, b, z = now.ravel(), change.ravel(), rate.ravel(), curve.ravel(), out.ravel()
    for k in range(x.shape[0]):
        z[k] = x[k] + weights.change * dx[k] + weights.rate * a[k] + weights.curve * b[k]


@njit(cache=True, error_model="numpy")
def _note(before: Any, known: Any, after: Any, s: float, change: Any, rate: Any) -> None:
    """Write after - before and (after - known) / s, contiguous arrays of any one shape."""
    x, z, end, dx, a = before.ravel(), known.ravel(), after.ravel(), change.ravel(), rate.ravel()
    for k in range(x.shape[0]):
        dx[k], a[k] = end[k] - x[k], (end[k] - z[k]) / s


@njit(cache=True, error_model="numpy")
def write_history(
    before: Any, known: Any, after: Any, s: float, by: Curve, change: Any, rate: Any, curve: Any
) -> None:
    """Write change and rate as `_note` does, and b as `by` makes it, contiguous arrays of any one shape."""
    x, z, end = before.ravel(), known.ravel(), after.ravel()
    dx, a, b = change.ravel(), rate.ravel(), curve.ravel()
    for k in range(x.shape[0]):
        old = a[k]
        dx[k], a[k] = end[k] - x[k], (end[k] - z[k]) / s
        b[k] = by.change * dx[k] + by.rate * a[k] + by.before * old + by.curve * b[k]
