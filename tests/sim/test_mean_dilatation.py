"""Hexahedra with mean dilatation: their split of each law, their energy, and what they do where nothing compresses."""

import numpy as np
import pytest

from tests.checks import assert_gradient, assert_symmetric, law_vector, random_rotation
from tests.sim.test_elements import block
from tripod_sim.elements.element import reference_gradients
from tripod_sim.elements.hexahedron import H8, H8_MODES
from tripod_sim.elements.mean_dilatation import H8_MEAN
from tripod_sim.forces.solid import Solid
from tripod_sim.materials import calls
from tripod_sim.materials.lame import lame_constants
from tripod_sim.materials.law import law_named
from tripod_sim.materials.laws import KAPPA, NAMES
from tripod_sim.materials.volume import RATIO
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import SolidMesh

LAM, MU = 3.0, 0.7


@pytest.fixture(params=NAMES)
def law(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def gradients(count: int = 4) -> list[np.ndarray]:
    rng = np.random.default_rng(11)
    return [random_rotation(rng) @ (np.eye(3) + rng.uniform(-0.25, 0.25, (3, 3))) for _ in range(count)]


def shaken(cells: tuple[int, int, int] = (2, 1, 1)) -> tuple[SolidMesh, np.ndarray]:
    """A distorted block and a state of it in which the points of an element differ in volume."""
    mesh = block(H8_MEAN, cells)
    return mesh, mesh.nodes + 0.05 * np.random.default_rng(4).standard_normal(mesh.nodes.shape)


@pytest.mark.parametrize("F", gradients())
def test_slope_is_the_derivative_of_the_volume(law: str, F: np.ndarray) -> None:
    measure, H, scratch = law_named(law).VOLUME, np.zeros((3, 3)), np.zeros((3, 3))
    s = np.linalg.svd(F, compute_uv=False)
    assert measure.slope(F, H) == pytest.approx(measure.derivatives(s, s.copy(), scratch), rel=1e-14)
    rng = np.random.default_rng(0)
    assert_gradient(lambda f: measure.slope(f, scratch), H, F, rng, h=1e-5, rel=1e-7)


@pytest.mark.parametrize("F", gradients())
def test_at_its_own_volume_a_point_has_the_tangent_of_the_law(law: str, F: np.ndarray) -> None:
    found, p, H = calls.addresses(law_named(law)), law_vector(law, LAM, MU), np.zeros((3, 3))
    at_mean, whole = np.zeros((9, 9)), np.zeros((9, 9))
    v = law_named(law).VOLUME.slope(F, H)
    calls.tangent_at_mean(found, F, v, p, False, at_mean)
    calls.tangent(found, F, p, False, whole)
    kappa = p[KAPPA]
    size = np.abs(whole).max()
    assert kappa * (H * H).sum() > 0.1 * size
    np.testing.assert_allclose(at_mean + kappa * np.outer(H, H), whole, atol=1e-9 * size)


def test_projection_lifts_only_negative_eigenvalues(law: str) -> None:
    lifted, found, p = 0, calls.addresses(law_named(law)), law_vector(law, LAM, MU)
    for F in gradients(8):
        exact, projected = np.zeros((9, 9)), np.zeros((9, 9))
        for mean in (0.6, 1.0) if law_named(law).VOLUME is RATIO else (-0.4, 2.5):
            calls.tangent_at_mean(found, F, mean, p, False, exact)
            calls.tangent_at_mean(found, F, mean, p, True, projected)
            w, v = np.linalg.eigh(exact)
            lifted += int((w < -1e-6 * MU).sum())
            nearest = (v * np.maximum(w, 1e-6 * MU)) @ v.T
            np.testing.assert_allclose(projected, nearest, atol=1e-7 * np.abs(exact).max())
    assert lifted > 0


def test_energy_is_that_of_plain_points_with_the_mean_in_the_second_term() -> None:
    """Worked out again in NumPy for neo-Hooke: mu/2 (J^(-2/3) I1 - 3) + K/2 (J* - 1)^2."""
    mesh, x = shaken()
    elements = np.array(mesh.elements)
    solid = Solid(mesh.nodes, elements, H8_MEAN, "neo_hooke", law_vector("neo_hooke", LAM, MU))
    G, weight = reference_gradients(H8_MEAN, mesh.nodes[elements])
    F = np.einsum("eai,eqaj->eqij", x[elements], G)
    J = np.linalg.det(F)
    mean = (weight * J).sum(axis=1) / weight.sum(axis=1)
    assert np.ptp(J, axis=1).min() > 0.05
    deviatoric = MU / 2 * (J ** (-2 / 3) * (F**2).sum(axis=(2, 3)) - 3)
    bulk = (LAM + 2 * MU / 3) / 2 * (mean - 1) ** 2
    expected = (weight * deviatoric).sum() + (weight.sum(axis=1) * bulk).sum()
    assert solid.energy(x, solid.rest_modes()) == pytest.approx(expected, rel=1e-12)


def test_force_is_the_energy_gradient_and_the_tangent_its_derivative(law: str) -> None:
    mesh, x = shaken()
    solid = Solid(mesh.nodes, np.array(mesh.elements), H8_MEAN, law, law_vector(law, LAM, MU))
    modes, rng = solid.rest_modes(), np.random.default_rng(1)

    def gradient(x: np.ndarray) -> np.ndarray:
        g = np.zeros_like(x)
        assert solid.add_gradient(x, modes, g) == pytest.approx(solid.energy(x, modes), rel=1e-12)
        return g

    assert_gradient(lambda y: solid.energy(y, modes), gradient(x), x, rng, h=1e-6, rel=1e-6)
    assert solid.stiffness(x, modes, project=False) == -1
    K = assembled(solid, mesh)
    assert_symmetric(K)
    d, h = rng.standard_normal(x.shape), 1e-6
    slope = (gradient(x + h * d) - gradient(x - h * d)).ravel() / (2 * h)
    np.testing.assert_allclose(slope, K @ d.ravel(), atol=1e-7 * np.abs(slope).max())


def test_projected_element_matrices_are_positive(law: str) -> None:
    mesh, x = shaken()
    solid = Solid(mesh.nodes, np.array(mesh.elements), H8_MEAN, law, law_vector(law, LAM, MU))
    squeezed = 0.5 * x * [1.0, 1.0, 1.6]
    lowest = {}
    for project in (False, True):
        assert solid.stiffness(squeezed, solid.rest_modes(), project=project) == -1
        eigenvalues = np.linalg.eigvalsh(solid.matrices)
        lowest[project] = float(eigenvalues.min() / eigenvalues.max())
    assert lowest[False] < -1e-3
    assert lowest[True] > -1e-12


def test_a_rotation_of_the_frame_rotates_forces_and_costs_nothing(law: str) -> None:
    mesh, x = shaken()
    solid = Solid(mesh.nodes, np.array(mesh.elements), H8_MEAN, law, law_vector(law, LAM, MU))
    modes, g, turned = solid.rest_modes(), np.zeros_like(x), np.zeros_like(x)
    Q, shift = random_rotation(np.random.default_rng(2)), np.array([0.3, -2.0, 1.0])
    energy = solid.add_gradient(x, modes, g)
    assert solid.add_gradient(x @ Q.T + shift, modes, turned) == pytest.approx(energy, rel=1e-11)
    np.testing.assert_allclose(turned, g @ Q.T, atol=1e-11 * np.abs(g).max())
    np.testing.assert_allclose(g.sum(axis=0), 0, atol=1e-11 * np.abs(g).max())
    np.testing.assert_allclose(np.cross(x, g).sum(axis=0), 0, atol=1e-11 * np.abs(g).max())


def assembled(solid: Solid, mesh: SolidMesh) -> np.ndarray:
    K = np.zeros((mesh.nodes.size, mesh.nodes.size))
    for e, k in zip(mesh.elements, solid.matrices, strict=True):
        dofs = (3 * e[:, None] + np.arange(3)).ravel()
        K[np.ix_(dofs, dofs)] += k
    return K


def tip_deflection(kind: str, cells: tuple[int, int, int], poisson: float, law: str = "neo_hooke") -> float:
    """Deflection of a cantilever of 10 x 1 x 1 under a load at its tip, over that of beam theory with shear."""
    young, length = 1000.0, 10.0
    straight = block(H8_MODES, cells, noise=0.0)
    mesh = convert(
        SolidMesh.of(straight.nodes * [length / cells[0], 1 / cells[1], 1 / cells[2]], straight.elements),
        kind,
    )
    lam, mu = lame_constants(young, poisson)
    solid = Solid(mesh.nodes, np.array(mesh.elements), mesh.kind, law, law_vector(law, lam, mu))
    assert solid.stiffness(np.array(mesh.nodes), solid.rest_modes(), project=False) == -1
    K = assembled(solid, mesh)
    free = np.flatnonzero(np.repeat(mesh.nodes[:, 0] > 1e-9, 3))
    tip = np.flatnonzero(mesh.nodes[:, 0] > length - 1e-9)
    load, u = np.zeros(len(K)), np.zeros(len(K))
    load[3 * tip + 2] = 1 / len(tip)
    u[free] = np.linalg.solve(K[np.ix_(free, free)], load[free])
    return float(u[3 * tip + 2].mean() / (length**3 / (3 * young / 12) + length / (5 / 6 * mu)))


def test_bending_does_not_stiffen_as_the_material_becomes_incompressible(law: str) -> None:
    """The plain element loses more than half of its deflection between nu 0.3 and 0.499, this one under 2 %."""
    cells = (10, 2, 2)
    kept = [tip_deflection(kind.name, cells, 0.499, law) / tip_deflection(kind.name, cells, 0.3, law)
            for kind in (H8, H8_MEAN)]  # fmt: skip
    assert kept[0] < 0.5
    assert kept[1] == pytest.approx(1, abs=0.02)


def test_nearly_incompressible_bending_converges() -> None:
    """To beam theory less the clamp, which keeps the first section from narrowing (H20: 0.963)."""
    coarse, fine = (tip_deflection("h8_mean", cells, 0.499) for cells in ((10, 2, 2), (20, 2, 4)))
    assert 0.963 - fine < 0.4 * (0.963 - coarse)
    assert fine > 2 * tip_deflection("h8", (20, 2, 4), 0.499)
