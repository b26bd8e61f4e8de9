"""Parts filled with tetrahedra: surfaces by fTetWild, STEP files by gmsh, and what scenes keep of them."""

import importlib.util
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from tests.messages import assert_names
from tests.sim.broken_surfaces import ball, box, surfaces, turned, write_stl
from tripod_sim.elements.tetrahedron import T4, T10
from tripod_sim.errors import SceneError
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.curved import KEPT, curved
from tripod_sim.mesh.part import mesher, part
from tripod_sim.mesh.part.part import PartMesh, PartSettings, mesh_part, tetrahedra
from tripod_sim.mesh.read import read_solid
from tripod_sim.mesh.refine import refine
from tripod_sim.mesh.solid_mesh import SolidMesh, element_quality, solid_volumes
from tripod_sim.mesh.write import write_mesh
from tripod_sim.scene.file import load_scene
from tripod_sim.simulation import Simulation

ROOT = Path(__file__).parents[2]
NEED = (
    "--size", "size", "open", "hole", "empty", "no triangles", "not finite", "solid", "quality", "inside", "volume",
)  # fmt: skip


def loads(package: str) -> bool:
    """Return whether a mesher can be imported, with the system libraries that it needs."""
    if importlib.util.find_spec(package) is None:
        return False
    code = (
        "import sys, types; sys.modules.setdefault('pyvista', types.ModuleType('pyvista')); import " + package
    )
    return subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0


tetwild = pytest.mark.skipif(not loads("pytetwild"), reason="needs pytetwild: pip install 'tripod[cad]'")
gmsh = pytest.mark.skipif(not loads("gmsh"), reason="needs gmsh: pip install 'tripod[step]'")


def notched(folder: Path) -> Path:
    """Return the example's STEP file: 80 x 16 x 12 mm, five notches of 2.5 to 1.5 mm half width, half deep."""
    found = runpy.run_path(str(ROOT / "examples" / "own_part.py"))
    path = folder / "notched.step"
    path.write_text(found["step_text"](*found["prism"](found["outline"]())))
    return path


def bar(folder: Path) -> Path:
    """Return a STEP file of a bar of 40 x 16 x 12 mm; the faces at its ends are `base` and `tip`."""
    found, path = runpy.run_path(str(ROOT / "examples" / "own_part.py")), folder / "bar.step"
    path.write_text(found["step_text"](*found["prism"](np.array([[0, 0], [40, 0], [40, 12], [0, 12]]))))
    return path


NOTCHED = 80 * 16 * 12 - 5 * 16 * 6 * (5 + 3) / 2
"""Its volume [mm³]."""


def fake_mesher(monkeypatch: pytest.MonkeyPatch, folder: Path, code: str) -> None:
    """Let a program of the test stand for fTetWild: `points`, `triangles`, `size`, `target` are there for `code`."""
    program = folder / "tetwild.py"
    program.write_text(
        "import os, signal, sys, time\nimport numpy as np\nfrom tripod_host.parent import die_with_parent\n"
        "die_with_parent(int(sys.argv[1]))\nsource, target = sys.argv[2:]\ngiven = np.load(source)\n" + code
    )
    monkeypatch.setattr(mesher, "__file__", str(folder / "mesher.py"))
    monkeypatch.setitem(mesher.PACKAGES, "tetwild", ("numpy", "cad"))


# no mesher needed -----------------------------------------------------------------------------------------------------


def test_a_mesher_that_is_not_installed_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(mesher.PACKAGES, "tetwild", ("pytetwild_is_absent", "cad"))
    with pytest.raises(SceneError) as caught:
        mesh_part(write_stl(tmp_path / "part.stl", box()), PartSettings(0.004), "PART")
    assert_names(caught.value, "part.stl", "pytetwild_is_absent", "pip install 'tripod[cad]'")


def test_a_mesher_that_takes_too_long_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pid = tmp_path / "pid"
    fake_mesher(monkeypatch, tmp_path, f"open({str(pid)!r}, 'w').write(str(os.getpid()))\ntime.sleep(600)")
    said = list[str]()
    with pytest.raises(SceneError) as caught:
        mesh_part(
            write_stl(tmp_path / "part.stl", box()), PartSettings(0.004, time_limit=3.0), "PART", said.append
        )
    assert_names(caught.value, "part.stl", "3 s", "--time-limit")
    assert {"meshing: 0 s", "meshing: 1 s", "meshing: 2 s"} <= set(said), "progress each second"
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)


@pytest.mark.parametrize(
    ("code", "names"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", ("-11",)),
        (
            "print('libGLU.so.1: cannot open shared object file'); sys.exit(1)",
            ("libGLU.so.1", "apt-get install"),
        ),
        ("np.savez(target, points=np.zeros((0, 3)), cells=np.zeros((0, 4), int))", ("no inside",)),
    ],
)
def test_a_mesher_that_fails_is_an_error_with_its_reason(
    code: str, names: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_mesher(monkeypatch, tmp_path, code)
    with pytest.raises(SceneError) as caught:
        mesh_part(write_stl(tmp_path / "part.stl", box()), PartSettings(0.004), "PART")
    assert_names(caught.value, "part.stl", *names)


FOUR = "p = given['points'].min(axis=0) + np.ptp(given['points'], axis=0) * np.array({})\n"
SAVE = "np.savez(target, points=p, cells=np.array({}))"
CUBE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
KUHN = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]


def test_a_mesh_of_another_volume_is_refused_unless_it_is_allowed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_mesher(monkeypatch, tmp_path, FOUR.format(CUBE) + SAVE.format(KUHN[:5]))
    path = write_stl(tmp_path / "part.stl", box())
    with pytest.raises(SceneError) as caught:
        mesh_part(path, PartSettings(0.004), "PART")
    assert_names(caught.value, "part.stl", "6000", "5000", "-17 %", "2 %", "--volume-change")
    found = mesh_part(path, PartSettings(0.004, volume_change=0.17), "PART")
    assert found.volume / found.volume_before == pytest.approx(5 / 6)


def test_an_element_that_would_ruin_the_step_is_refused_with_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # a node in the brick, almost on the lower face, from which all cells go out
    inner = [*CUBE, [0.5, 0.5, 1e-4]]
    faces = [(0, 1, 2), (0, 2, 3), (4, 6, 5), (4, 7, 6), (0, 5, 1), (0, 4, 5)]
    faces += [(3, 2, 6), (3, 6, 7), (0, 3, 7), (0, 7, 4), (1, 5, 6), (1, 6, 2)]
    fake_mesher(monkeypatch, tmp_path, FOUR.format(inner) + SAVE.format([[*f, 8] for f in faces]))
    with pytest.raises(SceneError) as caught:
        mesh_part(write_stl(tmp_path / "part.stl", box()), PartSettings(0.004, element="t4"), "PART")
    assert_names(caught.value, "quality", str(part.LEAST_QUALITY), "mm")
    assert ", 0.0005) mm" in str(caught.value) or "0.0002" in str(caught.value)


def test_edges_bend_onto_a_surface_as_far_as_elements_stay_good() -> None:
    mesh = convert(tetrahedra(np.array(CUBE, float) - 0.5, np.array(KUHN)), "t10")
    on_ball = mesh.nodes / np.linalg.norm(mesh.nodes, axis=1, keepdims=True).clip(1e-9) * 3**0.5 / 2
    places = np.where(np.abs(mesh.nodes).max(axis=1, keepdims=True) > 0.49, on_ball, mesh.nodes)
    straight = element_quality(mesh)
    assert (element_quality(SolidMesh.of(places, mesh.elements, T10)) < KEPT * straight).any(), (
        "too far for some"
    )
    found, less = curved(mesh, places)
    assert less > 0
    assert (element_quality(found) >= KEPT * straight).all()
    assert solid_volumes(found).sum() > solid_volumes(mesh).sum()
    whole, less = curved(mesh, mesh.nodes + 0.05 * (places - mesh.nodes))
    assert less == 0
    assert whole.nodes == pytest.approx(mesh.nodes + 0.05 * (places - mesh.nodes))


def test_refining_curved_elements_keeps_the_middles_of_their_edges() -> None:
    mesh = convert(tetrahedra(np.array(CUBE, float), np.array(KUHN)), "t10")
    bent = SolidMesh.of(mesh.nodes + 0.02 * np.sin(7 * mesh.nodes), mesh.elements, T10)
    fine = refine(bent)
    corners = fine.nodes[np.unique(fine.elements[:, :4])]
    assert sorted(map(tuple, corners.round(12).tolist())) == sorted(map(tuple, bent.nodes.round(12).tolist()))


@pytest.mark.parametrize("ending", [".vtu", ".msh"])
@pytest.mark.parametrize("element", ["t4", "t10"])
def test_a_mesh_that_is_written_is_read_with_its_faces(ending: str, element: str, tmp_path: Path) -> None:
    mesh = convert(tetrahedra(np.array(CUBE, float), np.array(KUHN)), element)
    rows = np.concatenate([f.nodes for f in mesh.boundary])
    below = rows[(mesh.nodes[rows][:, :, 2] == 0).all(axis=1)]
    left = rows[(mesh.nodes[rows][:, :, 0] == 0).all(axis=1)]
    path = tmp_path / f"a{ending}"
    write_mesh(path, mesh, {"left side": left, "below": below})
    found = read_solid(path, 1.0, element)
    assert found.nodes == pytest.approx(mesh.nodes, abs=1e-15)
    assert (found.elements == mesh.elements).all()
    name = {".vtu": "face:2", ".msh": "below"}[ending]
    assert found.groups[name].tolist() == np.unique(below).tolist()
    assert {".vtu": "face:1", ".msh": "left_side"}[ending] in found.groups


# fTetWild -------------------------------------------------------------------------------------------------------------


@tetwild
@pytest.mark.parametrize("element", ["t4", "t10"])
def test_a_ball_is_filled(element: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    found = mesh_part(
        write_stl(tmp_path / "a.stl", ball(level=3)), PartSettings(0.004, 1e-3, element), "PART"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["a.stl"], "the mesher leaves no file"
    assert found.mesh.kind is {"t4": T4, "t10": T10}[element]
    assert found.volume == pytest.approx(found.volume_before, rel={"t4": 0.02, "t10": 1e-3}[element])
    assert found.distance < {"t4": 5e-4, "t10": 2e-4}[element]
    assert found.quality.min() > 0.05
    on_surface = np.linalg.norm(found.mesh.nodes[np.unique(found.mesh.surface)], axis=1)
    assert on_surface == pytest.approx(0.01, abs=1.2e-4)


@tetwild
def test_cavities_are_found_and_numbered_for_chambers(tmp_path: Path) -> None:
    x = np.concatenate(
        [box((30, 20, 10)), *(turned(ball(3, at=(7 + 16 * k, 10, 5)), slice(None)) for k in (0, 1))]
    )
    found = mesh_part(write_stl(tmp_path / "a.stl", x), PartSettings(0.005, 1e-3), "PART")
    assert len(found.cavities) == 2
    assert found.cavities == pytest.approx(2 * [27e-3 * 1e-6 * 3819.49 / 1e3 * 1], rel=0.02)


BUILT = (
    "box", "ball", "tube", "inward", "one_turned", "half_turned", "one_missing", "five_missing", "no_lid", "doubled",
    "doubled_inward", "flat_triangles", "needle", "cracked", "crossing", "crossing_balls", "two_parts", "touching",
    "hollow", "hollow_wrong", "thin_wall", "thin_sheet", "inner_wall",
)  # fmt: skip
"""Surfaces of the set that are meshed; the others are refused."""


@tetwild
@pytest.mark.slow
@pytest.mark.parametrize("name", surfaces())
def test_each_surface_is_meshed_or_refused_with_the_reason(name: str, tmp_path: Path) -> None:
    path = write_stl(tmp_path / f"{name}.stl", surfaces()[name])
    try:
        found = mesh_part(path, PartSettings(0.004, 1e-3), "PART")
    except SceneError as error:
        assert name not in BUILT, str(error)
        assert_names(error, name)
        assert any(word in str(error) for word in NEED)
        return
    assert name in BUILT
    assert abs(found.volume / found.volume_before - 1) < 0.02
    assert found.quality.min() > part.LEAST_QUALITY
    assert found.distance < (0.0061 if name == "inner_wall" else 5e-4)
    assert len(found.cavities) == (name == "hollow")


# gmsh -----------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def finger(tmp_path_factory: pytest.TempPathFactory) -> PartMesh:
    return mesh_part(notched(tmp_path_factory.mktemp("step")), PartSettings(0.006), "PART")


@gmsh
def test_a_step_file_is_filled_in_metres_with_its_faces(finger: PartMesh) -> None:
    assert finger.volume_before == pytest.approx(1e-9 * NOTCHED, rel=1e-6)
    assert finger.volume == pytest.approx(1e-9 * NOTCHED, rel=1e-6)
    nodes, faces = finger.mesh.nodes, finger.faces
    assert np.ptp(nodes, axis=0) == pytest.approx([0.08, 0.016, 0.012])
    assert len(faces) == 26
    for name, axis, at in (("base", 0, 0.0), ("tip", 0, 0.08), ("top", 2, 0.012), ("left", 1, 0.008)):
        own = np.unique(faces[name])
        assert nodes[own, axis] == pytest.approx(at, abs=1e-9)
        assert finger.mesh.groups[name].tolist() == own.tolist()
    rows = np.concatenate([f.nodes for f in finger.mesh.boundary])
    assert sorted(map(tuple, np.sort(rows, axis=1).tolist())) == sorted(
        map(tuple, np.sort(np.concatenate(list(faces.values())), axis=1).tolist())
    )


@gmsh
@pytest.mark.parametrize(
    ("change", "names"),
    [
        (lambda text: text[:600], ("notched.step",)),
        (
            lambda text: re.sub(
                r"MANIFOLD_SOLID_BREP\('',#(\d+)\)", r"SHELL_BASED_SURFACE_MODEL('',(#\1))", text
            ).replace("ADVANCED_BREP_SHAPE", "MANIFOLD_SURFACE_SHAPE"),
            ("no solid", "26"),
        ),
        (lambda text: text.replace("MANIFOLD_SOLID_BREP", "SHELL_BASED_SURFACE_MODEL"), ("gmsh", "-11")),
    ],
)
def test_a_step_file_without_a_solid_is_refused(change, names: tuple[str, ...], tmp_path: Path) -> None:
    path = notched(tmp_path)
    path.write_text(change(path.read_text()))
    with pytest.raises(SceneError) as caught:
        mesh_part(path, PartSettings(0.006), "PART")
    assert_names(caught.value, *names)


@gmsh
@pytest.mark.parametrize("size", [0.012, 0.008, 0.004])
def test_edges_are_as_long_as_the_size_also_where_that_is_a_large_part_of_the_part(
    size: float, tmp_path: Path
) -> None:
    found = mesh_part(bar(tmp_path), PartSettings(size), "PART").mesh
    corners = found.nodes[found.elements[:, :4]]
    edges = np.linalg.norm(corners[:, [0, 0, 0, 1, 1, 2]] - corners[:, [1, 2, 3, 2, 3, 3]], axis=2)
    assert edges.max() > 0.8 * size
    assert 0.6 * size < np.median(edges) < 1.1 * size


def two_bars(folder: Path, gap: float) -> Path:
    """Return a STEP file of the bar of `bar`, and of a second one like it beyond a gap [mm] in X."""
    example, path = runpy.run_path(str(ROOT / "examples" / "own_part.py")), folder / "two.step"
    points, faces = example["prism"](np.array([[0, 0], [40, 0], [40, 12], [0, 12]]))
    first = example["step_text"](points, faces)
    second = example["step_text"](
        points + np.array([40 + gap, 0, 0]), {f"second {name}": f for name, f in faces.items()}
    )
    kept = re.findall(r"^#(?:1[3-9]|[2-9]\d|\d{3,})=.*;$", second, re.M)
    moved = [
        re.sub(r"#(\d+)", lambda m: m[0] if int(m[1]) < 13 else f"#{int(m[1]) + 5000}", line) for line in kept
    ]
    path.write_text(first.replace("ENDSEC;\nEND-ISO", "\n".join(moved) + "\nENDSEC;\nEND-ISO"))
    return path


def _is_end(part: PartMesh, rows: np.ndarray) -> bool:
    return bool((part.mesh.nodes[rows][..., 0] > part.mesh.nodes[:, 0].max() - 1e-9).all())


@gmsh
@pytest.mark.parametrize(("gap", "pieces", "length"), [(0.0, 1, 80.0), (-5.0, 1, 75.0), (5.0, 2, 80.0)])
def test_solids_that_touch_or_overlap_become_one_body(
    gap: float, pieces: int, length: float, tmp_path: Path
) -> None:
    found = mesh_part(two_bars(tmp_path, gap), PartSettings(0.008), "PART")
    assert found.volume == pytest.approx(length * 16 * 12 * 1e-9, rel=1e-6)
    assert len(np.unique(found.mesh.nodes.round(9), axis=0)) == len(found.mesh.nodes)
    edges = found.mesh.elements[:, [0, 1, 2]], found.mesh.elements[:, [1, 2, 3]]
    graph = coo_matrix(
        (np.ones(edges[0].size), (edges[0].ravel(), edges[1].ravel())), 2 * (len(found.mesh.nodes),)
    )
    corners = np.unique(found.mesh.elements[:, :4])
    assert len(np.unique(connected_components(graph, directed=False)[1][corners])) == pieces
    name = "second tip" if pieces == 2 else next(f for f, rows in found.faces.items() if _is_end(found, rows))
    assert name.startswith("face:") == (pieces == 1) == ("solids" in " ".join(found.notes))
    end = found.mesh.nodes[found.mesh.groups[name], 0]
    assert end == pytest.approx(1e-3 * (80 + gap), abs=1e-9)
    boundary = {tuple(sorted(row)) for faces in found.mesh.boundary for row in faces.nodes.tolist()}
    named = {tuple(sorted(row)) for rows in found.faces.values() for row in rows.tolist()}
    assert named == boundary


@gmsh
def test_a_step_file_keeps_its_unit(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as caught:
        mesh_part(notched(tmp_path), PartSettings(0.006, unit=1e-3), "PART")
    assert_names(caught.value, "unit", "--unit")


# scenes ---------------------------------------------------------------------------------------------------------------

SCENE = """name = "part"
[mesh]
source = "notched.step"
size = 0.012
[material]
young = 1e6
density = 1070
[gravity]
[[fixed]]
set = "base"
"""


@gmsh
def test_a_scene_keeps_the_mesh_of_its_part_and_never_makes_it_again_silently(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, scene = notched(tmp_path), tmp_path / "part.toml"
    scene.write_text(SCENE)
    first = Simulation(load_scene(scene))
    (kept,) = tmp_path.glob("notched-*.msh")
    assert_names(" ".join(first.notes), "notched.step", kept.name, "12 mm")
    first.step()
    tip = first.positions[np.isclose(first.mesh.nodes[:, 0], 0.08)]
    assert tip[:, 2].mean() < 0.012 / 2 - 1e-4, "it hangs down from its base"
    with monkeypatch.context() as patch:
        patch.setattr(part, "run_mesher", lambda *_: pytest.fail("made again"))
        again = Simulation(load_scene(scene))
        assert (again.mesh.nodes == first.mesh.nodes).all()
        assert kept.name not in " ".join(again.notes)
        linear = Simulation(load_scene(scene, ["mesh.element=t4"]))
        assert linear.mesh.kind is T4
        assert linear.mesh.count == first.mesh.count
    before = kept.read_bytes()
    other = Simulation(load_scene(scene, ["mesh.size=0.01"]))
    path.write_text(path.read_text().replace("PRODUCT('finger'", "PRODUCT('thumb'"))
    third = Simulation(load_scene(scene))
    assert_names(" ".join(other.notes), kept.name, "changed")
    assert_names(" ".join(third.notes), kept.name, "changed")
    assert len(list(tmp_path.glob("notched-*.msh"))) == 3
    assert kept.read_bytes() == before


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["mesh.size=none"], ("mesh.size", "tripod mesh")),
        (["mesh.scale=0.001"], ("mesh.scale", "0.001")),
    ],
)
def test_a_part_in_a_scene_needs_a_size_and_has_its_unit(
    words: list[str], names: tuple[str, ...], tmp_path: Path
) -> None:
    notched(tmp_path)
    scene = tmp_path / "part.toml"
    text = SCENE.replace("size = 0.012\n", "") if "none" in words[0] else SCENE
    scene.write_text(text)
    with pytest.raises(SceneError) as caught:
        Simulation(load_scene(scene, [] if "none" in words[0] else words))
    assert_names(caught.value, *names)


@gmsh
def test_a_part_takes_tetrahedra_only(tmp_path: Path) -> None:
    notched(tmp_path)
    scene = tmp_path / "part.toml"
    scene.write_text(SCENE)
    with pytest.raises(SceneError) as caught:
        Simulation(load_scene(scene, ["mesh.element=h20"]))
    assert_names(caught.value, "mesh.element", "h20", "t10", "t4")
