"""Static equilibrium among obstacles: the response of a step with contact, with a mass that is taken away.

From rest, a stage of implicit Euler of length s minimises E(x) + |x - x_0|²_M / (2 s²) among the contacts: a step down
the potential that nothing throws off, the safer the shorter. Each is longer than the one before (`DescentControl`),
until what is left to inertia, M (x - x_0) / s², is below the tolerance: then the body is in equilibrium. Frames that
servos drive go their way in increments, with equilibrium after each, so that friction, which sticks to where it was,
follows the way.
"""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.problem import DescentError
from tripod_sim.contact.stepper import ContactStepper
from tripod_sim.errors import UnsolvedError
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.scheme import Stage
from tripod_sim.integrators.static_descent import DescentControl
from tripod_sim.integrators.step_control import Increments
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.state import State


class ContactStatics(ContactStepper):
    """Moves a held body towards equilibrium among obstacles.

    Attributes:
        first: Length of the first stage of an increment [s].
        balanced: Whether the last one ended in equilibrium.
    """

    MOST = 100
    """Stages of an increment."""

    first = 0.01

    def __init__(self, world: ContactSolver, tolerance: float) -> None:
        """`world`: a body that is held, and obstacles; `tolerance`: unbalanced force [N] in equilibrium."""
        super().__init__(world)
        self._tolerance, world.problem.balance = tolerance, tolerance
        self._unbalanced, self._stages, self._way = np.inf, 0, 1.0
        self.balanced = False

    @property
    def exhausted(self) -> bool:
        """Whether no more stages of this increment are worth it."""
        return self._stages >= self.MOST

    def begin(self) -> None:
        """Begin an increment."""
        self.balanced, self._stages, self._way = False, 0, 1.0

    def advance(self, state: State, joints: FloatArray, h: float) -> StepReport:
        """Make a stage of `h` [s] with driven frames at `joints`, in place. Raises UnsolvedError."""
        self._load(state, joints, 1.0)
        self._stages += 1
        try:
            force = self.world.creep(Stage(self._way, h), self._report)
        except DescentError:
            force = np.inf
        if np.isfinite(force):
            self._way, self._unbalanced = 0.0, max(force, self.world.problem.unbalanced)
            self.balanced = self.world.solved and self._unbalanced <= self._tolerance
        if not np.isfinite(force) or (self.exhausted and not self.balanced):
            raise UnsolvedError(
                f"no equilibrium with the obstacles was found: the unbalanced force is {self._unbalanced:.3g} N, above "
                f"{self._tolerance:g} N",
                "move the obstacles or the servos in smaller steps",
            )
        return self._store(state)


def static_contact_steps(world: ContactSolver, tolerance: float, increments: Increments) -> Substeps:
    """Return what makes static steps among obstacles; arguments as of `ContactStatics` and `DescentControl`."""
    solver = ContactStatics(world, tolerance)
    return Substeps(solver, DescentControl(solver, increments))
