"""Fields on nodes: exact where uniform, near beam theory, the same in any frame, and free for who does not ask."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.checks import law_vector, random_rotation
from tests.messages import raises_naming
from tests.sim.beams import GRAVITY, HEIGHT, LENGTH, MASS, bar_scene
from tests.sim.test_elements import block
from tripod_host.arrays import FloatArray
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.element import Element
from tripod_sim.elements.hexahedron import H8_MODES
from tripod_sim.fields import FIELDS, NodalFields, extrapolation
from tripod_sim.forces.solid import Solid
from tripod_sim.forces.spring_force import SpringForce
from tripod_sim.forces.stress_kernels import PIOLA, VALUES, write_points
from tripod_sim.materials.laws import NAMES
from tripod_sim.mesh.solid_mesh import SolidMesh

LAM, MU = 2.0, 0.7
BULK = LAM + 2 * MU / 3
SOLID = [name for name, field in FIELDS.items() if field.solid]


@pytest.fixture(params=sorted(ELEMENTS))
def kind(request: pytest.FixtureRequest) -> Element:
    return ELEMENTS[request.param]


def solid_of(mesh: SolidMesh, law: str = "neo_hooke", lam: float = LAM) -> Solid:
    return Solid(mesh.nodes, np.array(mesh.elements), mesh.kind, law, law_vector(law, lam, MU))


def fields_of(mesh: SolidMesh, law: str = "neo_hooke", lam: float = LAM) -> NodalFields:
    return NodalFields([solid_of(mesh, law, lam)], mesh.nodes, np.arange(len(mesh.nodes)))


def bent(mesh: SolidMesh, size: float = 0.04) -> FloatArray:
    """Positions of a smooth motion that is not uniform."""
    X = mesh.nodes
    return X + size * np.sin(X[:, [1, 2, 0]] + 0.3 * X[:, [2, 0, 1]])


@pytest.mark.parametrize(
    "F",
    [
        np.diag([1.3, 0.9, 0.9]),
        np.eye(3) + 0.4 * np.eye(3, k=1) * [[1], [0], [0]],
        np.eye(3) + np.random.default_rng(4).uniform(-0.2, 0.2, (3, 3)),
    ],
    ids=["uniaxial", "shear", "any"],
)
def test_uniform_states_are_exact(kind: Element, F: FloatArray) -> None:
    mesh, J, b = block(kind), np.linalg.det(F), F @ F.T
    sigma = MU * J ** (-5 / 3) * (b - np.trace(b) / 3 * np.eye(3)) + BULK * (J - 1) * np.eye(3)
    deviator, principal = sigma - np.trace(sigma) / 3 * np.eye(3), np.linalg.eigvalsh(sigma)
    expected = {
        "von_mises": np.sqrt(1.5 * (deviator**2).sum()), "principal_max": principal[2], "principal_min": principal[0],
        "energy_density": 0.5 * MU * (J ** (-2 / 3) * np.trace(b) - 3) + 0.5 * BULK * (J - 1) ** 2,
        "stretch": np.sqrt(np.linalg.eigvalsh(b)[2]),
    }  # fmt: skip
    found = fields_of(mesh).values(SOLID, mesh.nodes @ F.T)
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-7, atol=1e-9, err_msg=name)
    np.testing.assert_allclose(found["displacement"], np.linalg.norm(mesh.nodes @ (F.T - np.eye(3)), axis=1))


@pytest.mark.parametrize("law", NAMES)
def test_the_undeformed_body_has_neither_stress_nor_energy(law: str) -> None:
    mesh = block(H8_MODES)
    found = fields_of(mesh, law).values(SOLID, mesh.nodes)
    for name in ("von_mises", "principal_max", "principal_min", "energy_density"):
        np.testing.assert_allclose(found[name], 0, atol=1e-7, err_msg=name)
    np.testing.assert_allclose(found["stretch"], 1, rtol=1e-9)


@pytest.mark.parametrize("law", NAMES)
def test_fields_do_not_change_where_all_is_turned(kind: Element, law: str) -> None:
    mesh = block(kind)
    fields, x = fields_of(mesh, law), bent(mesh)
    turn = random_rotation(np.random.default_rng(7))
    names = [name for name in SOLID if name != "displacement"]
    before, after = fields.values(names, x), fields.values(names, x @ turn.T + 0.3)
    for name in names:
        assert np.ptp(before[name]) > 1e-4
        np.testing.assert_allclose(after[name], before[name], rtol=1e-6, atol=1e-7, err_msg=name)


@pytest.mark.parametrize("lam", [LAM, 1e4 * MU])
def test_the_stress_is_that_of_the_forces_of_the_element(kind: Element, lam: float) -> None:
    """Mean dilatation included, also where the material is nearly incompressible."""
    mesh = block(kind)
    solid, x = solid_of(mesh, lam=lam), bent(mesh)
    modes = 0.01 * np.random.default_rng(1).standard_normal(solid.rest_modes().shape)
    arrays, forces, expected = solid.solid, np.zeros_like(x), np.zeros_like(x)
    points = np.zeros((*arrays.weight.shape, VALUES))
    write_points(x, modes, arrays, points)
    P = points[..., PIOLA : PIOLA + 9].reshape(*arrays.weight.shape, 3, 3)
    own = np.einsum("eq,eqij,eqja->eai", arrays.weight, P, arrays.G[..., : kind.size])
    np.add.at(forces, solid.elements, own)
    energy = solid.add_gradient(x, modes, expected)
    np.testing.assert_allclose(forces, expected, atol=1e-10 * np.abs(expected).max())
    assert (points[..., -1] * arrays.weight).sum() == pytest.approx(energy, rel=1e-10)


def test_extrapolation_is_exact_for_linear_values(kind: Element) -> None:
    """One point gives its value to all nodes."""
    matrix, slope = extrapolation(kind), np.array([0.3, -0.2, 0.5])
    np.testing.assert_allclose(matrix.sum(axis=1), 1)
    if len(kind.points) > 1:
        np.testing.assert_allclose(matrix @ (kind.points @ slope), kind.reference @ slope, atol=1e-12)


@pytest.mark.parametrize(
    ("element", "counts"), [("h8_modes", (20, 2, 2)), ("h20", (10, 1, 1)), ("h27", (10, 2, 2))]
)
def test_a_beam_has_the_stress_of_beam_theory(
    tmp_path: Path, element: str, counts: tuple[int, int, int]
) -> None:
    """At mid-length, q L² / 8 times h / 2 I, above in tension, below in compression; energy density sigma² / 2 E."""
    simulation = Simulation(load_scene(bar_scene(tmp_path, counts, element, young=1e8), ["inertia=off"]))
    simulation.step()
    found = simulation.fields().values(SOLID, simulation.positions)
    X = simulation.mesh.nodes
    middle = np.abs(X[:, 0] - LENGTH / 2) < 1e-9
    upper, lower = (middle & (side * X[:, 2] > HEIGHT / 2 - 1e-9) for side in (1, -1))
    sigma = MASS * GRAVITY * LENGTH / 8 * 6 / HEIGHT**3
    assert upper.sum() >= 2
    np.testing.assert_allclose(found["principal_max"][upper], sigma, rtol=0.02)
    np.testing.assert_allclose(found["principal_min"][lower], -sigma, rtol=0.02)
    np.testing.assert_allclose(found["von_mises"][upper | lower], sigma, rtol=0.02)
    np.testing.assert_allclose(found["energy_density"][upper], sigma**2 / 2e8, rtol=0.05)
    np.testing.assert_allclose(found["stretch"][upper] - 1, sigma / 1e8, rtol=0.02)


def test_an_element_inside_out_has_no_values_and_others_keep_theirs() -> None:
    mesh = block(H8_MODES, (3, 1, 1), noise=0.0)
    fields, x = fields_of(mesh), mesh.nodes @ np.diag([1.1, 1.0, 1.0])
    good = fields.values(["von_mises"], x)["von_mises"]
    first = mesh.nodes[:, 0] < 0.5
    x[first, 0] = 1.4
    found = fields.values(["von_mises"], x)["von_mises"]
    beyond = mesh.nodes[:, 0] > 1.5
    assert np.isnan(found[~beyond]).all()
    np.testing.assert_allclose(found[beyond], good[beyond], rtol=1e-7)
    again = fields.values(["von_mises"], mesh.nodes @ np.diag([1.1, 1.0, 1.0]))["von_mises"]
    np.testing.assert_allclose(again, good, rtol=1e-7)


@pytest.mark.parametrize("slack", [False, True])
def test_springs_have_the_largest_stretch_and_tension_at_a_node(slack: bool) -> None:
    ends = np.array([[0, 1], [1, 2]])
    net = SpringForce(ends, np.ones(2), np.array([10.0, 20.0]), np.zeros(2), slack=slack, owner="net")
    undeformed = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [5, 5, 5]])
    fields = NodalFields([net], undeformed, np.array([0, 1, 2, 2, 3]))
    assert fields.names == ("displacement", "stretch", "tension")
    x = undeformed * [[1.0, 1, 1], [1, 1, 1], [0.9, 1, 1], [1, 1, 1]] - [[0.2, 0, 0], *np.zeros((3, 3))]
    found = fields.values(fields.names, x)
    np.testing.assert_allclose(found["stretch"], [1.2, 1.2, 0.8, 0.8, np.nan])
    np.testing.assert_allclose(found["tension"], [2.0, 2.0, *[0.0 if slack else -4.0] * 2, np.nan])
    np.testing.assert_allclose(found["displacement"], [0.2, 0, 0.2, 0.2, 0])
    with raises_naming(SceneError, "von_mises", "displacement, stretch, tension"):
        fields.values(["von_mises"], x)
    with raises_naming(SceneError, "heat", "displacement, stretch, tension"):
        fields.values(["heat"], x)


def test_nodes_of_a_rigid_disc_have_no_stress_and_asking_changes_no_step() -> None:
    one, other = (Simulation(load_scene("tripod", ["mesh.level=1"])) for _ in range(2))
    fields = one.fields()
    goal = one.command - [0.2, 0.2, 0.2, 0.0]
    for _ in range(3):
        found = fields.values(fields.names, one.positions)
        one.step(goal)
        other.step(goal)
    assert (one.positions == other.positions).all()
    assert 0 < np.isnan(found["von_mises"]).sum() < 0.5 * len(one.positions)
    assert np.isfinite(found["displacement"]).all()


def test_values_follow_from_positions_alone() -> None:
    """Found again from a recording, in whatever order its steps are looked at."""
    simulation = Simulation(load_scene("silicone", ["mesh.level=1"]))
    seen, fields = [], simulation.fields()
    for _ in range(4):
        simulation.step()
        seen.append((simulation.positions.copy(), fields.values(fields.names, simulation.positions)))
    other = Simulation(load_scene("silicone", ["mesh.level=1"])).fields()
    for positions, values in reversed(seen):
        again = other.values(fields.names, positions)
        for name in fields.names:
            np.testing.assert_allclose(
                again[name], values[name], rtol=1e-6, atol=1e-6 * np.nanmax(values[name])
            )


def test_who_does_not_ask_loads_nothing() -> None:
    code = (
        "import sys, json; from tripod_sim import Simulation, load_scene\n"
        "simulation = Simulation(load_scene('pendulum')); simulation.step(); simulation.rehearse()\n"
        "names = ('tripod_sim.fields', 'tripod_sim.forces.stress_kernels')\n"
        "before = [name in sys.modules for name in names]; simulation.fields()\n"
        "print(json.dumps([before, [name in sys.modules for name in names]]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == [[False, False], [True, True]]
