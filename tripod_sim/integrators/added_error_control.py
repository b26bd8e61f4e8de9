"""Steps as long as the error that they add allows: what `dt = "auto"` asks for.

The interval of commands and outputs stays fixed; it is divided into substeps of 2^-k of it, which nest, so that lengths
recur and their factorisations, which are kept, serve many substeps. A substep that adds more than the tolerance to the
position of a node is rejected. The controller, of a proportional and an integral part [HairerWanner1996, chapter IV.2],
follows a length H of its own, of which the substeps are the next 2^-k below: with q the order of the scheme and r the
error, in parts of the tolerance, that a substep of H would have added,

    after an accepted substep    H' = 0.9 H r^(-0.7 / (q + 1)) r_before^(0.4 / (q + 1)),
    after a rejected one         H' = 0.9 h r^(-1 / (q + 1)).

The error is bounded for each substep and not for each unit of time: equal errors of all substeps are what reaches a
given error at the end with the fewest of them.

With a `pair` of schemes the substeps are steps of the first, of first order, where these get further with the same work
than those of the second. Its substeps of an interval are equal unless one is rejected, and twice as long after an
interval of small errors.

The equations of a substep are solved as far as its error is worth, not to the scene's `solver.tolerance`.
"""

import math
from typing import TYPE_CHECKING

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.step_control import MOST_FAILED, StepControl, Substep, Work
from tripod_sim.state import ErrorState, State

if TYPE_CHECKING:
    from tripod_sim.integrators.implicit import ImplicitSteps
    from tripod_sim.integrators.scheme import ImplicitScheme

SAFETY = 0.9
SHRINK, GROW = 0.1, 4.0
"""Bounds of the ratio of two lengths."""

SPARE = 0.3
"""Part of the tolerance that a step of first order may add: it damps, so that the errors of all steps add up."""

CALM = 0.3
"""Part of that below which its steps become longer."""

CHEAPER = 1.2
"""The first order takes over where it gets so many times further with the same work."""

WORK = 3.0
"""Steps of the first order that take as long as one of the second."""

LEAST = 1e-4
"""Smallest error, in parts of the tolerance, that the controller takes note of."""


class AddedErrorControl(StepControl):
    """Keeps the error that each substep adds below a tolerance."""

    rejects = True

    def __init__(
        self,
        steps: "ImplicitSteps",
        max_halvings: int,
        tolerance: float,
        shortest: float,
        *,
        pair: "tuple[ImplicitScheme, ImplicitScheme] | None" = None,
    ) -> None:
        """Prepare.

        Args:
            steps: Advances over each substep; must carry its error along.
            max_halvings: The smallest substep that is tried where Newton's method fails is 2^-max_halvings of a step,
                or smaller if the tolerance asks for that.
            tolerance: Error that a substep may add to the position of a node [m].
            shortest: Length of a substep that is accepted whatever its error [s].
            pair: Schemes of first and of second order that substeps may take; `steps` are then those of the second,
                which a step of the first, implicit Euler, starts afresh.
        """
        self._steps, self._newton, self._max_halvings = steps, steps.newton, max_halvings
        self._tolerance, self._shortest, self._pair = tolerance, shortest, pair
        self._most_failed = MOST_FAILED * self._newton.max_iterations
        self._newton.keep_several()

    def begin(self, state: State, move: FloatArray, dt: float) -> None:
        """Begin with the length proposed at the end of the last step."""
        estimate = state.errors
        assert self._steps.errors and estimate
        self._errors, self._dt = self._steps.errors, dt
        self._allowed = max(0, math.floor(math.log2(dt / self._shortest) + 1e-9))
        self._units = units = 2 ** max(self._allowed, self._max_halvings)
        self._least, self.added, self._most = units >> self._allowed, 0.0, 0.0
        self._failed, self._done, self._again = 0, 0, False
        self._euler = self._pair is not None and estimate.order != self._pair[1].order
        self._size = self._rung(estimate.proposed / dt * units if estimate.proposed else units)

    def propose(self) -> Substep | None:
        """Return the next substep."""
        done, units = self._done, self._units
        if done >= units:
            return None
        self._size = min(max(self._size, self._least), units if done == 0 else done & -done)
        self._h, self._end = self._dt * (self._size / units), done + self._size
        return Substep(self._end / units, self._h, self._size / units)

    @property
    def _limit(self) -> float:
        """Error that the substep may add [m]."""
        return SPARE * self._tolerance if self._euler else self._tolerance

    def prepare(self, state: State) -> None:
        """Drop the history before a step of implicit Euler; set how exactly the substep is solved."""
        if self._euler:
            self._steps.drop_history()
        self._newton.allow(self._limit, self._h)

    def shorten(self, spent: int) -> bool:
        """Halve the substep, unless it is the smallest, or too much has been spent on those that failed."""
        self._failed += spent
        if self._size == 1 or self._failed >= self._most_failed:
            return False
        self._size //= 2
        self._least, self._again = min(self._least, self._size), True
        return True

    def accepts(self, state: State, work: Work) -> bool:
        """Accept a substep that added little enough, or is the shortest; follow its error."""
        errors, estimate, h, units, dt = self._errors, state.errors, self._h, self._units, self._dt
        assert estimate
        added = errors.largest_added
        ratio = added / self._limit
        if not ratio <= 1 and self._size > self._least:  # so that NaN counts as too much
            self._rejected = h * self._shrink(ratio, errors.order)
            return False
        self._most = max(self._most, ratio)
        if self._euler:
            grown = 2 * h if self._end == units and self._most < CALM else h
            estimate.proposed, estimate.last = min(max(grown, dt * self._least / units), dt), 1.0
        else:
            self._follow(estimate, ratio, h, 1.0 if self._again else GROW)
            estimate.proposed = min(max(estimate.proposed, dt * self._least / units), dt)
        self._size, self._again = self._rung(estimate.proposed / dt * units), False
        self._done, self.added = self._end, max(self.added, added)
        return True

    def replace(self, state: State) -> None:
        """Propose a shorter substep in the place of a rejected one."""
        estimate = state.errors
        assert estimate
        estimate.proposed = self._rejected
        self._euler, self._again = self._euler and self._euler_suffices(estimate, self._dt), True
        self._size = self._rung(estimate.proposed / self._dt * self._units)

    def finish(self, state: State, report: object) -> None:
        """Choose the scheme of the next step."""
        if self._pair and (estimate := state.errors):
            first = self._euler or self._euler_returns(estimate, self._dt)
            estimate.order = self._pair[0 if first else 1].order

    def _euler_suffices(self, estimate: ErrorState, dt: float) -> bool:
        """Return whether steps of implicit Euler of the proposed length go on; if not, propose one of TR-BDF2."""
        assert self._pair
        length, second = min(estimate.proposed, dt), self._pair[1]
        other = self._errors.would_add(second, length) / self._tolerance
        longer = min(length * self._shrink(other, second.order), dt)
        if length * WORK >= longer:
            return True
        estimate.proposed = min(
            longer, length / math.sqrt(SPARE)
        )  # where servos start or stop, neither error is known
        return False

    def _euler_returns(self, estimate: ErrorState, dt: float) -> bool:
        """Return whether steps of implicit Euler now get further than those of TR-BDF2; if so, propose one."""
        assert self._pair
        length, first = min(estimate.proposed, dt) / WORK, self._pair[0]
        ratio = self._errors.would_add(first, length) / (SPARE * self._tolerance)
        if not ratio * CHEAPER**2 <= SAFETY**2:
            return False
        estimate.proposed = min(length * self._shrink(ratio, first.order), dt) if ratio > 0 else dt
        return True

    def _follow(self, estimate: ErrorState, ratio: float, h: float, most: float) -> None:
        """Write what follows an accepted part of `h` [s], at `most` so many times as long, to `proposed`."""

        k, length = self._errors.order + 1, estimate.proposed or h
        ratio = max(ratio * (length / h) ** k, LEAST) if math.isfinite(ratio) else 1.0
        factor = SAFETY * ratio ** (-0.7 / k) * estimate.last ** (0.4 / k)
        estimate.last, estimate.proposed = ratio, length * min(max(factor, SHRINK), most)

    @staticmethod
    def _shrink(ratio: float, order: int) -> float:
        """Return by what to multiply a rejected length."""
        return max(SAFETY * ratio ** (-1 / (order + 1)), SHRINK) if math.isfinite(ratio) else 0.5

    @staticmethod
    def _rung(units: float) -> int:
        """Return the largest power of two that is not above `units`, at least 1."""
        return 2 ** max(0, math.floor(math.log2(units) + 1e-9))
