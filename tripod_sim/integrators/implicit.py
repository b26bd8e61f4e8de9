"""Steps of the implicit schemes: each a list of stages (see `scheme`)."""

from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.history import History
from tripod_sim.integrators.integrator import Integrator
from tripod_sim.integrators.newton import Newton, NewtonReport
from tripod_sim.integrators.scheme import ImplicitScheme
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.state import State

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.integrators.time_error import ErrorTransport


class ImplicitSteps(Integrator):
    """Advances a state by an implicit scheme.

    The first step of a multistep scheme, and the first after `forget`, is one of implicit Euler. That gives the
    acceleration: to take it from the forces at the start would throw a crumpled body apart.
    """

    newton: Newton

    def __init__(self, scheme: ImplicitScheme, stage: ImplicitStage) -> None:
        """Prepare.

        Args:
            scheme: Gives the stages.
            stage: Solves them.
        """
        self.newton = stage.newton
        self.errors: ErrorTransport | None = None
        self._bound, self._used_history = stage.newton.bound, False
        self._scheme, self._stage = scheme, stage
        shape, velocities = stage.known.shape, slice(1, 2)
        self._history = History(shape, velocities)
        self._draft = History(
            shape, velocities
        )  # of a part that may still fail, which leaves that above as it was
        most = len(scheme.stages(1.0, 1.0))
        self._seen = np.zeros((1 + most, *shape))  # at the start of a part and at the end of each stage
        self._before = 0.0  # length of the part before [s], 0 where the next uses nothing of it

    @property
    def looks_back(self) -> bool:
        """Whether the next part depends on that before it."""
        return self._before > 0.0

    def drop_history(self) -> None:
        """Use nothing of earlier steps in the next."""
        self._before = 0.0

    def keep_history(self) -> None:
        """Remember the history, for `recall_history`."""
        self._kept = self._before, [a.copy() for a in self._history.arrays()]

    def recall_history(self) -> None:
        """Take back what the last part has changed in the history."""
        self._before, kept = self._kept
        for array, before in zip(self._history.arrays(), kept, strict=True):
            array[:] = before

    def renew(self, state: State, dt: float) -> None:
        """Factor for the next step now, if it would begin so."""
        first = self._scheme.stages(dt, self._before)[0]
        if self._stage.newton.renews(first.key):
            self._stage.read(state, self._seen[0])
            self._history.known(self._seen[0], first, self._stage.known)
            self._stage.renew(state, first)

    def forget(self) -> None:
        """Drop what was kept from earlier steps, so that the next depends on its state alone."""
        self._stage.forget()
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
        stage, history, draft, seen = self._stage, self._history, self._draft, self._seen
        total = NewtonReport()
        stage.read(state, seen[0])
        start, done = state.joints.copy(), 0.0
        for k, one in enumerate(planned := self._scheme.stages(h, self._before)):
            done += one.length
            last = k == len(planned) - 1
            history.known(seen[k], one, stage.known)
            report = stage.solve(state, joints if last else start + done / h * (joints - start), one)
            if self.errors:
                self.errors.keep_residual(k)
            total.iterations += report.iterations
            total.factorisations += report.factorisations
            total.linear_iterations += report.linear_iterations
            total.residual = report.residual
            if self.errors and state.errors and last:
                if not (
                    self.newton.serves or one.curves
                ):  # the factorisation lags behind the end of the step
                    self.newton.factor_at(state)
                self.errors.carry(state.errors, planned, seen[0, 1], state.velocities, stage.known[1], h)
            if self._scheme.is_multistep:
                stage.read(state, seen[k + 1])
                draft.follow(history, one)
                draft.note(seen[k], stage.known, seen[k + 1], one)
                history = draft
        if self._scheme.is_multistep:
            self._history, self._draft, self._before = self._draft, self._history, h
        return total
