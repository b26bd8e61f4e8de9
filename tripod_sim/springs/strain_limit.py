"""A bound on the stretch of springs: after each step the body is moved, as little as can be, to where it holds.

The positions x that a step arrived at become the minimum over x' of

    1/2 |x' - x|²_M + h²/2 sum of K max(0, l(x') - (1 - s) l_max)²,   l_max = (1 + stretch) L,

with K raised until l <= l_max everywhere; the velocities change by (x' - x) / h. Since the forces of that potential are
internal and central, the momentum stays. Of a body that nothing holds, a rotation of all velocities, (M r x w) r, gives
back the angular momentum that moving the nodes took [GoldenthalEtAl2007].

With contact a move afterwards would press bodies into each other: there a term of the potential that the step minimises
(see `contact.spring_nodes`) is, with multipliers t, the tensions [N], that are set after each minimisation to what it
asks for [NocedalWright2006, chapter 17],

    sum of max(0, t + K (l(x) - (1 - s) l_max))² / 2 K:   springs of rest length (1 - s) l_max - t / K that do not push.
"""

import numpy as np

from tripod_sim.build import Stepper
from tripod_sim.errors import StepError
from tripod_sim.integrators.substeps import StepReport
from tripod_sim.springs import implicit_kernels as kernels
from tripod_sim.springs.body import FloatArray
from tripod_sim.springs.implicit import SpringSolver
from tripod_sim.springs.spring_kernels import Links, lengths
from tripod_sim.springs.system import SpringSystem
from tripod_sim.state import State

MARGIN = 1e-4
"""s: springs that pull begin that much below the bound, so that they end below it."""

RAISES = 12
"""Of the stiffness K, tenfold each, before the step counts as failed."""


class Bound:
    """How long springs may become, and what pulls those that are longer.

    Attributes:
        links: Springs of stiffness K that are slack up to (1 - s) l_max.
    """

    def __init__(self, system: SpringSystem, stretch: float, dt: float) -> None:
        """`stretch`: largest elongation over the rest length; `dt`: time step [s]."""
        body = system.body
        self._springs, self.longest = system.links, (1 + stretch) * body.rest_length
        self._length = np.zeros(len(body.ends))
        self._first = self._stiffness = 100.0 * float(system.mass.max()) / dt**2
        self.links = self._links()

    def _links(self) -> Links:
        count = len(self.longest)
        return Links(
            self._springs.ends,
            (1 - MARGIN) * self.longest,
            np.full(count, self._stiffness),
            np.zeros(count),
            True,
        )

    def relax(self) -> None:
        """Make K what it was at first."""
        self._stiffness = self._first
        self.links = self._links()

    def harden(self) -> None:
        """Make K ten times larger; the tensions stay."""
        aimed, links = (1 - MARGIN) * self.longest, self.links
        links.rest[:] = aimed - 0.1 * (aimed - links.rest)
        self._stiffness *= 10
        links.stiffness[:] = self._stiffness

    def exceeded(self, x: FloatArray) -> bool:
        """Return whether a spring is longer than its bound at `x` [m], shape (n, 3)."""
        lengths(x, self._springs, self._length)
        return bool((self._length > self.longest).any())

    @property
    def pulls(self) -> bool:
        """Whether a spring has a tension at its bound."""
        return bool((self.links.rest < (1 - MARGIN) * self.longest).any())

    @property
    def worst(self) -> float:
        """Largest length over its bound, where `exceeded` was last asked."""
        return float((self._length / self.longest).max())

    def settle(self, x: FloatArray) -> float:
        """Set the tensions to those that `x` asks for; return by how much lengths were off, over half their margin."""
        rest = self.links.rest
        lengths(x, self._springs, self._length)
        asked = (1 - MARGIN) * self.longest - np.maximum(0.0, self._length - rest)
        off = np.abs(asked - rest) / (0.5 * MARGIN * self.longest)
        rest[:] = asked
        return float(off.max(initial=0.0))


class StrainLimited:
    """A time integrator whose steps end with no spring longer than its bound.

    Attributes:
        inner: The time integrator without that.
    """

    def __init__(
        self, system: SpringSystem, stepper: Stepper, stretch: float, options: kernels.Options, dt: float
    ) -> None:
        """Prepare.

        Args:
            system: The body.
            stepper: Its time integrator.
            stretch: Largest elongation over the rest length.
            options: Of the solver.
            dt: Time step [s].
        """
        self._system, self.inner = system, stepper
        self._bound = Bound(system, stretch, dt)
        reach = float(np.median(self._bound.longest))
        heaviest = float(system.mass.max())
        self._tolerance = 1e-5 * heaviest * reach / dt**2  # nodes to 1e-5 of a spring
        self._options = options._replace(one_solve=False, tolerance=self._tolerance)
        self._solver = SpringSolver(system, self._options, drag=0.0, rayleigh=0.0, moving=False)
        self._solver.problem = self._solver.problem._replace(
            links=self._bound.links, force=np.zeros_like(system.force), rounding=0.0
        )
        self._keep: State | None = None

    def forget(self) -> None:
        """Drop what was kept from earlier steps."""
        self.inner.forget()
        self._solver.work.kept[0] = 0.0
        self._bound.relax()

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance by one step, in place. Raises StepError and leaves `state`."""
        if self._keep is None:
            self._keep = state.copy()
        state.copy_to(self._keep)
        report = self.inner.step(state, joints, dt)
        if self._bound.exceeded(state.positions):
            try:
                self._pull_back(state, dt)
            except StepError:
                self._keep.copy_to(state)
                self.forget()
                raise
            done = self._solver.report(0)
            report.iterations += done.iterations
            report.factorisations += done.factorisations
        return report

    def _pull_back(self, state: State, h: float) -> None:
        solver, work, system = self._solver, self._solver.work, self._system
        x, v = state.positions.copy(), state.velocities
        moved, rate = state.positions.copy(), np.zeros_like(x)
        momentum = np.cross(x, system.mass[:, None] * v).sum(axis=0)
        for _ in range(RAISES):
            solver.problem = solver.problem._replace(links=self._bound.links)
            work.z[:], work.u[:], work.kept[0] = x, 0.0, 0.0
            outcome = kernels.solve_stage(
                moved, rate, h, solver.problem, solver.factor, solver.options, work, solver.counts
            )
            if outcome == kernels.SOLVED and not self._bound.exceeded(moved):
                break
            self._bound.harden()
        else:
            raise StepError(
                f"step {state.step} at {state.time:.4g} s: strain_limit cannot be met, the longest spring is at "
                f"{self._bound.worst:.4g} of its bound"
            )
        state.positions[:] = moved
        v += (moved - x) / h
        if not len(system.body.fixed):
            self._turn(state, momentum)

    def _turn(self, state: State, momentum: FloatArray) -> None:
        """Add the rotation of all velocities after which the angular momentum is `momentum` [N m s]."""
        mass = self._system.mass[:, None]
        r = state.positions - (mass * state.positions).sum(axis=0) / mass.sum()
        missing = momentum - np.cross(state.positions, mass * state.velocities).sum(axis=0)
        inertia = float((mass * r**2).sum()) * np.eye(3) - (mass * r).T @ r
        state.velocities += np.cross(np.linalg.pinv(inertia, rcond=1e-9) @ missing, r)
