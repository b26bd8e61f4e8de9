"""Impacts of rigid bodies: friction with restitution, the whole inertia, energy, several hits at once, and notes."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.messages import assert_names
from tests.sim.contact_bodies import G, ball_on, balls, box, boxes_on_plate, plate, step
from tests.sim.implicit_schemes import IMPLICIT, MULTISTEP
from tests.tiers import sampled
from tripod_sim.contact import impact_kernels
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.impact_kernels import HELD, one_contact
from tripod_sim.contact.response import Law
from tripod_sim.contact.rigid_bodies import RigidBodies
from tripod_study.run import run

MODES = ["lagrange", "penalty"]
SCHEMES = list(IMPLICIT)
STEPS = [1e-2, 2e-3, 5e-4, 1e-4]

ALONG, DOWN, MU = 2.0, 1.721, 0.3
"""Velocity with which bodies hit the plate [m/s], and Coulomb's coefficient."""


def thrown(shape: str, law: Law, scheme: str = "implicit_euler") -> ContactSolver:
    """Return a ball or cube of 0.1 m, 10 mm above the plate, without gravity."""
    if shape == "ball":
        world = ball_on(
            plate(), law, [0.1, 0.2, 0.06 + law.distance], scheme=scheme, gravity=[0.0, 0.0, 1e-300]
        )
    else:
        world = boxes_on_plate(law, [[0.1, 0.2, 0.06 + law.distance]], np.zeros(3), scheme=scheme)
    assert world.rigid
    world.rigid.velocity[0] = [ALONG, 0.0, -DOWN]
    return world


@pytest.mark.parametrize(
    ("shape", "response", "scheme", "e", "dt"),
    sampled(
        product(["ball", "cube"], MODES, SCHEMES, [0.0, 0.01, 0.3, 0.6], STEPS),
        *product(["ball", "cube"], MODES, ["implicit_euler"], [0.0, 0.01, 0.6], [1e-2, 5e-4]),
        *product(["ball", "cube"], ["lagrange"], MULTISTEP, [0.3], [2e-3]),
    ),
)
def test_friction_of_a_hit_is_bounded_by_the_whole_normal_impulse(
    shape: str, response: str, scheme: str, e: float, dt: float
) -> None:
    """Coulomb: mu times the normal impulse m (1 + e) v, and no more than stops the slip, 2/7 of the speed of a ball."""
    world = thrown(shape, Law(response, MU, e, distance=1e-4, tolerance=1e-4), scheme)
    assert world.rigid
    for _ in range(int(0.012 / dt) + 2):
        step(world, dt)
    velocity, spin = world.rigid.velocity[0], world.rigid.spin[0]
    loss = min(MU * (1 + e) * DOWN, 2 / 7 * ALONG if shape == "ball" else ALONG)
    assert ALONG - velocity[0] == pytest.approx(loss, rel=2e-3)
    assert velocity[2] == pytest.approx(e * DOWN, abs=2e-3)
    assert abs(velocity[1]) < 1e-6
    if shape == "ball":
        assert 0.05 * spin[1] == pytest.approx(2.5 * loss, rel=2e-3)
    else:
        assert 0.05 * np.abs(spin).max() < 1e-3


def kinetic(bodies: RigidBodies) -> float:
    """Return the kinetic energy [J]."""
    turning = np.einsum("kij,kjl,kml->kim", bodies.rotation, bodies.inertia, bodies.rotation)
    spins = np.einsum("ki,kij,kj->", bodies.spin, turning, bodies.spin)
    return 0.5 * float(bodies.mass @ (bodies.velocity**2).sum(axis=1) + spins)


def box_above(
    law: Law, edges: np.ndarray, rotation: np.ndarray, gap: float, mass: float = 1.0
) -> ContactSolver:
    """Return a box that is turned, the lowest corner `gap` [m] above the contact distance, without gravity."""
    inertia = mass / 12 * np.diag((edges**2).sum() - edges**2)
    part = box(edges)
    height = -(part.vertices @ rotation.T)[:, 2].min() + law.distance + gap
    bodies = RigidBodies(np.array([mass]), inertia[None], np.array([[0.3, 0.1, height]]), np.zeros(3))
    bodies.rotation[0] = rotation
    return ContactSolver(law, 5 * law.distance, obstacles=[plate()], rigid=(bodies, [part]))


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize(
    ("edges", "e"), [([0.1, 0.02, 0.02], 0.6), ([0.1, 0.02, 0.02], 1.0), ([0.1, 0.1, 0.1], 0.6)]
)
def test_a_corner_that_hits_without_friction_turns_the_box_by_its_whole_inertia(
    response: str, edges: list[float], e: float
) -> None:
    """One impulse j = (1 + e) v / (1 / m + a . I^-1 a) along the normal n; a = r x n, r from centre to corner."""
    rotation = Rotation.from_euler("xyz", [0.5, 0.9, 0.3]).as_matrix()
    world = box_above(Law(response, 0.0, e, distance=1e-4), np.array(edges), rotation, 0.5e-4)
    bodies = world.rigid
    assert bodies
    bodies.velocity[0, 2] = -1.0
    corners = box(edges).vertices @ rotation.T
    arm = np.cross(corners[np.argmin(corners[:, 2])], [0.0, 0.0, 1.0])
    inverse = rotation @ np.linalg.inv(bodies.inertia[0]) @ rotation.T
    impulse = (1 + e) / (1.0 + arm @ inverse @ arm)
    before = kinetic(bodies)
    step(world, 1e-4)
    assert 1.0 + bodies.velocity[0, 2] == pytest.approx(impulse, rel=5e-3)
    np.testing.assert_allclose(bodies.velocity[0, :2], 0.0, atol=1e-9)
    np.testing.assert_allclose(bodies.spin[0], inverse @ arm * impulse, rtol=5e-3, atol=1e-6)
    after = 0.5 * ((impulse - 1.0) ** 2 + impulse**2 * arm @ inverse @ arm)
    assert kinetic(bodies) / before == pytest.approx(2 * after, rel=5e-3)


def random_hit(rng: np.random.Generator, response: str) -> tuple[ContactSolver, str]:
    """Return a ball or a box with edges of a ratio up to 10 that is about to hit the plate, and with what."""
    kind = str(rng.choice(["ball", "corner", "edge", "face"]))
    law = Law(
        response,
        float(rng.choice([0.0, 0.1, 0.3, 1.0, 2.0])),
        float(rng.choice([0.3, 0.6, 1.0])),
        distance=1e-4,
        tolerance=1e-6,
    )
    speed = np.array([*rng.uniform(-3, 3, 2), -rng.uniform(0.2, 3.0)])
    mass, gap = 10 ** rng.uniform(-1, 1), float(rng.uniform(0, 1e-4))
    turn = Rotation.from_euler("z", rng.uniform(0, 6))
    if kind == "ball":
        world = ball_on(
            plate(), law, [0.3, 0.1, 0.05 + law.distance + gap], mass=mass, gravity=[0.0, 0.0, 1e-300]
        )
    else:
        edges = 0.2 * 10 ** rng.uniform(-1, 0, 3)
        if kind == "corner":
            turn *= Rotation.from_euler("xy", rng.uniform(0.1, 1.4, 2))
        if kind == "edge":
            turn *= Rotation.from_euler("x", rng.uniform(0.1, 1.4))
        world = box_above(law, edges, turn.as_matrix(), gap, mass)
    assert world.rigid
    world.rigid.velocity[0] = speed
    if kind != "face":
        world.rigid.spin[0] = rng.choice([0.0, 10.0]) * rng.standard_normal(3)
    return world, kind


@pytest.mark.parametrize(
    ("response", "dt", "number"),
    sampled(
        [(r, dt, n) for r in MODES for dt in (1e-2, 1e-3, 1e-4) for n in (15, 500)],
        *((r, dt, 15) for r in MODES for dt in (1e-2, 1e-3, 1e-4)),
    ),
)
def test_no_hit_gives_energy(response: str, dt: float, number: int) -> None:
    """Neither slow nor fast, sticking nor sliding, on corners, edges and faces, however far a step turns the body.

    Speeds err by the error of the moves, `tolerance` times the contact distance, over the step; springs may push out as
    slowly what has sunk in.
    """
    rng = np.random.default_rng(20261128)
    seen, hits, stopped = set(), 0, 0
    for _ in range(number):
        world, kind = random_hit(rng, response)
        assert world.rigid
        noise = 4 * world.law.tolerance * world.law.distance / dt
        for _ in range(12):
            before = kinetic(world.rigid)
            report = step(world, dt)
            slack = np.sqrt(2 * before * world.rigid.mass[0]) * noise
            assert kinetic(world.rigid) <= before * (1 + 1e-9) + slack
            hits += report.pressed > 0
            stopped += report.pressed > 0 and world.law.friction > 0
        seen.add(kind)
    assert len(seen) == 4
    assert hits >= number
    assert stopped > 0


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("gap", [0.0, 1e-6, 1e-3])
@pytest.mark.parametrize(("e", "dt"), [(1.0, 1e-2), (1.0, 1e-3), (0.5, 1e-3)])
def test_three_balls_in_a_row_keep_momentum_and_at_e_1_their_energy(
    response: str, gap: float, e: float, dt: float
) -> None:
    """The one that comes leaves at e times its speed relative to the next; those in touch stay so [Moreau1988]."""
    world = balls(Law(response, 0.3, e, distance=1e-4), [[0, 0, 0], [0.1051, 0, 0], [0.2052 + gap, 0, 0]])
    assert world.rigid
    world.rigid.velocity[0, 0] = 1.0
    lowered = max(step(world, dt).lowered for _ in range(int(0.03 / dt) + 5))
    speeds = world.rigid.velocity[:, 0]
    assert speeds.sum() == pytest.approx(1.0, abs=1e-9)
    if e == 1.0:
        assert (speeds**2).sum() == pytest.approx(1.0, abs=1e-5)
        assert lowered < 1e-6
    if gap == 0.0:
        np.testing.assert_allclose(speeds, [(1 - 2 * e) / 3, (1 + e) / 3, (1 + e) / 3], atol=5e-4)


@pytest.mark.parametrize("response", MODES)
def test_an_impulse_goes_through_what_lies_on_the_ground(response: str) -> None:
    """A cube that falls on a cube at rest on the plate bounces as from the plate."""
    law, dt = Law(response, 0.3, 0.6, distance=1e-3, tolerance=1e-4), 1e-3
    world = boxes_on_plate(law, [[0, 0, 0.051], [0, 0, 0.162]], np.array([0, 0, -G]))
    assert world.rigid
    for _ in range(100):
        before = float(world.rigid.velocity[1, 2])
        step(world, dt)
        if world.rigid.velocity[1, 2] > 0.1:
            break
    assert world.rigid.velocity[1, 2] == pytest.approx(-0.6 * before, rel=1e-4)
    assert before < -0.4
    assert abs(world.rigid.velocity[0, 2]) < 1e-3


def test_one_contact_obeys_signorini_and_coulomb() -> None:
    """For any inverse mass, also where friction and normal are coupled so strongly that slip directions are few."""
    rng = np.random.default_rng(7)
    met, impulse = dict.fromkeys(("open", "stick", "slide"), 0), np.empty(3)
    for _ in range(3000):
        A = rng.standard_normal((3, 3)) * 10 ** rng.uniform(-1, 1, 3)
        W = A @ A.T + 1e-3 * np.eye(3)
        n = rng.standard_normal(3)
        n /= np.linalg.norm(n)
        v, least, mu = (
            rng.standard_normal(3),
            float(rng.choice([0.0, 0.5])),
            float(rng.choice([0.0, 0.2, 1.0, 3.0])),
        )
        one_contact(W, n, v, least, mu, impulse)
        after, normal = v + W @ impulse, float(n @ impulse)
        slip, friction = after - (n @ after) * n, impulse - normal * n
        size = np.linalg.norm(friction)
        assert normal >= 0.0
        assert size <= mu * normal + 1e-12
        if normal == 0.0:
            assert n @ after >= least - 1e-12
            met["open"] += 1
            continue
        assert n @ after == pytest.approx(least, abs=1e-6)
        if size < mu * normal * (1 - 1e-9):
            assert np.linalg.norm(slip) < 2 * HELD * np.trace(W) * np.linalg.norm(impulse) + 1e-9
            met["stick"] += 1
        elif mu > 0.0:
            assert slip @ friction == pytest.approx(-np.linalg.norm(slip) * size, rel=1e-6, abs=1e-6)
            met["slide"] += 1
    assert min(met.values()) > 100


OBLIQUE = [
    "duration=0.05", "gravity=off", "contact.friction=2.0",
    "rigid=[{shape='box', size=[0.1,0.02,0.02], mass=0.2, position=[0,0,0.06], orientation=[0,0.4,0,0.9165151389911680]"
    ", velocity=[-2.0,0,-2.0]}]",
]  # fmt: skip
"""A stick that is thrown at the plate obliquely: with restitution and friction it would gain energy."""


def test_a_lowered_restitution_is_told() -> None:
    notes = {e: run("stack", overrides=[*OBLIQUE, f"contact.restitution={e}"]) for e in (0.0, 1.0)}
    assert notes[1.0]["contact"]["lowered"] > 0.01
    (note,) = [note for note in notes[1.0]["notes"] if "restitution" in note]
    assert_names(
        note, "contact.restitution", f"{notes[1.0]['contact']['lowered']:.2g}", "contact.friction", "dt"
    )
    assert notes[0.0]["contact"]["lowered"] == 0.0
    assert not any("restitution" in note for note in notes[0.0].get("notes", ()))


@pytest.mark.parametrize("angle", [0.3, 1.9, 4.0, 5.5])
def test_the_slope_of_the_slip_across_friction_is_its_derivative(angle: float) -> None:
    half = np.random.default_rng(3).standard_normal((3, 3))
    W, d, h = half @ half.T + np.eye(3), np.array([1.0, 0.4, -0.7]), 1e-6
    before, _, _, _ = impact_kernels._slip(W, d, 0.5, angle - h)
    after, _, _, _ = impact_kernels._slip(W, d, 0.5, angle + h)
    assert impact_kernels._slip(W, d, 0.5, angle)[1] == pytest.approx((after - before) / (2 * h), rel=1e-7)
