"""The implicit schemes: their steps are stages, each of which looks back on one at most (see `looking_back`)."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.looking_back import Memory, Stage, implicit_euler, stages
from tripod_sim.integrators.newton import NewtonReport
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.state import State


class ImplicitScheme(Substeps):
    """Implicit Euler, BDF2 or TR-BDF2.

    The first step of a scheme that looks back, and the first after `forget`, is one of implicit Euler. That gives the
    acceleration: to take it from the forces at the start would throw a crumpled body apart.
    """

    def __init__(self, name: str, stage: ImplicitStage, max_halvings: int) -> None:
        """Prepare.

        Args:
            name: Of the scheme: `implicit_euler`, which `auto` is with a fixed dt, `bdf2` or `tr_bdf2`.
            stage: Solves its stages.
            max_halvings: The smallest part of a step is 2^-max_halvings of it.
        """
        super().__init__(stage.newton, max_halvings)
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

    def _drop_history(self) -> None:
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

    def _part(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
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
