"""The ball where things touch: a rigid body among the others; in a maze it plays on, whatever touches the robot."""

import numpy as np
import pytest

from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.recording import Recording

BALL = "ball={radius=0.004, mass=1e-3, position=[-0.01, 0.0, 0.0085]}"
SAME = 'rigid=[{shape="ball", radius=0.004, mass=1e-3, position=[-0.01, 0.0, 0.0085]}]'
TOUCH = "contact={contact_distance=1e-4, alarm_distance=5e-4}"
SOLID = ("tripod", "mesh.level=1", TOUCH)
FAR = 'obstacles=[{source="cube.obj", scale=0.04, position=[0.0, 0.0, -0.2]}]'


def build(source: str, *words: str) -> Simulation:
    return Simulation(load_scene(source, words))


def test_beside_contact_the_ball_is_a_rigid_body_to_the_bit_and_says_so() -> None:
    ball, rigid = build(*SOLID, "gravity={}", BALL), build(*SOLID, "gravity={}", SAME)
    for _ in range(30):
        ball.step()
        rigid.step()
    assert ball.ball
    assert ball.positions.tobytes() == rigid.positions.tobytes()
    assert ball.ball.position.tobytes() == rigid.rigid[0].position.tobytes()
    assert ball.report.contact
    assert ball.report.contact.pressed, "it lies on the silicone"
    assert any("the ball is a rigid body" in note for note in ball.notes)
    assert not any("the ball is a rigid body" in note for note in rigid.notes)
    assert ball.rigid[-1].position.tobytes() == ball.ball.position.tobytes()


def test_the_ball_touches_rigid_bodies_and_obstacles() -> None:
    """A box lies on a cube that stands still, the ball falls on the box: with its own code it would fall through."""
    words = (
        TOUCH, "dt=0.005",
        'obstacles=[{source="cube.obj", scale=0.4, position=[0.0, 0.0, 0.0]}]',
        'rigid=[{shape="box", size=[0.02, 0.02, 0.01], mass=0.01, position=[0.0, 0.0, 0.0455]}]',
        "ball={radius=0.004, mass=1e-3, position=[0.002, 0.001, 0.08]}",
    )  # fmt: skip
    simulation = build("stack", *words)
    floor = simulation.rigid[0].position[2]
    for _ in range(80):
        simulation.step()
    assert simulation.ball
    assert len(simulation.rigid) == 2
    assert simulation.ball.position[2] > floor, "it is on the box or bounces"
    assert simulation.rigid[0].position[2] > 0.0445, "and that lies on the cube"


def test_the_ball_alone_among_obstacles_needs_no_other_body() -> None:
    words = ("rigid=off", TOUCH, "ball={radius=0.01, position=[0.0, 0.0, 0.2]}")
    simulation = build("stack", *words, 'obstacles=[{source="cube.obj", scale=0.1}]')
    for _ in range(5):
        simulation.step()
    assert simulation.ball
    assert simulation.ball.position[2] < 0.2


def test_the_ball_is_dropped_again_unless_something_is_there() -> None:
    simulation = build(*SOLID, "gravity={}", BALL)
    begin = simulation.ball
    for _ in range(20):
        simulation.step()
    simulation.drop_ball()
    assert begin and simulation.ball and simulation.state.rigid
    assert simulation.ball.position.tobytes() == begin.position.tobytes()
    assert not simulation.state.rigid.velocities.any()
    simulation.step()
    assert simulation.ball.position[2] < begin.position[2]
    simulation.state.positions[:, 2] += 0.008
    with pytest.raises(
        SceneError, match="ball cannot go back to where it begins: the soft body is there now"
    ):
        simulation.drop_ball()


def test_recordings_have_its_place() -> None:
    simulation = build(*SOLID, "gravity={}", BALL)
    recording = Recording(simulation, 2)
    simulation.step()
    recording.add(simulation)
    arrays = recording.arrays()
    np.testing.assert_array_equal(arrays["ball"], arrays["rigid"][:, 0])


@pytest.mark.parametrize("still", [False, True])
def test_in_a_maze_the_ball_plays_on_as_without_contact(still: bool) -> None:
    words = ["mesh.level=1", "maze={}", "ball={}", "solver.mode=newton", "solver.tolerance=1e-9"]
    if still:
        words += ["inertia=off", "damping=off"]
    plain, touching = build("tripod", *words), build("tripod", *words, TOUCH, FAR)
    for k in range(40):
        for one in (plain, touching):
            joints = one.command
            joints[0] = -0.005 * k
            one.step(joints)
    assert plain.ball and touching.ball and touching.state.ball
    assert np.linalg.norm(touching.state.ball.velocity) > 1e-3, "it rolls"
    np.testing.assert_allclose(touching.ball.position, plain.ball.position, atol=1e-7)
    np.testing.assert_allclose(touching.compliance().w, plain.compliance().w, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("drape", "contact=off", "obstacles=off", "ball={}"), "ball needs contact where the first body is no solid"),
        ((*SOLID, BALL, FAR, "inertia=off", "damping=off"), "ball beside contact needs inertia"),
        ((*SOLID, "gravity={}", BALL.replace("0.0085", "0.003")), "passes through the soft body, .* move ball, or"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(words: tuple[str, ...], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        build(*words)
