"""Meshes on which the 2x2x2 points of `h20` leave motions without energy, and what becomes of them."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import curve_fit

from benchmarks.analytic import tangent
from benchmarks.blocks import brick, elastic
from tests.messages import assert_names
from tests.sim.beams import LENGTH, bar_scene, beam, sag
from tripod_sim import Simulation, load_scene
from tripod_sim.bodies.suited import suited
from tripod_sim.build import build
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.linear.ldl import Ldl
from tripod_sim.mesh import hourglass
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.hourglass import unseen_motions
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.mesh.y_piece import LEVELS, y_piece


def cells(
    counts: tuple[int, int, int], size: tuple[float, float, float] = (1, 1, 1), bend: float = 0.0
) -> SolidMesh:
    """Return bricks of h20 of a `size`, sheared and bent if asked."""
    mesh = brick("h8", [np.linspace(0, n * s, n + 1) for n, s in zip(counts, size, strict=True)])
    x = np.array(mesh.nodes)
    x += bend * np.array(size) * np.sin(3 * (x / size)[:, [1, 2, 0]] + (x / size)[:, [2, 0, 1]])
    return convert(SolidMesh.of(x, mesh.elements), "h20")


@pytest.mark.parametrize("size", [(1, 1, 1), (10, 1, 1), (1, 1, 0.1)])
@pytest.mark.parametrize("counts", [(1, 1, 1), (2, 1, 1), (7, 1, 1), (2, 2, 1), (7, 2, 1), (3, 2, 2)])
def test_the_motions_without_energy_are_counted(
    counts: tuple[int, int, int], size: tuple[float, float, float]
) -> None:
    """As many as zero eigenvalues that the matrix of 2x2x2 points has and that of 3x3x3 points has not."""
    mesh = cells(counts, size)
    zeros = []
    for name in ("h20", "h20_full"):
        same = SolidMesh.of(mesh.nodes, mesh.elements, ELEMENTS[name])
        matrix = tangent(elastic(same, 1.0, 0.0), same, np.array(same.nodes))
        root = np.sqrt(matrix.diagonal())
        zeros.append(int((np.linalg.eigvalsh(matrix / np.outer(root, root)) < 1e-9).sum()))
    assert zeros[1] == 6
    assert unseen_motions(mesh) == zeros[0] - zeros[1]


@pytest.mark.parametrize("counts", [(4, 1, 1), (8, 1, 1)])
def test_a_bent_row_of_elements_is_found_too(counts: tuple[int, int, int]) -> None:
    assert unseen_motions(cells(counts, bend=0.1)) > 0


@pytest.mark.parametrize("counts", [(2, 2, 1), (4, 2, 1), (4, 4, 1), (2, 2, 2)])
def test_bent_elements_side_by_side_are_not(counts: tuple[int, int, int]) -> None:
    assert unseen_motions(cells(counts, bend=0.1)) == 0


@pytest.mark.parametrize("counts", [(1, 1, 1), (2, 1, 1), (7, 1, 1), (7, 2, 1), (3, 2, 2), (5, 5, 1)])
def test_parts_tell_as_much_as_the_whole(
    counts: tuple[int, int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh, found = cells(counts, bend=0.1), []
    for patch in (1000, 3):
        monkeypatch.setattr(hourglass, "PATCH", patch)
        monkeypatch.setattr(hourglass, "CHUNK", patch)
        hourglass._unseen.cache_clear()
        found.append(unseen_motions(mesh))
    assert found[0] == found[1]


def test_of_a_large_mesh_only_parts_are_factored(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = []
    monkeypatch.setattr(hourglass, "Ldl", lambda matrix: sizes.append(matrix.shape[0]) or Ldl(matrix))
    assert unseen_motions(cells((24, 24, 2))) == 0
    assert max(sizes) <= 3 * len(cells((16, 16, 1)).nodes)


@pytest.mark.parametrize("level", [1, 2, 3, 4, 8, 9])
def test_the_tripod_keeps_its_points(level: int) -> None:
    mesh = y_piece(LEVELS[level], kind=ELEMENTS["h20"])
    same, notes = suited(mesh, 0.45)
    assert same is mesh
    assert notes == ()


@pytest.mark.parametrize("counts", [(5, 1, 1), (10, 1, 1), (25, 1, 1), (6, 2, 1), (6, 2, 2)])
def test_a_bar_hangs_as_beam_theory_has_it(counts: tuple[int, int, int], tmp_path: Path) -> None:
    """Timoshenko's deflection; 1 % for the warping of the clamped end, (h/L)², which beam theory lets go."""
    assert sag(bar_scene(tmp_path, counts, "h20")) == pytest.approx(beam().sag, rel=0.01)


def test_a_thin_bar_under_a_skew_load_settles_at_once(tmp_path: Path) -> None:
    """Where the points do not see a motion, Newton's method finds no descent, or a state that is far off."""
    words = ["gravity.acceleration=[1.0, 3.0, -9.81]", "material.young=2e4", "material.poisson=0.45"]
    found = {}
    for element in ("h20", "h27"):
        simulation = Simulation(load_scene(bar_scene(tmp_path, (8, 1, 1), element), [*words, "inertia=off"]))
        simulation.step()
        found[element] = simulation.positions[simulation.positions[:, 0].argmax()]
    assert np.linalg.norm(found["h20"] - found["h27"]) < 0.02 * np.linalg.norm(found["h27"] - [LENGTH, 0, 0])


@pytest.mark.parametrize("counts", [(5, 1, 1), (10, 1, 1), (6, 2, 2)])
def test_a_bar_swings_with_the_period_of_beam_theory(counts: tuple[int, int, int], tmp_path: Path) -> None:
    """Let go, it swings about its static sag, as low as twice that; the second mode is 1/40 of the first."""
    period = beam().period
    simulation = Simulation(load_scene(bar_scene(tmp_path, counts, "h20"), [f"dt={period / 100!r}"]))
    tip = simulation.positions[:, 0] > LENGTH * (1 - 1e-9)
    sagged = []
    for _ in range(200):
        simulation.step()
        sagged.append(-simulation.positions[tip, 2].mean())
    steps = np.arange(1, 201)
    (middle, swing, omega), _ = curve_fit(
        lambda k, a, b, w: a - b * np.cos(w * k), steps, sagged, p0=[beam().sag, beam().sag, 2 * np.pi / 100]
    )
    assert middle == pytest.approx(beam().sag, rel=0.02)
    assert swing == pytest.approx(beam().sag, rel=0.03)
    assert 2 * np.pi / omega == pytest.approx(100, rel=0.02)


def test_the_note_tells_what_was_done(tmp_path: Path) -> None:
    simulation = Simulation(load_scene(bar_scene(tmp_path, (4, 1, 1), "h20")))
    (note,) = simulation.notes
    assert_names(note, "mesh.element 'h20'", "'h20_full'")
    assert Simulation(load_scene(bar_scene(tmp_path, (4, 1, 1), "h20"), ["mesh.refine=1"])).notes == ()


def test_a_file_in_millimetres_is_asked_about(tmp_path: Path) -> None:
    scene = bar_scene(tmp_path, (4, 2, 2), "h27")
    assert build(load_scene(scene)).notes == ()
    fixed = "fixed=[{low=[-1, -10, -10], high=[1, 10, 10]}]"
    (note,) = build(load_scene(scene, ["mesh.scale=1000", fixed])).notes
    assert_names(note, "m wide", "millimetres", "mesh.scale = 0.001")
