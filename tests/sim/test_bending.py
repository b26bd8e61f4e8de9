"""The error of linear elements in bending: told before a run, and compared with bars and with other elements."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks import coarse_meshes, trapezoids
from benchmarks.blocks import brick
from tests.messages import assert_names, line_naming
from tests.sim.beams import bar_scene, beam, sag
from tests.tiers import sampled
from tripod_bringup.cli import app
from tripod_sim import Simulation, load_scene
from tripod_sim.bodies import bending as examined
from tripod_sim.bodies.bending import Bending, bending
from tripod_sim.bodies.suited import suited
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.mesh.y_piece import LEVELS, y_piece

TILT = math.radians(31)


def found(mesh: SolidMesh, poisson: float = 0.0) -> Bending:
    result = bending(mesh, poisson)
    assert result
    return result


def block(element: str, cells: tuple[int, int, int]) -> SolidMesh:
    """A bar of 100 x 10 x 5 mm."""
    return brick(element, [np.linspace(0, w, n + 1) for w, n in zip((0.1, 0.01, 0.005), cells, strict=True)])


@pytest.mark.parametrize(
    ("element", "cells", "poisson", "error"),
    [
        ("t4", (40, 4, 2), 0.3, 0.50),
        ("t4", (40, 4, 2), 0.45, 0.71),
        ("t4", (40, 4, 2), 0.49, 0.90),
        ("h8", (20, 2, 2), 0.3, 0.31),
        ("h8", (20, 2, 2), 0.45, 0.40),
        ("h8", (20, 2, 2), 0.49, 0.52),
        ("h8_mean", (20, 2, 2), 0.3, 0.23),
        ("h8_mean", (20, 2, 2), 0.45, 0.23),
        ("h8_mean", (20, 2, 2), 0.49, 0.23),
    ],
)
def test_the_error_grows_with_poissons_ratio_as_that_of_a_clamped_bar(
    element: str, cells: tuple[int, int, int], poisson: float, error: float
) -> None:
    """Sag of the bar under its weight, clamped at one end, against `h20` on 40 x 6 x 4 cells."""
    told = found(block(element, cells), poisson)
    assert told.softest == pytest.approx(error, abs=0.06)
    assert told.sure and told.softest < error * 1.05
    assert_names(
        suited(block(element, cells), poisson)[1][0], element, f"{100 * told.softest:.0f} % too small"
    )


@pytest.mark.parametrize(("poisson", "drift"), [(0.3, 0.07), (0.45, 0.17), (0.49, 0.34)])
def test_tetrahedra_that_all_lean_drift_sideways(poisson: float, drift: float) -> None:
    """The tip of the same bar over its sag; with `h20` it is 0. Mirrored from cell to cell they do not drift."""
    mesh = block("t4", (40, 4, 2))
    assert found(mesh, poisson).sideways == pytest.approx(drift, abs=0.02)
    assert_names(suited(mesh, poisson)[1][0], "sideways", f"{100 * found(mesh, poisson).sideways:.0f} %")
    plain = block("h8", (20, 2, 2))
    mirrored = coarse_meshes.alternating(plain, np.argwhere(np.ones((20, 2, 2))))
    assert found(mirrored, poisson).sideways < 0.01


@pytest.mark.parametrize("seed", sampled(range(50), 1, 9, 21, 34, 37))
def test_the_note_is_right_or_says_at_least(seed: int) -> None:
    """`benchmarks/coarse_meshes.py` has all of them, and their table is in docs/verification.md."""
    assert coarse_meshes.verdict(coarse_meshes.measured(seed)) in ("within", "at least")


@pytest.mark.parametrize(
    ("note", "true", "verdict"),
    [
        ("expect deflections about 50 % too small", 0.6, "within"),
        ("expect deflections about 40 % too small", 0.6, "wrong"),
        ("expect deflections at least 40 % too small", 0.6, "at least"),
        ("expect deflections at least 90 % too small", 0.6, "wrong"),
        ("expect deflections about 50 % too large", 0.5, "wrong"),
        ("", 0.1, "within"),
        ("", 0.4, "wrong"),
    ],
)
def test_the_benchmark_judges_what_a_user_reads(note: str, true: float, verdict: str) -> None:
    assert coarse_meshes.verdict({"note": note, "true": true}) == verdict


@pytest.mark.parametrize(("cells", "thick"), trapezoids.BARS)
@pytest.mark.parametrize("tilt", [0, 10, 31])
def test_the_error_told_is_that_of_a_bar(cells: int, thick: int, tilt: int) -> None:
    """At any length of the cells and with one to three of them through the thickness.

    The bar is as wide as thick: its softest motions are mixtures of both directions.
    """
    mesh = trapezoids.leaning("h8_modes", cells, math.radians(tilt), thick)
    told = found(mesh)
    assert told.low - 0.02 <= 1 - trapezoids.deflection(mesh) <= told.high + 0.02
    assert told.high - told.low < 0.17


def test_a_users_own_mesh_sags_as_little_as_is_told(tmp_path: Path) -> None:
    scene = bar_scene(tmp_path, (10, 1, 1), "h8_modes", tilt=math.radians(20))
    mesh = Simulation(load_scene(scene)).mesh
    assert isinstance(mesh, SolidMesh)
    assert sag(scene) / beam().sag < 0.95
    assert 1 - found(mesh).softest == pytest.approx(sag(scene) / beam().sag, abs=0.07)


@pytest.mark.parametrize("counts", [(10, 1, 1), (10, 2, 2), (20, 2, 2)])
def test_linear_tetrahedra_bend_as_little_as_is_told(counts: tuple[int, int, int], tmp_path: Path) -> None:
    scene = bar_scene(tmp_path, counts, "t4")
    simulation = Simulation(load_scene(scene))
    assert isinstance(simulation.mesh, SolidMesh)
    told = found(simulation.mesh)
    assert told.low - 0.02 <= 1 - sag(scene) / beam().sag <= told.high + 0.02
    (note,) = simulation.notes
    assert_names(
        note,
        "mesh.element 't4'",
        f"{100 * (told.softest if told.sure else told.low):.0f} % too small",
        "'t10'",
    )


def test_enough_elements_are_not_told_of() -> None:
    mesh = brick("h8", [np.linspace(0, 4, 13), np.linspace(0, 1, 5), np.linspace(0, 1, 5)])
    assert 0 < found(mesh, 0.3).softest < 0.15
    assert suited(mesh, 0.3)[1] == ()


def test_a_mesh_that_is_too_large_is_told_of_without_a_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(examined, "MOST_NODES", {"t10": 500, "h20_full": 500})
    for element in ("t4", "h8", "h8_mean", "h8_modes"):
        mesh = block(element, (20, 2, 2))
        assert bending(mesh, 0.4) is None
        if element == "h8_modes":
            assert suited(mesh, 0.4)[1] == ()
        else:
            assert_names(suited(mesh, 0.4)[1][0], f"mesh.element '{element}'", len(mesh.elements), "'t10'")


@pytest.mark.parametrize("element", ["h27", "t10"])
def test_the_elements_that_are_named_have_no_such_error(element: str, tmp_path: Path) -> None:
    scene = bar_scene(tmp_path, (10, 1, 1), element, tilt=TILT)
    assert sag(scene) == pytest.approx(beam().sag, rel=0.01)
    assert Simulation(load_scene(scene)).notes == ()


def test_run_tells_it_on_standard_error_and_in_its_result(tmp_path: Path) -> None:
    scene = bar_scene(tmp_path, (10, 1, 1), "h8_modes", tilt=TILT)
    mesh = Simulation(load_scene(scene)).mesh
    assert isinstance(mesh, SolidMesh)
    words = ["run", str(scene), "--duration", "0.002"]
    plain, as_json = (CliRunner().invoke(app, [*words, *more]) for more in ([], ["--json"]))
    said = ("mesh.element 'h8_modes'", f"{100 * found(mesh).softest:.0f} % too small", "'h27'", "'t10'")
    for done in (plain, as_json):
        assert done.exit_code == 0
        line_naming(done.stderr, *said)
    (note,) = json.loads(as_json.stdout)["notes"]
    assert_names(note, *said)
    assert_names(CliRunner().invoke(app, ["explain", words[1], "--no-costs", "-q"]).stdout, *said)


@pytest.mark.parametrize("level", sorted(set(LEVELS) - {13}))
def test_the_meshes_that_come_with_tripod_are_not_warned_of(level: int) -> None:
    assert suited(y_piece(LEVELS[level]), 0.45)[1] == ()


def test_plain_hexahedra_are_told_of_too() -> None:
    """Their excess is (l/h)²/2 of nu = 0, whatever the shape: one third is left of a bar of cells twice as long."""
    mesh = brick("h8", [np.linspace(0, 20, 11), np.linspace(0, 1, 2), np.linspace(0, 1, 2)])
    assert 1 - found(mesh).softest == pytest.approx(1 / 3, abs=0.05)
    (note,) = suited(mesh, 0.0)[1]
    assert_names(note, "mesh.element 'h8'", f"{100 * found(mesh).softest:.0f} % too small")


def test_where_directions_differ_the_least_error_and_the_largest_are_told() -> None:
    """An almost square bar of tetrahedra, one cell wide and four thick: right one way, far too stiff the other way."""
    case = coarse_meshes.made(62)
    told = found(case.mesh, case.poisson)
    assert not told.sure and told.low < 0.5 * told.high
    (note,) = suited(case.mesh, case.poisson)[1]
    assert_names(note, "at least", f"{100 * told.low:.0f} %", f"{100 * told.high:.0f} %")


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
    one = SolidMesh.of(x, mesh.elements, mesh.kind)
    other = SolidMesh.of(1e-3 * (x @ turn.T)[order], place[elements], mesh.kind)
    assert 0.2 < found(one).softest < 0.95
    assert found(other).softest == pytest.approx(found(one).softest, abs=1e-3)
