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
"""

import math

import numpy as np
from numpy.typing import NDArray

from tripod_sim.errors import StepError
from tripod_sim.integrators.factor_store import FactorStore
from tripod_sim.integrators.newton import Newton, NewtonError, NewtonReport
from tripod_sim.integrators.substeps import StepReport, Substeps
from tripod_sim.integrators.time_error import ErrorState
from tripod_sim.state import State

FloatArray = NDArray[np.float64]

SAFETY = 0.9
SHRINK, GROW = 0.1, 4.0
"""Bounds of the ratio of two lengths."""

LEAST = 1e-4
"""Smallest error, in parts of the tolerance, that the controller takes note of."""


class AutoSteps(Substeps):
    """Divides the steps of a scheme, which must carry its error along."""

    def __init__(
        self, scheme: Substeps, newton: Newton, max_halvings: int, tolerance: float, shortest: float
    ) -> None:
        """Prepare.

        Args:
            scheme: Advances over each part.
            newton: The scheme's.
            max_halvings: The smallest part that is tried where Newton's method fails is 2^-max_halvings of a step, or
                smaller if the tolerance asks for that.
            tolerance: Error that a part may add to the position of a node [m].
            shortest: Length of a part that is accepted whatever its error [s].
        """
        super().__init__(newton, max_halvings)
        self._scheme, self._tolerance, self._shortest = scheme, tolerance, shortest
        self.errors = scheme.errors
        newton.store = FactorStore(newton.system)

    def _part(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        return self._scheme._part(state, joints, h)

    def _drop_history(self) -> None:
        self._scheme._drop_history()

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance `state` by `dt` [s] while the driven frames move to `joints`, shape (s + 1,), in place.

        Raises:
            StepError: the step could not be saved; `state` is unchanged.
        """
        errors, scheme = self.errors, self._scheme
        if errors is None or state.errors is None:
            return scheme.step(state, joints, dt)
        if self._backup is None:
            self._backup, self._origin = state.copy(), state.copy()
        backup, estimate = self._backup, state.errors
        state.copy_to(self._origin)
        allowed = max(0, math.floor(math.log2(dt / self._shortest) + 1e-9))
        units = 2 ** max(allowed, self._max_halvings)
        least, start, report, worst = units >> allowed, state.joints.copy(), StepReport(), 0.0
        done, again = 0, False
        size = self._rung(estimate.proposed / dt * units if estimate.proposed else units)
        while done < units:
            size = min(max(size, least), units if done == 0 else done & -done)
            h, end = dt * (size / units), done + size
            goal = joints if end == units else start + (end / units) * (joints - start)
            state.copy_to(backup)
            scheme.keep_history()
            try:
                result = scheme._part(state, goal, h)
            except NewtonError as error:
                backup.copy_to(state)
                report.halvings += 1
                if size == 1:
                    self._origin.copy_to(state)
                    self.forget()
                    raise StepError(
                        f"step {state.step + 1} at {state.time:.4g} s cannot be saved, even in parts of "
                        f"{1 / units:.2g} of it: {error}"
                    ) from error
                size, least, again = size // 2, min(least, size // 2), True
                continue
            report.iterations += result.iterations
            report.factorisations += result.factorisations
            ratio = errors.largest_added / self._tolerance
            if not ratio <= 1 and size > least:  # so that NaN counts as too much
                backup.copy_to(state)
                scheme.recall_history()
                report.rejected += 1
                estimate.proposed, again = h * self._shrink(ratio, errors.order), True
                size = self._rung(estimate.proposed / dt * units)
                continue
            self._follow(estimate, ratio, h, 1.0 if again else GROW)
            estimate.proposed = min(max(estimate.proposed, dt * least / units), dt)
            size, again = self._rung(estimate.proposed / dt * units), False
            report.residual, report.parts = result.residual, report.parts + 1
            done, worst = end, max(worst, ratio * self._tolerance)
        state.time += dt
        state.step += 1
        report.time_error = errors.report(estimate, worst)
        return report

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
