"""The one loop that divides a step into substeps: it alone saves a state and restores it."""

from typing import TYPE_CHECKING, NoReturn

from tripod_host.arrays import FloatArray
from tripod_sim.errors import StepError, UnsolvedError
from tripod_sim.integrators.integrator import Integrator
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.step_control import HalveOnFailure, StepControl, Substep
from tripod_sim.state import State

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.integrators.newton import Newton
    from tripod_sim.integrators.time_error import ErrorTransport


class Substeps:
    """Advances a state by whole steps, which a control divides into substeps of an integrator.

    Attributes:
        integrator: Advances over a substep.
        control: Chooses the substeps.
    """

    def __init__(self, integrator: Integrator, control: StepControl) -> None:
        """As the attributes."""
        self.integrator, self.control = integrator, control
        self._backup: State | None = None
        self._origin: State | None = None

    @property
    def newton(self) -> "Newton":
        """Solves the stages, of an integrator that has such."""
        assert self.integrator.newton
        return self.integrator.newton

    @property
    def errors(self) -> "ErrorTransport | None":
        """Carries the error of the time steps along; None where nobody asks for it."""
        return self.integrator.errors

    def forget(self) -> None:
        """Drop what was kept from earlier steps, so that the next depends on its state alone."""
        self.integrator.forget()
        self._backup = self._origin = None

    def prepare(self, state: State, dt: float) -> None:
        """Factor for a first step of `dt` [s] from `state`, which is left alone: it is then no slower than others."""
        self.forget()
        if not self.integrator.newton:  # it has no factorisation to keep
            return
        try:
            self.step(state.copy(), state.joints.copy(), dt)
        except StepError:
            return  # the step itself will say so
        self.integrator.drop_history()

    def renew(self, state: State, dt: float) -> None:
        """Refactor ahead of the next step, of `dt` [s] from `state`, where that takes long. Call when idle."""
        self.integrator.renew(state, dt)

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance `state` by `dt` [s] while the driven frames move to `joints`, shape (s + 1,), in place.

        Raises:
            StepError: the step could not be saved; `state` is unchanged.
        """
        integrator, control = self.integrator, self.control
        if (
            self._backup is None
            or self._origin is None
            or (self._backup.ball is None) != (state.ball is None)
        ):
            self._backup, self._origin = state.copy(), state.copy()
        start, begin, number, report = state.joints.copy(), state.time, state.step, StepReport()
        origin, first = self._backup, True
        control.begin(state, joints - start, dt)
        while substep := control.propose():
            if not first and origin is self._backup:  # keep the copy of the step's start
                self._backup, self._origin = self._origin, self._backup
            state.copy_to(self._backup)
            if control.rejects:
                integrator.keep_history()
            control.prepare(state)
            goal = joints if substep.end == 1.0 else start + substep.end * (joints - start)
            spent = self._spent()
            advance = integrator.advance_truncated if substep.last else integrator.advance
            try:
                work = advance(state, goal, substep.length)
                if integrator.restarts():
                    self._backup.copy_to(state)
                    work = advance(state, goal, substep.length)
                    integrator.restarted()
            except UnsolvedError as error:
                self._backup.copy_to(state)
                if control.rejects:
                    integrator.recall_history()
                report.halvings += 1
                if not control.shorten(self._spent() - spent):
                    self._give_up(origin, state, substep, error)
                continue
            state.time = begin + substep.end * dt
            if not control.accepts(state, work):
                self._backup.copy_to(state)
                integrator.recall_history()
                control.replace(state)
                report.rejected += 1
                continue
            report.add(work)
            first = False
        state.time, state.step = begin + dt, number + 1
        if self.errors and state.errors:
            report.time_error = self.errors.report(state.errors, control.added)
        control.finish(state, report)
        return report

    def _spent(self) -> int:
        """Return the linear solves so far, those of failed substeps too; 0 where the integrator counts none."""
        return self.integrator.newton.spent if self.integrator.newton else 0

    def _give_up(self, origin: State, state: State, substep: Substep, error: UnsolvedError) -> NoReturn:
        """Restore `state` to `origin`, where the step began, and raise StepError: a substep failed with `error`."""
        origin.copy_to(state)
        self.forget()
        if isinstance(error, StepError):
            raise error
        parts = f", even with substeps of {substep.share:.2g} of it" if substep.share < 1 else ""
        raise StepError(
            f"step {state.step + 1} at {state.time:.4g} s cannot be solved{parts}: {error.what}", error.remedy
        ) from error


def halving(integrator: Integrator, max_halvings: int) -> Substeps:
    """Return steps of `integrator` in which substeps that fail are halved, at most `max_halvings` times."""
    newton = integrator.newton
    return Substeps(integrator, HalveOnFailure(max_halvings, newton.max_iterations if newton else 1))
