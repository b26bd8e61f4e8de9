"""Steps of bodies in contact."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.problem import DescentError
from tripod_sim.errors import StepError
from tripod_sim.integrators.report import ContactReport, StepReport
from tripod_sim.state import State


class ContactStepper:
    """Advances the bodies of a scene among its obstacles (see `ContactSolver`).

    Attributes:
        world: The bodies, the obstacles and their contacts.
    """

    def __init__(self, world: ContactSolver) -> None:
        self.world = world

    def forget(self) -> None:
        """Drop the contact forces of the step before."""
        self.world.forget()
        if self.world.nodes:
            self.world.nodes.forget()

    def keep_history(self) -> None:
        """Remember what the next step may look back on, for `recall_history`."""
        self.world.keep_history()

    def recall_history(self) -> None:
        """Look back on that again: what has been done since is taken back."""
        self.world.recall_history()

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance `state` by `dt` [s], in place. Raises StepError and leaves it."""
        world = self.world
        nodes, rigid, effort = world.nodes, world.rigid, world.problem.effort
        effort.iterations = effort.factorisations = 0
        try:
            self._load(state, joints, dt)
            contact = self._advance(dt)
        except DescentError as error:
            self.forget()
            raise StepError(
                f"step {state.step + 1} at {state.time:.4g} s cannot be solved, even with smaller time steps: "
                f"{error}"
            ) from error
        if not np.isfinite(world.positions_now()).all():
            self.forget()
            raise StepError(
                f"step {state.step + 1} at {state.time:.4g} s: a number is not finite; take a smaller dt, and "
                "check units and stiffness"
            )
        if nodes:
            nodes.store(state)
            if world.some_held:
                nodes.add_reactions(world.forces()[: len(nodes.base)])
        if rigid and state.rigid:
            rigid.store(state.rigid)
        state.time += dt
        state.step += 1
        return StepReport(
            iterations=effort.iterations,
            factorisations=effort.factorisations,
            parts=contact.parts,
            residual=world.problem.unbalanced,
            contact=contact,
        )

    def _load(self, state: State, joints: FloatArray, dt: float) -> None:
        """Put the bodies where `state` has them, to move within `dt` [s] with driven frames that go to `joints`."""
        if self.world.nodes:
            self.world.nodes.load(state, joints, dt)
        if self.world.rigid and state.rigid:
            self.world.rigid.load(state.rigid)
        if self.world.kinematic:
            self.world.kinematic.load(state, joints, dt)

    def _advance(self, dt: float) -> ContactReport:
        """Advance the bodies by `dt` [s]. Raises DescentError."""
        return self.world.step(dt)
