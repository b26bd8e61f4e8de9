"""The compliance of a Tripod that stands on a post, against finite moves of the servos and of a load."""

import numpy as np
import pytest

from tests.scenes import CUBE, SHARP
from tripod_sim import Simulation, load_scene
from tripod_sim.ball.rest import carried
from tripod_sim.compliance import Compliance, compliance
from tripod_sim.contact.rest import curvature
from tripod_sim.contact.rest_rows import Carried, Points, Rest
from tripod_sim.forces.gravity import GravityForce
from tripod_sim.steps.sleep import Sleeping
from tripod_sim.system import System

FLOATS = np.ndarray
CALM = [
    "mesh.level=1",
    "dt=0.05",
    "solver.mode=newton",
    "solver.tolerance=1e-9",
    "damping={mass=20.0, stiffness=2e-3}",
]
DISC = f"obstacles=[{{source='{CUBE}', scale=0.1, position=[0,0,-0.0155]}}]"
"""A cube of 2 cm under the disc."""

STRIP = f"obstacles=[{{source='{CUBE}', scale=0.03, position=[0.028,0.001,-0.0075]}}]"
"""One of 6 mm under the first strip, to one side of its middle."""

BALL = "rigid=[{shape='ball', radius=0.008, mass=0.05, position=[0.0004,0.0002,0.0115]}]"
"""One in the hole of the disc, heavier than the body."""

GOAL = np.array([0.036, 0.036, 0.036, 0.0])
H, FORCE, STEPS = 1e-3, 0.005, 12


def contact(friction: float, response: str = "lagrange") -> str:
    law = f"friction={friction}, response='{response}', tolerance=1e-6, max_solves=200"
    return f"contact={{contact_distance=5e-4, alarm_distance=1.5e-3, {law}}}"


CASES = {
    "disc slides": (DISC, contact(0.0), 1e-3),
    "disc sticks": (DISC, contact(10.0), 1e-3),
    "strip slides": (STRIP, contact(0.0), 1e-3),
    "strip sticks": (STRIP, contact(4.0), 1e-2),
    "strip on a spring": (STRIP, contact(0.0, "penalty"), 1e-2),
    "disc under a ball": (BALL, contact(0.0), 1e-2),
}
"""What touches, contact, and the share by which prediction and finite moves may differ: sticking ones slip a little,
and of the six corners of its hole the ball presses others with every move."""


def settle(simulation: Simulation, joints: FLOATS, steps: int = STEPS) -> None:
    for _ in range(steps):
        simulation.step(joints)


@pytest.fixture(scope="module", params=CASES, ids=list(CASES))
def standing(request: pytest.FixtureRequest) -> tuple[Simulation, float]:
    """Pressed on the post, then a little back, so that what sticks is not at its limit."""
    post, touch, share = CASES[request.param]
    simulation = Simulation(load_scene(SHARP, [*CALM, post, touch]))
    for k in range(20):
        simulation.step(1.1 * GOAL * (k + 1) / 20)
    settle(simulation, 1.1 * GOAL, 20)
    settle(simulation, GOAL, 2 * STEPS)
    assert simulation.report.contact
    assert simulation.report.contact.pressed >= 2
    assert simulation.energies().kinetic < 1e-14
    return simulation, share


def bare(simulation: Simulation) -> Compliance:
    """Return the compliance of the same pose as if there were no post."""
    return compliance(body(simulation), simulation.state)


def body(simulation: Simulation) -> System:
    system = simulation._static.system
    assert isinstance(system, System)
    return system


def response(c: Compliance) -> tuple[FLOATS, FLOATS, FLOATS]:
    """Return J, K, and the effector's compliance at held angles."""
    K = np.linalg.inv(c.w[6:, 6:])
    J = c.w[:6, 6:] @ K
    return J, K, c.w[:6, :6] - J @ c.w[6:, :6]


Pose = tuple[FLOATS, FLOATS, FLOATS]


def pose(simulation: Simulation) -> Pose:
    return simulation.state.centres[0].copy(), simulation.state.rotations[0].copy(), simulation.efforts.copy()


def slope(ahead: Pose, behind: Pose, h: float) -> FLOATS:
    """Return how translation, rotation and torques change, shape (9,)."""
    R = ahead[1] @ behind[1].T
    spin = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    return np.concatenate([ahead[0] - behind[0], spin, ahead[2] - behind[2]]) / (2 * h)


def off(predicted: FLOATS, found: FLOATS) -> float:
    """Return the largest error of translations, rotations and torques, each as a share of its largest change."""
    parts = [slice(k, k + 3) for k in range(0, len(found), 3)]
    return max(float(np.abs(predicted[p] - found[p]).max() / np.abs(found[p]).max()) for p in parts)


def test_servo_rows_are_those_of_the_held_body(standing: tuple[Simulation, float]) -> None:
    simulation, share = standing
    c, without, columns = simulation.compliance(), bare(simulation), []
    for servo in range(3):
        ends = []
        for sign in (1, -1):
            settle(simulation, GOAL + sign * H * np.eye(4)[servo])
            ends.append(pose(simulation))
        columns.append(slope(ends[0], ends[1], H))
    settle(simulation, GOAL)
    found = np.array(columns).T
    J, K, _ = response(c)
    assert off(np.concatenate([J, K]), found) < share
    J, K, _ = response(without)
    assert off(np.concatenate([J, K]), found) > 10 * share


def test_effector_rows_are_those_of_the_held_body(standing: tuple[Simulation, float]) -> None:
    simulation, share = standing
    place, force = np.array([0.004, 0.002, 0.001]), np.array([0.3, -0.5, 1.0])
    held, free = (response(c)[2] for c in (simulation.compliance(), bare(simulation)))
    system = simulation._system
    assert isinstance(system, System)
    disc, gravity = system.groups.rigid[0], system.term(GravityForce)
    assert gravity
    arms = simulation.state.positions[disc] - simulation.state.centres[0]
    extra, ends = FORCE * carried(arms, place, force), []
    for sign in (1, -1):
        gravity._gradient[disc] -= sign * extra
        settle(simulation, GOAL)
        ends.append(pose(simulation))
        gravity._gradient[disc] += sign * extra
    settle(simulation, GOAL)
    found, wrench = slope(ends[0], ends[1], FORCE)[:6], np.concatenate([force, np.cross(place, force)])
    assert off(held @ wrench, found) < share
    assert off(free @ wrench, found) > 10 * share


def test_what_presses_is_in_balance_and_in_the_torques(standing: tuple[Simulation, float]) -> None:
    simulation, _ = standing
    c, without = simulation.compliance(), bare(simulation)
    np.testing.assert_array_equal(c.w, c.w.T)
    assert np.abs(c.equilibrium_offset).max() < 1e-8
    assert np.abs(without.equilibrium_offset).max() > 1e-4
    assert c.efforts == pytest.approx(simulation.efforts, abs=1e-8)


def on_nodes(system: System, at: FLOATS, vectors: FLOATS, give: FLOATS) -> Rest:
    """Return rows of nodes of the body alone, without pressure."""
    points = Points(at, np.full(at.shape, -1), np.zeros_like(vectors), np.ones(at.shape, dtype=bool))
    none = Carried(np.zeros((0, 3, 3)), np.zeros((0, 6)), np.zeros(0))
    m = len(at)
    return Rest(
        np.zeros_like(system.rest),
        points,
        np.zeros((m, 12, 12)),
        np.arange(m),
        vectors,
        points.arms,
        give,
        none,
    )


def test_many_points_under_a_disc_hold_it_in_six_directions() -> None:
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1"]))
    system = body(simulation)
    disc = system.groups.rigid[0]
    m = 3 * len(disc)
    at = np.concatenate([np.repeat(disc, 3)[:, None], np.zeros((m, 3), dtype=np.int64)], axis=1)
    vectors = np.zeros((m, 4, 3))
    vectors[:, 0] = np.tile(np.eye(3), (len(disc), 1))
    held = on_nodes(system, at, vectors, np.zeros(m))
    assert len(held.holding(system).rows) == 6 < m
    J, _, block = response(compliance(system, simulation.state, held=held))
    free = response(bare(simulation))
    assert np.abs(block).max() < 1e-12 * np.abs(free[2]).max()
    assert np.abs(J).max() < 1e-12 * np.abs(free[0]).max()


def test_rows_of_driven_nodes_turn_with_the_servos() -> None:
    """Against the move of the nodes, and all that follows against one dense solution for body, angles and rows."""
    words = ["mesh.level=1", "inertia=off", "damping=off", f"servos.angles={(10 * GOAL[:3]).tolist()}"]
    simulation = Simulation(load_scene(SHARP, words))
    system, rng = body(simulation), np.random.default_rng(1)
    r, n, s = system.reduction, system.unknowns, 3
    at = np.stack([system.driven[[0, -1, 3, 5]], r.free[[0, 20, 40, 60]]], axis=1)
    at = np.concatenate([at, at], axis=1)
    vectors = rng.standard_normal((4, 4, 3)) * np.array([1.0, 1.0, 0.0, 0.0])[:, None]
    give = np.array([0.0, 0.0, 0.004, -0.2])
    held = on_nodes(system, at, vectors, give)
    c = compliance(system, simulation.state, held=held)
    found = held.rows(system, np.arange(n))
    rows, turns = found[:, :n], found[:, n:]
    angles, moved = 1e-5, np.zeros((4, s))
    for k in range(s):
        ends = []
        for sign in (1, -1):
            state = simulation.state.copy()
            system.drive(state, simulation.state.joints + sign * angles * np.eye(4)[k])
            ends.append(np.einsum("rki,rki->r", vectors, state.positions[at]))
        moved[:, k] = (ends[0] - ends[1]) / (2 * angles)
    np.testing.assert_allclose(turns, moved, atol=1e-8)
    upper = r.pattern.toarray()
    K = upper + np.triu(upper, 1).T
    whole = np.zeros((n + s + 4, n + s + 4))
    whole[:n, :n], whole[:n, n : n + s], whole[n : n + s, :n] = K, r.drive, r.drive.T
    whole[n : n + s, n : n + s] = r.drive_drive
    C = np.concatenate([rows, turns], axis=1)
    whole[: n + s, n + s :], whole[n + s :, : n + s], whole[n + s :, n + s :] = C.T, C, -np.diag(give)
    ports = np.concatenate([3 * r.free_count + np.arange(6), n + np.arange(s)])
    expected = np.linalg.solve(whole, np.eye(len(whole))[:, ports])[ports]
    np.testing.assert_allclose(c.w, expected, atol=1e-8 * np.abs(expected).max())
    assert np.abs(c.w - bare(simulation).w).max() > 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize(("height", "near"), [("-0.0155", True), ("-0.9", False)])
def test_a_post_that_is_not_touched_changes_no_bit(height: str, near: bool) -> None:
    """Half a millimetre more than the contact distance below the disc, or far away."""
    post = DISC.replace("-0.0155", height)
    simulation = Simulation(load_scene(SHARP, [*CALM, post, contact(0.3)]))
    settle(simulation, np.zeros(4), 5)
    assert simulation.report.contact
    assert (simulation.report.contact.contacts > 0) == near
    assert simulation.report.contact.pressed == 0
    c, without = simulation.compliance(), bare(simulation)
    for name in ("w", "efforts", "equilibrium_offset"):
        assert getattr(c, name).tobytes() == getattr(without, name).tobytes()


def test_what_goes_where_it_is_pushed_does_not_hold() -> None:
    """A rigid ball that falls on the disc."""
    ball = "rigid=[{shape='ball', radius=0.012, mass=0.01, position=[0.0004,0.0002,0.016]}]"
    simulation = Simulation(load_scene(SHARP, [*CALM, "dt=0.005", ball, contact(0.3)]))
    for _ in range(40):
        simulation.step()
        if simulation.report.contact and simulation.report.contact.pressed:
            break
    else:
        pytest.fail("nothing was touched")
    assert simulation.compliance().w.tobytes() == bare(simulation).w.tobytes()
    assert simulation.left_out == (0,)


def test_a_body_that_sleeps_on_its_post_is_held() -> None:
    awake, asleep = (
        Simulation(load_scene(SHARP, [*CALM, DISC, contact(0.0), *words])) for words in ([], ["sleep={}"])
    )
    for simulation in (awake, asleep):
        for k in range(30):
            simulation.step(GOAL * min(1.0, (k + 1) / 10))
    assert isinstance(asleep._stepper, Sleeping)
    assert asleep._stepper.asleep
    w = asleep.compliance().w
    assert np.abs(w - awake.compliance().w).max() < 1e-3 * np.abs(w).max()
    assert np.abs(w - bare(asleep).w).max() > 1e-2 * np.abs(w).max()


def test_what_was_pressed_is_forgotten_with_the_state(standing: tuple[Simulation, float]) -> None:
    simulation, _ = standing
    before = simulation.save()
    simulation.restore(before)
    assert simulation.compliance().w.tobytes() == bare(simulation).w.tobytes()
    simulation.step(GOAL)
    assert not np.array_equal(simulation.compliance().w, bare(simulation).w)


def gap(x: FLOATS, signs: FLOATS) -> tuple[float, FLOATS, FLOATS]:
    """Return the distance of the sides' lines or planes, the weights and the direction between the nearest points."""
    one, other = np.flatnonzero(signs > 0), np.flatnonzero(signs < 0)
    shift = np.zeros((len(x), len(x) - 2))
    for t, (first, k) in enumerate([(one[0], k) for k in one[1:]] + [(other[0], k) for k in other[1:]]):
        shift[first, t], shift[k, t] = -signs[first], signs[k]
    start = np.zeros(len(x))
    start[one[0]], start[other[0]] = 1.0, -1.0
    w = start + shift @ np.linalg.lstsq(x.T @ shift, -x.T @ start, rcond=None)[0]
    d = w @ x
    return float(np.linalg.norm(d)), w, d / np.linalg.norm(d)


@pytest.mark.parametrize(
    "signs", [(1, 1, -1, -1), (1, -1, -1, -1), (1, 1, 1, -1), (1, -1, -1, 0), (1, 0, 0, -1)]
)
def test_the_curvature_of_a_gap_is_its_second_derivative(signs: tuple[int, ...]) -> None:
    """Of two sides whose nearest points lie within them."""
    rng = np.random.default_rng(5)
    sides, x, h = np.array(signs, dtype=float), rng.standard_normal((4, 3)), 1e-4
    used, weights = np.flatnonzero(sides), rng.uniform(0.5, 1.0, 4) * sides
    for side in (sides > 0, sides < 0):
        weights[side] /= np.abs(weights[side].sum())
    edges = [x[k] - x[i] for k in used for i in used[:k] if sides[k] == sides[i] and i < k]
    n = np.linalg.svd(np.array([*edges, np.zeros(3)]))[2][-1]
    x[sides > 0] += 0.7 * n - weights @ x

    def gradient(move: FLOATS) -> FLOATS:
        _, w, n = gap((x + move.reshape(4, 3))[used], sides[used])
        out = np.zeros((4, 3))
        out[used] = w[:, None] * n
        return out.ravel()

    distance, w, direction = gap(x[used], sides[used])
    assert distance == pytest.approx(0.7)
    np.testing.assert_allclose(w, weights[used], atol=1e-12)
    np.testing.assert_allclose(direction, n, atol=1e-12)
    found = np.array([(gradient(h * e) - gradient(-h * e)) / (2 * h) for e in np.eye(12)])
    second = curvature(x[None], weights[None], n[None])[0]
    assert np.abs(found).max() > 1e-2
    np.testing.assert_allclose(second, found, atol=1e-6 * np.abs(found).max())
