"""Steps within a bound of the stretch of springs: the inequality of `forces.strain_bound`, solved with each step.

Implicit stages have the bound among the terms that they minimise. Explicit schemes make their step without it; then
the nodes move, as little as can be, to where it holds: from x to the minimum over x' of

    1/2 |x' - x|²_M / h²  within  l(x') <= l_b,

rigid bodies as such, what is held or driven not at all; the velocities change by (x' - x) / h [GoldenthalEtAl2007]. The
forces of that are central, so the momentum stays. Of bodies that nothing holds, a rotation of all velocities,
(M r x w) r, gives back the angular momentum that moving the nodes took. Each of these is of first order: what stops at
its bound is known to a step.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.errors import StepError
from tripod_sim.forces.anchor import Anchor
from tripod_sim.forces.strain_bound import StrainBound
from tripod_sim.integrators.newton import Newton, NewtonError, NewtonReport
from tripod_sim.integrators.report import StepReport
from tripod_sim.mesh.topology import parts as connected_parts
from tripod_sim.state import State
from tripod_sim.system import System

MOST_ROUNDS = 40
"""Minimisations before a bound counts as one that cannot be met."""

SLOW = 0.3
"""Share of the error that a round may leave; where more is left K is raised."""

SETTLED = 1e-5
"""Unbalanced force at which the nodes count as moved to the bound, over their mass [m/s²]."""


class BoundedNewton(Newton):
    """Moves a state to the minimum within the bound of the system's springs: minimises and sets tensions in turn."""

    def __init__(self, system: System, bound: StrainBound, tolerance: float, max_iterations: int) -> None:
        """`bound`: a term of `system`; the others as for `Newton`."""
        super().__init__(system, tolerance, max_iterations)
        self.bound: StrainBound = bound
        self._asked, self._noise = tolerance, (0.0, 0.0)

    def forget(self) -> None:
        """Drop the tensions too."""
        super().forget()
        self.bound.relax()

    def solve(
        self, state: State, joints: FloatArray, *, keep: float | None = None, factored: bool = False
    ) -> NewtonReport:
        """Move `state` to the minimum within the bound, in place; see `Newton.solve`."""
        self._note_rounding(state)
        total, before = super().solve(state, joints, keep=keep, factored=factored), np.inf
        for _ in range(MOST_ROUNDS):
            error = self.bound.settle(state.positions)
            if error <= 1.0:
                return total
            if error > SLOW * before:
                self.bound.harden()
            self._note_rounding(state)
            before = error
            report = super().solve(state, joints, keep=keep)
            total.iterations += report.iterations
            total.factorisations += report.factorisations
            total.residual = report.residual
        i, j = self.bound.worst(state.positions)
        self.bound.relax()
        raise NewtonError(
            f"strain_limit cannot be kept by the spring between nodes {i} and {j}: fixed or moved nodes "
            "hold it longer; set a larger strain_limit, or hold fewer nodes"
        )

    def _note_rounding(self, state: State) -> None:
        self._noise = self.bound.rounding(state.positions)
        self.tolerance = max(self._asked, self._noise[0])

    def slack(self) -> float:
        """Rounding of the potential [J], that of the tensions too."""
        return super().slack() + self._noise[1]


class StrainLimited:
    """A time integrator whose steps end with no spring longer than its bound.

    Attributes:
        inner: The time integrator without that.
    """

    def __init__(
        self,
        inner: Any,
        system: Any,
        bound: StrainBound,
        mass: FloatArray,
        blocks: Sequence[IndexArray],
        max_iterations: int,
    ) -> None:
        """Prepare.

        Args:
            inner: The time integrator.
            system: Which it moves.
            bound: Of the springs; no term of `system`.
            mass: Of nodes [kg], shape (n,).
            blocks: Nodes that are connected, shapes (m, k).
            max_iterations: Of one minimisation.
        """
        self.inner, self._of, self._bound, self._mass = inner, system, bound, mass
        groups, rest = system.groups, system.start_state(np.zeros(system.groups.joints)).positions
        self._anchor = Anchor(len(rest))
        each = np.arange(len(rest))[:, None]  # nodes without springs have an entry, too
        self._system = System(rest, [], groups, [bound, self._anchor], joined=[each])
        own = np.unique(bound.elements)
        moved = own[mass[own] > 0]
        tolerance = SETTLED * float(mass[moved].min(initial=np.inf))
        self._newton = BoundedNewton(self._system, bound, tolerance, max_iterations)
        label = connected_parts(
            [*blocks, bound.elements, *(nodes[None] for nodes in groups.rigid)], len(rest)
        )
        loose = np.setdiff1d(label[own], label[groups.held().any(axis=1)])
        self._loose = [np.flatnonzero(label == part) for part in loose]
        self._keep: State | None = None
        self._moved: State | None = None

    def forget(self) -> None:
        """Drop what was kept from earlier steps."""
        self.inner.forget()
        self._newton.forget()

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance by one step, in place. Raises StepError and leaves `state`."""
        if self._keep is None:
            self._keep = state.copy()
        state.copy_to(self._keep)
        report: StepReport = self.inner.step(state, joints, dt)
        self._bound.aim(dt)
        if not self._bound.exceeded(state.positions):
            self._bound.slacken()
            return report
        try:
            done = self._pull_back(state, dt)
        except NewtonError as error:
            message = f"step {state.step} at {state.time - dt:.4g} s: {error.what}"
            self._keep.copy_to(state)
            self.forget()
            raise StepError(message, error.remedy) from error
        report.iterations += done.iterations
        report.factorisations += done.factorisations
        return report

    def _pull_back(self, state: State, h: float) -> NewtonReport:
        if self._moved is None:
            self._moved = self._system.start_state(state.joints)
        moved, v = self._moved, state.velocities
        for name in ("positions", "centres", "rotations", "joints"):
            getattr(moved, name)[:] = getattr(state, name)
        np.divide(self._mass, h * h, out=self._anchor.weight)
        self._anchor.point[:] = state.positions
        report = self._newton.solve(moved, moved.joints, keep=h)
        before = [self._spin(part, state) for part in self._loose]
        energy = self._energy(state)
        v += (moved.positions - state.positions) / h
        for name in ("positions", "centres", "rotations"):
            getattr(state, name)[:] = getattr(moved, name)
        for part, momentum in zip(self._loose, before, strict=True):
            self._turn(part, state, momentum)
        self._of.torques += self._system.torques
        if take := getattr(self.inner, "take", None):
            take(self._energy(state) - energy)
        return report

    def _energy(self, state: State) -> float:
        """Return the whole energy [J]."""
        kinetic = 0.5 * float(self._mass @ (state.velocities**2).sum(axis=1))
        return kinetic + sum(self._of.potentials(state))

    def _spin(self, part: IndexArray, state: State) -> FloatArray:
        """Return the angular momentum of nodes about the origin [N m s]."""
        momentum = self._mass[part, None] * state.velocities[part]
        return np.asarray(np.cross(state.positions[part], momentum).sum(axis=0))

    def _turn(self, part: IndexArray, state: State, momentum: FloatArray) -> None:
        """Add the rotation of the velocities of nodes after which their angular momentum is `momentum` [N m s]."""
        mass, x = self._mass[part, None], state.positions[part]
        r = x - (mass * x).sum(axis=0) / mass.sum()
        missing = momentum - self._spin(part, state)
        inertia = float((mass * r**2).sum()) * np.eye(3) - (mass * r).T @ r
        state.velocities[part] += np.cross(np.linalg.pinv(inertia, rcond=1e-9) @ missing, r)
