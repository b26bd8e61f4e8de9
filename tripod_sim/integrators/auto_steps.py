"""Steps as long as the error that they add allows: what `dt = "auto"` asks for.

The interval of commands and outputs stays fixed; it is divided into parts of 2^-k of it, which nest, so that lengths
recur and their factorisations, which are kept, serve many parts. A part that adds more than the tolerance to the
position of a node is taken back. The controller, of a proportional and an integral part [HairerWanner1996, chapter
IV.2], follows a length H of its own, of which the parts are the next 2^-k below: with q the order of the scheme and r
the error, in parts of the tolerance, that a part of H would have added,

    after an accepted part    H' = 0.9 H r^(-0.7 / (q + 1)) r_before^(0.4 / (q + 1)),
    after a rejected one      H' = 0.9 h r^(-1 / (q + 1)).

The error is bounded for each part and not for each unit of time: equal errors of all parts are what reaches a given
error at the end with the fewest of them.

With `mixed` the parts are steps of implicit Euler where these get further with the same work than those of TR-BDF2. Its
parts of an interval are equal unless one is taken back, and twice as long after an interval of small errors.

The equations of a part are solved as far as its error is worth, not to the scene's `solver.tolerance`.
"""

import math

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.newton import Newton, NewtonError, NewtonReport
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.integrators.time_error import ErrorState
from tripod_sim.state import State

SAFETY = 0.9
SHRINK, GROW = 0.1, 4.0
"""Bounds of the ratio of two lengths."""

FIRST, SECOND = 1, 2
"""Orders of implicit Euler and TR-BDF2."""

SPARE = 0.3
"""Part of the tolerance that a step of implicit Euler may add: it damps, so that the errors of all steps add up."""

CALM = 0.3
"""Part of that below which its steps become longer."""

CHEAPER = 1.2
"""Implicit Euler takes over where it gets so many times further with the same work."""

WORK = 3.0
"""Steps of implicit Euler that take as long as one of TR-BDF2."""

LEAST = 1e-4
"""Smallest error, in parts of the tolerance, that the controller takes note of."""


class AutoSteps(Substeps):
    """Divides the steps of a scheme, which must carry its error along."""

    def __init__(
        self,
        scheme: Substeps,
        newton: Newton,
        max_halvings: int,
        tolerance: float,
        shortest: float,
        *,
        mixed: bool = False,
    ) -> None:
        """Prepare.

        Args:
            scheme: Advances over each part.
            newton: The scheme's.
            max_halvings: The smallest part that is tried where Newton's method fails is 2^-max_halvings of a step, or
                smaller if the tolerance asks for that.
            tolerance: Error that a part may add to the position of a node [m].
            shortest: Length of a part that is accepted whatever its error [s].
            mixed: Whether parts may be steps of implicit Euler; `scheme` is then TR-BDF2, which such a step starts
                afresh.
        """
        super().__init__(newton, max_halvings)
        self._scheme, self._tolerance, self._shortest, self._mixed = scheme, tolerance, shortest, mixed
        self.errors = scheme.errors
        newton.keep_several()

    def _part(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        return self._scheme._part(state, joints, h)

    def _drop_history(self) -> None:
        self._scheme._drop_history()

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance `state` by `dt` [s] while the driven frames move to `joints`, shape (s + 1,), in place.

        Raises:
            StepError: the step could not be saved; `state` is unchanged.
        """
        errors, estimate = self.errors, state.errors
        if errors is None or estimate is None:
            return self._scheme.step(state, joints, dt)
        if self._backup is None:
            self._backup, self._origin = state.copy(), state.copy()
        state.copy_to(self._origin)
        report = StepReport()
        worst = self._divided(state, joints, dt, report)
        state.time += dt
        state.step += 1
        report.time_error = errors.report(estimate, worst)
        return report

    def _divided(self, state: State, joints: FloatArray, dt: float, report: StepReport) -> float:
        """Advance in parts; return the most that one added [m]. Raises StepError and leaves `state`."""
        errors, estimate = self.errors, state.errors
        assert errors and estimate
        allowed = max(0, math.floor(math.log2(dt / self._shortest) + 1e-9))
        units = 2 ** max(allowed, self._max_halvings)
        least, start, worst, most = units >> allowed, state.joints.copy(), 0.0, 0.0
        failed, done, again, euler = 0, 0, False, self._mixed and estimate.order != SECOND
        size = self._rung(estimate.proposed / dt * units if estimate.proposed else units)
        while done < units:
            size = min(max(size, least), units if done == 0 else done & -done)
            h, end = dt * (size / units), done + size
            goal = joints if end == units else start + (end / units) * (joints - start)
            limit = SPARE * self._tolerance if euler else self._tolerance
            spent = self.newton.spent
            try:
                result = self._try_part(state, goal, h, limit, fresh=euler)
            except NewtonError as error:
                self._take_back(state)
                report.halvings += 1
                failed += self.newton.spent - spent
                if size == 1 or failed >= self._most_failed:
                    self._give_up(self._origin, state, size / units, error)
                size, least, again = size // 2, min(least, size // 2), True
                continue
            report.iterations += result.iterations
            report.factorisations += result.factorisations
            report.linear_iterations += result.linear_iterations
            added = errors.largest_added
            ratio = added / limit
            if not ratio <= 1 and size > least:  # so that NaN counts as too much
                self._take_back(state)
                report.rejected += 1
                estimate.proposed = h * self._shrink(ratio, errors.order)
                euler, again = euler and self._euler_suffices(estimate, dt), True
                size = self._rung(estimate.proposed / dt * units)
                continue
            most = max(most, ratio)
            if euler:
                grown = 2 * h if end == units and most < CALM else h
                estimate.proposed, estimate.last = min(max(grown, dt * least / units), dt), 1.0
            else:
                self._follow(estimate, ratio, h, 1.0 if again else GROW)
                estimate.proposed = min(max(estimate.proposed, dt * least / units), dt)
            size, again = self._rung(estimate.proposed / dt * units), False
            report.residual, report.parts = result.residual, report.parts + 1
            done, worst = end, max(worst, added)
        if self._mixed:
            estimate.order = FIRST if euler or self._euler_returns(estimate, dt) else SECOND
        return worst

    def _try_part(
        self, state: State, goal: FloatArray, h: float, limit: float, *, fresh: bool
    ) -> NewtonReport:
        """Advance by a part of `h` [s] that may add `limit` [m], with its history, or `fresh` without."""
        assert self._backup
        state.copy_to(self._backup)
        self._scheme.keep_history()
        if fresh:
            self._scheme._drop_history()
        self.newton.allow(limit, h)
        return self._scheme._part(state, goal, h)

    def _take_back(self, state: State) -> None:
        """Undo `_try_part`."""
        assert self._backup
        self._backup.copy_to(state)
        self._scheme.recall_history()

    def _euler_suffices(self, estimate: ErrorState, dt: float) -> bool:
        """Return whether steps of implicit Euler of the proposed length go on; if not, propose one of TR-BDF2."""
        assert self.errors
        length = min(estimate.proposed, dt)
        other = self.errors.would_add(SECOND, length) / self._tolerance
        longer = min(length * self._shrink(other, SECOND), dt)
        if length * WORK >= longer:
            return True
        estimate.proposed = min(
            longer, length / math.sqrt(SPARE)
        )  # where servos start or stop, neither error is known
        return False

    def _euler_returns(self, estimate: ErrorState, dt: float) -> bool:
        """Return whether steps of implicit Euler now get further than those of TR-BDF2; if so, propose one."""
        assert self.errors
        length = min(estimate.proposed, dt) / WORK
        ratio = self.errors.would_add(FIRST, length) / (SPARE * self._tolerance)
        if not ratio * CHEAPER**2 <= SAFETY**2:
            return False
        estimate.proposed = min(length * self._shrink(ratio, FIRST), dt) if ratio > 0 else dt
        return True

    def _follow(self, estimate: ErrorState, ratio: float, h: float, most: float) -> None:
        """Write what follows an accepted part of `h` [s], at `most` so many times as long, to `proposed`."""
        assert self.errors
        k, length = self.errors.order + 1, estimate.proposed or h
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
