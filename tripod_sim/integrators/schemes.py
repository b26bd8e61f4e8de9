"""The implicit schemes: their steps are stages, each of which looks back on one at most (see `looking_back`)."""

from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.looking_back import Memory, Stage, implicit_euler, stages
from tripod_sim.integrators.newton import NewtonReport
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.state import State

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.integrators.time_error import ErrorTransport


class ImplicitScheme:
    """Implicit Euler, BDF2 or TR-BDF2.

    The first step of a scheme that looks back, and the first after `forget`, is one of implicit Euler. That gives the
    acceleration: to take it from the forces at the start would throw a crumpled body apart.
    """

    def __init__(self, name: str, stage: ImplicitStage) -> None:
        """Prepare.

        Args:
            name: Of the scheme: `implicit_euler`, which `auto` is with a fixed dt, `bdf2` or `tr_bdf2`.
            stage: Solves its stages.
        """
        self.newton = stage.newton
        self.errors: ErrorTransport | None = None
        self._bound, self._used_history = stage.newton.bound, False
        self._name, self._stage = name, stage
        self._remembers = name in ("bdf2", "tr_bdf2")
        self._memory = Memory(stage.known.shape)
        self._draft = Memory(
            stage.known.shape
        )  # of a part that may still fail, which leaves that above as it was
        self._seen = np.zeros((3, *stage.known.shape))  # at the start of a part and at the end of each stage
        self._before = 0.0  # length of the part before [s], 0 where the next looks back on nothing

    @property
    def looks_back(self) -> bool:
        """Whether the next part depends on that before it."""
        return self._before > 0.0

    def drop_history(self) -> None:
        """Use nothing of earlier steps in the next."""
        self._before = 0.0

    def keep_history(self) -> None:
        """Remember the history, for `recall_history`."""
        self._kept = self._before, self._memory.change.copy(), self._memory.rate.copy()

    def recall_history(self) -> None:
        """Take back what the last part has changed in the history."""
        self._before, self._memory.change[:], self._memory.rate[:] = self._kept

    def renew(self, state: State, dt: float) -> None:
        """Factor for the next step now, if it would begin so."""
        first = self._stages(dt)[0]
        if self._stage.newton.renews(first.s):
            self._stage.read(state, self._seen[0])
            self._memory.known(self._seen[0], first, self._stage.known)
            self._stage.renew(state, first.s)

    def _stages(self, h: float) -> tuple[Stage, ...]:
        return stages(self._name, h, self._before) if self._before else (implicit_euler(h),)

    def forget(self) -> None:
        """Drop what was kept from earlier steps, so that the next depends on its state alone."""
        self.newton.forget()
        self.drop_history()

    def restarts(self) -> bool:
        """Return whether the last substep must be made again without history.

        Where the bound of strains pulls, velocities jump: implicit Euler alone makes such a substep.
        """
        if not (self._bound and self._bound.pulled):
            return False
        self.drop_history()
        return self._used_history

    def restarted(self) -> None:
        """Take notice that the last substep was made again."""
        if self._bound and self._bound.pulls:
            self.drop_history()

    def advance(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        """Advance `state` by `h` [s] while the driven frames move to `joints`, in place, or raise NewtonError."""
        if self._bound:
            self._used_history, self._bound.pulled = self.looks_back, False
        stage, memory, draft, seen = self._stage, self._memory, self._draft, self._seen
        total = NewtonReport()
        stage.read(state, seen[0])
        start, done = state.joints.copy(), 0.0
        for k, one in enumerate(planned := self._stages(h)):
            done += one.length
            last = k == len(planned) - 1
            memory.known(seen[k], one, stage.known)
            report = stage.solve(state, joints if last else start + done / h * (joints - start), one.s)
            if self.errors:
                self.errors.keep_residual(k)
            total.iterations += report.iterations
            total.factorisations += report.factorisations
            total.linear_iterations += report.linear_iterations
            total.residual = report.residual
            if self.errors and state.errors and last:
                self._carry_errors(state, h)
            if self._remembers:
                stage.read(state, seen[k + 1])
                draft.note(seen[k], stage.known, seen[k + 1], one)
                memory = draft
        if self._remembers:
            self._memory, self._draft, self._before = self._draft, self._memory, h
        return total

    def _carry_errors(self, state: State, h: float) -> None:
        """Carry the errors of the time steps over a part of `h` [s] to `state`."""
        errors, of = self.errors, state.errors
        assert errors and of
        start, end, u = self._seen[0, 1], state.velocities, self._stage.known[1]
        if errors.rests(of, start, end, h):
            return
        if not self._before:
            errors.euler(of, start, end, h, keep_rates=self._name == "tr_bdf2")
        elif self._name == "bdf2":
            errors.bdf2(of, start, end, u, h, h / self._before)
        else:
            errors.tr_bdf2(of, start, end, u, h)
