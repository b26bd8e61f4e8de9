"""A cloth that touches itself: folded, it lies on itself and does not pass through itself."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.blocks import brick
from tests.messages import assert_names, raises_naming
from tripod_sim import Simulation, load_scene
from tripod_sim.contact import start_kernels as kernels
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.contact.detection import Detector
from tripod_sim.contact.start import near_itself
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.mesh.surfaces import Part, join
from tripod_sim.mesh.topology import directed_edges

NODES, SIZE, DISTANCE = 7, 0.6, 0.004

MODES = ["lagrange", "penalty"]


def folded(tmp_path: Path, response: str, speed: float, *, self_contact: bool) -> Simulation:
    """A cloth on a table, its right half folded to 30 degrees above the left one and thrown down at `speed` [m/s]."""
    corners = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n"
    (tmp_path / "table.obj").write_text(corners + "f 1 2 3 4\n")
    simulation = Simulation(
        load_scene(
            "drape",
            [
                "springs.source=grid", f"springs.nodes={NODES}", f"springs.size={SIZE}", "springs.bending=0",
                "springs.position=[0, 0, 0.005]", f"obstacles.0.source={tmp_path / 'table.obj'}", "damping.mass=10",
                f"contact.response={response}", f"contact.contact_distance={DISTANCE}",
                f"contact.alarm_distance={3 * DISTANCE}", f"contact.self_contact={str(self_contact).lower()}",
            ],
        )
    )  # fmt: skip
    x, right = simulation.state.positions, simulation.state.positions[:, 0] > 1e-9
    out = x[right, 0].copy()
    x[right, 0], x[right, 2] = -np.cos(np.pi / 6) * out, x[right, 2] + np.sin(np.pi / 6) * out
    x[:, 2] += np.random.default_rng(1).uniform(
        0, 5e-4, len(x)
    )  # in a plane no sign of a volume would mean anything
    simulation.state.velocities[right, 2] = -speed
    return simulation


def passes_itself(simulation: Simulation) -> bool:
    """Whether an edge passes through a triangle of the same cloth."""
    x, triangles = simulation.positions, simulation.mesh.triangles
    edges = np.unique(np.sort(directed_edges(triangles), axis=1), axis=0)
    pairs = np.stack(np.meshgrid(np.arange(len(edges)), np.arange(len(triangles))), axis=-1).reshape(-1, 2)
    marked = np.zeros(len(x), dtype=np.bool_)
    kernels.mark_passing(pairs, edges, triangles, x.copy(), 0.0, marked)
    return bool(marked.any())


def lowest_of_fold(simulation: Simulation, right: np.ndarray) -> float:
    """Lowest node of the folded half, at least an edge from the fold, above the table [m]."""
    return float(simulation.positions[right, 2].min())


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("speed", [0.0, 30.0])
def test_a_folded_cloth_lies_on_itself(tmp_path: Path, response: str, speed: float) -> None:
    """At 30 m/s a step covers 0.3 m, 75 contact distances."""
    simulation = folded(tmp_path, response, speed, self_contact=True)
    right = simulation.mesh.nodes[:, 0] > 1.5 * SIZE / (NODES - 1)
    assert not passes_itself(simulation)
    for _ in range(150):
        report = simulation.step()
        assert report.contact
        assert report.contact.cut == 0.0
        assert not passes_itself(simulation)
    # table, contact distance, cloth, contact distance, cloth; penalty lets each sink in by up to a half of it
    least = 2 * DISTANCE * (0.95 if response == "lagrange" else 0.45)
    assert lowest_of_fold(simulation, right) > least
    assert simulation.energies().kinetic < 1e-5


def test_without_self_contact_it_lies_in_itself(tmp_path: Path) -> None:
    """What the other test shows is not so by chance."""
    simulation = folded(tmp_path, "lagrange", 0.0, self_contact=False)
    right = simulation.mesh.nodes[:, 0] > 1.5 * SIZE / (NODES - 1)
    passed = False
    for _ in range(150):
        simulation.step()
        passed |= passes_itself(simulation)
    assert passed
    assert lowest_of_fold(simulation, right) < 1.1 * DISTANCE


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("speed", [0.0, 30.0])
def test_a_second_sheet_of_the_same_file_lies_on_the_first(
    tmp_path: Path, response: str, speed: float
) -> None:
    """Two soft bodies: the lower one is held at its corners, the upper one, turned by 20 degrees, falls on it."""
    lower = [(0.1 * i - 0.2, 0.1 * j - 0.2, 0.0) for i in range(5) for j in range(5)]
    turn = np.deg2rad(20)
    upper = [
        (0.6 * (x * np.cos(turn) - y * np.sin(turn)), 0.6 * (x * np.sin(turn) + y * np.cos(turn)), 0.03)
        for x, y, _ in lower
    ]
    cells = [(5 * i + j + 1, 5 * i + j + 6, 5 * i + j + 7, 5 * i + j + 2) for i in range(4) for j in range(4)]
    text = "".join(f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in (*lower, *upper))
    for first in (0, 25):
        text += "".join("f " + " ".join(str(n + first) for n in cell) + "\n" for cell in cells)
    (tmp_path / "sheets.obj").write_text(text)
    simulation = Simulation(
        load_scene(
            "drape",
            [
                f"springs.source={tmp_path / 'sheets.obj'}", "springs.fixed_nodes=[0, 4, 20, 24]",
                "springs.position=[0, 0, 0]", "springs.node_mass=0.001", "obstacles=[]", "contact.self_contact=true",
                f"contact.response={response}", f"contact.contact_distance={DISTANCE}",
                f"contact.alarm_distance={3 * DISTANCE}", "damping.mass=10", "sleep=off",
            ],
        )
    )  # fmt: skip
    x = simulation.state.positions
    x[:, 2] += np.random.default_rng(1).uniform(0, 5e-4, len(x)) * ~np.isin(np.arange(50), [0, 4, 20, 24])
    simulation.state.velocities[25:, 2] = -speed
    for _ in range(150):
        simulation.step()
        assert not passes_itself(simulation)
    assert simulation.positions[25:, 2].min() > simulation.positions[:25, 2].min()
    assert (
        np.abs(simulation.state.velocities).max() < 0.2
    )  # it lies there: 1.5 s of free fall would be 15 m/s


def test_sheets_that_pass_through_each_other_at_the_start_are_named(tmp_path: Path) -> None:
    """A flat sheet in any direction does not pass through itself, whatever rounding says; one across it does."""
    turn = np.deg2rad([17.0, 31.0])
    sheet = np.array([(0.1 * i, 0.1 * j, 0.0) for i in range(5) for j in range(5)])
    for axis, angle in zip((0, 2), turn, strict=True):
        a, b = np.delete(np.arange(3), axis)
        c, s = np.cos(angle), np.sin(angle)
        sheet[:, a], sheet[:, b] = c * sheet[:, a] - s * sheet[:, b], s * sheet[:, a] + c * sheet[:, b]
    cells = [(5 * i + j + 1, 5 * i + j + 6, 5 * i + j + 7, 5 * i + j + 2) for i in range(4) for j in range(4)]

    def scene(name: str, sheets: list[np.ndarray], *words: str) -> Simulation:
        text = "".join(f"v {x:.9f} {y:.9f} {z:.9f}\n" for part in sheets for x, y, z in part)
        for k in range(len(sheets)):
            text += "".join("f " + " ".join(str(n + 25 * k) for n in cell) + "\n" for cell in cells)
        (tmp_path / name).write_text(text)
        given = [f"springs.source={tmp_path / name}", "obstacles=[]", "contact.self_contact=true", *words]
        return Simulation(load_scene("drape", given))

    scene("one.obj", [sheet])
    beside = sheet + np.array([0.013, 0.007, 0.03])
    scene("beside.obj", [sheet, beside])
    centre = sheet.mean(axis=0)
    across = centre + (sheet - centre)[:, [2, 0, 1]] + np.array([0.013, 0.007, 0.0])
    for start in ("refuse", "lift"):
        with raises_naming(SceneError, "nodes", "body itself", "start") as caught:
            scene("across.obj", [sheet, across], f"contact.start={start}")
        assert "\n" not in str(caught.value)
    scene("across.obj", [sheet, across], "contact.self_contact=false", "obstacles=[{source='sphere.obj'}]",
          "springs.position=[0, 0, 2]")  # fmt: skip


@pytest.mark.parametrize("height", [1e-6, 1e-4])
def test_an_edge_that_hardly_reaches_through_a_triangle_counts_where_asked(height: float) -> None:
    """The edge ends at `height` [m] above and at 1 mm below the triangle; nearer than 10 um is but rounding."""
    x = np.array([[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [0.002, 0.002, height], [0.002, 0.002, -1e-3]])
    pairs, edges, triangles = np.zeros((1, 2), dtype=np.int64), np.array([[3, 4]]), np.array([[0, 1, 2]])
    for least, counts in ((0.0, True), (1e-5, height > 1e-5)):
        marked = np.zeros(len(x), dtype=np.bool_)
        kernels.mark_passing(pairs, edges, triangles, x, least, marked)
        assert marked.all() == marked.any() == counts


def slit_panel(width: float, height: float) -> Part:
    """A block of 1 cm, `height` [m] high, with a slit of `width` [m] in the middle from x = 2 mm on."""
    z = np.array([0.0, (height - width) / 2, (height + width) / 2, height])
    block = brick("h8", [np.linspace(0, 0.01, 6), np.linspace(0, 0.01, 6), z])
    centres = np.array(block.nodes)[np.asarray(block.elements)].mean(axis=1)
    slit = (centres[:, 0] > 0.002) & (np.abs(centres[:, 2] - height / 2) < width / 2)
    kept = np.asarray(block.elements)[~slit]
    nodes, elements = np.unique(kept, return_inverse=True)
    mesh = SolidMesh.of(np.array(block.nodes)[nodes], elements.reshape(kept.shape), block.kind)
    filled = np.ones(len(mesh.surface), dtype=np.bool_)
    return Part(np.array(mesh.nodes), mesh.surface, filled=filled, self_contact=True)


def test_a_thin_solid_touches_itself_across_a_slit_and_not_through_itself() -> None:
    """Both leaves are 0.4 mm thick, the slit 0.2 mm wide, the contact distance 2 mm; all nodes turned anyhow."""
    part = slit_panel(2e-4, 1e-3)
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    surfaces, x = join([part])
    x = np.ascontiguousarray(x @ turn.T)
    found = ContactSet()
    Detector(surfaces, x, 2e-3, 5e-3).near(x, found)
    assert found.count > 20
    weights, vertices = found.arrays.weight[: found.count], found.arrays.vertex[: found.count]
    gaps = np.linalg.norm(np.einsum("ck,cki->ci", weights, x[vertices]), axis=1)
    np.testing.assert_allclose(gaps, 2e-4, rtol=1e-6)
    (note,) = near_itself(part, 2e-3)
    assert_names(note, "contact.contact_distance", "0.002 m", "nearest", "0.0002 m")
    assert near_itself(part, 1e-4) == ()


def test_a_surface_by_columns_is_joined_by_rows_as_its_loops_are_compiled() -> None:
    part = slit_panel(2e-4, 1e-3)
    columns = replace(part, triangles=np.asfortranarray(part.triangles))
    surfaces, _ = join([columns])
    assert surfaces.triangles.flags.c_contiguous
    np.testing.assert_array_equal(surfaces.triangles, join([part])[0].triangles)


def test_a_panel_thinner_than_the_contact_distance_rises_as_without_contact() -> None:
    alone, touching = (
        Simulation(load_scene("cook", ["mesh.cells=[4, 4, 1]", *words]))
        for words in ([], ["contact={self_contact=true}"])
    )
    for simulation in (alone, touching):
        simulation.step()
    assert touching.report.contact
    assert touching.report.contact.contacts == 0
    assert touching.notes == ()
    np.testing.assert_allclose(touching.positions, alone.positions, atol=1e-10)
