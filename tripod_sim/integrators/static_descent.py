"""Static equilibrium of bodies whose shape may have no stiffness of its own, such as hanging cloths and chains.

They go there by substeps of implicit Euler from rest, each four times as long as the one before (pseudo-transient
continuation): a descent of the potential that directions without stiffness cannot throw off, and that ends as Newton's
method [NocedalWright2006].
"""

import math
from typing import Protocol

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.forces.anchor import Anchor
from tripod_sim.integrators.integrator import Integrator
from tripod_sim.integrators.newton import Newton, NewtonError, NewtonReport
from tripod_sim.integrators.step_control import Increments, StepControl, Substep, Work
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.state import State
from tripod_sim.system_kernels import same

MOST_SUBSTEPS, MOST_FAILURES = 200, 20
"""Substeps, and failed ones, after which no equilibrium counts as found."""

LONGER, SHORTER = 4.0, 16.0
"""Ratio of a substep's length to the one before it, and of a failed one's length to that of the next."""


class StaticDescent(Integrator):
    """Moves a state towards equilibrium by a step of implicit Euler from rest.

    Attributes:
        newton: Solves the step.
        first: Length of the first substep [s].
        balanced: Whether the last one ended in equilibrium.
    """

    newton: Newton

    def __init__(self, newton: Newton, mass: FloatArray) -> None:
        """`mass`: of nodes [kg], shape (n,), positive of free ones. Adds the inertia of the steps to the system."""
        self.newton, system = newton, newton.system
        self._mass, self._anchor = mass, Anchor(len(mass))
        system.take(self._anchor)
        system.elastic.limit()
        stiffest = system.elastic.largest_stiffness()
        self.first = float(np.sqrt(mass.max() / stiffest)) if stiffest > 0 else 1.0
        self.balanced, self._substeps = False, 0

    def forget(self) -> None:
        """Drop the factorisation."""
        self.newton.forget()

    @property
    def exhausted(self) -> bool:
        """Whether no more substeps of this increment are worth it."""
        return self._substeps >= MOST_SUBSTEPS

    def begin(self) -> None:
        """Begin an increment."""
        self.balanced, self._substeps = False, 0

    def advance(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        """Make a substep of `h` [s] with driven nodes at `joints`, in place. Raises NewtonError."""
        system, anchor = self.newton.system, self._anchor
        if rests := self._rests(state, joints):
            return rests
        np.divide(self._mass, h * h, out=anchor.weight)
        anchor.point[:] = state.positions
        try:
            report = self.newton.solve(state, joints)
        finally:
            anchor.weight[:] = 0.0
        system.evaluate(state)
        report.residual = system.unbalanced()
        self.balanced = report.residual <= self.newton.tolerance + system.rounding(state)
        self._substeps += 1
        if self.exhausted and not self.balanced:
            raise NewtonError(
                f"after {self._substeps} increments the unbalanced force is {report.residual:.3g} N, above "
                f"{self.newton.tolerance:g} N",
                "apply the load in smaller steps, or add [inertia]",
            )
        return report

    def _rests(self, state: State, joints: FloatArray) -> NewtonReport | None:
        """Return the report of a substep that finds the state in equilibrium; None where it is not."""
        system = self.newton.system
        if not same(joints, state.joints) or not math.isfinite(system.evaluate(state)):
            return None
        residual = system.unbalanced()
        self.balanced = residual <= self.newton.tolerance + system.rounding(state)
        return NewtonReport(residual=residual) if self.balanced else None


class Descent(Protocol):
    """What `DescentControl` asks of an integrator whose substeps lead to equilibrium."""

    @property
    def first(self) -> float:
        """Length of the first substep of an increment [s]."""

    @property
    def balanced(self) -> bool:
        """Whether the last one ended in equilibrium."""

    @property
    def exhausted(self) -> bool:
        """Whether no more substeps of this increment are worth it."""

    def begin(self) -> None:
        """Begin an increment."""


class DescentControl(StepControl):
    """Substeps become longer until one ends in equilibrium; one that fails is made again, much shorter.

    Driven nodes go their way in increments, each to equilibrium, in its first substep. Where that fails the increment,
    and those after it, are halved, too.
    """

    def __init__(self, solver: Descent, increments: Increments | None = None) -> None:
        """`solver`: makes the substeps; `increments`: the largest ones, None for the whole step."""
        self._solver, self._increments = solver, increments

    def begin(self, state: State, move: FloatArray, dt: float) -> None:
        """Begin with the first length."""
        self._size = 1.0 / self._increments.count(move) if self._increments else 1.0
        self._done, self._moves = 0.0, bool(move.any())
        self._begin_increment()

    def _begin_increment(self) -> None:
        self._solver.begin()
        self._end = 1.0 if self._done + self._size > 1.0 - 1e-6 else self._done + self._size
        self._length, self._failures, self._moved = self._solver.first, 0, False

    def propose(self) -> Substep | None:
        """Return the next substep, in which driven nodes are at the end of the increment; None in equilibrium."""
        if self._solver.balanced:
            self._done = self._end
            if self._done >= 1.0:
                return None
            self._begin_increment()
        return Substep(self._end, self._length, self._end - self._done)

    def shorten(self, spent: int) -> bool:
        """Choose a much shorter substep; return False after many."""
        self._length /= SHORTER
        self._failures += 1
        if self._moves and not self._moved:
            self._size *= 0.5
            self._end = self._done + 0.5 * (self._end - self._done)
        return self._failures <= MOST_FAILURES and not self._solver.exhausted

    def accepts(self, state: State, work: Work) -> bool:
        """Accept, and choose a longer one."""
        self._length *= LONGER
        self._moved = True
        return True


def descent_steps(newton: Newton, mass: FloatArray) -> Substeps:
    """Return what makes static steps of bodies without stiffness of shape; arguments as of `StaticDescent`."""
    solver = StaticDescent(newton, mass)
    return Substeps(solver, DescentControl(solver))
