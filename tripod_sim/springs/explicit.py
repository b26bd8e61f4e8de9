"""Steps of spring bodies by explicit schemes, whole or divided into as many parts as their stability asks for."""

import math

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError, StepError
from tripod_sim.forces.spring_kernels import add_forces
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.scheme import ExplicitScheme
from tripod_sim.integrators.stability import longest_part, remedy
from tripod_sim.springs import explicit_kernels as kernels
from tripod_sim.springs.frequency_bound import fastest
from tripod_sim.springs.loop import SpringLoop
from tripod_sim.state import State
from tripod_sim.system import System

MOST_PARTS = 10_000_000
"""Of one step."""


class ExplicitSprings:
    """Advances a spring body by an explicit scheme; f is the force, a = M^-1 f(x, v).

        explicit Euler        x' = x + h v,   v' = v + h a      unstable: undamped modes grow by w² h² / 2 a step
        semi-implicit Euler   v' = v + h a,   x' = x + h v'     first order, keeps the energy of long motions
        RK4                   the classical scheme, fourth order, for reference

    [HairerLubichWanner2006]

    Attributes:
        limit: Longest stable part [s].
        finer: Times as many parts as are needed that a step is divided into.
    """

    def __init__(
        self, system: System, loop: SpringLoop, scheme: ExplicitScheme, *, divide: bool, forces: bool
    ) -> None:
        """Prepare.

        Args:
            system: The sum of terms.
            loop: Its arrays.
            scheme: Which.
            divide: Whether a step is divided into stable parts; if not, instability shows.
            forces: Whether `system.gradient` is written at the end of a step.
        """
        self._system, self.loop, self._scheme, self._divide = system, loop, scheme.tableau, divide
        self.writes_forces, (omega, rate) = forces, fastest(loop)
        self.limit, self._part = scheme.longest_step(omega, rate), longest_part(scheme, omega, rate)
        self._scratch = np.zeros((8, *system.rest.shape))
        self._watch = np.zeros(5)
        self._watching, self.finer = False, 1
        self._fall = float((loop.load.force**2).sum(axis=1) @ loop.load.inverse_mass)

    def forget(self) -> None:
        """Measure the growth of energy from the next step on."""
        self._watching = False

    def parts(self, dt: float) -> int:
        """Return into how many parts a step of `dt` [s] is divided. Raises SceneError if into too many."""
        if not self._divide or not self._part < self.finer * dt:
            return 1
        count = self.finer * dt / self._part
        if not count <= MOST_PARTS:
            raise SceneError(
                f"dt is {dt:g} s: a stable step needs {count:.2g} substeps of {self._part:.2g} s (allowed: "
                f"{MOST_PARTS}); choose an implicit inertia.scheme or a smaller dt"
            )
        return math.ceil(count)

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance by one step, in place. Raises StepError and leaves `state`."""
        return self.advance(state, joints, dt, 1)

    def advance(self, state: State, joints: FloatArray, dt: float, count: int) -> StepReport:
        """Advance by `count` steps of `dt` [s] in one compiled loop, in place; the same bits as one by one.

        Raises:
            StepError: a number left the range of floating point; `state` is the last good one.
        """
        parts = self.parts(dt)
        if not self._watching:
            springs, weight = self._system.potentials(state)
            kinetic = 0.5 * float(self.loop.load.mass @ (state.velocities**2).sum(axis=1))
            self._watch[:] = kinetic + springs + weight, kinetic + springs, 2 * self._fall * dt**2, 0.0, 0.0
            self._watching = True
        outcome, done = kernels.explicit_steps(
            self._scheme, count, dt / parts, parts, state.positions, state.velocities, self.loop.origin,
            self.loop.links, self.loop.load, self._watch, self._scratch,
        )  # fmt: skip
        for _ in range(done):
            state.time += dt
        state.step += done
        if outcome == kernels.OVERFLOW:
            raise StepError(
                f"step {state.step + 1} at {state.time:.4g} s overflows: the explicit scheme is unstable at dt {dt:g} "
                f"s (limit {self.limit:.3g} s); {remedy(self.limit, divides=self._divide)}"
            )
        if self.writes_forces:
            write_gradient(self.loop, state, self._system.gradient)
        grew = int(self._watch[4])
        return StepReport(
            parts=parts * done,
            dt_limit=self.limit,
            growth=float(self._watch[3]) if grew else 0.0,
            grew_at=state.step - grew + 1 if grew else 0,
        )


def write_gradient(loop: SpringLoop, state: State, out: FloatArray) -> None:
    """Write minus the forces of springs, dampers and loads at `state` to `out` [N], shape (n, 3)."""
    out[:] = loop.load.force
    add_forces(state.positions, state.velocities, loop.links, out)
    np.negative(out, out=out)
