"""A simulation goes on as another one, of the same scene with other settings."""

import numpy as np

from tripod_sim.simulation import Simulation


def carry(before: Simulation, after: Simulation) -> None:
    """Bring `after` to where `before` is: joints, time and step go on, and so do servos and ball.

    Where both have the same nodes all of the state goes on. Else the body of `after` begins at rest with its servos
    where they are: what it moved with is lost, and its effector is where that mesh has it at rest. The ball keeps its
    place on the disc.

    Raises StepError: `after` has no equilibrium there.
    """
    state = before.state
    if same_nodes(before, after):
        copy = state.copy()
        copy.errors, copy.twin = after.state.errors, after.state.twin
        after.restore((copy, before.torques.copy()))
        return
    if not np.array_equal(after.state.joints, state.joints) or after.state.velocities.any():
        after.rest_at(before.state.joints)
    after.state.time, after.state.step = state.time, state.step
    if state.servos and after.state.servos:
        state.servos.copy_to(after.state.servos)
    if state.ball and after.state.ball:
        state.ball.copy_to(after.state.ball)
        turn = after.state.rotations[0] @ state.rotations[0].T
        ball = after.state.ball
        ball.position[:] = after.state.centres[0] + turn @ (ball.position - state.centres[0])
        ball.twist[:] = 0.0


def same_nodes(one: Simulation, other: Simulation) -> bool:
    """Return whether the states of two simulations are of the same nodes and bodies."""
    pairs = (
        (getattr(one.state, n).shape, getattr(other.state, n).shape)
        for n in ("positions", "modes", "centres")
    )
    return all(a == b for a, b in pairs) and np.array_equal(one.mesh.nodes, other.mesh.nodes)
