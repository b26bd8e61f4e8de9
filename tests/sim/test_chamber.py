"""The potential of a chamber: volume of curved faces, its derivatives, force and moment, work."""

from collections.abc import Callable

import numpy as np
import pytest

from tests.sim.hollow_bodies import commanded, on_axes, pressurised, sphere_shell, tube
from tripod_host.arrays import FloatArray
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.element import Element
from tripod_sim.forces.chamber import Chamber
from tripod_sim.forces.set_loads import face_integrals
from tripod_sim.integrators.newton import Newton
from tripod_sim.mesh.cavity import cavity_faces, closed_surfaces, faces_of_set
from tripod_sim.mesh.solid_mesh import SolidMesh

KINDS = ("t4", "w6", "h8", "t10", "h20", "h27")
PRESSURE = 2e4  # [Pa]


def shaken(mesh: SolidMesh, by: float = 0.1) -> FloatArray:
    """Positions with all nodes moved at random by a share of the smallest distance from the origin [m]."""
    size = by * float(np.linalg.norm(mesh.nodes, axis=1).min())
    return np.asarray(mesh.nodes + size * np.random.default_rng(1).uniform(-1, 1, mesh.nodes.shape))


def shell(element: str) -> tuple[SolidMesh, Chamber]:
    mesh = sphere_shell(element, 0.01, 0.02, 2, 1)
    return mesh, Chamber(cavity_faces(mesh, 0, "chamber.0.cavity"), mesh.nodes)


def capped_tube(element: str) -> tuple[SolidMesh, Chamber]:
    mesh = tube(element, 0.01, 0.02, 0.005, 2, 1)
    inner = np.flatnonzero(np.linalg.norm(mesh.nodes[:, :2], axis=1) < 0.01 + 1e-9)
    return mesh, Chamber(faces_of_set(mesh, inner, "chamber.0.set", "inner", cap=True), mesh.nodes)


BODIES = {"shell": shell, "capped_tube": capped_tube}
Made = Callable[[str], tuple[SolidMesh, Chamber]]


@pytest.fixture(params=BODIES.values(), ids=BODIES)
def made(request: pytest.FixtureRequest) -> Made:
    found: Made = request.param
    return found


def reference_rule(kind: Element) -> tuple[FloatArray, FloatArray]:
    """Points and weights on the reference cell, exact to degree 9 along each side; tetrahedra are collapsed cubes."""
    x, w = np.polynomial.legendre.leggauss(6)
    p = np.stack(np.meshgrid(x, x, x, indexing="ij"), -1).reshape(-1, 3)
    w = np.einsum("i,j,k->ijk", w, w, w).ravel()
    cell = kind.plain.cell
    if cell == "hexahedron":
        return p, w
    (r, s, t), w = ((p + 1) / 2).T, w / 8
    if cell == "wedge":
        return np.column_stack([r, s * (1 - r), 2 * t - 1]), 2 * w * (1 - r)
    return np.column_stack([r, s * (1 - r), t * (1 - r) * (1 - s)]), w * (1 - r) ** 2 * (1 - s)


@pytest.mark.parametrize("element", KINDS)
def test_the_volume_inside_the_outer_surface_is_that_of_body_and_cavity(element: str) -> None:
    """Of deformed elements with curved faces, by quadrature of det J, to rounding."""
    mesh = sphere_shell(element, 0.01, 0.02, 2, 1)
    x, (inner, outer) = shaken(mesh), closed_surfaces(mesh)
    points, weights = reference_rule(ELEMENTS[element])
    body = np.linalg.det(mesh.kind.jacobians(x[mesh.elements], points)) @ weights
    assert -outer.volume(x) - inner.volume(x) == pytest.approx(body.sum(), rel=1e-12, abs=0)
    assert inner.volume(x) > 0 > outer.volume(x)


@pytest.mark.parametrize("element", ["t10", "h20", "h27"])
def test_the_volume_of_a_sphere_converges_at_fourth_order(element: str) -> None:
    exact, errors = 4 / 3 * np.pi * 1e-6, []
    for cells in (4, 8):
        mesh = sphere_shell(element, 0.01, 0.02, cells, 1)
        errors.append(abs(cavity_faces(mesh, 0, "").volume(mesh.nodes) / exact - 1))
    assert errors[0] < 2e-3
    assert errors[0] / errors[1] > 11


@pytest.mark.parametrize("element", ["t4", "w6", "h8"])
def test_a_capped_tube_of_plane_faces_has_the_volume_of_a_prism(element: str) -> None:
    """Of a polygon with the tube's number of sides; linear faces have none but straight edges."""
    mesh, chamber = capped_tube(element)
    sides = 8
    area = 0.5 * sides * 0.01**2 * np.sin(2 * np.pi / sides)
    assert chamber.surface.volume(mesh.nodes) == pytest.approx(area * 0.005, rel=1e-12, abs=0)


@pytest.mark.parametrize("element", ["t10", "h20", "h27"])
def test_a_capped_tube_of_curved_faces_has_the_volume_of_parabolas(element: str) -> None:
    """Chords, and segments of parabolas with two thirds of chord times height above them."""
    mesh, chamber = capped_tube(element)
    half = np.pi / 8
    chord, height = 0.02 * np.sin(half), 0.01 * (1 - np.cos(half))
    area = 8 * (0.5 * 0.01**2 * np.sin(2 * half) + 2 / 3 * chord * height)
    assert chamber.surface.volume(mesh.nodes) == pytest.approx(area * 0.005, rel=1e-12, abs=0)


@pytest.mark.parametrize("element", KINDS)
def test_gradient_and_effort_are_the_derivatives_of_the_potential(made: Made, element: str) -> None:
    mesh, chamber = made(element)
    x, way = shaken(mesh), np.random.default_rng(2).standard_normal(mesh.nodes.shape)
    chamber.value = PRESSURE
    g, unused, h = np.zeros_like(x), np.zeros_like(x), 1e-3
    value = chamber.add_gradient(x, g)
    assert value == pytest.approx(-PRESSURE * chamber.surface.volume(x), rel=1e-12, abs=0)
    assert chamber.effort == pytest.approx(value / PRESSURE, rel=1e-14, abs=0)
    assert chamber.volume == -chamber.effort and chamber.effort_slope == 0
    assert chamber.energies(x) == (0.0, 0.0)
    near, far = ([chamber.add_gradient(x + s * k * h * way, unused) for s in (1, -1)] for k in (1, 2))
    slope = (8 * (near[0] - near[1]) - (far[0] - far[1])) / (
        12 * h
    )  # of a cubic function: exact but for rounding
    assert np.vdot(g, way) == pytest.approx(slope, rel=1e-10)
    coupling = np.zeros_like(x)
    chamber.add_coupling(x, coupling)
    np.testing.assert_allclose(coupling * PRESSURE, g, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("element", KINDS)
def test_the_hessian_is_the_derivative_of_the_gradient(made: Made, element: str) -> None:
    mesh, chamber = made(element)
    x, way, h = shaken(mesh), np.random.default_rng(3).standard_normal(mesh.nodes.shape), 1e-4
    chamber.value = PRESSURE
    chamber.stiffness(x, project=False)
    product, up, down = np.zeros((3, *x.shape))
    chamber.add_products(way, product)
    chamber.add_gradient(x + h * way, up)
    chamber.add_gradient(x - h * way, down)  # of a quadratic function: exact but for rounding
    np.testing.assert_allclose(product, (up - down) / (2 * h), atol=1e-9 * np.abs(product).max())
    np.testing.assert_array_equal(chamber.matrices, chamber.matrices.transpose(0, 2, 1))
    assert np.abs(chamber.matrices).max() > 1
    np.testing.assert_array_equal(np.trace(chamber.matrices, axis1=1, axis2=2), 0)
    chamber.stiffness(x, project=True)
    product[:] = 0.0
    chamber.add_products(way, product)
    assert not chamber.matrices.any() and not product.any()


@pytest.mark.parametrize("element", KINDS)
def test_the_gradient_is_the_pressure_on_the_deformed_faces(element: str) -> None:
    """p ∫ N_a n dA of each face; its derivative is symmetric for the sum over a closed surface, not for one face."""
    mesh, chamber = shell(element)
    x, g, force = shaken(mesh), *np.zeros((2, *mesh.nodes.shape))
    chamber.value = PRESSURE
    chamber.add_gradient(x, g)
    for faces in chamber.surface.faces:
        np.add.at(force, faces.nodes, -PRESSURE * face_integrals(faces, x)[2])
    np.testing.assert_allclose(-g, force, atol=1e-12 * np.abs(g).max())


def stiffness_of_faces(chamber: Chamber, x: FloatArray, *, one: bool) -> FloatArray:
    """Derivative of the forces p ∫ N_a n dA of all faces or of the first one, by differences: quadratic, so exact."""
    rows = np.zeros((x.size, x.size))
    nodes = chamber.surface.nodes
    for dof in (3 * nodes[:, None] + np.arange(3)).ravel():
        for sign in (1, -1):
            moved = x.copy()
            moved.ravel()[dof] += sign * 1e-3
            for faces in chamber.surface.faces:
                some = faces._replace(nodes=faces.nodes[:1]) if one else faces
                force = np.zeros_like(x)
                np.add.at(force, some.nodes, -PRESSURE * face_integrals(some, moved)[2])
                rows[dof] += sign * force.ravel() / 2e-3
    return rows


@pytest.mark.parametrize("element", ["t4", "h8", "h20"])
def test_the_antisymmetric_parts_of_faces_cancel_over_a_closed_surface(element: str) -> None:
    mesh, chamber = shell(element)
    x = shaken(mesh)
    whole, one = (stiffness_of_faces(chamber, x, one=one) for one in (False, True))
    size = np.abs(whole).max()
    assert np.abs(one - one.T).max() > 0.1 * np.abs(one).max()
    np.testing.assert_allclose(whole, whole.T, atol=1e-9 * size)
    chamber.value = PRESSURE
    chamber.stiffness(x, project=False)
    K = np.zeros_like(whole)
    for pair, block in zip(chamber.elements, chamber.matrices, strict=True):
        dofs = (3 * pair[:, None] + np.arange(3)).ravel()
        K[np.ix_(dofs, dofs)] += block
    np.testing.assert_allclose(-K, whole, atol=1e-9 * size)


@pytest.mark.parametrize("element", KINDS)
@pytest.mark.parametrize("away", [0.0, 3.0])
def test_force_and_moment_of_a_closed_surface_are_zero(made: Made, element: str, away: float) -> None:
    """To rounding, wherever the body is: the volume, too, but for that of the positions."""
    mesh, chamber = made(element)
    x, g = shaken(mesh) + away, np.zeros_like(mesh.nodes)
    chamber.value = PRESSURE
    chamber.add_gradient(x, g)
    rounding, size = 1e-15 * np.abs(g).sum(), 0.02
    assert np.abs(g).sum() > 1
    np.testing.assert_allclose(g.sum(axis=0), 0, atol=rounding)
    np.testing.assert_allclose(np.cross(x - away, g).sum(axis=0), 0, atol=size * rounding)
    moved = 1e-15 * max(1.0, away / size)
    assert chamber.volume == pytest.approx(chamber.surface.volume(shaken(mesh)), rel=10 * moved, abs=0)


def test_no_pressure_makes_no_force() -> None:
    mesh, chamber = shell("h20")
    g = np.zeros_like(mesh.nodes)
    assert chamber.add_gradient(mesh.nodes, g) == 0
    assert not g.any() and chamber.volume > 0


def test_the_work_of_the_pressure_is_the_strain_energy() -> None:
    """E = ∫ p dV = P V(P) - ∫ V dp along equilibria: a smooth function of p, so ten Gauss points are exact."""
    mesh = sphere_shell("h20", 0.01, 0.02, 2, 1)
    chamber = Chamber(cavity_faces(mesh, 0, ""), mesh.nodes)
    system = pressurised(mesh, chamber, on_axes(mesh.nodes, 3), 1e5, 0.49)
    state, newton, end = system.start_state(commanded(0.0)), Newton(system, 1e-9, 100), 1.5e4
    points, weights = np.polynomial.legendre.leggauss(10)
    volumes = []
    for pressure in [*(end * (points + 1) / 2), end]:
        newton.solve(state, commanded(pressure))
        volumes.append(chamber.volume)
    work = end * volumes[-1] - end / 2 * float(weights @ volumes[:-1])
    energy = system.potentials(state)[0]
    assert volumes[-1] > 1.3 * chamber.surface.volume(mesh.nodes)
    assert work == pytest.approx(energy, rel=1e-6)


def test_the_compliance_of_a_chamber_is_the_change_of_shape_and_volume_with_its_pressure() -> None:
    mesh = sphere_shell("h20", 0.01, 0.02, 2, 1)
    chamber = Chamber(cavity_faces(mesh, 0, ""), mesh.nodes)
    system = pressurised(mesh, chamber, on_axes(mesh.nodes, 3), 1e5, 0.49)
    state, newton, pressure, step = (
        system.start_state(commanded(0.0)),
        Newton(system, 1e-10, 100),
        1.2e4,
        10.0,
    )
    places, volumes = [], []
    for p in (pressure - step, pressure + step, pressure):
        newton.solve(state, commanded(p))
        places.append(state.positions.copy())
        volumes.append(chamber.volume)
    system.assemble(state, project=False)
    system.evaluate(state)
    assert system.factor()
    column, dx = system.reduction.drive[:, 0], np.zeros_like(mesh.nodes)
    answer = -system.linear.solve(column)
    system.reduction.moves(answer, system.lever, dx)
    slope = (places[1] - places[0]) / (2 * step)
    np.testing.assert_allclose(dx, slope, atol=1e-5 * np.abs(slope).max())
    assert -column @ answer == pytest.approx((volumes[1] - volumes[0]) / (2 * step), rel=1e-5, abs=0)
