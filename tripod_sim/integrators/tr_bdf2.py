"""TR-BDF2: the trapezoidal rule over g h, then BDF2 over the rest; g = 2 - sqrt 2 [BankEtAl1985].

Second order, one step (no history but the acceleration), and it damps what it cannot resolve. With k = g h / 2 the
first stage is

    x_g = x + k (v + v_g),   v_g = v + k (a + M^-1 f(x_g, v_g)),

the second, with p = 1 / (g (2 - g)), q = (1 - g)² p and s = (1 - g) / (2 - g) h (= k),

    x' = p x_g - q x + s v',   v' = p v_g - q v + s M^-1 f(x', v').

The acceleration a of each node at the start of a step is the one with which the step before ended; it includes the
forces of constraints, so nodes of rigid bodies need no rule of their own.
"""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.integrators.newton import NewtonReport
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.state import State

FloatArray = NDArray[np.float64]

G = 2 - np.sqrt(2)
P = 1 / (G * (2 - G))
Q = (1 - G) ** 2 * P
HALF = G / 2
"""s / h of both stages: they share one factorisation."""


class TrBdf2(Substeps):
    """The composite scheme; its first step, and the first after `forget`, is one of implicit Euler.

    That step gives the acceleration. To take it from the forces at the start would throw a crumpled body apart.
    """

    def __init__(self, stage: ImplicitStage, max_halvings: int) -> None:
        super().__init__(stage.newton, max_halvings)
        self._stage = stage
        self._rate: FloatArray | None = None
        self._start, self._end = np.zeros_like(stage.known), np.zeros_like(stage.known)

    @property
    def looks_back(self) -> bool:
        """Whether there is a part before the next."""
        return self._rate is not None

    def _drop_history(self) -> None:
        self._rate = None

    def keep_history(self) -> None:
        """Remember the history, for `recall_history`."""
        self._kept = None if self._rate is None else self._rate.copy()

    def recall_history(self) -> None:
        """Take back what the last part has changed in the history."""
        self._rate = self._kept

    def _part(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        stage, k, start = self._stage, HALF * h, self._start
        stage.read(state, start)
        if self._rate is None:
            stage.known[:] = start
            report = stage.solve(state, joints, h)
            self._rate = np.zeros_like(start)
            self._measure_rate(state, h)
            if self.errors and state.errors:
                self.errors.euler(state.errors, start[1], state.velocities, h, keep_rates=True)
            return report
        middle = state.joints + G * (joints - state.joints)
        np.multiply(self._rate, k, out=stage.known)
        stage.known += start
        first = stage.solve(state, middle, k)
        if self.errors:
            self.errors.keep_residual(0)
        stage.read(state, self._end)
        np.multiply(self._end, P, out=stage.known)
        stage.known -= Q * start
        second = stage.solve(state, joints, k)
        if self.errors and state.errors:
            self.errors.keep_residual(1)
            self.errors.tr_bdf2(state.errors, start[1], state.velocities, stage.known[1], h, float(G))
        self._measure_rate(state, k)
        return NewtonReport(
            first.iterations + second.iterations,
            first.factorisations + second.factorisations,
            second.residual,
            linear_iterations=first.linear_iterations + second.linear_iterations,
        )

    def _measure_rate(self, state: State, s: float) -> None:
        """Write the rates of x, v and g at the end of a stage."""
        assert self._rate is not None
        self._stage.read(state, self._rate)
        self._rate -= self._stage.known
        self._rate /= s
