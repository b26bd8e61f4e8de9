"""Quasi-static steps: each ends in equilibrium, reached by increments of load and joints that stay on the branch."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.load_steps import LoadSteps
from tripod_sim.integrators.newton import Newton, NewtonReport
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.state import State
from tripod_sim.system_kernels import same


class QuasiStatic(Substeps):
    """Moves a state from equilibrium to equilibrium, and tells where one is unstable."""

    def __init__(
        self, newton: Newton, max_halvings: int, max_turn: float, reach: float, *, watch: bool = False
    ) -> None:
        """Prepare.

        Args:
            newton: Finds equilibria.
            max_halvings: The smallest part of a step is 2^-max_halvings of the largest.
            max_turn: Largest servo move of an increment [rad].
            reach: Of an arm [m], sets the same for the slide.
            watch: Whether unstable equilibria are told.
        """
        super().__init__(newton, max_halvings)
        self._watch = watch
        self._max_turn, self._reach = max_turn, reach
        self._loads_help = True
        self._load = LoadSteps(newton.system, newton.tolerance)
        self._unstable: bool | None = None  # the equilibrium where the last part ended; None: there is none

    def _largest_part(self, move: FloatArray) -> float:
        s = len(self.newton.system.groups.driven)
        turn = max(float(np.abs(move[:s]).max(initial=0.0)), abs(float(move[s])) / self._reach)
        return 1.0 / max(1, int(np.ceil(turn / self._max_turn)))

    def _smallest_part(self, move: FloatArray) -> float:
        """As `Substeps._smallest_part`; where nothing moves, all parts are the same."""
        return super()._smallest_part(move) if move.any() else self._largest_part(move)

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """As `Substeps.step`."""
        self._loads_help = True
        return super().step(state, joints, dt)

    def _part(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        if report := self._unchanged(state, joints):
            return report
        self._unstable = None
        load = self._load.carry(state) if self._loads_help else NewtonReport()
        self._loads_help &= load.halvings <= LoadSteps.HALVINGS  # else a shorter part begins at the same load
        report = self.newton.solve(state, joints, factored=load.factorisations > 0)
        report.iterations += load.increments
        report.factorisations += load.increments
        report.increments, report.halvings = load.increments, load.halvings
        self._loads_help = True
        report.unstable = self._watch and self.newton.indefinite and not self._is_stable(state)
        self._unstable = report.unstable
        return report

    def _unchanged(self, state: State, joints: FloatArray) -> NewtonReport | None:
        """Return the report of a part that ends where the last one did, without a tangent; None where it may not."""
        system = self.newton.system
        if self._unstable is None or not same(joints, state.joints) or not system.knows(state):
            return None
        system.evaluate(state)
        size = system.unbalanced()
        return NewtonReport(residual=size, unstable=self._unstable) if size <= self.newton.tolerance else None

    def _is_stable(self, state: State) -> bool:
        """Return whether the tangent is positive definite at `state`, as it is."""
        system = self.newton.system
        system.assemble(state, project=False)
        system.evaluate(state)
        return system.factor()
