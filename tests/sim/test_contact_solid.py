"""Finite-element solids in contact: rest, weight, friction, speed, servos and disc, rigid bodies, what is refused."""

from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names
from tests.scenes import CUBE, FLOOR, SHARP
from tests.sim.contact_scenes import assert_same_after_reset, refusal
from tripod_host.rotations import rotation_matrix, rotation_vector
from tripod_sim import Simulation, load_scene
from tripod_sim.bodies.soft_build import assembled
from tripod_sim.contact.crossings import Crossings
from tripod_sim.contact.group_kernels import add_residual
from tripod_sim.contact.solid_nodes import SolidNodes
from tripod_sim.contact.stepper import ContactStepper
from tripod_sim.integrators.scheme import euler_stage
from tripod_sim.integrators.stepper import integrator_of
from tripod_sim.mesh.described import described_mesh
from tripod_sim.mesh.surfaces import Part
from tripod_sim.scene.lowering import lowered
from tripod_sim.steps.contact import surfaces

G, WEIGHT = 9.81, 0.032 * 9.81

MODES = ["lagrange", "penalty"]

COARSE = ["mesh.level=1"]

FAR = ["contact={tolerance=1e-6}", f"obstacles=[{{source='{FLOOR}', position=[0,0,-0.9]}}]"]
"""An obstacle that nothing reaches."""

PLATE = f"obstacles=[{{source='{FLOOR}', position=[0,0,-0.003]}}]"
"""0.5 mm below the piece, the contact distance."""


def refused(scene: str, *overrides: str) -> str:
    return refusal(scene, [*COARSE, *overrides])


def contact_force(simulation: Simulation) -> np.ndarray:
    """Return the sum of the contact forces on the solid [N]."""
    stepper = integrator_of(simulation._stepper)
    assert isinstance(stepper, ContactStepper)
    assert stepper.world.nodes
    return stepper.world.forces()[: len(stepper.world.nodes.base)].sum(axis=0)


@pytest.mark.parametrize("response", MODES)
def test_the_silicone_that_falls_on_a_cube_rests_and_presses_with_its_weight(response: str) -> None:
    """The shipped scene from a lower height and more damped, so that it rests soon."""
    words = ["obstacles.0.position=[0,0,-0.03]", "damping.mass=5", f"contact.response={response}"]
    simulation = Simulation(load_scene("silicone_drop", [*COARSE, *words]))
    _, part, nodes, _ = surfaces(
        assembled(lowered(simulation.scene), described_mesh)[0], simulation.scene.contact
    )[0]
    half = 0.02
    corners = np.array([[x, y, z] for x in (-half, half) for y in (-half, half) for z in (-0.05, -0.01)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([[q[0], q[k], q[k + 1]] for q in quads for k in (1, 2)])
    watch = Crossings(part, [Part(corners, triangles, fixed=True)])
    total, lowest = np.inf, 0.0
    for _ in range(220):
        report = simulation.step()
        assert report.contact
        assert not watch.found(simulation.positions[nodes], straight=report.contact.parts == 1)
        lowest = min(lowest, report.contact.smallest_gap)
        e = simulation.energies()
        now = e.kinetic + e.strain + e.gravity
        assert now <= total + 1e-7
        total = now
        assert report.contact.cut == 0.0
    assert simulation.energies().kinetic < 1e-8
    np.testing.assert_allclose(contact_force(simulation), [0, 0, WEIGHT], atol=1e-3 * WEIGHT)
    # multipliers hold the distance; penalty lets bodies sink in by half of it
    assert lowest > (-1e-6 if response == "lagrange" else -0.5 * 5e-4)
    assert np.ptp(simulation.positions[:, 2]) > 0.01  # it hangs over the edges


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("share", [0.5, 0.99, 1.01])
def test_the_silicone_on_an_incline_obeys_coulomb(response: str, share: float) -> None:
    """`share` of the friction at which it begins to stick; gravity is tilted instead of the plate."""
    tilt = 0.35
    gravity = [float(G * np.sin(tilt)), 0.0, float(-G * np.cos(tilt))]
    words = [
        f"contact.response={response}", f"contact.friction={share * np.tan(tilt)}", PLATE, "contact.tolerance=1e-4",
        f"gravity.acceleration={gravity}",
    ]  # fmt: skip
    simulation = Simulation(load_scene("silicone_drop", [*COARSE, *words]))
    mass = simulation._mass
    speeds = []
    for _ in range(100):
        simulation.step()
        speeds.append(float(mass @ simulation.state.velocities[:, 0] / mass.sum()))
    found = (speeds[-1] - speeds[50]) / (49 * simulation.scene.dt)
    if share > 1:
        assert abs(found) < 1e-8
        assert abs(speeds[-1]) < 1e-8
    else:
        assert found == pytest.approx(G * np.sin(tilt) * (1 - share), rel=1e-4)


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("speed", [1.0, 10.0, 50.0])
def test_silicone_thrown_at_a_plate_of_a_tenth_of_a_millimetre_stays_above(
    response: str, speed: float, tmp_path: Path
) -> None:
    """At 50 m/s a step of 10 ms covers 0.5 m, a hundred times the thickness of the piece."""
    xyz = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-1e-4, 0.0)]
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    lines = [f"v {x} {y} {z}" for x, y, z in xyz] + ["f " + " ".join(str(k + 1) for k in q) for q in quads]
    (tmp_path / "thin.obj").write_text("\n".join(lines) + "\n")
    words = [
        "dt=0.01", "mesh.element=h8_mean", f"contact.response={response}", "contact.contact_distance=1e-4",
        "contact.alarm_distance=3e-4", f"obstacles=[{{source='{tmp_path / 'thin.obj'}', position=[0.01,0.02,-0.1]}}]",
    ]  # fmt: skip
    simulation = Simulation(load_scene("silicone_drop", [*COARSE, *words]))
    simulation.state.velocities[:] = [0.1 * speed, 0.0, -speed]
    e = simulation.energies()
    total = e.kinetic + e.strain + e.gravity
    hit = False
    for _ in range(int(0.1 / speed / 0.01) + 4):
        report = simulation.step()
        assert report.contact
        assert report.contact.cut == 0.0
        assert simulation.positions[:, 2].min() > -0.1
        hit |= bool(report.contact.pressed) or simulation.state.velocities[:, 2].max() > -0.5 * speed
        e = simulation.energies()
        # what penalty sank in, half of the contact distance, it lifts again
        slack = 1e-7 if response == "lagrange" else 1e-7 + 0.5e-4 * WEIGHT
        assert e.kinetic + e.strain + e.gravity <= total + slack
        total = e.kinetic + e.strain + e.gravity
    assert hit


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ("silicone", []),
        ("silicone", ["mesh.element=h20", "damping.mass=3"]),
        ("tripod", []),
        ("tripod", ["clamp={}"]),
        ("tripod", ["mesh.element=t4", "mesh.level=5", "material.law=corotational"]),
    ],
)
def test_where_nothing_touches_the_motion_is_that_without_contact(scene: str, words: list[str]) -> None:
    """Another way to the minimum of the same potential: modes, damping, driven nodes, disc and torques."""
    base = [*COARSE, *words, "solver.tolerance=1e-8", "solver.mode=newton"]
    bare, touching = Simulation(load_scene(scene, base)), Simulation(load_scene(scene, [*base, *FAR]))
    for k in range(12):
        joints = np.array([-0.3, -0.2, 0.1, 0.01]) * min(1, k / 10) if bare.scene.servos else None
        bare.step(joints)
        touching.step(joints)
    moved = np.abs(bare.positions - bare.mesh.nodes).max()
    assert moved > 1e-3
    np.testing.assert_allclose(touching.positions, bare.positions, atol=1e-7 * moved)
    np.testing.assert_allclose(
        touching.efforts, bare.efforts, atol=1e-6 * np.abs(bare.efforts).max(initial=1.0)
    )


def test_removing_contact_gives_the_bits_of_a_scene_that_never_had_it() -> None:
    def motion(scene: str, words: list[str]) -> bytes:
        simulation = Simulation(load_scene(scene, [*COARSE, "dt=0.005", "damping.stiffness=2e-3", *words]))
        for _ in range(20):
            simulation.step()
        return simulation.state.positions.tobytes() + simulation.state.velocities.tobytes()

    never = motion("silicone_free", [])
    assert motion("silicone_drop", ["contact=off", "obstacles=off"]) == never
    assert motion("silicone_drop", []) != never


def test_reset_and_repetition_give_the_same_bits() -> None:
    words = ["obstacles.0.position=[0,0,-0.024]"]
    simulation = Simulation(load_scene("silicone_drop", [*COARSE, *words]))
    assert_same_after_reset(simulation, 12)


def test_gradient_and_potential_agree_with_a_disc_that_turns() -> None:
    """Also at rotations so large that the derivative of the rotation vector is not that of the rotation."""
    simulation = Simulation(load_scene(SHARP, [*COARSE, *FAR]))
    stepper = integrator_of(simulation._stepper)
    assert isinstance(stepper, ContactStepper)
    solid = stepper.world.nodes
    assert isinstance(solid, SolidNodes)
    solid.load(simulation.state, simulation.state.joints, 0.005)
    solid.begin(euler_stage(0.005))
    rng = np.random.default_rng(3)
    u = np.zeros(solid.unknowns)
    solid.guess(u)
    solid.hessian(u, project=True)
    u[: solid._own] = 1e-5 * rng.standard_normal(solid._own)
    u[solid._own - 3 : solid._own] = [0.02, -0.03, 0.05]
    du = 1e-6 * rng.standard_normal(solid.unknowns)
    du[solid._own - 3 : solid._own] *= 1e3
    du[solid.given] = 0.0
    gradient = np.zeros_like(u)
    solid.add(u, gradient)
    up, down = (solid.add(u + s * du, np.zeros_like(u)) for s in (1.0, -1.0))
    assert (up - down) / 2 == pytest.approx(float(gradient @ du), rel=1e-5)


def test_a_moment_counts_by_what_the_rotation_vector_turns() -> None:
    """m . w of the spin w with which exp([theta]x) turns while theta changes is J^T m . dtheta/dt."""
    theta, step, moment = (np.array(v) for v in ([0.4, -1.1, 0.3], [1.0, 2.0, -3.0], [0.7, 0.2, -0.4]))
    for turn in (theta, 1e-5 * theta):
        u, out = np.concatenate([np.zeros(3), turn]), np.zeros(6)
        add_residual(np.concatenate([np.zeros(3), moment]), 0, u, out)
        after, before = (rotation_matrix(turn + s * 1e-6 * step) for s in (1.0, -1.0))
        expected = moment @ rotation_vector(after @ before.T) / 2e-6
        assert out[3:] @ step == pytest.approx(float(expected), rel=1e-7)
        assert not out[:3].any()


def test_a_post_stops_the_sinking_tripod_and_the_servos_feel_it() -> None:
    """A cube of 2 cm under the disc. At rest the work of the servos is the change of energy: the post does none."""
    post = [
        "contact={contact_distance=5e-4, alarm_distance=1.5e-3, friction=0.0}",
        f"obstacles=[{{source='{CUBE}', scale=0.1, position=[0,0,-0.0155]}}]",
    ]
    words = ["solver.mode=newton", "solver.tolerance=1e-7", "damping={mass=30.0, stiffness=2e-3}"]
    bare, held = (Simulation(load_scene(SHARP, [*COARSE, *words, *w])) for w in ([], post))

    def settle(angle: float) -> tuple[float, float]:
        """Return energy and sum of torques at rest."""
        start, goal = held.state.joints.copy(), np.array([angle, angle, angle, 0.0])
        for k in range(60):
            joints = start + (goal - start) * min(1.0, (k + 1) / 20)
            bare.step(joints)
            report = held.step(joints)
            assert report.contact
            assert report.contact.smallest_gap > -1e-6
        energies = held.energies()
        assert energies.kinetic < 1e-9
        return energies.strain + energies.gravity, float(held.efforts.sum())

    (low, first), (high, second) = settle(0.03), settle(0.036)
    assert (high - low) / 0.006 == pytest.approx((first + second) / 2, rel=0.01)
    assert first > 2 * bare.efforts.sum() > 0.01  # the strips are bent over the post
    assert bare.effector
    assert held.effector
    assert bare.effector.position[2] < -0.005
    # the disc stands on the post: its lower side on the top, at the contact distance
    assert held.effector.position[2] == pytest.approx(-0.0055 + 5e-4 + 0.0025, abs=1e-4)
    up = contact_force(held)
    assert up[2] > 0.1
    np.testing.assert_allclose(up[:2], 0, atol=2e-3 * up[2])


def test_a_rigid_ball_dropped_on_the_tripod_comes_to_rest_on_it() -> None:
    words = [
        "contact={contact_distance=2e-4, alarm_distance=1e-3, friction=0.5}", "damping={mass=20.0, stiffness=5e-3}",
        "rigid=[{shape='ball', radius=0.012, mass=0.01, position=[0.0004,0.0002,0.017]}]",
    ]  # fmt: skip
    simulation = Simulation(load_scene(SHARP, [*COARSE, *words]))
    assert simulation.effector
    before = simulation.effector.position[2]
    assert len(simulation.positions) == len(simulation.mesh.nodes)
    lowest = 0.0
    for _ in range(100):
        report = simulation.step()
        assert report.contact
        lowest = min(lowest, report.contact.smallest_gap)
        assert report.contact.cut == 0.0
    assert lowest > -2e-4
    ball = simulation.rigid[0]
    assert np.linalg.norm(ball.position[:2]) < 0.004  # in the hole
    np.testing.assert_allclose(contact_force(simulation), [0, 0, -0.01 * G], atol=0.02 * 0.01 * G)
    assert simulation.effector.position[2] < before - 1e-4


def test_a_box_on_a_driven_strip_is_taken_along_and_its_servo_carries_it() -> None:
    """The nodes at the clamp follow the servo; what lies on them is lifted and dragged by friction."""
    words = [
        "contact={contact_distance=2e-4, alarm_distance=1e-3, friction=0.8}",
        "rigid=[{size=[0.006,0.006,0.002], mass=0.001, position=[0.05,0,0.0037]}]",
    ]  # fmt: skip
    damped = [*COARSE, "damping={mass=30.0, stiffness=2e-3}", "solver.mode=newton", "solver.tolerance=1e-8"]
    simulation, bare = (Simulation(load_scene(SHARP, [*damped, *w])) for w in (words, []))
    for k in range(70):
        joints = np.array([0.1 * min(1, k / 30), 0, 0, 0.003 * min(1, k / 30)])
        simulation.step(joints)
        bare.step(joints)
    box, frame = simulation.rigid[0], simulation.driven_frames[0]
    start, end = simulation.mesh.nodes[frame.nodes], simulation.state.positions[frame.nodes]
    moved = (end - start).mean(axis=0)
    assert np.abs(moved).max() > 2e-3
    tilt = 2 * np.arctan2(np.linalg.norm(box.quaternion[:3]), box.quaternion[3])
    assert tilt == pytest.approx(0.1, abs=0.01)
    np.testing.assert_allclose(box.position - [0.05, 0, 0.0037], moved, atol=8e-4)
    # the servo carries it: its torque works as much as lifts the box
    lever = box.position - frame.point - simulation.state.joints[-1] * frame.inward
    lift = 0.001 * G * np.cross(frame.axis, lever)[2]
    assert abs(lift) > 3e-5
    np.testing.assert_allclose(simulation.efforts - bare.efforts, [lift, 0, 0], atol=0.02 * abs(lift))


def test_held_nodes_may_be_where_an_obstacle_is() -> None:
    """What cannot yield is not pressed: the fixed corners of a cloth, the end of a strip that its servo moves."""
    plate = "obstacles=[{source='plate.obj', position=[0,0,-0.001]}]"
    words = ["springs.nodes=9", "springs.size=0.6", "springs.fixed_corners=[0,1,2,3]", "contact={}", plate]
    cloth = Simulation(load_scene("cloth", words))
    for _ in range(20):
        report = cloth.step()
    assert report.contact
    assert report.contact.pressed > 60
    np.testing.assert_allclose(cloth.positions[[0, 8, 72, 80], 2], 0, atol=1e-12)
    assert cloth.positions[10:70, 2].max() == pytest.approx(0.001, abs=1e-5)  # 2 mm above the plate
    cube = f"obstacles=[{{source='{CUBE}', scale=0.1, position=[0.058,0,-0.0128]}}]"
    tripod = Simulation(load_scene(SHARP, [*COARSE, "contact={contact_distance=1e-4}", cube]))
    for k in range(20):
        report = tripod.step(np.array([-0.5 * (k + 1) / 20, 0, 0, 0]))
        assert report.contact
        assert (report.parts, report.contact.cut) == (1, 0.0)
    end = tripod.driven_frames[0].nodes
    assert tripod.positions[end, 2].min() < -0.003


def test_fixed_nodes_nearer_than_the_contact_distance_do_not_press_each_other(tmp_path: Path) -> None:
    """Two sheets 1 mm apart in one body, one fixed as a whole, the other in part: neither side of those can yield."""
    at = [
        (0.1 * i + 0.03 * k, 0.1 * j + 0.02 * k, 0.001 * k)
        for k in (0, 1)
        for j in range(3)
        for i in range(3)
    ]
    quads = [[9 * k + 3 * j + i + n for n in (1, 2, 5, 4)] for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    lines = [f"v {x} {y} {z}" for x, y, z in at] + ["f " + " ".join(map(str, q)) for q in quads]
    (tmp_path / "sheets.obj").write_text("\n".join(lines) + "\n")
    words = [
        f"springs.source={tmp_path / 'sheets.obj'}", "springs.fixed_corners=[]",
        "springs.fixed_nodes=[0,1,2,3,4,5,6,7,8,9,10,12,13]",
        "contact={self_contact=true, contact_distance=0.002, alarm_distance=0.006}",
    ]  # fmt: skip
    simulation = Simulation(load_scene("cloth", words))
    pressed = 0
    for _ in range(10):
        report = simulation.step()
        assert report.contact
        pressed = max(pressed, report.contact.pressed)
    assert pressed > 0
    assert np.abs(simulation.positions).max() < 0.4


def test_a_start_inside_an_obstacle_is_refused_or_lifted() -> None:
    inside = "obstacles.0.position=[0,0,-0.019]"
    text = refused("silicone_drop", inside)
    assert_names(text, "nodes", "the body", "obstacles.0", "contact.start = 'lift'")
    simulation = Simulation(load_scene("silicone_drop", [*COARSE, inside, "contact.start=lift"]))
    assert 0.001 + 0.0025 <= simulation.positions[:, 2].max() < 0.001 + 0.005 + 0.0015
    simulation.step()
    held = "fixed=[{low=[0.045,-1,-1], high=[1,1,1]}]"
    text = refused("silicone_drop", inside, "contact.start=lift", held)
    assert_names(text, "contact.start is 'lift'", "body is held")
    post = "obstacles=[{source='cube.obj', scale=0.1, position=[0,0,-0.012]}]"
    text = refused("tripod", "contact={}", post)  # undeformed it is above, sagging it is not
    assert_names(text, "nodes", "obstacles.0")
    ball = "rigid=[{shape='ball', radius=0.01, position=[0,0,0.008]}]"
    assert_names(refused("tripod", "contact={}", ball), "rigid.0", "the soft body")


def test_bad_contact_of_a_solid_is_named() -> None:
    scheme = refused("silicone_drop", "inertia.scheme=rk4")
    assert_names(scheme, "inertia.scheme is 'rk4'", "contact or a ball", "implicit_euler", "bdf2", "tr_bdf2")
    near = refused("silicone_drop", "contact.alarm_distance=1e-4")
    assert_names(near, "contact.alarm_distance is 0.0001 m", "above contact.contact_distance, 0.0005 m")
    below = refused("silicone_drop", "contact.contact_distance=-1")
    assert_names(below, "contact.contact_distance is -1.0", "above 0 m")
    assert_names(refused("silicone_drop", "obstacles=off"), "contact", "nothing to act on")
    assert_names(refused("silicone_drop", "contact=off"), "obstacles", "contact")
