"""Cables: derivatives, balance, hard cases, and what beam theory says of a beam that a cable bends."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import fsolve

from benchmarks.blocks import brick, elastic, lumped
from tests.checks import assert_derivative, assert_gradient, assert_symmetric
from tests.messages import raises_naming
from tests.sim.implicit_schemes import IMPLICIT, scheme_of
from tripod_host.arrays import FloatArray
from tripod_sim import SceneError
from tripod_sim.constraints.groups import Groups
from tripod_sim.forces.anchor import Anchor
from tripod_sim.forces.cable import Cable
from tripod_sim.integrators.implicit import ImplicitSteps
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.substeps import Substeps, halving
from tripod_sim.mesh.embedding import Embedding, in_solid, in_world, joined
from tripod_sim.mesh.solid_mesh import Block, SolidMesh
from tripod_sim.state import State
from tripod_sim.system import System

LENGTH, SIDE, YOUNG, DENSITY = 0.1, 0.02, 0.5e6, 1070.0
"""Of the finger along x, of square section: [m], [m], [Pa], [kg/m³]."""


def finger(element: str = "h20", cells: tuple[int, int, int] = (8, 2, 2)) -> SolidMesh:
    """Return its mesh, the section from 0 to SIDE."""
    ends = (LENGTH, SIDE, SIDE)
    return brick(element, [np.linspace(0, end, n + 1) for end, n in zip(ends, cells, strict=True)])


def line(height: float = 0.017, count: int = 5, *, across: float = 0.011) -> FloatArray:
    """Return via points along the finger [m]."""
    return np.stack(
        [np.linspace(0.004, 0.097, count), np.full(count, across), np.full(count, height)], axis=1
    )


def pulled(mesh: SolidMesh, points: FloatArray) -> Embedding:
    """Return via points in the finger behind a pull point in the world, in line with them."""
    return joined([in_world(np.array([[-0.01, *points[0, 1:]]])), in_solid(points, mesh)])


@dataclass
class Held:
    """A body that is held where x = 0, with cables."""

    system: System
    cables: list[Cable]
    newton: Newton
    state: State

    def settle(self, *commands: float, parts: int = 1) -> FloatArray:
        """Go to rest at these commands, in some parts; return the positions [m]."""
        start = self.state.joints.copy()
        for part in range(1, parts + 1):
            joints = start.copy()
            joints[: len(commands)] += (np.array(commands) - start[: len(commands)]) * part / parts
            self.newton.solve(self.state, joints)
        self.system.evaluate(self.state)
        return self.state.positions


def held(
    mesh: SolidMesh, *cables: Cable, young: float = YOUNG, poisson: float = 0.45, tolerance: float = 1e-10
) -> Held:
    """Return a body at rest without gravity."""
    x = np.array(mesh.nodes)
    groups = Groups(len(x), fixed=np.flatnonzero(x[:, 0] < 1e-9), actuators=len(cables))
    system = System(x, [elastic(mesh, young, poisson)], groups, cables)
    return Held(
        system, list(cables), Newton(system, tolerance, 200), system.start_state(np.zeros(len(cables) + 1))
    )


@dataclass
class Moving:
    """The finger with inertia and damping, stepped in time."""

    cable: Cable
    stepper: Substeps
    state: State

    def step(self, command: float, dt: float) -> None:
        """Advance by `dt` [s], the cable's command at the end given."""
        self.stepper.step(self.state, np.array([command, 0.0]), dt)


def moving(*, drag: float, scheme: str = "implicit_euler") -> Moving:
    """Return the finger; `drag`: damping by mass [1/s]."""
    mesh = finger("h8_modes")
    x = np.array(mesh.nodes)
    _, mass = lumped(mesh, DENSITY * LENGTH * SIDE**2)
    cable, inertia = Cable(pulled(mesh, line()), x), Anchor(len(x))
    groups = Groups(len(x), fixed=np.flatnonzero(x[:, 0] < 1e-9), actuators=1)
    system = System(x, [elastic(mesh, YOUNG, 0.45)], groups, [cable, inertia])
    stage = ImplicitStage(Newton(system, 1e-8, 200), inertia, mass, drag)
    stepper = halving(ImplicitSteps(scheme_of(scheme), stage), 4)
    return Moving(cable, stepper, system.start_state(np.zeros(2)))


def gradient(cable: Cable, x: FloatArray) -> FloatArray:
    """Return dV/dx [N]."""
    g = np.zeros_like(x)
    cable.add_gradient(x, g)
    return g


def whole(cable: Cable, size: int) -> FloatArray:
    """Return the Hessian of the last `stiffness` among all unknowns."""
    out = np.zeros((3 * size, 3 * size))
    own = (3 * cable.elements[0][:, None] + np.arange(3)).ravel()
    out[np.ix_(own, own)] = cable.matrices[0]
    return out


def commanded(cable: Cable, q: float, x: FloatArray) -> float:
    """Return V [J] at the command q."""
    cable.value = q
    return cable.add_gradient(x, np.zeros_like(x))


@pytest.mark.parametrize("element", ["h8", "h20", "h27", "t4", "t10", "w6"])
@pytest.mark.parametrize(("by_tension", "q"), [(False, 0.01), (True, 3.0)])
def test_the_derivatives_are_those_of_the_potential(element: str, by_tension: bool, q: float) -> None:
    """With a point in the world, two at one place, and two in one element."""
    rng, mesh = np.random.default_rng(1), finger(element)
    points = np.concatenate([line(count=4), [[0.0975, 0.011, 0.006]]])
    cable = Cable(pulled(mesh, points[[0, 1, 1, 2, 3, 4]]), mesh.nodes, by_tension=by_tension, stiffness=1e4)
    x = mesh.nodes + 1e-3 * rng.standard_normal(mesh.nodes.shape)
    commanded(cable, q, x)
    g = gradient(cable, x)
    cable.stiffness(x, project=False)
    hessian = whole(cable, len(x))
    assert_gradient(lambda at: commanded(cable, q, at), g, x, rng, h=1e-7, rel=1e-6)
    assert_derivative(lambda at: gradient(cable, at), hessian, x, rng, h=1e-7, rel=1e-6)
    assert_symmetric(hessian)
    assert np.linalg.eigvalsh(cable.matrices[0])[0] > -1e-10 * np.abs(hessian).max()
    product, move = np.zeros_like(x), rng.standard_normal(x.shape)
    cable.add_products(move, product)
    np.testing.assert_allclose(
        product.ravel(), hessian @ move.ravel(), rtol=0, atol=1e-9 * np.abs(hessian).max()
    )
    coupling, h = np.zeros_like(x), 1e-6 * q
    cable.add_coupling(x, coupling)
    effort, slope = cable.effort, cable.effort_slope
    sides = []
    for shifted in (q + h, q - h):
        energy = commanded(cable, shifted, x)
        sides.append((energy, cable.effort, gradient(cable, x)))
    (high, up, above), (low, down, below) = sides
    assert effort == pytest.approx((high - low) / (2 * h), rel=1e-6)
    assert slope == pytest.approx((up - down) / (2 * h), rel=1e-6, abs=1e-9)
    np.testing.assert_allclose(
        coupling, (above - below) / (2 * h), rtol=0, atol=1e-6 * np.abs(coupling).max()
    )


@pytest.mark.parametrize("by_tension", [False, True])
def test_a_cable_within_a_body_exerts_no_net_force_and_no_moment(by_tension: bool) -> None:
    rng, mesh = np.random.default_rng(2), finger()
    cable = Cable(in_solid(line(), mesh), mesh.nodes, by_tension=by_tension)
    x = mesh.nodes + 2e-3 * rng.standard_normal(mesh.nodes.shape)
    commanded(cable, 5.0, x)
    g = gradient(cable, x)
    size = np.abs(g).sum()
    assert size > 1.0
    np.testing.assert_allclose(g.sum(axis=0), 0.0, atol=1e-15 * size)
    np.testing.assert_allclose(np.cross(x, g).sum(axis=0), 0.0, atol=1e-16 * size)


def test_a_cable_that_is_pushed_is_slack_and_stores_nothing() -> None:
    mesh = finger()
    cable = Cable(pulled(mesh, line()), mesh.nodes, stiffness=1e4)
    for q, tension in ((0.003, 30.0), (-0.003, 0.0)):
        energy = commanded(cable, q, mesh.nodes)
        assert cable.tension == cable.effort == pytest.approx(tension, abs=1e-9)
        assert energy == pytest.approx(tension**2 / 2e4)
        assert cable.energies(mesh.nodes) == (energy, 0.0)
        assert np.abs(gradient(cable, mesh.nodes)).max() > 0 or not tension
        cable.stiffness(mesh.nodes, project=False)
        assert cable.matrices.any() == (tension > 0)
    given = Cable(pulled(mesh, line()), mesh.nodes, rest_length=cable.rest_length + 0.002, stiffness=1e4)
    commanded(given, 0.003, mesh.nodes)
    assert given.tension == pytest.approx(10.0)


def test_a_tension_that_is_negative_pulls_nothing() -> None:
    mesh = finger()
    cable = Cable(pulled(mesh, line()), mesh.nodes, by_tension=True)
    assert commanded(cable, -2.0, mesh.nodes) == 0.0
    assert not gradient(cable, mesh.nodes).any()


def test_of_a_segment_that_vanishes_no_force_is_left_and_around_it_none_jumps() -> None:
    """The pull point in the world, at a via point of the body: a body that reaches it stays there."""
    mesh = finger()
    points = line()
    cable = Cable(
        joined([in_world(points[:1] - np.array([1e-3, 0, 0])), in_solid(points, mesh)]),
        mesh.nodes,
        by_tension=True,
    )
    bare = Cable(in_solid(points, mesh), mesh.nodes, by_tension=True)
    there = mesh.nodes - [1e-3, 0, 0]
    for each in (cable, bare):
        commanded(each, 2.0, there)
    np.testing.assert_allclose(gradient(cable, there), gradient(bare, there), rtol=0, atol=1e-8)
    cable.stiffness(there, project=False)
    assert np.isfinite(cable.matrices).all()
    assert cable.length == pytest.approx(bare.length, abs=2e-6 * cable.length)
    beside = there + np.array([1e-10, 0, 0])
    assert np.abs(gradient(cable, beside) - gradient(bare, there)).max() < 5e-3


@pytest.mark.parametrize("points", [np.zeros((0, 3)), line()[:1], line()[[2, 2, 2]]])
def test_a_cable_without_length_is_refused(points: FloatArray) -> None:
    mesh = finger()
    with raises_naming(SceneError, "cable.0", "no length", len(points), "different places"):
        Cable(in_solid(points, mesh) if len(points) else in_world(points), mesh.nodes, owner="cable.0")


def test_a_cable_in_the_world_alone_is_refused() -> None:
    with raises_naming(SceneError, "cable.0", "no via point", "body"):
        Cable(in_world(line()), finger().nodes, owner="cable.0")


DEPTH, OFFSET = 0.004, 0.0015
"""Of the slender beam, square, and how far the cable lies off its axis [m]."""


def arc(tension: float) -> tuple[float, float]:
    """Return stretch of the axis and its curvature per undeformed length [1/m] of a beam that a cable bends.

    The cable follows the beam at OFFSET from the axis, so every section bears the force -T and the moment T OFFSET:
    the axis is a circular arc. With nu = 0 plane sections of neo-Hookean material have the stretch s = c + k y and the
    stress E (s - 1 / s) / 2 [Pa]; c and k balance force and moment.
    """

    def unbalanced(ck: FloatArray) -> list[float]:
        c, k = ck

        def moment(y: float, power: int) -> float:
            s = c + k * y
            return DEPTH * YOUNG * (s - 1 / s) / 2 * y**power

        force, turn = (quad(moment, -DEPTH / 2, DEPTH / 2, (power,), epsabs=1e-14)[0] for power in (0, 1))
        return [(force + tension) / tension, turn / (tension * OFFSET) - 1.0]

    guess = tension * OFFSET / (YOUNG * DEPTH**4 / 12)
    c, k = fsolve(unbalanced, [1.0, guess], xtol=1e-12)
    return float(c), float(k)


@pytest.mark.parametrize("angle", [0.5, 1.5])
def test_a_cable_beside_the_axis_bends_a_beam_to_the_arc_of_the_exact_solution(angle: float) -> None:
    """The tip within 0.5 % of its way, up to a turn of 1.5 rad."""
    tension = angle / LENGTH * YOUNG * DEPTH**4 / 12 / OFFSET
    c, k = arc(tension)
    cells = (50, 2, 2)
    lines = [np.linspace(0, LENGTH, cells[0] + 1), *[np.linspace(-DEPTH / 2, DEPTH / 2, 3)] * 2]
    mesh = brick("h20", lines)
    x = np.linspace(0, LENGTH, cells[0] + 1)
    points = np.stack([x, np.zeros_like(x), np.full_like(x, OFFSET)], axis=1)
    body = held(mesh, Cable(in_solid(points, mesh), mesh.nodes, by_tension=True), poisson=0.0)
    found = body.settle(tension, parts=6)
    tip = found[np.argmin(np.linalg.norm(mesh.nodes - [LENGTH, 0, 0], axis=1))]
    turn = k * LENGTH
    exact = np.array([c * np.sin(turn) / k, 0.0, c * (1 - np.cos(turn)) / k])
    assert turn > 0.9 * angle
    assert np.linalg.norm(tip - exact) < 0.005 * np.linalg.norm(exact - [LENGTH, 0, 0])


def test_opposite_cables_of_one_tension_bend_nothing_and_press_the_beam() -> None:
    """In the middle of the beam its strain is that of the force of both over the section."""
    tension, mesh = 0.4, finger()
    cables = [
        Cable(pulled(mesh, line(h, across=SIDE / 2)), mesh.nodes, by_tension=True) for h in (0.017, 0.003)
    ]
    found = held(mesh, *cables).settle(tension, tension)
    axis = np.linalg.norm(mesh.nodes[:, 1:] - SIDE / 2, axis=1) < 1e-9
    moved, x = found[axis] - mesh.nodes[axis], mesh.nodes[axis, 0]
    assert np.abs(moved[:, 1:]).max() < 1e-10
    first, last = (moved[np.argmin(np.abs(x - at)), 0] for at in (0.0375, 0.0625))
    assert (last - first) / 0.025 == pytest.approx(-2 * tension / (SIDE**2 * YOUNG), rel=0.01)
    assert held(mesh, cables[0]).settle(tension)[:, 2].max() - mesh.nodes[:, 2].max() > 0.001


def test_commanded_by_length_or_by_the_tension_that_this_takes_the_pose_is_the_same() -> None:
    mesh = finger()
    points = pulled(mesh, line())
    by_tension = held(mesh, Cable(points, mesh.nodes, by_tension=True))
    want = by_tension.settle(6.0, parts=3).copy()
    (cable,) = by_tension.cables
    assert want[:, 2].max() > 0.04
    stiff = Cable(points, mesh.nodes)
    by_length = held(mesh, stiff, tolerance=2e-9)
    found = by_length.settle(-cable.effort + 6.0 / 1e6, parts=3)
    assert stiff.tension == pytest.approx(6.0, rel=1e-8)
    np.testing.assert_allclose(found, want, rtol=0, atol=1e-9)


def test_at_rest_steps_of_any_length_give_the_same_pose() -> None:
    found = []
    for dt in (1e-3, 5e-3, 20e-3):
        body = moving(drag=90.0)
        for _ in range(round(0.8 / dt)):
            body.step(0.01, dt)
        assert np.abs(body.state.velocities).max() < 1e-8
        assert body.cable.length == pytest.approx(body.cable.rest_length - 0.01, abs=2e-5)
        found.append(body.state.positions.copy())
    assert np.abs(found[0] - moving(drag=0.0).state.positions).max() > 0.01
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("scheme", [name for name in IMPLICIT if name != "generalised_alpha"])
def test_slack_and_taut_in_turn_each_step_is_solved(scheme: str) -> None:
    """Generalised alpha gains energy from velocities that jump, since it carries an acceleration on."""
    body, taut = moving(drag=20.0, scheme=scheme), 0
    for k in range(200):
        body.step(-0.05 if k % 2 else 0.01, 5e-3)
        assert np.isfinite(body.state.positions).all()
        assert not (k % 2 and body.cable.tension)
        taut += body.cable.tension > 0.1
    assert taut > 50


@pytest.mark.parametrize("element", ["h20", "t10", "h8_modes"])
def test_a_cable_along_the_edge_of_elements_is_one_a_nanometre_beside_it(element: str) -> None:
    mesh = finger(element)
    edge = line(0.01, across=0.01)  # the middle of two by two cells
    edge[-2:, 2] = 0.02
    found = []
    for aside in ([0, 0, 0], [0, 1e-9, -1e-9], [0, -1e-9, -1e-9]):
        body = held(mesh, Cable(pulled(mesh, edge + aside), mesh.nodes, by_tension=True))
        found.append(body.settle(4.0, parts=2))
    assert np.abs(found[0] - mesh.nodes).max() > 0.004
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=0, atol=1e-8)


def test_a_pull_of_half_the_length_in_one_step_is_solved() -> None:
    """It asks for 50 kN before anything has moved."""
    body = moving(drag=2.0)
    body.step(0.05, 5e-3)
    assert body.cable.length == pytest.approx(body.cable.rest_length - 0.05, abs=1e-3)
    assert np.isfinite(body.state.positions).all()


def test_between_two_bodies_it_pulls_both_alike_along_its_line() -> None:
    one, two = finger(), finger("t10", (4, 1, 1))
    nodes = np.concatenate([one.nodes, two.nodes + np.array([0.02, 0.05, 0.01])])
    both = SolidMesh(nodes, (one.blocks[0], Block(two.kind, two.elements + len(one.nodes))))
    ends = np.array([[0.09, 0.01, 0.01], [0.05, 0.06, 0.02]])
    cable = Cable(in_solid(ends, both), nodes, by_tension=True)
    commanded(cable, 3.0, nodes)
    g = gradient(cable, nodes)
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    np.testing.assert_allclose(-g[: len(one.nodes)].sum(axis=0), 3.0 * along, rtol=0, atol=1e-9)
    np.testing.assert_allclose(-g[len(one.nodes) :].sum(axis=0), -3.0 * along, rtol=0, atol=1e-9)


def test_a_rigid_end_is_turned_by_a_cable_that_is_pulled_at_once() -> None:
    """The pull asks for 5 kN before anything has moved, and such a force would turn the end over."""
    mesh = finger()
    x = np.array(mesh.nodes)
    end = np.flatnonzero(x[:, 0] > LENGTH - 0.02)
    groups = Groups(len(x), rigid=(end,), fixed=np.flatnonzero(x[:, 0] < 1e-9), actuators=1)
    cable = Cable(pulled(mesh, line()), x)
    system = System(x, [elastic(mesh, YOUNG, 0.45)], groups, [cable])
    body = Held(system, [cable], Newton(system, 1e-8, 60), system.start_state(np.zeros(2)))
    found = body.settle(0.005)
    assert cable.length == pytest.approx(cable.rest_length - 0.005, abs=1e-5)
    spread = found[end] - found[end].mean(axis=0)
    was = x[end] - x[end].mean(axis=0)
    np.testing.assert_allclose(spread @ spread.T, was @ was.T, rtol=0, atol=1e-15)
    assert found[end, 2].mean() - x[end, 2].mean() > 0.005
