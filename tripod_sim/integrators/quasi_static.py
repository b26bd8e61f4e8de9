"""Quasi-static steps: each ends in equilibrium, reached by increments of load and joints that stay on the branch."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.integrator import Integrator
from tripod_sim.integrators.load_steps import LoadSteps
from tripod_sim.integrators.newton import Newton, NewtonReport
from tripod_sim.integrators.step_control import HalveOnFailure, Increments
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.state import State
from tripod_sim.system_kernels import same

SNAP, LEAST = 3.0, 0.02
"""An increment snaps if it moves a node further than `SNAP` times the linear response to the load, and than this share
of the body's largest extent. Up to a limit point equilibria move by at most twice the linear response."""


class QuasiStatic(Integrator):
    """Moves a state from equilibrium to equilibrium, and tells where one is unstable or lies beyond a snap-through."""

    newton: Newton

    def __init__(self, newton: Newton, *, watch: bool = False) -> None:
        """`newton`: finds equilibria; `watch`: whether unstable ones are reported."""
        self.newton, self._watch = newton, watch
        self._loads_help = True
        self._load = LoadSteps(newton.system, newton.tolerance)
        self._least = LEAST * float(np.ptp(newton.system.rest, axis=0).max())
        self._before = np.zeros_like(newton.system.rest)
        self._unstable: bool | None = None  # the equilibrium where the last part ended; None: there is none

    def forget(self) -> None:
        """Drop what was kept from earlier steps, so that the next depends on its state alone."""
        self.newton.forget()

    def begin(self) -> None:
        """Begin a step: increments of the load may help again."""
        self._loads_help = True

    def advance(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        """Bring `state` to equilibrium with the driven frames at `joints`, in place, or raise NewtonError."""
        if report := self._unchanged(state, joints):
            return report
        self._unstable = None
        driven = self.newton.system.moves_frames(state.joints, joints)
        self._before[:] = state.positions
        self.newton.system.command(joints)
        load = self._load.carry(state) if self._loads_help else NewtonReport()
        self._loads_help &= load.halvings <= LoadSteps.HALVINGS  # else a shorter part begins at the same load
        report = self.newton.solve(state, joints, factored=load.factorisations > 0)
        report.iterations += load.increments
        report.factorisations += load.increments
        report.increments, report.halvings = load.increments, load.halvings
        self._loads_help = True
        report.unstable = self._watch and self.newton.indefinite and not self._is_stable(state)
        self._unstable = report.unstable
        report.snapped = self._watch and not driven and self._snapped(state)
        return report

    def _unchanged(self, state: State, joints: FloatArray) -> NewtonReport | None:
        """Return the report of a part that ends where the last one did, without a tangent; None where it may not."""
        system = self.newton.system
        if self._unstable is None or not same(joints, state.joints) or not system.knows(state):
            return None
        system.evaluate(state)
        size = system.unbalanced()
        return NewtonReport(residual=size, unstable=self._unstable) if size <= self.newton.tolerance else None

    def _snapped(self, state: State) -> bool:
        """Return whether the load moved `state` to another branch of equilibria; False where lengths are commanded."""
        if self._load.response == np.inf or self.newton.system.commands_positions:
            return False
        moved = float(np.sqrt(((state.positions - self._before) ** 2).sum(axis=1).max()))
        return moved > max(SNAP * self._load.response, self._least)

    def _is_stable(self, state: State) -> bool:
        """Return whether the tangent is positive definite at `state`, as it is."""
        system = self.newton.system
        system.assemble(state, project=False)
        system.evaluate(state)
        return system.factor()


class IncrementControl(HalveOnFailure):
    """Divides a step so that no servo moves far within one increment; one that fails is halved."""

    def __init__(self, solver: QuasiStatic, max_halvings: int, increments: Increments) -> None:
        """Prepare.

        Args:
            solver: Finds the equilibria.
            max_halvings: The smallest increment is 2^-max_halvings of the largest.
            increments: The largest ones.
        """
        super().__init__(max_halvings, solver.newton.max_iterations)
        self._solver, self._increments = solver, increments

    def begin(self, state: State, move: FloatArray, dt: float) -> None:
        """Begin with the largest increment."""
        self._solver.begin()
        super().begin(state, move, dt)

    def fewest(self, move: FloatArray) -> int:
        """As `Increments.count`."""
        return self._increments.count(move)

    def halvings(self, move: FloatArray) -> int:
        """As `HalveOnFailure.halvings`; where nothing moves, all increments are the same."""
        return super().halvings(move) if move.any() else 0


def quasi_static_steps(
    newton: Newton, max_halvings: int, max_turn: float, reach: float, *, watch: bool = False
) -> Substeps:
    """Return what makes static steps; arguments as of `QuasiStatic`, `IncrementControl` and `Increments`."""
    solver = QuasiStatic(newton, watch=watch)
    increments = Increments(newton.system.turns, max_turn, reach)
    return Substeps(solver, IncrementControl(solver, max_halvings, increments))
