"""A simulation goes on as another one, of the same scene with other settings."""

from collections.abc import Sequence

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.errors import StepError
from tripod_sim.simulation import Simulation
from tripod_sim.state import State
from tripod_sim.system import System

JUMP = 5e-3
"""How far disc and other rigid groups may be from where they were, another mesh at rest where one moved [m]: what is
farther off has buckled another way."""


def carry(before: Simulation, after: Simulation) -> None:
    """Bring `after` to where `before` is: joints, time and step go on, and so do servos and ball.

    Where both have the same nodes all of the state goes on. Else the body of `after`, which `settle` has brought near,
    begins at rest with its servos where they are: what it moved with is lost, and its effector is where that mesh has
    it at rest. The ball keeps its place on the disc.

    Raises StepError: `after` has no equilibrium there.
    """
    state = before.state
    if same_nodes(before, after):
        copy = state.copy()
        copy.errors, copy.twin, copy.way = after.state.errors, after.state.twin, after.state.way
        after.restore((copy, before.torques.copy()))
        return
    if not np.array_equal(after.state.joints, state.joints) or after.state.velocities.any():
        after.rest_at(_asked(after, state), time=state.time)
    after.state.time, after.state.step = state.time, state.step
    if state.servos and after.state.servos:
        state.servos.copy_to(after.state.servos)
    if state.ball and after.state.ball:
        state.ball.copy_to(after.state.ball)
        turn = after.state.rotations[0] @ state.rotations[0].T
        ball = after.state.ball
        ball.position[:] = after.state.centres[0] + turn @ (ball.position - state.centres[0])
        ball.twist[:] = 0.0


def settle(before: Simulation, state: State, after: Simulation) -> None:
    """Bring the body of `after` to rest with its servos where `state` of `before` has them, bent the same way.

    It begins with the shape that `before` has. Where that turns an element of a coarser mesh inside out, it goes there
    from its own start.

    Raises StepError: there is no equilibrium near by.
    """
    coarse, fine = before.system, after.system
    assert isinstance(coarse, System)  # others have no mesh that may change
    assert isinstance(fine, System)
    (start,) = bent_like(coarse, [state], fine, state.joints[None])
    try:
        after.rest_at(_asked(after, state), start, state.time)
    except StepError:
        after.reset()
        after.rest_at(_asked(after, state), time=state.time)
    off = np.linalg.norm(after.state.centres - state.centres, axis=1).max(initial=0.0)
    if off > JUMP:
        raise StepError(f"its body would jump by {1e3 * off:.0f} mm")


def _asked(simulation: Simulation, state: State) -> FloatArray:
    """Return the angles and the slide of a state, without how far prescribed motions are."""
    return state.joints[: len(simulation.torques) + 1]


def bent_like(coarse: System, states: Sequence[State], fine: System, joints: FloatArray) -> list[State]:
    """Return states on another mesh of the same body, bent as `states` are, with its driven frames at `joints`.

    Displacements between the nodes of `coarse` are linear; modes and velocities are zero. Nothing is in equilibrium.

    Args:
        coarse: Of `states`, whose rigid groups are those of `fine`.
        states: k of them.
        fine: Of what is returned.
        joints: Shape (k, s + 1).
    """
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator  # noqa: PLC0415 - slow, seldom needed

    places, own = coarse.rest, fine.rest
    moved = np.stack([state.positions - places for state in states], axis=1)
    found = LinearNDInterpolator(places, moved, rescale=True)(own)
    lost = ~np.isfinite(found).all(axis=(1, 2))
    found[lost] = NearestNDInterpolator(places, moved, rescale=True)(own[lost])
    placed, undeformed, bent = fine.groups.placed(own), coarse.groups.placed(places), list[State]()
    for k, state in enumerate(states):
        start = fine.undeformed(np.zeros_like(joints[k]))
        start.positions[:] = own + found[:, k]
        for b, nodes in enumerate(fine.groups.rigid):
            centre, R = placed[nodes].mean(axis=0), state.rotations[b]
            start.rotations[b] = R
            start.centres[b] = state.centres[b] + R @ (
                centre - undeformed[coarse.groups.rigid[b]].mean(axis=0)
            )
            start.positions[nodes] = start.centres[b] + (placed[nodes] - centre) @ R.T
        fine.drive(start, joints[k])
        bent.append(start)
    return bent


def same_nodes(one: Simulation, other: Simulation) -> bool:
    """Return whether the states of two simulations are of the same nodes and bodies."""
    pairs = (
        (getattr(one.state, n).shape, getattr(other.state, n).shape)
        for n in ("positions", "modes", "centres")
    )
    return all(a == b for a, b in pairs) and np.array_equal(one.mesh.nodes, other.mesh.nodes)
