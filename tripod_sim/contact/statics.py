"""Static equilibrium among obstacles: the response of a step with contact, with a mass that is taken away.

From rest, a stage of implicit Euler of length s minimises E(x) + |x - x_0|²_M / (2 s²) among the contacts: a step down
the potential that nothing throws off, the safer the shorter. Each is made four times as long as the one before, until
what is left to inertia, M (x - x_0) / s², is below the tolerance: then the body is in equilibrium. One that fails is
made shorter. Frames that servos drive go their way in increments, with equilibrium after each, so that friction, which
sticks to where it was, follows the way.
"""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.problem import DescentError
from tripod_sim.contact.stepper import ContactStepper
from tripod_sim.integrators.report import ContactReport
from tripod_sim.integrators.scheme import Stage
from tripod_sim.state import State


class ContactStatics(ContactStepper):
    """Moves a held body from equilibrium to equilibrium among obstacles."""

    FIRST = 0.01
    """Length of the first stage of an increment [s]."""

    LONGER, SHORTER, MOST, FAILURES = 4.0, 16.0, 100, 20
    """Factors of that after a stage that was solved, and after one that was not; stages of an increment, and how many
    of them may fail."""

    def __init__(
        self, world: ContactSolver, tolerance: float, max_turn: float, reach: float, servos: int = 0
    ) -> None:
        """Prepare.

        Args:
            world: A body that is held, and obstacles.
            tolerance: Unbalanced force [N] at which a body is in equilibrium.
            max_turn: Largest servo move of an increment [rad].
            reach: Of an arm [m], sets the same for the slide.
            servos: Their number.
        """
        super().__init__(world)
        self._tolerance, self._max_turn, self._reach, self._servos = tolerance, max_turn, reach, servos
        self._unbalanced, world.problem.balance = np.inf, tolerance

    def _load(self, state: State, joints: FloatArray, dt: float) -> None:
        turns = np.abs(joints - state.joints)
        s = self._servos
        turn = max(float(turns[:s].max(initial=0.0)), float(turns[s]) / self._reach)
        self._increments = max(1, int(np.ceil(turn / self._max_turn)))
        super()._load(state, joints, 1.0)

    def _advance(self, dt: float) -> ContactReport:
        """Go the way of the driven frames, in equilibrium after each increment. Raises DescentError."""
        report, left, size = ContactReport(), 1.0, 1.0 / self._increments
        while left > 0.0:
            size = self._increment(min(size, left), report)
            left = left - size if left > 1.000001 * size else 0.0
        return report

    def _increment(self, size: float, report: ContactReport) -> float:
        """Go a share `size` of the way, or what of it can be solved, to equilibrium; return it."""
        world, s, ahead, failures = self.world, self.FIRST, size, 0
        for _ in range(self.MOST):
            force = world.creep(Stage(ahead, s), report)
            if np.isfinite(force):
                ahead, s = 0.0, s * self.LONGER
                self._unbalanced = max(force, world.problem.unbalanced)
                if world.solved and self._unbalanced <= self._tolerance:
                    return size
                continue
            failures, s = failures + 1, s / self.SHORTER
            if ahead:
                ahead = size = 0.5 * size
            if failures > self.FAILURES:
                break
        raise DescentError(
            f"no equilibrium with the obstacles was found: the unbalanced force is {self._unbalanced:.3g} "
            f"N, above {self._tolerance:g} N; move the obstacles or the servos in smaller steps"
        )
