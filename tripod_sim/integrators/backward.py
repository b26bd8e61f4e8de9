"""Backward differentiation: implicit Euler (first order) and BDF2 (second order), with steps of changing length.

With r = h / h_before,

    a x' - b x + c x_before = h v',   a = (1 + 2 r) / (1 + r),  b = 1 + r,  c = r² / (1 + r),

and the same for v' and M^-1 f; implicit Euler is a = b = 1, c = 0. Both damp: implicit Euler takes about w² h² / 2
of the amplitude of a mode of angular frequency w a step, BDF2 about w⁴ h⁴ / 4 [HairerWanner1996, chapter V].
"""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.integrators.newton import NewtonReport
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.state import State

FloatArray = NDArray[np.float64]


class ImplicitEuler(Substeps):
    """x' = x + h v', v' = v + h M^-1 f(x', v')."""

    def __init__(self, stage: ImplicitStage, max_halvings: int) -> None:
        super().__init__(stage.newton, max_halvings)
        self._stage = stage

    def renew(self, state: State, dt: float) -> None:
        """Factor for the next step now, if it would begin so."""
        if self._stage.newton.renews(dt):
            self._stage.read(state, self._stage.known)
            self._stage.renew(state, dt)

    def _part(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        stage = self._stage
        stage.read(state, stage.known)
        report = stage.solve(state, joints, h)
        if self.errors and state.errors:
            self.errors.euler(state.errors, stage.known[1], state.velocities, h)
        return report


class Bdf2(Substeps):
    """The two-step formula; its first step, and the first after `forget`, is one of implicit Euler."""

    def __init__(self, stage: ImplicitStage, max_halvings: int) -> None:
        super().__init__(stage.newton, max_halvings)
        self._stage = stage
        self._now, self._before = np.zeros_like(stage.known), np.zeros_like(stage.known)
        self._h_before: float | None = None

    @property
    def looks_back(self) -> bool:
        """Whether there is a part before the next."""
        return self._h_before is not None

    def _drop_history(self) -> None:
        self._h_before = None

    def keep_history(self) -> None:
        """Remember the history, for `recall_history`."""
        self._kept = self._now, self._before, self._h_before

    def recall_history(self) -> None:
        """Take back what the last part has changed in the history."""
        self._now, self._before, self._h_before = self._kept  # a step writes only what it swaps

    def renew(self, state: State, dt: float) -> None:
        """Factor for the next step now, if it would begin so."""
        s = self._length(dt)
        if self._stage.newton.renews(s):
            self._read(state, dt)
            self._stage.renew(state, s)

    def _length(self, h: float) -> float:
        """Return h / a."""
        r = h / self._h_before if self._h_before else 0.0
        return h / ((1 + 2 * r) / (1 + r))

    def _read(self, state: State, h: float) -> None:
        """Write what is known at `state` to the stage."""
        stage, now = self._stage, self._now
        stage.read(state, now)
        if self._h_before is None:
            stage.known[:] = now
        else:
            r = h / self._h_before
            a, b, c = (1 + 2 * r) / (1 + r), 1 + r, r * r / (1 + r)
            np.multiply(now, b / a, out=stage.known)
            stage.known -= (c / a) * self._before

    def _part(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        stage, now = self._stage, self._now
        self._read(state, h)
        report = stage.solve(state, joints, self._length(h))
        if self.errors and state.errors:
            if self._h_before is None:
                self.errors.euler(state.errors, now[1], state.velocities, h)
            else:
                self.errors.bdf2(
                    state.errors, now[1], state.velocities, stage.known[1], h, h / self._h_before
                )
        self._now, self._before, self._h_before = self._before, now, h
        return report
