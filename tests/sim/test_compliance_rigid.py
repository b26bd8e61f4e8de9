"""Rigid bodies on the Tripod in its compliance: rows and stiffness against finite moves, and which are left out."""

from collections.abc import Iterator

import numpy as np
import pytest

from tests.scenes import CUBE, SHARP
from tests.sim.test_compliance_contact import CALM, GOAL, bare, contact, gap, settle
from tripod_host.rotations import rotation_matrix
from tripod_sim import Simulation, load_scene
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.rest import rest_of
from tripod_sim.contact.rest_bodies import loose
from tripod_sim.contact.rest_rows import Rest
from tripod_sim.contact.stepper import ContactStepper
from tripod_sim.integrators.stepper import integrator_of
from tripod_sim.response import Holding, Response, held_response
from tripod_sim.system import System

FLOATS = np.ndarray
POST = f"obstacles=[{{source='{CUBE}', scale=0.03, position=[-0.027,0.0005,0.0015]}}]"
PLANK = "rigid=[{shape='box', size=[0.036,0.006,0.004], mass=0.005, position=[-0.0145,0.0,0.0072]}]"
"""From a post beside the body to its disc."""


@pytest.fixture(scope="module")
def lying() -> Simulation:
    """The plank at rest, pressed on a little more before, so that what sticks is not at its limit."""
    simulation = Simulation(load_scene(SHARP, [*CALM, POST, PLANK, contact(10.0)]))
    for k in range(10):
        simulation.step(1.02 * GOAL * (k + 1) / 10)
    settle(simulation, 1.02 * GOAL, 20)
    settle(simulation, GOAL, 20)
    return simulation


Bridge = tuple[Simulation, ContactSolver, System, Rest]


@pytest.fixture
def bridged(lying: Simulation) -> Iterator[Bridge]:
    """Its contacts with weights and normals as they are exactly there, not where the step found them; and their system,
    with the levers of that state."""
    stepper, system = integrator_of(lying._stepper), lying._static.system
    assert isinstance(stepper, ContactStepper)
    assert isinstance(system, System)
    c, x = stepper.world.contacts.arrays, stepper.world.positions_now()
    before = c.weight.copy(), c.normal.copy()
    for k in pressing(stepper.world):
        used = np.flatnonzero(c.weight[k])
        _, c.weight[k, used], c.normal[k] = gap(x[c.vertex[k, used]], np.sign(c.weight[k, used]))
    rest, left_out = rest_of(stepper, system, lying.state, lying._parts.rigid)
    assert rest
    assert left_out == ()
    assert len(rest.carried.spans) == 1
    yield lying, stepper.world, system, rest
    c.weight[:], c.normal[:] = before


def pressing(world: ContactSolver) -> np.ndarray:
    return np.flatnonzero(world.contacts.arrays.pressure[: world.contacts.count] > 0)


def moved(world: ContactSolver, simulation: Simulation, shift: FLOATS, turn: FLOATS, disc: FLOATS) -> FLOATS:
    """Return the vertices of all contacts after a move of the plank, and a shift `disc` of the disc [m]."""
    x, part = world.positions.copy(), world.surfaces.body
    centre = simulation.state.rigid.centres[0]
    x[part == 1] = centre + shift + (x[part == 1] - centre) @ rotation_matrix(turn).T
    x[part == 0] += disc
    return x


def directions(simulation: Simulation, count: int) -> list[tuple[FLOATS, FLOATS, FLOATS, FLOATS]]:
    """Return moves: shift and turn of the plank, shift of the disc, and all as the columns of a `Holding` have them."""
    rng, found = np.random.default_rng(3), []
    for _ in range(count):
        shift, turn, disc = rng.standard_normal((3, 3)) * np.array([[1.0], [50.0], [1.0]])
        found.append((shift, turn, disc, np.concatenate([disc, np.zeros(6), shift, turn])))
    return found


def test_the_plank_touches_post_and_disc(bridged: Bridge) -> None:
    simulation, world, system, rest = bridged
    c, of = world.contacts.arrays, pressing(world)
    parts = {frozenset(world.surfaces.body[c.vertex[k]].tolist()) for k in of}
    post = int(world.surfaces.body[-1])
    assert parts == {frozenset({0, 1}), frozenset({1, post})}
    unknowns = rest.holding(system).unknowns
    np.testing.assert_array_equal(
        unknowns, 3 * system.reduction.free_count + np.arange(6)
    )  # of the disc alone
    assert simulation.energies().kinetic < 1e-14


def test_rows_are_how_gaps_change(bridged: Bridge) -> None:
    simulation, world, system, rest = bridged
    c, of, h = world.contacts.arrays, pressing(world), 1e-7
    rows = rest.rows(system, rest.holding(system).unknowns)[: len(of)]
    assert (rest.of[: len(of)] == np.arange(len(of))).all()  # first those of the gaps
    for shift, turn, disc, column in directions(simulation, 5):
        gaps = []
        for sign in (h, -h):
            x = moved(world, simulation, sign * shift, sign * turn, sign * disc)
            gaps.append([distance(x[c.vertex[k]], c.weight[k]) for k in of])
        np.testing.assert_allclose(rows @ column, np.subtract(*gaps) / (2 * h), rtol=1e-4, atol=1e-6)


def test_the_stiffness_is_that_of_the_pressures(bridged: Bridge) -> None:
    """Of the potential -p g - f . d, with friction f as a dead force on the two sides' way d."""
    simulation, world, system, rest = bridged
    c, of, h = world.contacts.arrays, pressing(world), 2e-6

    def potential(x: FLOATS) -> float:
        total = 0.0
        for k in of:
            total -= c.pressure[k] * distance(x[c.vertex[k]], c.weight[k])
            total -= float(c.friction[k] @ (c.weight[k] @ x[c.vertex[k]]))
        return total

    stiffness, start = rest.holding(system).stiffness, potential(world.positions)
    for shift, turn, disc, column in directions(simulation, 5):
        ends = [potential(moved(world, simulation, s * shift, s * turn, s * disc)) for s in (h, -h)]
        expected = (ends[0] - 2 * start + ends[1]) / h**2
        assert abs(expected) > 0.1
        assert column @ stiffness @ column == pytest.approx(expected, rel=1e-3)


def test_a_plank_that_turns_along_with_the_disc_slips_on_the_post_alone(bridged: Bridge) -> None:
    """Though the surfaces are the contact distance apart."""
    simulation, world, system, rest = bridged
    c, of = world.contacts.arrays, pressing(world)
    rows = rest.rows(system, rest.holding(system).unknowns)
    sticking = np.flatnonzero(np.bincount(rest.of, minlength=len(of)) == 3)  # the others slip anyhow
    centres = simulation.state.centres[0], simulation.state.rigid.centres[0]
    turn, about = np.array([0.3, -0.5, 0.8]), np.array([0.01, 0.02, -0.03])
    shifts = [np.cross(turn, centre - about) for centre in centres]
    column = np.concatenate([shifts[0], turn, np.zeros(3), shifts[1], turn])
    slips = np.array([np.abs(rows[rest.of == k] @ column).max() for k in sticking])
    post = world.surfaces.body[-1]
    on_disc = [post not in world.surfaces.body[c.vertex[of[k]]] for k in sticking]
    assert 0 < sum(on_disc) < len(sticking)
    assert ((slips < 1e-15) == on_disc).all()


def distance(x: FLOATS, weights: FLOATS) -> float:
    used = np.flatnonzero(weights)
    return gap(x[used], np.sign(weights[used]))[0]


def test_with_the_plank_all_is_in_balance(lying: Simulation) -> None:
    simulation = lying
    c, without = simulation.compliance(), bare(simulation)
    assert simulation.left_out == ()
    assert np.abs(c.equilibrium_offset).max() < 1e-7
    assert np.abs(without.equilibrium_offset).max() > 1e-4
    np.testing.assert_array_equal(c.w, c.w.T)
    assert c.efforts == pytest.approx(simulation.efforts, abs=1e-8)


def held(rows: FLOATS, stiffness: FLOATS | None = None) -> Holding:
    """Return rows of rigid bodies on a body that stands still."""
    size = rows.shape[1]
    return Holding(
        np.zeros(0, dtype=np.int64), np.zeros((size, size)) if stiffness is None else stiffness, rows,
        np.zeros(size), np.tile([1.0, 1.0, 1.0, 0.01, 0.01, 0.01], size // 6),
    )  # fmt: skip


def pushes(*contacts: tuple[list[float], list[float]]) -> FLOATS:
    """Return the rows of contacts (point from the centre [m], normal)."""
    return np.array([[*n, *np.cross(r, n)] for r, n in contacts])


Z, FEET = [0.0, 0.0, 1.0], ([0.01, 0.0, -0.01], [-0.01, 0.01, -0.01], [-0.01, -0.01, -0.01])
STANDS = pushes(*((foot, Z) for foot in FEET))
STICKS = pushes(*((foot, axis) for foot in FEET for axis in np.eye(3).tolist()))


def test_what_slides_or_rolls_is_loose_and_what_sticks_on_three_feet_is_not() -> None:
    ball = pushes(*(([0.0, 0.0, -0.01], axis) for axis in np.eye(3).tolist()))
    assert loose(held(STANDS)).tolist() == [True]
    assert loose(held(ball)).tolist() == [True]
    assert loose(held(STICKS)).tolist() == [False]


def test_a_ball_without_friction_in_a_hole_is_held_however_it_turns() -> None:
    normals = [[0.6, 0.0, 0.8], [-0.3, 0.5, 0.8], [-0.3, -0.5, 0.8]]
    rows = pushes(*(([-0.01 * k for k in n], n) for n in normals))
    rows[:, 3:] = 0.0
    assert loose(held(rows)).tolist() == [False]
    assert loose(held(rows[:2])).tolist() == [True]


def test_springs_hold_as_well_unless_they_push_away() -> None:
    """Nothing but springs; then one direction of them unstable."""
    none, springs = np.zeros((0, 6)), 100.0 * STICKS.T @ STICKS
    assert loose(held(none, springs)).tolist() == [False]
    assert loose(held(none, 100.0 * STANDS.T @ STANDS)).tolist() == [True]
    springs[5, 5] *= -1.0
    assert loose(held(none, springs)).tolist() == [True]


def test_of_two_bodies_the_loose_one_is_named() -> None:
    """The second slides on the first, which sticks; then the first is not touched at all."""
    upper = np.zeros((3, 12))
    upper[:, :6], upper[:, 6:] = -STANDS, STANDS
    both = np.concatenate([np.concatenate([STICKS, np.zeros((9, 6))], axis=1), upper])
    assert loose(held(both)).tolist() == [False, True]
    alone = np.concatenate([np.zeros((9, 6)), STICKS], axis=1)
    assert loose(held(alone)).tolist() == [True, False]


def test_the_response_of_a_held_body_is_that_of_one_dense_system() -> None:
    """Of a body, its angles, further unknowns and multipliers together; nothing is in balance."""
    rng = np.random.default_rng(6)
    n, s, b, m, ports, where = 8, 2, 6, 3, np.array([0, 2, 1, 4, 5]), np.array([2, 3, 4])
    root = rng.standard_normal((n, n))
    K, Ks, Kss = root @ root.T + np.eye(n), rng.standard_normal((n, s)), 9.0 * np.eye(s)
    unbalanced, r = rng.standard_normal(n), rng.standard_normal(b)
    half = rng.standard_normal((3 + s + b, 3 + s + b))
    Z, C = half @ half.T, rng.standard_normal((m, 3 + s + b))
    back = np.linalg.inv(K)
    free = Response(
        back[np.ix_(ports, ports)], -(back @ Ks)[ports], Kss - Ks.T @ back @ Ks, -(back @ unbalanced)[ports]
    )
    found = held_response(free, Holding(ports[where], Z, C, r, np.ones(b)), where)

    size, place = n + b + m + s, np.concatenate([ports[where], n + b + m + np.arange(s), n + np.arange(b)])
    whole = np.zeros((size, size))  # x, y, multipliers, angles
    whole[:n, :n], whole[:n, -s:], whole[-s:, :n], whole[-s:, -s:] = K, Ks, Ks.T, Kss
    whole[np.ix_(place, place)] += Z
    rows = n + b + np.arange(m)
    whole[np.ix_(rows, place)], whole[np.ix_(place, rows)] = C, C.T
    inner, coupling, loads = whole[:-s, :-s], whole[:-s, -s:], np.zeros(size - s)
    loads[:n], loads[n : n + b] = unbalanced, r
    answer = np.linalg.inv(inner)
    close = {"rtol": 1e-8, "atol": 1e-10}
    np.testing.assert_allclose(found.flexibility, answer[np.ix_(ports, ports)], **close)
    np.testing.assert_allclose(found.jacobian, -(answer @ coupling)[ports], **close)
    np.testing.assert_allclose(found.fall, -(answer @ loads)[ports], **close)
    np.testing.assert_allclose(found.stiffness, whole[-s:, -s:] - coupling.T @ answer @ coupling, **close)
