"""Every shape of a rigid body or obstacle, by being registered: mass properties, picture, rest, flights, hits."""

import numpy as np
import pytest
from scipy.integrate import quad

from tests.checks import random_rotation
from tests.messages import assert_names
from tests.sim.contact_bodies import plate, step
from tests.sim.contact_scenes import refusal
from tripod_sim import Simulation, load_scene
from tripod_sim.contact.contact_build import obstacle_parts, obstacle_shapes
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.detection import LEAST, Detector
from tripod_sim.contact.response import Law
from tripod_sim.contact.rigid_bodies import RigidBodies
from tripod_sim.contact.rigid_start import overlaps
from tripod_sim.contact.start import within
from tripod_sim.distance_kernels import point_triangle_distance, segment_segment
from tripod_sim.mesh.surface_mesh import SurfaceMesh
from tripod_sim.mesh.surfaces import Part, join
from tripod_sim.shapes import Shape, fields_of, shape_of
from tripod_sim.shapes.ball import ball
from tripod_sim.shapes.capsule import capsule
from tripod_sim.shapes.surface import solid_of
from tripod_sim.tables.bodies import SHAPES

G, DISTANCE, ALARM = 9.81, 1e-3, 3e-3

VALUES = {"size": [0.1, 0.12, 0.14], "radius": 0.05, "length": 0.12, "source": "cube.obj", "scale": 0.5}
"""Of bodies of about 0.1 m."""


def table(name: str, **more: object) -> str:
    """Return the table of a body of a shape."""
    given = {"shape": name} | {field: VALUES[field] for field in fields_of(name)} | more
    return "{" + ", ".join(f"{field}={value!r}" for field, value in given.items()) + "}"


def shape(name: str) -> Shape:
    return shape_of(load_scene("stack", [f"rigid=[{table(name)}]"]).rigid[0], "rigid.0")


def world_of(
    shapes: list[Shape], centres: list[list[float]], law: Law, obstacles: list[Part]
) -> ContactSolver:
    """Return bodies of 0.3 kg each, turned at random, without gravity."""
    rng = np.random.default_rng(1)
    inertia = 0.3 * np.array([s.inertia for s in shapes])
    bodies = RigidBodies(np.full(len(shapes), 0.3), inertia, np.array(centres), np.zeros(3))
    bodies.rotation[:] = [random_rotation(rng) for _ in shapes]
    return ContactSolver(law, ALARM, obstacles=obstacles, rigid=(bodies, [s.part for s in shapes]))


def parts_of(world: ContactSolver, shapes: list[Shape]) -> list[Part]:
    """Return the surfaces of the bodies where they are."""
    assert world.rigid
    return [
        s.obstacle(c, R).part
        for s, c, R in zip(shapes, world.rigid.centre, world.rigid.rotation, strict=True)
    ]


@pytest.mark.parametrize("name", SHAPES)
def test_mass_properties_are_nearly_those_of_the_picture(name: str) -> None:
    """A polyhedron inscribed is a little smaller, and a little lighter to turn."""
    one = shape(name)
    seen = solid_of(SurfaceMesh(one.vertices, one.triangles), "f")
    np.testing.assert_allclose(seen.vertices, one.vertices, atol=1e-12)  # its centre is the origin
    assert 0.93 * one.volume < seen.volume <= one.volume * (1 + 1e-12)
    np.testing.assert_allclose(seen.inertia, one.inertia, rtol=0.06, atol=1e-6)
    assert np.trace(seen.inertia) <= np.trace(one.inertia) * (1 + 1e-9)


@pytest.mark.parametrize("name", SHAPES)
def test_the_picture_lies_on_the_surface_that_touches(name: str) -> None:
    one = shape(name)
    sets = np.concatenate([one.part.triangles, one.part.segments[:, [0, 1, 1]]])
    sets = sets if len(sets) else np.zeros((1, 3), dtype=np.int64)
    x = one.part.vertices
    for p in one.vertices:
        least = min(point_triangle_distance(p, x[a], x[b], x[c])[3] for a, b, c in sets)
        assert np.sqrt(least) == pytest.approx(one.part.radius, abs=1e-9)
    far = np.linalg.norm(one.vertices, axis=1).max()
    assert one.part.reach == pytest.approx(far, rel=1e-9)


@pytest.mark.parametrize(("radius", "length"), [(0.05, 0.2), (0.3, 0.01), (1.0, 1.0)])
def test_the_capsule_has_the_volume_and_inertia_of_its_slices(radius: float, length: float) -> None:
    one, h = capsule(radius, length), 0.5 * length

    def integral(of_slice: object) -> float:
        assert callable(of_slice)
        kinks = [-h, h]
        return float(quad(of_slice, -h - radius, h + radius, points=kinks, epsrel=1e-12, limit=200)[0])

    def square(z: float) -> float:
        return radius**2 - max(abs(z) - h, 0.0) ** 2

    volume = integral(lambda z: np.pi * square(z))
    along = integral(lambda z: np.pi * square(z) ** 2 / 2) / volume
    across = integral(lambda z: np.pi * (square(z) ** 2 / 4 + square(z) * z**2)) / volume
    assert one.volume == pytest.approx(volume, rel=1e-9)
    np.testing.assert_allclose(one.inertia, np.diag([across, across, along]), rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("name", SHAPES)
def test_a_body_falls_and_rests_on_a_plate_and_carries_its_weight(name: str) -> None:
    simulation = Simulation(
        load_scene(
            "stack", [f"rigid=[{table(name, mass=0.3, position=[0, 0, 0.3], orientation=[0, 0.6, 0, 0.8])}]"]
        )
    )
    for _ in range(200):
        report = simulation.step()
        assert simulation.positions[:, 2].min() > 0
    assert simulation.energies().kinetic < 1e-6
    assert report.contact
    assert report.contact.force == pytest.approx(0.3 * G, rel=1e-3)


@pytest.mark.parametrize("name", SHAPES)
def test_nothing_passes_through_a_plate_at_speed(name: str) -> None:
    one = shape(name)
    world = world_of([one], [[0.3, 0.2, 0.5]], Law("lagrange", 0.3, 0.0, distance=DISTANCE), [plate()])
    assert world.rigid
    world.rigid.velocity[0], world.rigid.spin[0] = [20.0, 0, -300.0], [50.0, 40.0, -60.0]
    for _ in range(8):
        step(world, 0.01)
        (part,) = parts_of(world, [one])
        assert part.vertices[:, 2].min() > part.radius


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("other", SHAPES)
@pytest.mark.parametrize("speed", [2.0, 100.0])
def test_a_free_collision_keeps_momentum(name: str, other: str, speed: float) -> None:
    shapes = [shape(name), shape(other)]
    world = world_of(shapes, [[0, 0, 0], [0.4, 0.03, 0.02]], Law("lagrange", 0.3, 0.5, distance=DISTANCE), [])
    rigid = world.rigid
    assert rigid
    rigid.velocity[0] = [speed, 0, 0]

    def angular() -> np.ndarray:
        own = np.einsum("kij,kjl,kml,km->ki", rigid.rotation, rigid.inertia, rigid.rotation, rigid.spin)
        return np.asarray((np.cross(rigid.centre, 0.3 * rigid.velocity) + own).sum(axis=0))

    def energy() -> float:
        turned = np.einsum("kji,kj->ki", rigid.rotation, rigid.spin)
        return float(
            0.15 * (rigid.velocity**2).sum() + 0.5 * np.einsum("ki,kij,kj->", turned, rigid.inertia, turned)
        )

    before, kinetic = angular(), list[float]()
    dt = 0.3 / 10 / speed if speed < 10 else 0.01
    for _ in range(20):
        step(world, dt)
        assert not overlaps(*parts_of(world, shapes))
        if rigid.velocity[1].any():
            kinetic.append(energy())
    assert np.linalg.norm(rigid.velocity[1]) > 0.1 * speed  # it was hit
    np.testing.assert_allclose(rigid.velocity.sum(axis=0), [speed, 0, 0], atol=1e-6 * speed)
    # forces act at the points that are closest: as far apart as the contact distance, and as bodies move in a step
    impulse, apart = 0.3 * np.linalg.norm(rigid.velocity[1]), DISTANCE + speed * dt
    assert np.linalg.norm(angular() - before) < apart * impulse
    assert kinetic[0] < 0.15 * speed**2  # later, many radians in a step, tumbling keeps L and not the energy


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("other", SHAPES)
def test_a_body_rests_or_slides_off_an_obstacle_without_entering_it(name: str, other: str) -> None:
    words = [
        f"rigid=[{table(name, mass=0.3, position=[0.01, 0.02, 0.35])}]",
        f"obstacles=[{table(other, orientation=[0.6, 0.0, 0.0, 0.8])}]",
    ]
    simulation = Simulation(load_scene("stack", words))
    (obstacle,), one, pressed = obstacle_parts(simulation.scene.obstacles), shape(name), 0
    rigid = simulation.state.rigid
    assert rigid
    for _ in range(60):
        report = simulation.step()
        assert report.contact
        pressed += report.contact.pressed > 0
        assert not overlaps(one.obstacle(rigid.centres[0], rigid.rotations[0]).part, obstacle)
    assert pressed


@pytest.mark.parametrize("name", SHAPES)
def test_a_cloth_hangs_over_an_obstacle(name: str) -> None:
    words = [
        "springs.nodes=13", "springs.size=0.4", "springs.position=[0.01,0.02,0.12]", "springs.fixed_corners=[]",
        "springs.stiffness=500", "damping={mass=2.0, stiffness=0.0}", "dt=0.01",
        "contact={contact_distance=0.002, alarm_distance=0.006}",
        f"obstacles=[{table(name, orientation=[0.6, 0.0, 0.0, 0.8])}]",
    ]  # fmt: skip
    simulation = Simulation(load_scene("cloth", words))
    (obstacle,) = obstacle_parts(simulation.scene.obstacles)
    for _ in range(60):
        report = simulation.step()
        assert report.contact
        cloth = Part(simulation.positions, simulation.mesh.surface)
        assert not overlaps(cloth, obstacle)
    assert report.contact.pressed > 3
    assert simulation.positions[:, 2].max() > 0.02


@pytest.mark.parametrize("name", SHAPES)
def test_bodies_that_begin_inside_of_each_other_are_refused(name: str) -> None:
    at = [0, 0, 1.0]
    two = f"rigid=[{table(name, position=at)}, {table(name, position=[0.02, 0, 1.0])}]"
    assert_names(refusal("stack", [two]), "rigid.1", "rigid.0")
    within_one = f"rigid=[{{shape='ball', radius=0.01, position={at}}}]"
    assert_names(
        refusal("stack", [within_one, f"obstacles=[{table(name, position=at)}]"]), "rigid.0", "obstacles.0"
    )


@pytest.mark.parametrize("name", SHAPES)
def test_an_obstacle_is_shown_where_it_stands(name: str) -> None:
    turn, place = [0.6, 0.0, 0.0, 0.8], [0.1, 0.2, -0.5]
    scene = load_scene("stack", [f"obstacles=[{table(name, position=place, orientation=turn)}]"])
    (shown,) = obstacle_shapes(scene.obstacles)
    here = shown.part.vertices.mean(axis=0)
    np.testing.assert_allclose(shown.vertices.mean(axis=0), here, atol=1e-9)
    np.testing.assert_allclose(here, place, atol=1e-9)
    assert shown.part.fixed


@pytest.mark.parametrize("angle", [0.1, 0.3])
def test_a_capsule_rolls_down_an_incline_as_exactly_as_a_ball(angle: float) -> None:
    """a = g sin(angle) / (1 + I / r²), of a ball and a capsule."""
    off = []
    for one in (ball(0.05), capsule(0.05, 0.2)):
        gravity = np.array([G * np.sin(angle), 0.0, -G * np.cos(angle)])
        bodies = RigidBodies(np.array([0.3]), 0.3 * one.inertia[None], np.array([[0, 0, 0.0505]]), gravity)
        bodies.rotation[0] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]  # its axis along y
        world = ContactSolver(
            Law(friction=0.8, distance=5e-4), 1.5e-3, obstacles=[plate()], rigid=(bodies, [one.part])
        )
        speeds = []
        for _ in range(100):
            step(world, 0.005)
            speeds.append(float(bodies.velocity[0, 0]))
        found = (speeds[-1] - speeds[49]) / (50 * 0.005)
        off.append(abs(found / (G * np.sin(angle) / (1 + one.inertia[2, 2] / 0.05**2)) - 1))
        np.testing.assert_allclose(bodies.spin[0, 1] * 0.05, bodies.velocity[0, 0], rtol=1e-3)
    assert off[0] < 2e-3
    assert off[1] < max(2 * off[0], 1e-4)


def test_a_capsule_is_found_wherever_it_is_near_a_triangle() -> None:
    """By its ends, its side or across it, at rest and over a step; 2,000 places."""
    rng, found, near, met = np.random.default_rng(7), ContactSet(), 0, 0
    radius = 0.004

    def gap(x: np.ndarray) -> float:
        p, q, a, b, c = x
        least = min(point_triangle_distance(p, a, b, c)[3], point_triangle_distance(q, a, b, c)[3])
        least = min(least, *(segment_segment(p, q, *edge)[2] for edge in ((a, b), (b, c), (c, a))))
        return float(np.sqrt(least)) - radius

    for case in range(2000):
        triangle = rng.standard_normal((3, 3)) * 0.01
        part = Part(
            rng.standard_normal((2, 3)) * 0.01, segments=np.array([[0, 1]]), radius=radius, rigid=case % 2 == 0,
            fixed=case % 2 == 1,
        )  # fmt: skip
        other = Part(triangle, np.array([[0, 1, 2]]), fixed=case % 4 == 0)
        pierced = overlaps(Part(part.vertices, segments=part.segments), other)
        surfaces, x = join([part, other] if other.fixed or not part.fixed else [other, part])
        order = np.arange(5) if other.fixed or not part.fixed else np.array([3, 4, 0, 1, 2])
        detector = Detector(surfaces, x, DISTANCE, ALARM)
        detector.near(x, found)
        apart = gap(x[order])
        assert apart > 0 or within(part, other).size
        if pierced:
            continue
        assert found.count > 0 or apart > 0.99 * ALARM, (case, apart)
        assert found.count == 0 or apart < ALARM
        near += apart < DISTANCE
        end = x.copy()
        moving = order[:2] if not part.fixed else order[2:]
        end[moving] += rng.standard_normal(3) * 10 ** rng.uniform(-3, -1)
        share = detector.met(x, end, found)
        met += share < 1
        if share < 1 and apart > 1e-9:
            assert found.count
        if apart > 1e-9:
            for t in np.linspace(0, share, 5):
                assert gap((x + t * (end - x))[order]) >= min(LEAST * DISTANCE, 0.49 * apart) - 1e-12, case
    assert near > 100
    assert met > 100


@pytest.mark.parametrize("name", SHAPES)
def test_fields_that_a_shape_does_not_read_are_named(name: str) -> None:
    simulation = Simulation(load_scene("stack", [f"rigid=[{table(name, position=[0, 0, 1.0])}]"]))
    assert not [note for note in simulation.notes if "rigid.0" in str(note)]
    extra = {f: VALUES[f] for f in VALUES if f not in ("source", *fields_of(name))}
    words = table(
        name, position=[0, 0, 1.0], **{f: 0.9 if np.isscalar(v) else [0.9] * 3 for f, v in extra.items()}
    )
    notes = " ".join(str(note) for note in Simulation(load_scene("stack", [f"rigid=[{words}]"])).notes)
    assert_names(notes, *(f"rigid.0.{f}" for f in extra))


@pytest.mark.parametrize("name", SHAPES)
def test_a_chain_carries_a_body(name: str) -> None:
    """It has no triangles: balls pass between its nodes unless their centres are compared with its edges."""
    words = [
        "springs.source=chain", "springs.nodes=9", "springs.size=0.6", "springs.fixed_corners=[0,1]",
        "springs.stiffness=800", "damping={mass=2.0, stiffness=0.0}", "dt=0.005",
        "contact={contact_distance=0.002, alarm_distance=0.006, friction=0.8}",
        f"rigid=[{table(name, mass=0.02, position=[0.29, 0.0, 0.12])}]",
    ]  # fmt: skip
    simulation = Simulation(load_scene("cloth", words))
    one, rigid, pressed = shape(name), simulation.state.rigid, 0
    assert rigid
    links = np.stack([np.arange(8), np.arange(1, 9)], axis=1)
    for _ in range(60):
        report = simulation.step()
        assert report.contact
        pressed += report.contact.pressed > 0
        chain = Part(simulation.positions[:9], segments=links)
        assert not overlaps(one.obstacle(rigid.centres[0], rigid.rotations[0]).part, chain)
    assert pressed
