"""Steps of bodies in contact."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.errors import UnsolvedError
from tripod_sim.integrators.integrator import Integrator
from tripod_sim.integrators.report import ContactReport, StepReport
from tripod_sim.integrators.substeps import Substeps, halving
from tripod_sim.state import State

MOST_HALVINGS = 6
"""How often a substep with contact is halved at most; the shortest is truncated where something would pass through."""


class ContactStepper(Integrator):
    """Advances the bodies of a scene among its obstacles (see `ContactSolver`).

    What replaces a substep that failed is made by implicit Euler, without history: something hit in it.

    Attributes:
        world: The bodies, the obstacles and their contacts.
    """

    def __init__(self, world: ContactSolver) -> None:
        self.world = world
        self._report, self._restarts, self._rough = ContactReport(), False, -np.inf

    def forget(self) -> None:
        """Drop the contact forces of the step before."""
        self.world.forget()
        self._start_report()
        self._rough = -np.inf
        for body in self.world.bodies:
            body.forget()

    def drop_history(self) -> None:
        """Make the next substep by implicit Euler."""
        self.world.drop_history()

    def keep_history(self) -> None:
        """Remember what the next step may look back on, for `recall_history`."""
        self.world.keep_history()

    def recall_history(self) -> None:
        """Look back on that again: what has been done since is taken back."""
        self.world.recall_history()

    def restarts(self) -> bool:
        """Return whether something hit in the stages of a multistep scheme: implicit Euler makes the substep."""
        return self._restarts

    def advance(self, state: State, joints: FloatArray, h: float) -> StepReport:
        """Advance `state` by `h` [s], in place. Raises UnsolvedError; the bodies are then in between."""
        return self._advance(state, joints, h, truncates=False)

    def advance_truncated(self, state: State, joints: FloatArray, h: float) -> StepReport:
        """As `advance`; where something would pass through something else, the moves end before it."""
        return self._advance(state, joints, h, truncates=True)

    def _advance(self, state: State, joints: FloatArray, h: float, *, truncates: bool) -> StepReport:
        self._load(state, joints, h)
        end = state.time + h
        if rough := end <= self._rough + 1e-9 * h:
            self.world.drop_history()
        try:
            self._restarts = not self.world.step(h, self._report, truncates=truncates)
        except UnsolvedError:
            self.world.drop_history()
            self._rough = max(self._rough, end)
            raise
        if self._restarts:
            return StepReport()
        if rough:
            self.world.drop_history()
        return self._store(state)

    def _load(self, state: State, joints: FloatArray, h: float) -> None:
        """Put the bodies where `state` has them, to move within `h` [s] with driven frames that go to `joints`."""
        for body in self.world.bodies:
            body.load(state, joints, h)

    def _store(self, state: State) -> StepReport:
        """Write where the bodies are to `state`; return what it took, failed substeps before this one included."""
        world = self.world
        effort, report = world.problem.effort, self._report
        if not np.isfinite(world.positions_now()).all():
            raise UnsolvedError("a number is not finite", "take a smaller dt, and check units and stiffness")
        forces = world.forces() if world.some_held else None
        for body, own in zip(world.bodies, world.ranges, strict=True):
            body.store(state)
            if forces is not None:
                body.add_reactions(forces[own])
        done = StepReport(
            iterations=effort.iterations,
            factorisations=effort.factorisations,
            parts=report.parts,
            residual=world.problem.unbalanced,
            contact=report,
        )
        self._start_report()
        return done

    def _start_report(self) -> None:
        """Count the work of the next substep from nothing."""
        effort = self.world.problem.effort
        effort.iterations = effort.factorisations = 0
        self._report = ContactReport()


def contact_steps(world: ContactSolver) -> Substeps:
    """Return steps of the bodies of `world` in which substeps that fail are halved."""
    return halving(ContactStepper(world), MOST_HALVINGS)
