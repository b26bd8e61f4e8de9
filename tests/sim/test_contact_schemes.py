"""Contact in every implicit scheme: the order where nothing hits, and the same physics as with implicit Euler."""

from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.sim.contact_bodies import G, ball_on, box, boxes_on_plate, plate, step
from tests.sim.implicit_schemes import MULTISTEP, ORDERS, scheme_of
from tests.sim.springs import force_of, net_of
from tests.tiers import sampled
from tripod_sim import Simulation, load_scene
from tripod_sim.constraints.groups import Groups
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.response import Law
from tripod_sim.contact.rigid_bodies import RigidBodies
from tripod_sim.contact.solid_nodes import SolidNodes
from tripod_sim.contact.stepper import contact_steps
from tripod_sim.forces.anchor import Anchor
from tripod_sim.forces.gravity import GravityForce
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.stepper import integrator_of
from tripod_sim.mesh.surfaces import Part
from tripod_sim.springs.body import SpringBody
from tripod_sim.system import System
from tripod_study.variations.drape import crossings_of

SCHEMES = MULTISTEP

MODES = ["lagrange", "penalty"]

FAR = "contact={tolerance=1e-6}"


def order(errors: list[float]) -> np.ndarray:
    """Return the orders between errors at steps that are halved."""
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


@lru_cache
def top(scheme: str, steps: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return rotation, centre and change of angular momentum of a free top that tumbles for 0.5 s."""
    bodies = RigidBodies(
        np.array([1.0]), 1e-3 * np.diag([1.0, 2.0, 3.0])[None], np.array([[0, 0, 10.0]]), np.array([0, 0, -G])
    )
    world = ContactSolver(
        Law(), 3e-3, scheme_of(scheme), obstacles=[plate()], rigid=(bodies, [box([0.1, 0.1, 0.1])])
    )
    bodies.velocity[0], bodies.spin[0] = [1.0, 0.0, 5.0], [1.0, 4.0, 1.0]

    def momentum() -> np.ndarray:
        R = bodies.rotation[0]
        return np.asarray(R @ bodies.inertia[0] @ R.T @ bodies.spin[0])

    before = momentum()
    for _ in range(steps):
        step(world, 0.5 / steps)
    return (
        bodies.rotation[0],
        bodies.centre[0],
        float(np.abs(momentum() - before).max() / np.abs(before).max()),
    )


@pytest.mark.parametrize(("scheme", "expected"), ORDERS)
def test_a_tumbling_top_in_free_flight_has_the_order_of_the_scheme_and_keeps_its_angular_momentum(
    scheme: str, expected: int
) -> None:
    exact = top("tr_bdf2", 1600)[0]
    found = [top(scheme, n) for n in (50, 100, 200)]
    turned = [float(np.abs(rotation - exact).max()) for rotation, _, _ in found]
    flown = [float(np.abs(c - [0.5, 0.0, 10 + 2.5 - G / 8]).max()) for _, c, _ in found]
    assert order(turned) == pytest.approx(expected, abs=0.15)
    assert order(flown) == pytest.approx(expected, abs=0.02)
    assert turned[-1] < (1e-2 if expected == 1 else 1e-4)
    assert max(lost for _, _, lost in found) < 1e-10


@pytest.mark.parametrize("scheme", SCHEMES)
def test_where_free_moves_show_a_hit_the_step_is_solved_once(scheme: str) -> None:
    distance, height, h = 1e-3, 0.1, 0.01
    world = ContactSolver(
        Law(distance=distance), 3e-3, scheme_of(scheme), obstacles=[plate()],
        rigid=(RigidBodies(np.ones(1), 1e-3 * np.eye(3)[None], np.array([[0, 0, 0.05 + distance + height]]),
                           np.array([0, 0, -G])), [box([0.1, 0.1, 0.1])]),
    )  # fmt: skip
    fall = np.sqrt(2 * height / G)
    before = int(fall / h)
    for k in range(before):
        report = step(world, h)
        assert report.restarted == (k == 0)
        assert not np.isfinite(report.meets)
    assert world.rigid
    gap, speed = world.rigid.centre[0, 2] - 0.05 - distance, -world.rigid.velocity[0, 2]
    report = step(world, h)
    assert report.restarted
    assert report.passes == report.parts == 1
    assert report.meets == pytest.approx(gap / (h * speed + h * h * G), rel=1e-9)
    assert (before + report.meets) * h == pytest.approx(fall, abs=0.1 * h)
    again = [step(world, h).restarted for _ in range(5)]  # what was left of the gap is made up in the first
    assert again == [True, True, False, False, False]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("dt", [0.002, 0.0005])
def test_a_block_that_friction_stops_stays_where_it_stops(scheme: str, dt: float) -> None:
    """Pushed up an incline on which it just sticks: a scheme that looked back over the stop would let it slide down."""
    lean = np.radians(20)
    friction = 1.02 * np.tan(lean)
    simulation = Simulation(
        load_scene("incline", [f"contact.friction={friction}", f"inertia.scheme={scheme}", f"dt={dt}"])
    )
    up = np.array([-np.cos(lean), 0.0, np.sin(lean)])
    brake = G * (np.sin(lean) + friction * np.cos(lean))
    for _ in range(round(0.2 / dt)):
        simulation.step()
    settled = simulation.save()
    for speed in (0.1, 0.13, 0.17):
        simulation.restore(settled)
        simulation.state.rigid.velocities[0] = speed * up
        simulation._stepper.forget()
        start = simulation.state.rigid.centres[0].copy()
        for _ in range(round(0.3 / dt)):
            simulation.step()
        gone = float((simulation.state.rigid.centres[0] - start) @ up)
        assert gone == pytest.approx(speed**2 / (2 * brake), abs=speed * dt), speed
        assert np.abs(simulation.state.rigid.velocities[0] @ up) < 2e-4, speed


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_box_that_lands_in_short_steps_does_not_rebound(scheme: str) -> None:
    for share in np.linspace(0.0, 0.9, 7):
        h, height = 2e-4, 2e-3
        world = ContactSolver(
            Law(tolerance=1e-4, distance=1e-3), 3e-3, scheme_of(scheme), obstacles=[plate()],
            rigid=(RigidBodies(np.ones(1), 1e-3 * np.eye(3)[None], np.array([[0, 0, 0.051 + height + 3e-5 * share]]),
                               np.array([0, 0, -G])), [box([0.1, 0.1, 0.1])]),
        )  # fmt: skip
        rises = []
        assert world.rigid
        for _ in range(round(0.04 / h)):
            step(world, h)
            rises.append(float(world.rigid.velocity[0, 2]))
        assert min(rises) == pytest.approx(-np.sqrt(2 * G * height), rel=0.03)
        assert max(rises) < 2e-3


@pytest.mark.parametrize("scheme", ["implicit_euler", *SCHEMES])
def test_a_rod_that_tumbles_fast_gains_no_energy(scheme: str) -> None:
    """It turns by 0.2 rad a step, about its length the most: the force of its spin taken as it begins would explode."""
    inertia = 1e-3 * np.diag([1.0, 20.0, 21.0])
    bodies = RigidBodies(np.array([1.0]), inertia[None], np.array([[0, 0, 10.0]]), np.zeros(3))
    world = ContactSolver(
        Law(), 3e-3, scheme_of(scheme), obstacles=[plate()], rigid=(bodies, [box([0.1, 0.1, 0.1])])
    )
    bodies.spin[0] = [20.0, 10.0, 4.0]

    def energy() -> float:
        turned = bodies.rotation[0].T @ bodies.spin[0]
        return 0.5 * float(turned @ inertia @ turned)

    start, most = energy(), 0.0
    for _ in range(200):
        step(world, 0.01)
        most = max(most, energy())
    assert 0.5 * start < most < 1.05 * start


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ("silicone", ["mesh.level=1", "damping={mass=3, stiffness=2e-3}"]),
        ("tripod", ["mesh.level=1"]),
        (
            "cloth",
            ["solver.tolerance=1e-10", "springs.damping=0.01", "damping={mass=1, stiffness=1e-3}", "dt=0.01"],
        ),
    ],
)
def test_where_nothing_touches_the_motion_is_that_of_the_scheme_without_contact(
    scheme: str, scene: str, words: list[str]
) -> None:
    """Velocities are no part of what the one hands to the other: the way of each stage must be the same."""
    base = ["solver.tolerance=1e-8", "solver.mode=newton", *words, f"inertia.scheme={scheme}"]
    obstacle = "obstacles=[{source='plate.obj', position=[0,0,-5]}]"
    bare, touching = (
        Simulation(load_scene(scene, base)),
        Simulation(load_scene(scene, [*base, FAR, obstacle])),
    )
    for k in range(12):
        joints = np.array([-0.3, -0.2, 0.1, 0.01]) * min(1, k / 10) if bare.scene.servos else None
        bare.step(joints)
        report = touching.step(joints)
        assert report.contact
        assert report.contact.restarted == (k == 0)
    moved = np.abs(bare.positions - bare.mesh.nodes).max()
    assert moved > 1e-3
    np.testing.assert_allclose(touching.positions, bare.positions, atol=1e-7 * moved)
    np.testing.assert_allclose(
        touching.efforts, bare.efforts, atol=1e-6 * np.abs(bare.efforts).max(initial=1.0)
    )


def pressed_mass(scheme: str, steps: int) -> tuple[float, int]:
    """Return the height at 0.3 s of a mass on a spring on a node that the plate carries, and the steps begun again."""
    law, k, mass, length = Law(tolerance=1e-7), 200.0, 0.5, 0.2
    nodes = np.array([[0.1, 0.2, law.distance], [0.1, 0.2, law.distance + length]])
    body = SpringBody(
        nodes, np.array([[0, 1]]), np.array([length]), np.array([k]), np.zeros(1), np.array([0.1, mass])
    )
    part = Part(nodes, np.zeros((0, 3), dtype=np.int64), body.ends)
    inertia, groups = Anchor(2), Groups(2)
    system = System(
        nodes,
        [force_of(body)],
        groups,
        [GravityForce(body.mass, (0.0, 0.0, -G), nodes), inertia],
        damped=True,
    )
    stage = ImplicitStage(Newton(system, 1e-9, 50), inertia, body.mass, 0.0)
    soft = SolidNodes(stage, body.mass, np.arange(2), 1e-12, 1e-12)
    world = ContactSolver(law, 3 * law.distance, scheme_of(scheme), obstacles=[plate()], nodes=(soft, [part]))
    loop, state, restarts = contact_steps(world), system.start_state(np.zeros(1)), 0
    for _ in range(steps):
        report = loop.step(state, np.zeros(1), 0.3 / steps).contact
        restarts += report.restarted
        assert report.pressed
        assert state.positions[0, 2] == pytest.approx(law.distance, abs=1e-8)
    return float(state.positions[1, 2] - law.distance - length), restarts


@pytest.mark.parametrize(("scheme", "expected"), ORDERS)
def test_what_keeps_pressed_moves_with_the_order_of_the_scheme(scheme: str, expected: int) -> None:
    """The force of the contact changes from m g to three times that; exact: (M g / k) (1 - cos w t)."""
    exact = -0.5 * G / 200.0 * (1 - np.cos(np.sqrt(200.0 / 0.5) * 0.3))
    found = [pressed_mass(scheme, n) for n in (100, 200, 400)]
    errors = [abs(height - exact) for height, _ in found]
    assert order(errors) == pytest.approx(expected, abs=0.15)
    assert errors[-1] < (2e-3 if expected == 1 else 1e-4)
    assert all(restarts <= 1 for _, restarts in found)


def slide(scheme: str, dt: float) -> tuple[float, float]:
    """Return how far a block of 0.4 m/s slides on a level plate, and its largest speed backwards."""
    law = Law(friction=0.3, tolerance=1e-5)
    world = boxes_on_plate(law, [[0, 0, 0.051]], np.array([0, 0, -G]), scheme=scheme)
    assert world.rigid
    world.rigid.velocity[0, 0], back = 0.4, 0.0
    for _ in range(round(0.3 / dt)):
        step(world, dt)
        back = max(back, -float(world.rigid.velocity[0, 0]))
    assert abs(world.rigid.velocity[0, 0]) < 1e-4
    return float(world.rigid.centre[0, 0]), back


@pytest.mark.parametrize(("scheme", "expected"), ORDERS)
def test_a_block_slides_to_its_stop_with_the_order_of_the_scheme_and_stays(
    scheme: str, expected: int
) -> None:
    """A scheme that looked back over the stop would go on to slow it down, and so push it back at mu g dt / 2."""
    steps = (0.01, 0.005, 0.0025, 0.00125)
    found = [slide(scheme, dt) for dt in steps]
    errors = [abs(way - 0.4**2 / (2 * 0.3 * G)) for way, _ in found]
    # where within a step it stops changes from one length to the next: over three halvings that matters little
    assert expected - 0.1 < order(errors).mean() < expected + 0.3
    assert errors[0] < (2.2e-3 if expected == 1 else 3e-4)
    assert max(back * dt for (_, back), dt in zip(found, steps, strict=True)) < 5.1e-5


@pytest.mark.parametrize(("scheme", "expected"), ORDERS)
def test_friction_follows_a_slip_that_turns_with_the_order_of_the_scheme(scheme: str, expected: int) -> None:
    """On a slope, pushed across: v' = g_t - mu g_n v / |v|. Against the move it would lag by half a step."""
    mu, tilt, start, end = 0.3, np.radians(20), np.array([0.1, 0.6]), 0.1
    down, onto = G * np.sin(tilt), G * np.cos(tilt)
    exact = solve_ivp(
        lambda _, v: [down, 0.0] - mu * onto * v / np.linalg.norm(v), (0, end), start, rtol=1e-10, atol=1e-12
    ).y[:, -1]
    errors = []
    for steps in (10, 20, 40):
        law = Law(friction=mu, tolerance=1e-6, max_solves=1000)
        world = boxes_on_plate(law, [[0, 0, 0.051]], np.array([down, 0, -onto]), scheme=scheme)
        assert world.rigid
        world.rigid.velocity[0, :2] = start
        for _ in range(steps):
            step(world, end / steps)
        errors.append(float(np.linalg.norm(world.rigid.velocity[0, :2] - exact)))
    assert order(errors) == pytest.approx(expected, abs=0.2)
    assert errors[-1] < (2e-3 if expected == 1 else 1e-4)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("height", [0.003, 0.1])
def test_a_ball_that_does_not_bounce_stays_where_it_lands(response: str, scheme: str, height: float) -> None:
    """A scheme that looked back over the hit would throw it up again by up to half of its speed."""
    law = Law(response, tolerance=1e-4)
    world = ball_on(plate(), law, [0.3, 0.1, 0.051 + height], scheme=scheme)
    assert world.rigid
    touched = False
    for _ in range(120):
        report = step(world, 0.005)
        touched |= bool(report.pressed)
        if touched:
            # penalty lifts what it let sink in, half of the contact distance, within a step
            assert world.rigid.centre[0, 2] < 0.051 + (1e-6 if response == "lagrange" else 1.5e-3)
        assert world.rigid.centre[0, 2] > 0.05
    assert touched
    assert np.abs(world.rigid.velocity).max() < 1e-4
    assert report.restarted == (response == "penalty")


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_ball_bounces_as_high_as_the_restitution_says(scheme: str) -> None:
    simulation = Simulation(load_scene("bounce", [f"inertia.scheme={scheme}"]))
    heights, restarted = [], 0
    for _ in range(1000):
        report = simulation.step()
        assert report.contact
        restarted += report.contact.restarted
        heights.append(float(simulation.rigid[0].position[2]) - 0.05)
    assert min(heights) > 0
    hit = int(np.argmin(heights[:500]))
    assert max(heights[hit:]) == pytest.approx(0.49 * 0.5, rel=0.015)
    assert restarted < 10  # the first step, and two for each hit


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("response", MODES)
def test_a_ball_rolls_down_an_incline_and_a_block_obeys_coulomb(response: str, scheme: str) -> None:
    law, tilt = Law(response, 0.3, tolerance=1e-6), 0.2
    world = ball_on(
        plate(), law, [0, 0, 0.051], scheme=scheme, gravity=[G * np.sin(tilt), 0, -G * np.cos(tilt)]
    )
    assert world.rigid
    for _ in range(100):
        report = step(world, 0.01)
    assert report.restarted == (response == "penalty")
    speed = float(world.rigid.velocity[0, 0])
    assert speed == pytest.approx(5 / 7 * G * np.sin(tilt), rel=2e-3)
    assert 0.05 * world.rigid.spin[0, 1] == pytest.approx(speed, rel=2e-3)
    lean = np.radians(20)
    down = np.array([np.cos(lean), 0.0, -np.sin(lean)])
    for share, steps in ((1.01, 400), (0.9, 120)):
        words = [
            f"contact.friction={share * np.tan(lean)}",
            f"contact.response={response}",
            "contact.tolerance=1e-6",
        ]
        simulation = Simulation(load_scene("incline", [*words, f"inertia.scheme={scheme}"]))
        speeds = []
        for _ in range(steps):
            simulation.step()
            speeds.append(float(simulation.state.rigid.velocities[0] @ down))
        found = (speeds[-1] - speeds[steps // 2]) / ((steps - 1 - steps // 2) * simulation.scene.dt)
        if share > 1:
            assert abs(speeds[-1]) < 2e-5
        else:
            assert found == pytest.approx(0.1 * G * np.sin(lean), rel=0.01)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("response", MODES)
def test_the_stack_rests_and_carries_its_weight(response: str, scheme: str) -> None:
    words = [f"contact.response={response}", f"inertia.scheme={scheme}", "contact.tolerance=1e-5"]
    simulation = Simulation(load_scene("stack", words))
    start = np.array([pose.position for pose in simulation.rigid])
    for _ in range(100):
        report = simulation.step()
    assert simulation.energies().kinetic < 1e-7
    np.testing.assert_allclose([pose.position for pose in simulation.rigid], start, atol=2e-3)
    assert report.contact
    assert report.contact.force == pytest.approx(0.3 * G * (3 + 2 + 1), rel=5e-3)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("speed", [0.5, 50.0])
def test_nothing_passes_a_plate_of_a_tenth_of_a_millimetre(response: str, scheme: str, speed: float) -> None:
    """A box that tumbles: at 50 m/s a step of 10 ms covers five thousand times the thickness."""
    thin, law = box([1.0, 1.0, 1e-4]), Law(response, 0.3, distance=1e-4)
    bodies = RigidBodies(
        np.array([0.3]), 1e-4 * np.diag([3.0, 9.0, 11.0])[None], np.array([[0.05, 0.02, 0.35]]), np.zeros(3)
    )
    world = ContactSolver(
        law, 3e-4, scheme_of(scheme), obstacles=[Part(thin.vertices, thin.triangles, fixed=True)],
        rigid=(bodies, [box([0.1, 0.05, 0.02])]),
    )  # fmt: skip
    bodies.velocity[0], bodies.spin[0] = [0.03 * speed, 0, -speed], [3.0, 20.0, 5.0]
    hit = False
    for _ in range(int(min(60, 0.5 / speed / 0.01 + 20))):
        report = step(world, 0.01)
        hit |= report.restarted and report.pressed > 0
        assert world.positions_now()[:8, 2].min() > 5e-5
    assert hit


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("speed", sampled([0.5, 50.0], 0.5))
def test_a_cloth_of_a_tenth_of_a_millimetre_passes_nothing(response: str, scheme: str, speed: float) -> None:
    words = [
        "springs.source=grid", "springs.nodes=9", "springs.size=0.8", "contact.contact_distance=1e-4",
        "contact.alarm_distance=3e-4", f"contact.response={response}", "springs.position=[0.01, 0.005, 0.22]",
    ]  # fmt: skip
    scene = load_scene("drape", [*words, f"inertia.scheme={scheme}"])
    assert scene.springs
    assert scene.contact
    simulation = Simulation(scene)
    watch = crossings_of(scene)
    simulation.state.velocities[:, 2] = -speed
    pressed = 0
    for _ in range(12):
        report = simulation.step()
        assert report.contact
        assert np.isfinite(simulation.positions).all()
        one = len(scheme_of(scheme).stages(1.0, 1.0)) == 1 or report.contact.restarted
        straight = report.contact.parts == 1 and one
        assert not watch.found(simulation.positions, straight=straight)
        pressed = max(pressed, report.contact.pressed)
    assert pressed > 0


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("response", MODES)
def test_the_silicone_that_falls_on_a_cube_rests_and_presses_with_its_weight(
    response: str, scheme: str
) -> None:
    words = [
        "mesh.level=1",
        "obstacles.0.position=[0,0,-0.03]",
        "damping.mass=5",
        f"contact.response={response}",
    ]
    simulation = Simulation(load_scene("silicone_drop", [*words, f"inertia.scheme={scheme}"]))
    own = 0
    for _ in range(220):
        report = simulation.step()
        assert report.contact
        assert report.contact.cut == 0.0
        assert report.contact.smallest_gap > (-1e-6 if response == "lagrange" else -0.5 * 5e-4)
        own += bool(report.contact.pressed) and not report.contact.restarted
    assert simulation.energies().kinetic < 1e-8
    world = integrator_of(simulation._stepper).world
    weight = world.forces()[: len(world.nodes.base)].sum(axis=0)
    np.testing.assert_allclose(weight, [0, 0, 0.032 * G], atol=1e-3 * 0.032 * G)
    assert np.ptp(simulation.positions[:, 2]) > 0.01  # it hangs over the edges
    assert (own > 1) == (response == "lagrange")  # steps of the scheme itself while pressed


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_cloth_within_its_strain_limit_is_caught(scheme: str) -> None:
    words = ["springs.source=grid", "springs.nodes=9", "springs.size=0.8", "springs.node_mass=0.02"]
    simulation = Simulation(
        load_scene("drape", [*words, "strain_limit.stretch=0.05", f"inertia.scheme={scheme}"])
    )
    body = net_of(simulation.scene)
    for _ in range(60):
        report = simulation.step()
        x = simulation.positions
        lengths = np.linalg.norm(x[body.ends[:, 1]] - x[body.ends[:, 0]], axis=1)
        assert (lengths / body.rest_length).max() <= 1.05
        assert np.linalg.norm(x, axis=1).min() > 0.19
    assert report.contact
    assert report.contact.pressed


@pytest.mark.parametrize("scheme", SCHEMES)
def test_reset_gives_the_same_bits(scheme: str) -> None:
    simulation = Simulation(
        load_scene("stack", ["rigid.2.position=[0.04, 0, 0.27]", f"inertia.scheme={scheme}"])
    )

    def motion() -> bytes:
        for _ in range(25):
            simulation.step()
        return simulation.positions.tobytes()

    first = motion()
    simulation.reset()
    assert motion() == first
