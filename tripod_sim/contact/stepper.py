"""Steps of a spring body in contact, by implicit Euler."""

import numpy as np

from tripod_sim.contact.problem import DescentError
from tripod_sim.contact.world import World
from tripod_sim.errors import StepError
from tripod_sim.integrators.substeps import StepReport
from tripod_sim.mesh.solid_mesh import FloatArray
from tripod_sim.state import State


class ContactStepper:
    """Advances a spring body among obstacles (see `World`).

    Attributes:
        world: The body, the obstacles and their contacts.
    """

    def __init__(self, world: World) -> None:
        assert world.nodes
        self.world, self._nodes = world, world.nodes

    def forget(self) -> None:
        """Drop the contact forces of the step before."""
        self.world.forget()

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance `state` by `dt` [s], in place. Raises StepError and leaves it."""
        nodes, effort = self._nodes, self.world.problem.effort
        nodes.x[:], nodes.v[:] = state.positions, state.velocities
        effort.iterations = effort.factorisations = effort.linear_iterations = 0
        try:
            contact = self.world.step(dt)
        except DescentError as error:
            self.forget()
            raise StepError(
                f"step {state.step + 1} at {state.time:.4g} s cannot be saved, even in parts: {error}"
            ) from error
        if not (np.isfinite(nodes.x).all() and np.isfinite(nodes.v).all()):
            self.forget()
            raise StepError(f"step {state.step + 1} at {state.time:.4g} s: a number is not finite")
        state.positions[:], state.velocities[:] = nodes.x, nodes.v
        state.time += dt
        state.step += 1
        return StepReport(
            iterations=effort.iterations,
            factorisations=effort.factorisations,
            linear_iterations=effort.linear_iterations,
            parts=contact.parts,
            residual=self.world.problem.unbalanced,
            contact=contact,
        )
