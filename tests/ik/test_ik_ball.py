"""The compliance with a ball lying on the robot, against finite moves of the servos and of a load."""

import numpy as np
import pytest

from tripod_host.rotations import rotation_matrix
from tripod_sim import Simulation, load_scene
from tripod_sim.ball.rest import carried
from tripod_sim.compliance import compliance
from tripod_sim.forces.gravity import GravityForce

STATIC = ["inertia=off", "damping=off", "solver.tolerance=1e-10", "mesh.level=1", "dt=0.025"]
MAZE = ("maze", [*STATIC, "maze.source=first", "maze.mass=0.02", "ball.mass=0.00125", "ball.rolling=1.0"])
HOLE = ("tripod_ball", ["mesh.level=1", "ball.mass=0.001", "damping.mass=10"])
H, FORCE = 1e-3, 1e-3


def rest(simulation, joints=None):
    """Step until the ball rests; its load in the maze follows by half of what is left each step."""
    for _ in range(300 if simulation.scene.inertia else 45):
        simulation.step(joints)


def settled(scene, overrides):
    simulation = Simulation(load_scene(scene, overrides))
    for k in range(4):
        rest(simulation)
        if k == 0:  # as before each difference: what contacts remember of the landing is forgotten
            simulation.restore(simulation.save())
    assert not simulation.ball_event
    state = simulation.state
    assert np.linalg.norm(state.ball.velocity if state.ball else state.rigid.velocities) < 1e-5
    return simulation


def turned(start, end):
    R = end @ start.T
    return np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2


def pose(simulation):
    return simulation.state.centres[0].copy(), simulation.state.rotations[0].copy(), simulation.efforts.copy()


def slope(ahead, behind, h):
    moved, spin = ahead[0] - behind[0], turned(behind[1], ahead[1])
    return np.concatenate([moved, spin]) / (2 * h), (ahead[2] - behind[2]) / (2 * h)


def by_servos(simulation):
    """Return d(effector)/d(angles), (6, 3), and d(torques)/d(angles), (3, 3), by central differences."""
    start, columns, torques = simulation.state.joints.copy(), [], []
    before = simulation.save()
    for servo in range(3):
        ends = []
        for sign in (1, -1):
            simulation.restore(before)
            rest(simulation, start + sign * H * np.eye(4)[servo])
            ends.append(pose(simulation))
        column, torque = slope(*ends, H)
        columns.append(column)
        torques.append(torque)
    simulation.restore(before)
    simulation.step()  # what presses is known of a step alone
    return np.array(columns).T, np.array(torques).T


def by_force(simulation, place, force):
    """Return the move of the effector under a dead force on the disc at `place` [m] from its centre, per newton."""
    system, before, ends = simulation._parts.system, simulation.save(), []
    disc, load = system.groups.rigid[0], system.term(GravityForce)._gradient
    arms = simulation.state.positions[disc] - simulation.state.centres[0]
    extra = carried(arms, place, force)
    for sign in (1, -1):
        simulation.restore(before)
        load[disc] -= sign * FORCE * extra
        rest(simulation)
        ends.append(pose(simulation))
        load[disc] += sign * FORCE * extra
    simulation.restore(before)
    simulation.step()  # what presses is known of a step alone
    return slope(*ends, FORCE)[0]


@pytest.fixture(scope="module", params=[MAZE, HOLE], ids=["maze", "hole"])
def lying(request):
    return settled(*request.param)


def close(predicted, found, share):
    """Positions and rotations apart: each within `share` of its largest change."""
    return all(
        np.abs(predicted[rows] - found[rows]).max() < share * np.abs(found[rows]).max()
        for rows in (slice(0, 3), slice(3, 6))
    )


def share_of(simulation):
    """Return the share within which rows are right: contacts are solved less exactly than a body at rest."""
    return 1e-4 if simulation.state.ball else 2.5e-4


def response(c):
    """Return J, K, and the effector's compliance at held angles."""
    K = np.linalg.inv(c.w[6:, 6:])
    J = c.w[:6, 6:] @ K
    return J, K, c.w[:6, :6] - J @ c.w[6:, :6]


def test_with_a_ball_at_rest_the_servo_rows_are_those_of_the_loaded_body(lying):
    """Central differences leave h² of third derivatives; without the ball's part the errors are ten times that."""
    J, K, _ = response(lying.compliance())
    slopes, stiffness = by_servos(lying)
    assert close(J, slopes, share_of(lying))
    assert np.abs(K - stiffness).max() < 5e-5 * np.abs(stiffness).max()
    bare = response(without_ball(lying))[0]
    assert not close(bare, slopes, 8e-4)


@pytest.mark.parametrize(
    ("place", "force"), [([0, 0, 0], [1.0, 0.0, 0.0]), ([0.004, 0.002, 0.001], [0.3, -0.5, 1.0])]
)
def test_with_a_ball_at_rest_the_effector_rows_are_those_of_the_loaded_body(lying, place, force):
    held = response(lying.compliance())[2]
    wrench = np.concatenate([force, np.cross(place, force)])
    moved = by_force(lying, np.array(place), np.array(force))
    assert close(held @ wrench, moved, share_of(lying))
    bare = response(without_ball(lying))[2]
    assert not close(bare @ wrench, moved, 3e-4)


def test_a_body_with_a_ball_at_rest_is_in_equilibrium(lying):
    assert np.abs(lying.compliance().equilibrium_offset).max() < 1e-8
    assert np.abs(without_ball(lying).equilibrium_offset).max() > 1e-5


def without_ball(simulation):
    """Return the compliance of the same pose as if there were no ball."""
    ball, simulation.state.ball = simulation.state.ball, None
    if not ball:
        return compliance(simulation._static.system, simulation.state)
    try:
        return simulation.compliance()
    finally:
        simulation.state.ball = ball


def test_of_a_body_with_inertia_it_is_the_same():
    """The ball's load is in the static tangent of the dynamic simulation, and asking changes no bit of it."""
    scene, overrides = MAZE
    moving = [o for o in overrides if not o.startswith(("inertia", "damping", "dt"))]
    simulation = Simulation(load_scene(scene, moving))
    for _ in range(400):
        simulation.step()
    before = simulation.state.positions.tobytes(), simulation.state.ball.numbers.tobytes()
    c = simulation.compliance()
    assert (simulation.state.positions.tobytes(), simulation.state.ball.numbers.tobytes()) == before
    still = settled(scene, overrides)
    assert np.abs(c.w - still.compliance().w).max() < 1e-3 * np.abs(c.w).max()
    assert c.position + c.equilibrium_offset[:3] == pytest.approx(still.compliance().position, abs=2e-6)


def test_what_a_rigid_body_carries_turns_with_it():
    rng = np.random.default_rng(2)
    arms, place, force = rng.standard_normal((7, 3)), rng.standard_normal(3), rng.standard_normal(3)
    forces, R = carried(arms, place, force), rotation_matrix(rng.standard_normal(3))
    assert forces.sum(axis=0) == pytest.approx(force, abs=1e-13)
    assert np.cross(arms @ R.T, forces).sum(axis=0) == pytest.approx(np.cross(R @ place, force), abs=1e-13)
