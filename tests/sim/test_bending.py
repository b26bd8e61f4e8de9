"""The error that the shape of cells makes in bending: told beforehand, and held against bars that hang."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks import trapezoids
from benchmarks.blocks import brick
from tests.messages import assert_names, line_naming
from tests.sim.beams import bar_scene, beam, sag
from tripod_bringup.cli import app
from tripod_sim import Simulation, load_scene
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.mesh.bending import MOST_LAYERS, deflection_share, stacked, tetrahedra_share
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.mesh.suited import suited
from tripod_sim.mesh.y_piece import LEVELS, y_piece

TILT = math.radians(31)


@pytest.mark.parametrize(("cells", "thick"), trapezoids.BARS)
@pytest.mark.parametrize("tilt", [0, 10, 31])
def test_the_error_told_is_that_of_a_bar(cells: int, thick: int, tilt: int) -> None:
    """To 7 % of the deflection, at any length of the cells and with one to three of them through the thickness."""
    mesh = trapezoids.leaning("h8_modes", cells, math.radians(tilt), thick)
    assert deflection_share(mesh) == pytest.approx(trapezoids.deflection(mesh), abs=0.07)


def test_a_users_own_mesh_sags_as_little_as_is_told(tmp_path: Path) -> None:
    scene = bar_scene(tmp_path, (10, 1, 1), "h8_modes", tilt=math.radians(20))
    mesh = Simulation(load_scene(scene)).mesh
    assert isinstance(mesh, SolidMesh)
    assert sag(scene) / beam().sag < 0.95
    assert deflection_share(mesh) == pytest.approx(sag(scene) / beam().sag, abs=0.07)


@pytest.mark.parametrize("counts", [(10, 1, 1), (10, 2, 2), (20, 2, 2), (40, 4, 4)])
def test_linear_tetrahedra_bend_as_little_as_is_told(counts: tuple[int, int, int], tmp_path: Path) -> None:
    scene = bar_scene(tmp_path, counts, "t4")
    simulation = Simulation(load_scene(scene))
    assert isinstance(simulation.mesh, SolidMesh)
    share = tetrahedra_share(simulation.mesh)
    assert share == pytest.approx(sag(scene) / beam().sag, abs=0.08)
    (note,) = simulation.notes
    assert_names(note, "mesh.element 't4'", f"{100 * (1 - share):.0f} % too little", "'t10'")


def test_enough_linear_tetrahedra_are_not_told_of() -> None:
    """Turned and scaled, too: what is added to the energy falls with the square of their size."""
    mesh = convert(brick("h8", [np.linspace(0, 3, 25), np.linspace(0, 1, 9), np.linspace(0, 2, 17)]), "t4")
    assert suited(mesh)[1] == ()
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    turned = SolidMesh(1e-3 * mesh.nodes @ (turn * np.sign(np.linalg.det(turn))), mesh.elements, mesh.kind)
    assert tetrahedra_share(turned) == pytest.approx(tetrahedra_share(mesh), abs=1e-3)


@pytest.mark.parametrize("element", ["h27", "t10"])
def test_the_elements_that_are_named_have_no_such_error(element: str, tmp_path: Path) -> None:
    scene = bar_scene(tmp_path, (10, 1, 1), element, tilt=TILT)
    assert sag(scene) == pytest.approx(beam().sag, rel=0.01)
    assert Simulation(load_scene(scene)).notes == ()


def test_run_tells_it_on_standard_error_and_in_its_result(tmp_path: Path) -> None:
    words = ["run", str(bar_scene(tmp_path, (10, 1, 1), "h8_modes", tilt=TILT)), "--duration", "0.002"]
    plain, as_json = (CliRunner().invoke(app, [*words, *more]) for more in ([], ["--json"]))
    said = ("mesh.element 'h8_modes'", "48 % too small", "'h27'", "'t10'")
    for done in (plain, as_json):
        assert done.exit_code == 0
        line_naming(done.stderr, *said)
    (note,) = json.loads(as_json.stdout)["notes"]
    assert_names(note, *said)
    assert_names(CliRunner().invoke(app, ["explain", words[1], "--no-costs", "-q"]).stdout, *said)


@pytest.mark.parametrize("level", sorted(LEVELS))
def test_the_meshes_that_come_with_tripod_are_not_warned_of(level: int) -> None:
    assert suited(y_piece(LEVELS[level]))[1] == ()


def test_plain_hexahedra_are_told_of_too() -> None:
    """Their excess is (l/h)²/2 of nu = 0, whatever the shape: one third is left of a bar of cells twice as long."""
    mesh = brick("h8", [np.linspace(0, 20, 11), np.linspace(0, 1, 2), np.linspace(0, 1, 2)])
    assert deflection_share(mesh) == pytest.approx(1 / 3, abs=0.05)
    (note,) = suited(mesh)[1]
    assert_names(note, "mesh.element 'h8'", f"{100 * (1 - deflection_share(mesh)):.0f} % too small")


def test_neither_turning_nor_scaling_nor_numbering_changes_it() -> None:
    mesh = brick("h8_modes", [np.linspace(0, 9, 5), np.linspace(0, 1, 3), np.linspace(0, 2, 2)])
    x = np.array(mesh.nodes)
    x += 0.2 * np.sin(x @ [[1, 2, 3], [3, 1, 2], [2, 3, 1]])
    rng = np.random.default_rng(1)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    axes = [1, 2, 3, 0, 5, 6, 7, 4]  # the cell's own axes, turned by a quarter
    elements = np.where(rng.random(len(mesh.elements))[:, None] < 0.5, mesh.elements, mesh.elements[:, axes])
    order = rng.permutation(len(x))
    place = np.argsort(order)
    one = SolidMesh(x, mesh.elements, mesh.kind)
    other = SolidMesh(1e-3 * (x @ turn.T)[order], place[elements], mesh.kind)
    assert 0.2 < deflection_share(one) < 0.95
    assert deflection_share(other) == pytest.approx(deflection_share(one), rel=1e-9)


def test_the_layers_are_counted_along_each_axis() -> None:
    mesh = brick("h8", [np.linspace(0, 1, n + 1) for n in (4, 2, 40)])
    assert (stacked(mesh) == [4, 2, MOST_LAYERS]).all()
    pieces = SolidMesh(mesh.nodes, mesh.elements[::2], ELEMENTS["h8"])
    assert stacked(pieces).min() == 1
