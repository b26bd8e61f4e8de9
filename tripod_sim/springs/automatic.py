"""Steps of spring bodies whose scheme and lengths the simulator chooses: what `dt = "auto"` asks for by default."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError, StepError
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.schemes import rk4, semi_implicit_euler
from tripod_sim.integrators.time_error import TimeErrorReport
from tripod_sim.springs import automatic_kernels as kernels
from tripod_sim.springs.explicit import MOST_PARTS, write_gradient
from tripod_sim.springs.explicit_kernels import FINE
from tripod_sim.springs.frequency_bound import fastest
from tripod_sim.springs.loop import SpringLoop
from tripod_sim.state import ErrorState, State
from tripod_sim.system import System

SHARE = 0.9
"""Of Verlet's stability limit that its longest part takes; RK4's has that margin in it."""


class AutomaticSprings:
    """Advances a spring body by explicit steps of Verlet and RK4, whichever needs fewer forces (see the kernels).

    With w the largest frequency and d the largest rate of damping the stability limit of Verlet, which takes dampers at
    the velocity that the last acceleration leads to, is 2 / (w sqrt(d² / w² + 1) + d), that of semi-implicit Euler with
    twice the damping.

    Attributes:
        forces: Evaluations of the forces that a part took in the last call, in the mean.
    """

    def __init__(
        self, system: System, loop: SpringLoop, tolerance: float, shortest: float, *, forces: bool
    ) -> None:
        """Prepare.

        Args:
            system: The sum of terms.
            loop: Its arrays.
            tolerance: Error that a part may add to the position of a node [m].
            shortest: Length of a part that is accepted whatever its error [s].
            forces: Whether `system.gradient` is written at the end of a step.
        """
        self._system, self.loop, self._tolerance, self._shortest = system, loop, tolerance, shortest
        self.writes_forces, (omega, rate) = forces, fastest(loop)
        self.forces = 0.0
        self._verlet = SHARE * semi_implicit_euler.SCHEME.longest_step(omega, 2.0 * rate)
        self._runge_kutta = rk4.SCHEME.longest_step(omega, rate)
        self._scratch = np.zeros((9, *system.rest.shape))

    @property
    def errors(self) -> "AutomaticSprings":
        """What carries the errors of the steps along."""
        return self

    def start(self, velocities: FloatArray) -> ErrorState:
        """Return what is remembered at the start: no errors, since none are carried along."""
        none = np.zeros((2, 0, 3))
        return ErrorState(none, none.copy(), np.zeros((0, 3)), none.copy())

    def forget(self) -> None:
        """Nothing is kept from earlier steps but in the state."""

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance by `dt` [s], in place. Raises StepError and leaves `state`."""
        return self.advance(state, joints, dt, 1)

    def advance(self, state: State, joints: FloatArray, dt: float, count: int) -> StepReport:
        """Advance by `count` steps of `dt` [s] in one compiled loop, in place; the same bits as one by one.

        Raises:
            SceneError: a step would take too many parts.
            StepError: a number left the range of floating point; `state` is the last good one.
        """
        remembered = state.errors
        assert remembered
        if not dt / self._runge_kutta <= MOST_PARTS:
            raise SceneError(
                f"dt is {dt:g} s: a stable step needs {dt / self._runge_kutta:.2g} substeps of "
                f"{self._runge_kutta:.2g} s (allowed: {MOST_PARTS}); set inertia.scheme = 'tr_bdf2' or a "
                "smaller dt"
            )
        outcome, done, parts, rejected, forces, worst, order, proposed = kernels.automatic_steps(
            count, dt, self._tolerance, self._shortest, self._verlet, self._runge_kutta, rk4.SCHEME.tableau,
            remembered.order, remembered.proposed, state.positions, state.velocities, self.loop.links,
            self.loop.load, self._scratch,
        )  # fmt: skip
        remembered.order, remembered.proposed = order, proposed
        self.forces = forces / max(1, parts)
        for _ in range(done):
            state.time += dt
        state.step += done
        if outcome != FINE:
            raise StepError(
                f"step {state.step + 1} at {state.time:.4g} s overflows, even with substeps of "
                f"{self._shortest:g} s; set inertia.scheme = 'tr_bdf2', which is stable at any dt"
            )
        if self.writes_forces:
            write_gradient(self.loop, state, self._system.gradient)
        report = StepReport(parts=parts, rejected=rejected, dt_limit=self._runge_kutta)
        report.time_error = TimeErrorReport(np.nan, np.nan, -1, worst)
        return report
