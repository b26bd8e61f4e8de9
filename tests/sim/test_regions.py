"""Regions: which elements are of another material, by place, by groups of cells and of nodes."""

import tempfile
from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_sim import Simulation
from tripod_sim.errors import SceneError
from tripod_sim.scene.file import load_scene

SIDE = 0.01
"""Edge of the three cubes that stand in a row along x [m]."""

ROW = f"""
name = "row"
[mesh]
source = "SOURCE"
corners = [[0,0,0],[{3 * SIDE},0,0],[{3 * SIDE},{SIDE},0],[0,{SIDE},0],
           [0,0,{SIDE}],[{3 * SIDE},0,{SIDE}],[{3 * SIDE},{SIDE},{SIDE}],[0,{SIDE},{SIDE}]]
cells = [3, 1, 1]
[material]
young = 1e5
poisson = 0.0
density = 1000.0
[[fixed]]
low = [-1, -1, -1]
high = [0, 1, 1]
[[set]]
name = "end"
along = [1, 0, 0]
beyond = {3 * SIDE}
[[load]]
set = "end"
force = [1e-4, 0, 0]
"""

STIFF = """
[[region]]
set = "NAME"
young = 4e5
poisson = 0.0
density = 3000.0
"""


def row(name: str, *words: str, source: str = "block", table: str = "") -> Simulation:
    text = ROW.replace("SOURCE", source) + table + STIFF.replace("NAME", name)
    if source != "block":
        text = text.replace("corners =", "#").replace("           [0,0,", "#").replace("cells =", "#")
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "row.toml").write_text(text)
        simulation = Simulation(load_scene(Path(folder) / "row.toml", words))
    simulation.step()
    return simulation


def assert_stiff(simulation: Simulation, cubes: int) -> None:
    """Assert that so many of the cubes are of the stiff material: F / A sum L / E, and the mass."""
    rest = simulation.mesh.nodes
    end = rest[:, 0] > 3 * SIDE - 1e-9
    stretch = (simulation.positions - rest)[end, 0].mean()
    expected = 1e-4 / SIDE**2 * SIDE * (cubes / 4e5 + (3 - cubes) / 1e5)
    assert stretch == pytest.approx(expected, rel=1e-4)
    assert simulation._mass.sum() == pytest.approx(SIDE**3 * (3000 * cubes + 1000 * (3 - cubes)), rel=1e-9)


@pytest.mark.parametrize("element", ["h8_modes", "h20", "t10"])
@pytest.mark.parametrize("refine", [0, 1])
def test_a_layer_that_holds_no_node_has_the_elements_whose_centroids_are_in_it(
    element: str, refine: int
) -> None:
    """Between the faces of the cube in the middle, where it is not refined; with eight parts they have nodes amid."""
    low, high = (0.011, 0.019) if refine == 0 else (0.0105, 0.0195)
    table = f'[[set]]\nname = "layer"\nlow = [{low}, -1, -1]\nhigh = [{high}, 1, 1]\n'
    words = (f"mesh.element={element}", f"mesh.refine={refine}")
    assert_stiff(row("layer", *words, table=table), 1)
    if not refine and element == "h8_modes":
        with raises_naming(SceneError, "set.1 ('layer')", "no node"):
            row("layer", *words, "fixed.0={set='layer'}", table=table)


def test_a_region_without_an_element_is_refused_with_what_counts() -> None:
    table = '[[set]]\nname = "face"\nalong = [1, 0, 0]\nat = 0.01\n'
    with raises_naming(SceneError, "region.0.set", "'face'", "no element", "centroid"):
        row("face", table=table)
    with raises_naming(SceneError, "region.0.set", "'layr'", "end"):
        row("layr")


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file of the row: `part:1` are the outer cubes, `side:1` the nodes of the first two."""
    x = np.array([[i, j, k] for i in range(4) for j in (0, 1) for k in (0, 1)], float) * SIDE
    first = np.array([0, 4, 6, 2, 1, 5, 7, 3])
    cubes = [(first + 4 * i).tolist() for i in range(3)]
    path = tmp_path_factory.mktemp("row") / "row.vtu"
    mesh = meshio.Mesh(
        x,
        [("hexahedron", cubes)],
        cell_data={"part": [np.array([1, 0, 1])]},
        point_data={"side": (x[:, 0] < 2.5 * SIDE).astype(int)},
    )
    mesh.write(path)
    return path


@pytest.mark.parametrize("words", [[], ["mesh.element=h20"], ["mesh.element=t10"], ["mesh.refine=1"]])
def test_a_group_of_cells_has_its_cells_and_one_of_nodes_those_with_all_nodes_in_it(
    words: list[str], file: Path
) -> None:
    """All nodes of the cube in the middle are nodes of the others, but it is not in their group."""
    assert_stiff(row("part:1", *words, source=str(file)), 2)
    assert_stiff(row("side:1", *words, source=str(file)), 2)


def test_a_group_and_a_place_have_what_is_in_both(file: Path) -> None:
    table = '[[set]]\nname = "far"\ngroup = "part:1"\nalong = [1, 0, 0]\nbeyond = 0.012\n'
    assert_stiff(row("far", source=str(file), table=table), 1)
    assert_stiff(row("far", source=str(file), table=table.replace("part:1", "side:1")), 1)
    assert_stiff(row("all", source=str(file)), 3)
    assert_stiff(row("body", source=str(file)), 3)
