"""Implicit stages of springs alone: what `integrators` has for all bodies, but for a solver compiled as a whole."""

from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.reduction import Reduction
from tripod_sim.forces.anchor import Anchor
from tripod_sim.integrators.newton import Newton, NewtonError, NewtonReport
from tripod_sim.integrators.scheme import Stage
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.springs import implicit_kernels as kernels
from tripod_sim.springs.implicit import SpringSolver
from tripod_sim.springs.spring_system import SpringSystem
from tripod_sim.state import State


class StageEnd:
    """What the estimate of the error of time steps asks of a system, of springs alone at the end of a stage.

    Attributes:
        groups, unknowns, torques, reduction, lever, terms: As of a `System`.
        damped: Whether springs have dampers.
    """

    terms = ()

    def __init__(self, system: SpringSystem, solver: SpringSolver, *, keep: bool) -> None:
        """`keep`: whether a factorisation made for the estimate may serve the next stage."""
        self.damped = system.remembers > 0
        n = len(system.body.nodes)
        self.groups, self.unknowns, self.torques = system.groups, system.unknowns, system.torques
        self.reduction = Reduction([np.arange(n)[:, None]], system.groups)
        self.lever = self.reduction.lever
        self._s, self._keep, self._solver, self._fresh = 0.0, keep, solver, False
        self._free, self._scratch = system.body.free, np.zeros((5, n, 3))

    @property
    def linear(self) -> "StageEnd":
        """What solves with the Hessian at the end of the stage."""
        return self

    @property
    def residual(self) -> FloatArray:
        """Unbalanced force of free nodes [N], shape (unknowns,)."""
        return self._solver.work.g[self._free].ravel()

    def reach(self, s: float) -> None:
        """Note that a stage of `s` [s] has been solved."""
        self._s, self._fresh = s, True

    def solve(self, b: FloatArray) -> FloatArray:
        """Return H^-1 b, shape (unknowns,)."""
        solver = self._solver
        out = np.empty_like(b)
        kernels.solve_at_end(
            b, self._s, self._fresh, self._keep, solver.problem, solver.factor, solver.options, solver.work,
            self._scratch, out,
        )  # fmt: skip
        self._fresh = False
        return out

    def add_rates(self, y: FloatArray, out: FloatArray) -> None:
        """As `System.add_rates`."""
        kernels.add_rates(y, self._s, self._solver.problem, self._solver.work, out)


class SpringNewton(Newton):
    """Newton's method for springs alone: as `Newton`, a stage in one compiled call (see `implicit_kernels`).

    Attributes:
        solver: Its arguments.
        end: What the estimate of the error of the time steps asks for; None without one.
    """

    def __init__(
        self, system: SpringSystem, solver: SpringSolver, *, predict: bool, end: StageEnd | None
    ) -> None:
        """`predict`: whether stages begin where the last accelerations lead."""
        like: Any = system  # all of a `System` that is asked for here
        super().__init__(like, solver.options.tolerance, solver.options.max_iterations)
        self.solver, self.end, self._predict = solver, end, predict

    def forget(self) -> None:
        """Drop the factorisation, so that the next solve depends on its state alone."""
        self.solver.forget()

    def renews(self, keep: float) -> bool:
        """Return that there is nothing to do before a solve."""
        return False

    def keep_several(self) -> None:
        """Keep the last factorisation alone."""

    def solve_stage(self, state: State, s: float) -> NewtonReport:
        """Move `state` to the end of the stage of `s` [s], in place, velocities too. Raises NewtonError."""
        outcome = self.solver.solve(state, s, predict=self._predict)
        report = self.solver.report()
        self.spent += report.iterations
        if outcome != kernels.SOLVED:
            raise NewtonError(self.solver.why(outcome))
        if self.end:
            self.end.reach(s)
        return report


class SpringStage(ImplicitStage):
    """Implicit stages of springs alone."""

    def __init__(self, newton: SpringNewton, inertia: Anchor, mass: FloatArray, mass_damping: float) -> None:
        super().__init__(newton, inertia, mass, mass_damping)
        solver = newton.solver
        z, u, *reference = self.known
        solver.work = solver.work._replace(z=z, u=u)
        if reference:
            m = len(solver.work.reference)
            solver.work = solver.work._replace(reference=self.known[2:].reshape(-1)[:m])
        self._springs = newton

    def solve(self, state: State, joints: FloatArray, stage: Stage) -> NewtonReport:
        """As `ImplicitStage.solve`; its unknowns are velocities, so that short steps lose no digits."""
        if self._springs.end:
            self.aim(stage)
        return self._springs.solve_stage(state, stage.s)
