"""Rigid bodies in contact: Coulomb's law on an incline, bounces, a stack, and nothing that passes through."""

from itertools import product

import numpy as np
import pytest

from tests.sim.contact_bodies import G, ball_on, box, boxes_on_plate, plate, step
from tests.sim.implicit_schemes import IMPLICIT, scheme_of
from tests.tiers import sampled
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.response import Law
from tripod_sim.contact.rigid_bodies import RigidBodies
from tripod_sim.integrators.scheme import euler_stage
from tripod_sim.mesh.surfaces import Part

MODES = ["lagrange", "penalty"]


def slide(
    response: str, angle: float, friction: float, steps: int = 60, dt: float = 0.01
) -> tuple[float, ContactSolver]:
    """Mean acceleration down an incline, over the second half."""
    gravity = np.array([G * np.sin(angle), 0, -G * np.cos(angle)])
    world = boxes_on_plate(Law(response, friction, tolerance=1e-4), [[0, 0, 0.051]], gravity)
    speeds = []
    for _ in range(steps):
        step(world, dt)
        assert world.rigid
        speeds.append(float(world.rigid.velocity[0, 0]))
    return (speeds[-1] - speeds[steps // 2]) / ((steps - 1 - steps // 2) * dt), world


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("friction", [0.1, 0.3, 0.6])
def test_block_sticks_below_and_slides_above_the_angle_of_friction(response: str, friction: float) -> None:
    critical = np.arctan(friction)
    stuck, world = slide(response, 0.99 * critical, friction, steps=250)  # it slips while the load builds up
    assert world.rigid
    assert abs(stuck) < 1e-6
    assert np.abs(world.rigid.velocity).max() < 1e-4
    angle = 1.01 * critical
    down = G * (np.sin(angle) - friction * np.cos(angle))
    assert slide(response, angle, friction)[0] == pytest.approx(down, rel=0.02)
    assert down > 0.005


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize(("angle", "friction"), [(0.2, 0.0), (0.4, 0.3), (0.5, 0.1)])
def test_block_slides_with_the_right_acceleration(response: str, angle: float, friction: float) -> None:
    down = G * (np.sin(angle) - friction * np.cos(angle))
    found, world = slide(response, angle, friction)
    assert found == pytest.approx(down, rel=0.01)
    assert world.rigid
    assert abs(world.rigid.velocity[0, 1]) < 0.01 * world.rigid.velocity[0, 0]


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.8, 1.0])
def test_ball_bounces_as_high_as_the_restitution_says(response: str, restitution: float) -> None:
    dt, height, distance = 5e-4, 0.1, 1e-4
    world = ball_on(plate(), Law(response, 0.3, restitution, distance=distance), [0.3, 0.1, 0.05 + height])
    heights = []
    for _ in range(800):
        step(world, dt)
        assert world.rigid
        heights.append(float(world.rigid.centre[0, 2]) - 0.05)
    assert min(heights) > 0
    hit = int(np.argmin(heights[:400]))
    expected = restitution**2 * height
    assert max(heights[hit:]) == pytest.approx(expected, rel=0.03, abs=2 * distance)
    speed = np.sqrt(2 * G * height)
    assert 3 * G * dt / speed < 0.03  # what one step of gravity more or less makes


@pytest.mark.parametrize("response", MODES)
def test_ball_does_not_bounce_for_ever(response: str) -> None:
    world = ball_on(plate(), Law(response, 0.3, 0.8, rest_speed=0.05, distance=1e-3), [0, 0, 0.1])
    for _ in range(600):
        step(world, 0.01)
    assert world.rigid
    assert np.abs(world.rigid.velocity).max() < 1e-6
    assert 0.05 < world.rigid.centre[0, 2] < 0.0511


@pytest.mark.parametrize("h", [1e-4, 1e-3, 1e-2])
def test_what_has_sunk_in_comes_out_slowly_however_short_the_step(h: float) -> None:
    """Else half of the contact distance in 0.1 ms would be 5 m/s."""
    world = ball_on(plate(), Law(distance=1e-3), [0.0, 0.0, 0.0505])
    highest, fastest = 0.0, 0.0
    for _ in range(round(0.05 / h)):
        step(world, h)
        assert world.rigid
        highest = max(highest, float(world.rigid.centre[0, 2]))
        fastest = max(fastest, float(world.rigid.velocity[0, 2]))
    assert 0 < fastest <= 0.0501
    assert highest < 0.0512
    assert world.rigid.centre[0, 2] == pytest.approx(0.051, abs=2e-4)


@pytest.mark.parametrize("response", MODES)
def test_stack_of_three_rests(response: str) -> None:
    centres = [[0.002 * k, 0.001 * k, 0.051 + 0.101 * k] for k in range(3)]
    world = boxes_on_plate(Law(response, 0.4, tolerance=1e-4), centres, np.array([0, 0, -G]))
    for _ in range(200):
        report = step(world, 0.01)
    assert world.rigid
    kinetic = 0.5 * 0.3 * (world.rigid.velocity**2).sum() + 0.5 * 0.3 * 0.01 / 6 * (world.rigid.spin**2).sum()
    assert kinetic < 1e-8
    np.testing.assert_allclose(world.rigid.centre, centres, atol=2e-3)
    assert report.smallest_gap > -1e-3
    assert report.force == pytest.approx(
        0.3 * G * (3 + 2 + 1), rel=1e-3
    )  # each interface carries what is above


def heavy_on_light(law: Law, ratio: float, scheme: str = "implicit_euler") -> ContactSolver:
    """Return a cube of 1000 kg that lies on one that is lighter by `ratio`, on the plate."""
    masses = np.array([1000.0 / ratio, 1000.0])
    inertia = masses[:, None, None] * 0.01 / 6 * np.eye(3)
    bodies = RigidBodies(masses, inertia, np.array([[0, 0, 0.051], [0, 0, 0.152]]), np.array([0, 0, -G]))
    parts = [box([0.1, 0.1, 0.1]) for _ in masses]
    return ContactSolver(law, 3 * law.distance, scheme_of(scheme), obstacles=[plate()], rigid=(bodies, parts))


@pytest.mark.parametrize(
    ("ratio", "tolerance", "scheme"),
    sampled(
        product([1e2, 1e4, 1e5, 1e6], [1e-3, 1e-5, 1e-7], IMPLICIT),
        (1e4, 1e-3, "implicit_euler"),
        (1e4, 1e-3, "tr_bdf2"),
        (1e6, 1e-7, "implicit_euler"),
    ),
)
def test_a_heavy_cube_rests_on_a_light_one(ratio: float, tolerance: float, scheme: str) -> None:
    """What trembles goes no further within a stage than gaps may err; weights are carried, each by what is below."""
    world, h = heavy_on_light(Law(friction=0.3, tolerance=tolerance), ratio, scheme), 5e-3
    assert world.rigid
    gap, weight = tolerance * world.law.distance, 1000.0 * G
    for _ in range(100):
        report = step(world, h)
        assert report.residual <= gap
        assert np.abs(world.rigid.velocity).max() < 10 * gap / h
    np.testing.assert_allclose(world.rigid.centre, [[0, 0, 0.051], [0, 0, 0.152]], atol=20 * gap)
    assert np.abs(world.rigid.spin).max() < 10 * gap / h / 0.05
    # a tremble of one gap a step on top of the weight, at both interfaces
    assert report.force == pytest.approx((2 + 1 / ratio) * weight, abs=20 * 1000 * gap / h**2)


@pytest.mark.parametrize("ratio", [1e2, 1e4])
def test_springs_that_do_not_bear_a_heavy_cube_say_so(ratio: float) -> None:
    """Under penalty it rests on the light one, or the residual is above the tolerance."""
    world, worst = heavy_on_light(Law("penalty", 0.3), ratio), 0.0
    assert world.rigid
    for _ in range(100):
        worst = max(worst, step(world, 1e-2).residual)
    rests = np.abs(world.rigid.centre[:, 2] - [0.051, 0.152]).max() < 1e-3
    assert rests or worst > world.law.tolerance * world.law.distance


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("speed", [0.5, 5.0, 50.0])
@pytest.mark.parametrize("shape", ["box", "ball", "turned"])
def test_nothing_passes_a_plate_of_a_tenth_of_a_millimetre(response: str, speed: float, shape: str) -> None:
    """At 50 m/s a step of 10 ms covers 0.5 m, five thousand times the thickness."""
    thin = box([1.0, 1.0, 1e-4])
    obstacle = Part(thin.vertices, thin.triangles, fixed=True)
    law = Law(response, 0.3, distance=1e-4)
    if shape == "ball":
        world = ball_on(obstacle, law, [0.05, 0.02, 0.35], radius=0.01)
    else:
        bodies = RigidBodies(
            np.array([0.3]), 5e-4 * np.eye(3)[None], np.array([[0.05, 0.02, 0.35]]), np.zeros(3)
        )
        world = ContactSolver(law, 3e-4, obstacles=[obstacle], rigid=(bodies, [box([0.1, 0.05, 0.02])]))
    assert world.rigid
    world.rigid.velocity[0] = [0.03 * speed, 0, -speed]
    if shape == "turned":
        world.rigid.spin[0] = [3.0, 20.0, 5.0]
    for _ in range(int(min(60, 0.5 / speed / 0.01 + 20))):
        step(world, 0.01)
        lowest = world.positions_now()[: 1 if shape == "ball" else 8, 2].min() - (
            0.01 if shape == "ball" else 0
        )
        assert lowest > 5e-5
    assert lowest < 0.35  # it came down, or went up again


@pytest.mark.parametrize("ratio", [1.5, 3.0, 30.0])
@pytest.mark.parametrize("speed", [1.0, 300.0, 5000.0])
def test_a_free_body_keeps_its_angular_momentum_and_gains_no_energy(speed: float, ratio: float) -> None:
    """However far a step turns it: at 300 and 5000 rad/s by several and by fifty radians."""
    inertia = 1e-3 * np.diag([1.0, ratio - 0.3, ratio])
    bodies = RigidBodies(np.array([0.3]), inertia[None], np.zeros((1, 3)), np.zeros(3))
    bodies.spin[0] = speed * np.array([0.3, 0.8, 0.2])

    def momentum() -> np.ndarray:
        turn = bodies.rotation[0]
        return np.asarray(turn @ inertia @ turn.T @ bodies.spin[0])

    start, u = momentum(), np.zeros(6)
    energy = bodies.spin[0] @ start
    for _ in range(50):
        bodies.begin(euler_stage(0.01))
        bodies.guess(u)
        bodies.finish(u)
        before, energy = energy, bodies.spin[0] @ momentum()
        assert energy <= before * (1 + 1e-9)
    np.testing.assert_allclose(momentum(), start, rtol=0, atol=1e-9 * np.linalg.norm(start))
