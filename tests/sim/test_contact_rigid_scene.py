"""Rigid bodies of scenes: the shipped incline, bounce and stack, bodies on cloth, what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names
from tests.sim.contact_scenes import assert_same_after_reset, refusal
from tests.sim.implicit_schemes import IMPLICIT
from tripod_sim import Simulation, load_scene
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.contact.detection import Detector
from tripod_sim.mesh.surface_mesh import SurfaceMesh
from tripod_sim.mesh.surfaces import Part, join
from tripod_sim.shapes.ball import ball
from tripod_sim.shapes.box import box
from tripod_sim.shapes.surface import solid_of
from tripod_sim.springs.generate import grid
from tripod_study.run import run

G, TILT = 9.81, np.radians(20)

MODES = ["lagrange", "penalty"]

DOWN = np.array([np.cos(TILT), 0.0, -np.sin(TILT)])
"""Along the incline of the scene."""


def refused(scene: str, *overrides: str) -> str:
    return refusal(scene, overrides)


def sliding(friction: float, response: str, steps: int = 200) -> tuple[float, float]:
    """Return the acceleration down the shipped incline over the second half of the steps, and the speed at the end."""
    simulation = Simulation(
        load_scene("incline", [f"contact.friction={friction}", f"contact.response={response}"])
    )
    speeds = []
    for _ in range(steps):
        simulation.step()
        speeds.append(float(simulation.state.rigid.velocities[0] @ DOWN))
    half = steps // 2
    return (speeds[-1] - speeds[half]) / ((steps - 1 - half) * simulation.scene.dt), speeds[-1]


@pytest.mark.parametrize("response", MODES)
def test_the_block_sticks_a_percent_above_the_angle_of_friction_and_slides_below(response: str) -> None:
    critical = np.tan(TILT)
    acceleration, speed = sliding(1.01 * critical, response, steps=500)  # it slips while the load builds up
    assert abs(acceleration) < 1e-5
    assert abs(speed) < 1e-5
    down = G * (np.sin(TILT) - 0.99 * critical * np.cos(TILT))
    assert down > 0.03
    assert sliding(0.99 * critical, response)[0] == pytest.approx(down, rel=0.01)


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("friction", [0.0, 0.1, 0.3])
def test_the_block_slides_as_coulomb_says(response: str, friction: float) -> None:
    down = G * (np.sin(TILT) - friction * np.cos(TILT))
    assert sliding(friction, response, steps=120)[0] == pytest.approx(down, rel=0.01)  # the plate ends at 1 m


@pytest.mark.parametrize("restitution", [0.0, 0.7, 0.9])
def test_the_ball_rises_as_high_as_the_restitution_says(restitution: float) -> None:
    simulation = Simulation(load_scene("bounce", [f"contact.restitution={restitution}"]))
    heights = []
    for _ in range(1000):
        simulation.step()
        heights.append(float(simulation.rigid[0].position[2]) - 0.05)
    assert min(heights) > 0
    hit = int(np.argmin(heights[:500]))
    # a step of gravity more or less on 3.13 m/s, twice and squared: 1.3 %
    assert max(heights[hit : hit + 600]) == pytest.approx(restitution**2 * 0.5, rel=0.015, abs=3e-4)


def test_the_ball_s_bounces_end() -> None:
    simulation = Simulation(load_scene("bounce", ["dt=0.005"]))
    for _ in range(800):
        simulation.step()
    assert simulation.energies().kinetic < 1e-12


@pytest.mark.parametrize("response", MODES)
def test_the_stack_rests_and_carries_its_weight(response: str) -> None:
    simulation = Simulation(load_scene("stack", [f"contact.response={response}"]))
    start = np.array([pose.position for pose in simulation.rigid])
    for _ in range(200):
        report = simulation.step()
    assert simulation.energies().kinetic < 1e-8
    np.testing.assert_allclose([pose.position for pose in simulation.rigid], start, atol=2e-3)
    assert report.contact
    assert report.contact.force == pytest.approx(0.3 * G * (3 + 2 + 1), rel=1e-3)


@pytest.mark.parametrize("scheme", IMPLICIT)
def test_what_the_fall_of_a_pressed_box_would_hide_is_met_and_does_not_bounce(scheme: str) -> None:
    """Without forces the lower box falls along, so that the upper one would not come near it within the step."""
    h, speed = 6e-3, 0.6
    free = speed * h + (1.0 if scheme == "implicit_euler" else 0.5) * G * h**2
    words = [f"dt={h}", f"inertia.scheme={scheme}", f"rigid.1.position=[0, 0, {0.152 + free - 1e-4}]"]
    simulation = Simulation(load_scene("stack", [*words, "rigid.2.position=[0, 0, 1.0]"]))
    rigid = simulation.state.rigid
    assert rigid
    rigid.velocities[1, 2] = -speed
    least = []
    for _ in range(4):
        simulation.step()
        least.append(float(rigid.centres[1, 2]) - 0.152)
    assert min(least) > -1e-6
    assert abs(rigid.velocities[1, 2]) < 1e-4


def test_energies_and_shown_vertices_follow_the_bodies() -> None:
    """In free flight: kinetic energy and weight's potential as by hand, vertices as far from the centre as ever."""
    words = [
        "rigid=[{shape='box', mass=2.0, size=[0.1,0.2,0.4], position=[0,0,3], velocity=[1,0,0], spin=[0,0,5]}]"
    ]
    simulation = Simulation(load_scene("stack", words))
    first = simulation.positions
    assert first.shape == simulation.mesh.nodes.shape == (8, 3)
    np.testing.assert_array_equal(first, simulation.mesh.nodes)
    before = simulation.energies()
    assert before.kinetic == pytest.approx(0.5 * 2 * 1 + 0.5 * 2 / 12 * (0.1**2 + 0.2**2) * 25, rel=1e-12)
    for _ in range(10):
        simulation.step()
    after, pose = simulation.energies(), simulation.rigid[0]
    fallen = G * 0.01**2 * 55
    np.testing.assert_allclose(pose.position, [0.1, 0, 3 - fallen], atol=1e-12)
    assert after.gravity - before.gravity == pytest.approx(-2 * G * fallen, rel=1e-9)
    np.testing.assert_allclose(
        pose.quaternion, [0, 0, np.sin(0.25), np.cos(0.25)], atol=1e-12
    )  # 0.1 s at 5 rad/s
    reach = np.linalg.norm(simulation.positions - pose.position, axis=1)
    np.testing.assert_allclose(reach, np.linalg.norm([0.05, 0.1, 0.2]), rtol=1e-12)


def test_a_closed_surface_is_as_heavy_to_turn_as_the_box_that_it_is() -> None:
    shape = box((0.1, 0.2, 0.4))
    moved = SurfaceMesh(shape.vertices + np.array([3.0, -1.0, 2.0]), shape.triangles)
    same = solid_of(moved, "f")
    np.testing.assert_allclose(same.inertia, shape.inertia, atol=1e-12)
    np.testing.assert_allclose(same.vertices, shape.vertices, atol=1e-12)
    # the ball is shown by a polyhedron inscribed: a little smaller, and so a little lighter to turn
    sphere = ball(0.3)
    inscribed = solid_of(SurfaceMesh(sphere.vertices, sphere.triangles), "f").inertia
    np.testing.assert_allclose(inscribed, sphere.inertia, rtol=0.06, atol=1e-6)
    assert inscribed[0, 0] < sphere.inertia[0, 0]


def test_a_body_from_a_file_lands_like_a_box() -> None:
    words = ["rigid=[{shape='surface', source='cube.obj', scale=0.5, mass=0.3, position=[0,0,0.06]}]"]
    simulation = Simulation(load_scene("stack", words))
    for _ in range(100):
        report = simulation.step()
    assert report.contact
    assert report.contact.force == pytest.approx(0.3 * G, rel=1e-3)
    assert simulation.rigid[0].position[2] == pytest.approx(0.051, abs=1e-4)


@pytest.mark.parametrize("shape", ["ball", "box"])
def test_a_cloth_held_at_its_corners_catches_a_body(shape: str) -> None:
    cloth = [
        "springs.nodes=9", "springs.size=0.6", "springs.fixed_corners=[0,1,2,3]", "springs.stiffness=500",
        "damping={mass=2.0, stiffness=0.0}", "contact={contact_distance=0.002, alarm_distance=0.006}", "dt=0.01",
        f"rigid=[{{shape='{shape}', mass=0.1, radius=0.06, size=[0.12,0.12,0.12], position=[0.01,0.02,0.1]}}]",
    ]  # fmt: skip
    simulation = Simulation(load_scene("cloth", cloth))
    assert len(simulation.mesh.nodes) == len(simulation.positions) > 81
    gaps, forces = [], []
    for _ in range(250):
        report = simulation.step()
        assert report.contact
        gaps.append(report.contact.smallest_gap)
        forces.append(report.contact.force)
        assert report.contact.cut == 0
    assert min(gaps) > -0.002
    height = simulation.rigid[0].position[2]
    assert height - simulation.positions[:81, 2].min() > 0.05  # it lies on the cloth
    assert height > -0.3
    assert np.mean(forces[-100:]) == pytest.approx(0.1 * G, rel=0.05)  # the cloth still swings


def test_a_soft_body_that_does_not_touch_itself_is_compared_with_others_only() -> None:
    """Else most of the time went to pairs of neighbours in the body itself. What is found stays the same."""
    net = grid(9, 0.6)
    places = [[0.1, 0.05, height] for height in (0.5, 0.03)]
    found = []
    for touches_itself in (False, True):
        cloth = Part(net.nodes, net.triangles, self_contact=touches_itself)
        for place in places:
            body = box((0.1, 0.2, 0.05)).part
            surfaces, x = join([cloth, replace(body, vertices=body.vertices + place)])
            detector, contacts = Detector(surfaces, x, 0.002, 0.006), ContactSet()
            detector.near(x, contacts)
            keys = np.sort(contacts.arrays.key[: contacts.count])
            found.append((detector.pairs, keys.tolist()))
    (far, none), (near, some), (own, _), (_, all_found) = found
    assert far == 0
    assert not none
    assert own > 500
    assert 0 < near < own
    assert some
    assert set(some) <= set(all_found)  # where it may touch itself, its flat neighbours are found, too


def test_bodies_that_pass_through_something_at_the_start_are_named_or_lifted() -> None:
    text = refused("stack", "rigid.1.position=[0,0,0.1]")
    assert_names(
        text, "rigid.1", "rigid.0", "rigid.1.position is (0.0, 0.0, 0.1) m", "contact.start = 'lift'"
    )
    assert_names(refused("stack", "rigid.0.position=[0,0,0.03]"), "rigid.0", "obstacles.0")
    assert_names(refused("bounce", "rigid.0.position=[0,0,0.04]"), "rigid.0", "obstacles.0")
    two = "rigid=[{shape='ball'}, {shape='ball', position=[0.05, 0, 0.05]}]"
    assert_names(refused("bounce", two, "obstacles=off"), "rigid.1", "rigid.0")
    # a ball wholly inside of a closed obstacle
    inside = ["obstacles=[{source='cube.obj'}]", "rigid.0.position=[0,0,0]", "rigid.0.radius=0.01"]
    assert_names(refused("bounce", *inside), "rigid.0", "obstacles.0")
    lifted = Simulation(
        load_scene("stack", ["contact.start=lift", *(f"rigid.{k}.position=[0,0,0]" for k in range(3))])
    )
    heights = [pose.position[2] for pose in lifted.rigid]
    np.testing.assert_allclose(heights, [0.05, 0.15, 0.25], atol=0.005)
    for _ in range(100):
        report = lifted.step()
    assert report.contact
    assert report.contact.force == pytest.approx(0.3 * G * 6, rel=1e-3)


@pytest.mark.parametrize(
    ("scene", "words", "named"),
    [
        ("stack", ["rigid.0.mass=0"], ["rigid.0.mass is 0.0", "at least 1e-09 kg"]),
        ("stack", ["rigid.0.size=[0.1,-0.1,0.1]"], ["rigid.0.size is (0.1, -0.1, 0.1)", "above 0 m"]),
        ("bounce", ["rigid.0.radius=nan"], ["rigid.0.radius is nan"]),
        ("stack", ["rigid.0.shape=cone"], ["rigid.0.shape is 'cone'", "box", "ball", "surface"]),
        (
            "stack",
            ["rigid.1.orientation=[0,0,0,0.5]"],
            ["rigid.1.orientation is (0.0, 0.0, 0.0, 0.5)", "norm 0.5", "unit quaternion"],
        ),
        ("stack", ["obstacles.0.orientation=[0,0,0,0]"], ["obstacles.0.orientation is (0.0, 0.0, 0.0, 0.0)"]),
        ("stack", ["rigid.0.shape=surface"], ["rigid.0.source is ''", "shape 'surface'", "path"]),
        ("stack", ["rigid.0.source=a.obj"], ["rigid.0.source is 'a.obj'", "rigid.0.shape is 'box'"]),
        ("stack", ["rigid.0.shape=surface", "rigid.0.source=plate.obj"], ["plate.obj", "open"]),
        ("stack", ["rigid.0.shape=surface", "rigid.0.source=inward.obj"], ["inward.obj", "inward"]),
        ("stack", ["contact=off", "obstacles=off"], ["rigid needs contact"]),
        (
            "stack",
            ["rigid=off"],
            ["mesh is missing", "[mesh]", "[material]", "[springs]", "[[body]]", "[[rigid]]"],
        ),
        ("stack", ["servos={}"], ["servos", "soft body"]),
        ("bounce", ["obstacles=off"], ["contact", "nothing to act on", "[[obstacles]]", "[[rigid]]"]),
        ("stack", ["inertia.scheme=rk4"], ["inertia.scheme is 'rk4'", "implicit_euler", "bdf2", "tr_bdf2"]),
        (
            "stack",
            ["contact.alarm_distance=0.001"],
            ["contact.alarm_distance is 0.001 m", "above contact.contact_distance, 0.001 m"],
        ),
    ],
)
def test_bad_rigid_bodies_are_named(scene: str, words: list[str], named: list[str], tmp_path: Path) -> None:
    inward = tmp_path / "inward.obj"
    inward.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n")
    assert_names(refused(scene, *(word.replace("=inward.obj", f"={inward}") for word in words)), *named)


def test_reset_and_repetition_give_the_same_bits() -> None:
    simulation = Simulation(load_scene("stack", ["rigid.2.position=[0.04, 0, 0.27]"]))
    assert_same_after_reset(simulation, 40)


def test_a_run_tells_poses_and_contacts_and_records_the_vertices(tmp_path: Path) -> None:
    summary = run("stack", duration=0.2, out=tmp_path / "stack.npz")
    assert len(summary["rigid"]) == 3
    assert summary["rigid"][0]["position"][2] == pytest.approx(0.051, abs=1e-3)
    assert summary["contact"]["force"] == pytest.approx(0.3 * G * 6, rel=0.05)
    with np.load(tmp_path / "stack.npz") as file:
        assert file["positions"].shape == (20, 24, 3)
