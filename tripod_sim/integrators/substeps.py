"""Advancing in parts: a part that fails is rolled back and halved."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.errors import StepError
from tripod_sim.integrators.newton import Newton, NewtonError, NewtonReport
from tripod_sim.integrators.report import StepReport
from tripod_sim.state import State

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.integrators.time_error import ErrorTransport


MOST_FAILED = 3
"""Parts of a step that fail may take together so many times the linear solves after which one is given up: parts that
can be saved fail at once, where an element turns inside out, and others go on failing however short they are."""


class Substeps(ABC):
    """Advances a state by steps, whole or in parts. A scheme says in `_part` how it advances over one part.

    Attributes:
        newton: Solves.
        errors: Carries the error of the time steps along; None where nobody asks for it.
    """

    def __init__(self, newton: Newton, max_halvings: int) -> None:
        """`max_halvings`: the smallest part is 2^-max_halvings of the largest."""
        self.newton, self._max_halvings = newton, max_halvings
        self._most_failed = MOST_FAILED * newton.max_iterations
        self._backup: State | None = None
        self.errors: ErrorTransport | None = None
        self._bound = newton.bound

    @abstractmethod
    def _part(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        """Advance `state` by `h` [s] while the driven frames move to `joints`, in place, or raise NewtonError."""

    def _largest_part(self, move: FloatArray) -> float:
        """Return the largest fraction of a step to try, for joints that move by `move`, shape (s + 1,)."""
        return 1.0

    def _smallest_part(self, move: FloatArray) -> float:
        """Return the smallest fraction of a step to try, for joints that move by `move`, shape (s + 1,)."""
        return self._largest_part(move) * 0.5**self._max_halvings

    def forget(self) -> None:
        """Drop what was kept from earlier steps, so that the next depends on its state alone."""
        self.newton.forget()
        self._drop_history()
        self._backup = None

    def keep_history(self) -> None:  # noqa: B027
        """Remember what a scheme of several steps knows of earlier ones, for `recall_history`."""

    def recall_history(self) -> None:  # noqa: B027
        """Take back what the part after `keep_history` has changed in that."""

    @property
    def looks_back(self) -> bool:
        """Whether the next part depends on those before it."""
        return False

    def _drop_history(self) -> None:  # noqa: B027 - schemes of one step have none
        """Drop what a scheme of several steps knows of earlier ones."""

    def prepare(self, state: State, dt: float) -> None:
        """Factor for a first step of `dt` [s] from `state`, which is left alone: it is then no slower than others."""
        self.forget()
        try:
            self.step(state.copy(), state.joints.copy(), dt)
        except StepError:
            return  # the step itself will say so
        self._drop_history()

    def renew(self, state: State, dt: float) -> None:  # noqa: B027 - not every scheme can
        """Do now what the next step, of `dt` [s] from `state`, would begin with, where that takes long."""

    def _bounded_part(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        """As `_part`; where the bound of strains pulls, velocities jump, so that is done by implicit Euler alone."""
        assert self._bound and self._backup
        again, self._bound.pulled = self.looks_back, False
        result = self._part(state, joints, h)
        if self._bound.pulled:
            self._drop_history()
            if again:
                self._backup.copy_to(state)
                result = self._part(state, joints, h)
                if self._bound.pulls:
                    self._drop_history()
        return result

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance `state` by `dt` [s] while the driven frames move to `joints`, shape (s + 1,), in place.

        Raises:
            StepError: the step could not be saved; `state` is unchanged.
        """
        if self._backup is None:
            self._backup = state.copy()
        start, report, done = state.joints.copy(), StepReport(), 0.0
        first = size = self._largest_part(joints - start)
        least, failed = self._smallest_part(joints - start), 0
        origin: State | None = None
        while done < 1.0:
            end = 1.0 if done + size > 1.0 - 1e-9 else done + size
            goal = joints if end == 1.0 else start + end * (joints - start)
            state.copy_to(self._backup)
            spent = self.newton.spent
            try:
                h = dt if end - done == 1.0 else dt * (end - done)
                result = self._bounded_part(state, goal, h) if self._bound else self._part(state, goal, h)
            except NewtonError as error:
                self._backup.copy_to(state)
                report.halvings += 1
                failed += self.newton.spent - spent
                if size < 2 * least * 0.999 or failed >= self._most_failed:
                    self._give_up(origin or state, state, size, error)
                size *= 0.5
                continue
            if end < 1.0 and origin is None:
                origin = self._backup.copy()
            report.iterations += result.iterations
            report.factorisations += result.factorisations
            report.linear_iterations += result.linear_iterations
            report.residual, report.unstable = result.residual, result.unstable
            report.increments += result.increments
            report.halvings += result.halvings
            report.parts += 1
            done, size = end, min(first, size * 2 if report.halvings else size)
        state.time += dt
        state.step += 1
        if self.errors and state.errors:
            report.time_error = self.errors.report(state.errors, np.nan)
        return report

    def _give_up(self, origin: State, state: State, part: float, error: NewtonError) -> NoReturn:
        """Take `state` back to `origin`, where the step began, and raise StepError: a `part` failed with `error`."""
        origin.copy_to(state)
        self.forget()
        parts = f", even with substeps of {part:.2g} of it" if part < 1 else ""
        raise StepError(
            f"step {state.step + 1} at {state.time:.4g} s cannot be solved{parts}: {error.what}", error.remedy
        ) from error
