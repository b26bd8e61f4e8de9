"""The ball outside of a maze: a rigid body among the others, and the bodies of servos; in a maze it plays on."""

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tests.sim.implicit_schemes import IMPLICIT
from tripod_sim import SceneError, Simulation, load_scene
from tripod_study.recording import Recording

BALL = "ball={radius=0.004, mass=1e-3, position=[-0.01, 0.0, 0.0085]}"
SAME = 'rigid=[{shape="ball", radius=0.004, mass=1e-3, position=[-0.01, 0.0, 0.0085]}]'
TOUCH = "contact={contact_distance=1e-4, alarm_distance=5e-4}"
SOLID = ("tripod", "mesh.level=1", TOUCH)
FAR = 'obstacles=[{source="cube.obj", scale=0.04, position=[0.0, 0.0, -0.2]}]'


def build(source: str, *words: str) -> Simulation:
    return Simulation(load_scene(source, words))


@pytest.mark.parametrize("beside", [TOUCH, "contact=off"])
def test_the_ball_is_a_rigid_body_to_the_bit(beside: str) -> None:
    touch = TOUCH
    if beside != TOUCH:
        touch = "contact={contact_distance=2.5e-4, alarm_distance=7.5e-4, restitution=0.4, rest_speed=0.01}"
    ball = build("tripod", "mesh.level=1", beside, BALL)
    rigid = build("tripod", "mesh.level=1", touch, SAME)
    for _ in range(30):
        ball.step()
        rigid.step()
    assert ball.ball
    assert ball.positions.tobytes() == rigid.positions.tobytes()
    assert ball.ball.position.tobytes() == rigid.rigid[0].position.tobytes()
    assert ball.report.contact
    assert ball.report.contact.pressed, "it lies on the silicone"
    assert ball.rigid[-1].position.tobytes() == ball.ball.position.tobytes()


def test_the_ball_touches_rigid_bodies_and_obstacles() -> None:
    """A box lies on a cube that stands still, the ball falls on the box."""
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
    assert begin and simulation.ball
    assert simulation.ball.position.tobytes() == begin.position.tobytes()
    assert not simulation.state.rigid.velocities.any()
    simulation.step()
    assert simulation.ball.position[2] < begin.position[2]
    simulation.state.positions[:, 2] += 0.008
    with raises_naming(SceneError, "ball", "soft body"):
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
    ("words", "named"),
    [
        (
            (*SOLID, BALL, FAR, "inertia=off", "damping=off"),
            ("ball needs inertia", "[inertia]", "[[obstacles]]"),
        ),
        (("tripod", BALL, "inertia=off", "damping=off"), ("ball needs inertia", "[inertia]")),
        (
            ("tripod", BALL, "inertia.scheme=rk4"),
            ("inertia.scheme is 'rk4'", "contact or a ball", "implicit_euler", "bdf2", "tr_bdf2"),
        ),
        ((*SOLID, "gravity={}", BALL.replace("0.0085", "0.003")), ("ball", "the soft body", "move ball")),
        (
            (*SOLID, BALL.replace("-0.01, 0.0, 0.0085", "0.06, 0, -0.03")),
            ("ball.position", "0.06, 0.0, -0.03", "servo_0", "contact.start = 'lift'"),
        ),
        (("tripod", BALL, "ball.rolling=0.1"), ("ball.rolling is 0.1", "a maze", "leave it out")),
        (("tripod", BALL, "ball.substep=1e-3"), ("ball.substep is 0.001", "a maze", "leave it out")),
        ((*SOLID, BALL, "ball.friction=0.5"), ("ball.friction is 0.5", "contact.friction")),
    ],
)
def test_what_cannot_be_is_refused(words: tuple[str, ...], named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named):
        build(*words)


def in_the_hole(*words: str) -> Simulation:
    """Return the ball of `tripod_ball` after a second."""
    simulation = build("tripod_ball", "mesh.level=1", *words)
    for _ in range(200):
        simulation.step()
    return simulation


@pytest.mark.parametrize("mass", [5e-4, 8e-3])
def test_the_ball_lies_in_the_hole_and_is_borne_light_or_heavy(mass: float) -> None:
    """The rim is a polygon of radius R = 5 mm: the centre stands sqrt((r + d)² - R²) above it; 8 g: a quarter of the
    silicone.
    """
    simulation = in_the_hole(f"ball.mass={mass}")
    assert simulation.ball and simulation.effector and simulation.scene.material
    assert mass < 8e-3 or mass == simulation.scene.material.mass / 4
    assert np.abs(simulation.ball.position[:2]).max() < 1e-6
    low, high = (np.sqrt(0.0085**2 - (0.005 * f) ** 2) + 0.0025 for f in (1.0, np.cos(np.pi / 6)))
    assert low - 1e-5 < simulation.ball.position[2] - simulation.effector.position[2] < high + 1e-5
    falls = simulation.state.rigid.velocities[0, 2]
    simulation.step()
    borne = simulation._world.forces()[simulation._world.owners()[1] == 0].sum(axis=0)
    gained = mass * (simulation.state.rigid.velocities[0, 2] - falls) / simulation.scene.dt
    assert np.abs(borne[:2]).max() < 1e-3 * mass * 9.81
    assert borne[2] == pytest.approx(mass * 9.81 + gained, rel=1e-6)
    assert borne[2] == pytest.approx(mass * 9.81, rel=0.01)


def test_tilted_it_falls_off_which_is_told_until_it_is_dropped_again() -> None:
    simulation = in_the_hole()
    joints = simulation.command
    assert simulation.ball_event == ""
    for k in range(200):
        joints[:3] = np.array([-0.5, 0.6, 0.6]) * min(k / 80, 1)
        simulation.step(joints)
        if simulation.ball_event:
            break
    assert_names(simulation.ball_event, "ball lost", "0.1 m")
    assert simulation.ball and simulation.ball.position[2] == pytest.approx(
        simulation.state.positions[:, 2].min() - 0.1, abs=0.02
    )
    simulation.drop_ball()
    assert simulation.ball_event == ""


def test_on_an_obstacle_far_below_it_is_not_lost() -> None:
    words = (SOLID[1], TOUCH, "ball={radius=0.004, position=[0.03, 0.03, -0.18]}")
    simulation = build("tripod", *words, FAR.replace("0.04", "0.5").replace("-0.2", "-0.235"))
    for _ in range(30):
        simulation.step()
    assert simulation.ball
    assert simulation.ball.position[2] < simulation.state.positions[:, 2].min() - 0.1
    assert simulation.report.contact and simulation.report.contact.pressed
    assert simulation.ball_event == ""


TOP = -0.02885
"""Height of the tops of the servos [m]."""


def test_a_servo_s_top_stops_the_ball_and_its_side_pushes_it() -> None:
    """On the top at azimuth 0 it stays; on a plate beside the body, 5.9 mm thick, that takes it along inward."""
    ball = "ball={radius=0.004, mass=1e-3, position=[0.06, 0.0, -0.015], restitution=0}"
    simulation = build("tripod", "mesh.level=1", ball)
    for _ in range(100):
        simulation.step()
    assert simulation.ball
    assert simulation.ball.position == pytest.approx([0.06, 0.0, TOP + 0.004 + 0.00025], abs=1e-6)
    floor = 'obstacles=[{source="cube.obj", scale=0.5, position=[0.0, 0.0, -0.0954]}]'  # its top at -45.4 mm
    ball = "ball={radius=0.004, mass=1e-3, position=[0.048, 0.0, -0.0411]}"
    simulation = build("tripod", "mesh.level=1", TOUCH, ball, floor, "contact.friction=0")
    for k in range(100):
        joints = simulation.command
        joints[-1] = 0.03 * min(k / 99, 1)
        simulation.step(joints)
    assert simulation.ball
    x, y, z = simulation.ball.position
    assert (y, z) == pytest.approx((0.0, -0.0413), abs=1e-5)
    assert x == pytest.approx(0.06 - 0.03 - 0.0059 - 0.004 - 1e-4, abs=1e-5)


@pytest.mark.parametrize("scheme", IMPLICIT)
def test_what_lies_on_a_servo_s_top_rides_along_and_what_it_holds_passes_it(scheme: str) -> None:
    box = "rigid=[{size=[0.008, 0.008, 0.004], mass=1e-3, position=[0.06, 0.0, -0.02673]}]"
    words = ("mesh.level=1", f"inertia.scheme={scheme}", TOUCH)
    simulation = build("tripod", *words, box)
    start = simulation.rigid[0].position
    for k in range(150):
        joints = simulation.command
        joints[-1] = 0.01 * (1 - np.cos(np.pi * min(k / 100, 1)))
        simulation.step(joints)
    assert simulation.rigid[0].position - start == pytest.approx([-0.02, 0.0, -2e-5], abs=3e-5)
    hubs = [f"{{set='end_{k}', hub=[{x}, {y}, -0.0027], axis=[{a}, {b}, 0.0]}}" for k, x, y, a, b in (
        (0, 0.03, 0.0, 0.0, -1.0), (1, -0.015, 0.026, 0.866, 0.5), (2, -0.015, -0.026, -0.866, 0.5),
    )]  # fmt: skip
    ends = [f"{{name='end_{k}', along=[{x}, {y}, 0.0], beyond=0.045}}" for k, x, y in (
        (0, 1.0, 0.0), (1, -0.5, 0.866), (2, -0.5, -0.866),
    )]  # fmt: skip
    words = (*words, f"set=[{', '.join(ends)}]", f"servo=[{', '.join(hubs)}]")
    simulation = build("tripod", *words, box.replace("-0.02673", "-0.2"), "clamp=off")
    for _ in range(5):
        simulation.step()
    assert simulation.report.contact
    assert simulation.report.contact.contacts == 0
