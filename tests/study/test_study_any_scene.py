"""Studies of scenes as users describe them."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names, names, raises_naming
from tests.sim.test_part_mesh import bar, gmsh
from tests.sim.test_part_mesh import notched as finger
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.mesh.part.part import mean_edge
from tripod_sim.scene.file import scene_text
from tripod_study import any_scene
from tripod_study.accuracy.choice import choose
from tripod_study.accuracy.studied import studied
from tripod_study.advice import advice
from tripod_study.any_scene import Subject, plan
from tripod_study.plan import Plan
from tripod_study.result import assemble
from tripod_study.task import outcome
from tripod_study.watch import task

STRIP = """
name = "{name}"
dt = 0.01
duration = 0.1
[mesh]
level = 1
element = "h8"
[material]
[gravity]
[inertia]
[[fixed]]
low = [0.04, -0.02, -0.01]
high = [0.06, 0.02, 0.01]
"""


def strip(folder: Path, name: str = "strip") -> str:
    path = folder / "scene.toml"
    path.write_text(STRIP.format(name=name))
    return str(path)


def made(study: Plan) -> dict[str, object]:
    runs = [s for some in study.runs() for s in some]
    records = {study.key(s): {**outcome(task, study.told(s)), "code": "here"} for s in runs}
    return assemble(study, records, "test")


def test_a_scene_of_a_user_is_studied_and_picked_from(tmp_path: Path) -> None:
    scene = strip(tmp_path)
    study = plan(Subject(scene, ["material.young=1e5"]), quick=True)
    result = made(study)
    rows = {(r["settings"]["inertia.scheme"], r["settings"]["dt"]): r for r in result["points"]}  # type: ignore[attr-defined, index]
    assert all(row["status"] == "ok" for row in rows.values())
    first, second = rows["implicit_euler", 0.01], rows["tr_bdf2", 0.005]
    assert first["error"] > second["error"] > 0
    assert 0 < result["reference"]["own_error"] < first["error"]  # type: ignore[index]
    path = tmp_path / "study.json"
    path.write_text(json.dumps(result))
    choice = choose(scene, "reference", ["material.young=1e5"], study=path, speed=lambda: 0.04)
    best = min(rows.values(), key=lambda row: row["error"])
    assert choice.settings == best["settings"]
    assert choice.error == pytest.approx(3 * best["error"] + best["own_error"])
    assert not choice.outside
    assert_names(choice.quantity, "root mean square", "worst instant", "0.1 s")
    text = Path(scene).read_text()
    for old, new, same in [
        ("dt = 0.01", "dt = 0.02", True),  # the study chooses it
        ("duration = 0.1", 'duration = 0.2\ndescription = "longer"', True),
        ("[material]", "[material]\nmass = 0.032", True),  # as it is by default
        ("[material]", "[material]\nmass = 0.064", False),
        ("[gravity]", "", False),
        ("low = [0.04", "low = [0.03", False),
    ]:
        Path(scene).write_text(text.replace(old, new))
        choice = choose(scene, "reference", ["material.young=1e5"], study=path, speed=lambda: 0.04)
        assert len(choice.outside) == (not same)
        for cause in choice.outside:
            assert_names(cause, "scene", "file")
    assert "material.young" in str(choose(scene, "reference", study=path, speed=lambda: 0.04).outside)


def test_points_are_compared_at_the_same_places_however_the_mesh_is_refined(tmp_path: Path) -> None:
    study = plan(Subject(strip(tmp_path)), quick=True)
    seen = [
        np.array(task(study.told({**study.default, "mesh.refine": refine, "dt": 0.01})).observed["body"])
        for refine in (0, 1)
    ]
    assert seen[0].shape == seen[1].shape
    fall = np.abs(seen[0][-1] - seen[0][0]).max()
    assert 0 < np.abs(seen[0] - seen[1]).max() < 0.3 * fall


def test_servos_move_as_the_user_says() -> None:
    study = plan(Subject("tripod", ["mesh.level=1"], servo="0:0,0,0; 0.05:-0.2,0,0"), quick=True)
    assert [q.name for q in study.quantities] == ["effector", "body"]
    rows = np.array(task(study.told(study.default)).observed["effector"])
    still = plan(Subject("tripod", ["mesh.level=1"], servo="0:0,0,0; 0.05:-1e-9,0,0"), quick=True)
    rest = np.array(task(still.told(still.default)).observed["effector"])
    assert np.abs(rows[-1] - rest[-1]).max() > 1e-4
    assert study.key(study.default) != still.key(still.default)


def test_settings_that_the_scene_refuses_are_no_points() -> None:
    study = plan(Subject("pendulum", ["solver.linear=cg", "springs.node_mass=0.1"]), quick=False)
    assert study.name.startswith("pendulum_")
    for point in study.points:
        load_scene("pendulum", [f"{k}={v}" for k, v in study.full(point.settings).items()])
    assert {p.settings["inertia.scheme"] for p in study.points} >= {"rk4", "implicit_euler"}


def test_another_mesh_file_or_scene_is_another_study(tmp_path: Path) -> None:
    keys = []
    for text in (STRIP, STRIP.replace("-0.01]", "-0.02]")):
        path = tmp_path / "scene.toml"
        path.write_text(text.format(name="strip"))
        study = plan(Subject(str(path)), quick=True)
        keys.append(study.key(study.default))
    assert keys[0] != keys[1]


def test_what_the_files_of_a_scene_hold_is_part_of_what_was_studied_and_not_where_they_are(
    tmp_path: Path,
) -> None:
    shipped = Path(load_scene("incline").obstacles[0].source).read_text()
    seen = []
    for name, text in (("a", shipped), ("b", shipped), ("c", shipped + "v 0 0 0\n")):
        (tmp_path / name).mkdir()
        scene = tmp_path / name / "scene.toml"
        scene.write_text(scene_text("incline"))
        (scene.parent / "plate.obj").write_text(text)
        seen.append(studied(load_scene(scene), ()))
    assert seen[0] == seen[1] != seen[2]


def test_a_name_cannot_lead_the_files_elsewhere(tmp_path: Path) -> None:
    study = plan(Subject(strip(tmp_path, "../../etc/x y")), quick=True)
    assert study.name == "_etc_x_y"


@pytest.mark.parametrize(
    ("subject", "named"),
    [
        (Subject("tripod", ["motion=off"]), ("'tripod'", "at rest", "no servo moves", "--servo")),
        (Subject("tripod", ["motion=off", "inertia=off", "damping=off"]), ("'tripod'", "static", "no servo")),
        (Subject("silicone", servo="0:0,0,0"), ("'silicone'", "no servos")),
        (Subject("silicone", slide="0.01"), ("'silicone'", "no servos")),
        (Subject("silicone", duration=-1.0), ("duration", "-1 s", "allowed")),
        (Subject("silicone", duration=float("nan")), ("duration", "nan s", "allowed")),
        (Subject("silicone", ["material.yung=1"]), ("material.yung", "'young'?")),
        (
            Subject("tripod_sofa", ["mesh.level=7"], duration=5000.0),
            ("'tripod_sofa'", "at most 30 s", "--duration", "--quick"),
        ),
    ],
)
def test_what_cannot_be_studied_is_told_in_one_line(subject: Subject, named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named) as error:
        plan(subject, quick=True)
    assert "\n" not in str(error.value)


def part_scene(folder: Path, size: float, *, notched: bool) -> str:
    """Write the scene of a part that is held at its base and hangs, filled with edges of `size` [m]."""
    part = finger(folder) if notched else bar(folder)
    path = folder / "part.toml"
    path.write_text(
        f'name = "part"\ndt = 0.01\nduration = 0.05\n[mesh]\nsource = "{part.name}"\nsize = {size}\n[material]\n'
        'young = 3e4\ndensity = 1070\n[gravity]\n[inertia]\n[[fixed]]\nset = "base"\n[[marker]]\nset = "tip"\n'
    )
    return str(path)


@gmsh
def test_the_mesh_of_a_part_is_made_again_finer_and_coarser(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(any_scene, "QUICK_BUDGET", 2.0)
    scene = part_scene(tmp_path, 0.012, notched=False)
    study = plan(Subject(scene), quick=True)
    assert study.default["mesh.size"] == 0.012
    assert "mesh.refine" not in study.default
    edge = mean_edge(Simulation(load_scene(scene)).mesh)
    coarse, fine = study.references[0].rungs(study.default)
    assert (coarse["mesh.size"], fine["mesh.size"]) == (0.012, pytest.approx(edge / 2, rel=1e-3))
    assert {p.settings["mesh.size"] for p in study.points} == {0.012, 0.01692, 0.024}
    assert [q.name for q in study.quantities] == ["marker tip", "body"]
    result = made(study)
    rows = [row for row in result["points"] if row["settings"]["inertia.scheme"] == "tr_bdf2"]  # type: ignore[attr-defined]
    errors = {(row["settings"]["mesh.size"], row["settings"]["dt"]): row["error"] for row in rows}
    for dt in (0.01, 0.005):
        assert errors[0.024, dt] > errors[0.012, dt] > 0
    own = result["reference"]["own_error"]  # type: ignore[index]
    assert 0 < own < 0.1
    rows = task(study.told(study.default)).observed["body"]
    assert np.abs(rows[0]).max() == 0 < np.abs(rows[-1]).max(), "told by how far places moved"
    path = tmp_path / "study.json"
    path.write_text(json.dumps(result))
    cheap = choose(scene, "budget 300%", study=path, speed=lambda: 0.04)
    assert not cheap.outside
    assert cheap.settings["mesh.size"] in (0.012, 0.01692, 0.024)


@gmsh
def test_a_larger_size_is_no_point_where_features_make_the_mesh_as_fine_as_it_is(tmp_path: Path) -> None:
    scene = part_scene(tmp_path, 0.04, notched=True)
    study = plan(Subject(scene, duration=0.01), quick=True)
    edge = mean_edge(Simulation(load_scene(scene)).mesh)
    assert edge < 0.01, "features make it finer than the size"
    _, fine = study.references[0].rungs(study.default)
    assert fine["mesh.size"] <= (1 + 1e-3) * edge / 2
    assert {s for p in study.points if (s := p.settings["mesh.size"]) >= 0.04} == {0.04}


def test_a_marker_is_what_the_errors_are_of(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    words = '\n[[set]]\nname = "tip"\nlow = [-1, -1, -1]\nhigh = [-0.02, 1, 1]\n[[marker]]\nset = "tip"\n'
    path.write_text(STRIP.format(name="strip") + words)
    study = plan(Subject(str(path)), quick=True)
    assert [q.name for q in study.quantities] == ["marker tip", "body"]
    rows = np.array(task(study.told(study.default)).observed["marker tip"])
    assert rows.shape == (6, 3)  # the start, and five instants
    assert rows[-1, 2] < rows[0, 2] - 1e-4


def test_scenes_of_bodies_with_names_are_studied() -> None:
    study = plan(Subject("finger", ["dt=0.005"], duration=0.05), quick=True)
    assert [q.name for q in study.quantities] == ["body"]
    rows = np.array(task(study.told(study.default)).observed["body"])
    assert rows.shape[1] > 100
    assert np.abs(rows[-1] - rows[0]).max() > 1e-5
    assert {p.settings["inertia.scheme"] for p in study.points} >= {"implicit_euler", "tr_bdf2"}


def test_a_study_of_a_static_scene_is_picked_from(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        STRIP.format(name="still").replace("[inertia]", '[[load]]\nset = "all"\nforce = [0, 0, -0.01]')
    )
    made_of = made(plan(Subject(str(path)), quick=True))
    found = tmp_path / "study.json"
    found.write_text(json.dumps(made_of))
    assert not choose(str(path), "reference", study=found, speed=lambda: 0.04).outside
    with raises_naming(SceneError, "static solves", "scene moves"):
        choose(str(path), "reference", ["inertia={}"], study=found, speed=lambda: 0.04)


def test_where_nothing_moves_there_are_no_errors_and_a_way_out_is_told(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(STRIP.format(name="still").replace("[gravity]", "").partition("[[fixed]]")[0])
    result = made(plan(Subject(str(path)), quick=True))
    assert result["front"] == []
    said = result["reference"]["message"]  # type: ignore[index]
    assert_names(said, "body", "gravity", "load", "servo", "initial velocity", "[[marker]]")


def test_a_motion_that_no_steps_can_tell_is_called_so() -> None:
    result = made(plan(Subject("stack", duration=0.1), quick=True))
    result["reference"] |= {"own_error": 0.43}  # type: ignore[operator]
    told = ("43 %", "chaotic", "shorten it")
    assert_names(advice(result)[-1], "--quick", *told)
    closer = advice({**result, "quick": False})[-1]
    assert_names(closer, *told)
    assert not names(closer, "--quick")


def test_where_no_mesh_is_finer_the_errors_say_that_they_are_without_it(tmp_path: Path) -> None:
    without = ("without", "error of the mesh")
    coarse = plan(Subject("tripod", duration=0.4), quick=True)
    assert_names(coarse.note, "finer mesh")
    assert_names(coarse.quantities[0].what, *without)
    whole = plan(
        Subject("tripod", duration=0.4), quick=False
    )  # another element errs otherwise than the reference
    assert {p.settings["mesh.element"] for p in whole.points} == {
        whole.default["mesh.element"]
    } or not whole.note
    bodies = plan(Subject("finger", duration=0.05), quick=True)
    assert_names(bodies.note, "[[body]]", "not refined")
    assert_names(bodies.quantities[0].what, *without)
    fine = plan(Subject(strip(tmp_path)), quick=True)
    assert fine.note == ""
    assert not names(fine.quantities[0].what, "mesh")


def test_a_quick_study_shortens_a_motion_that_would_take_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """It halves it until the reference is affordable, and says so; a duration that the user gave it keeps."""
    words = ["mesh.level=1"]
    whole = plan(Subject("tripod", words), quick=True)
    monkeypatch.setattr(any_scene, "QUICK_BUDGET", any_scene.QUICK_BUDGET / 10)
    short = plan(Subject("tripod", words), quick=True)
    assert short.base["duration"] < 0.6 * whole.base["duration"]
    assert_names(short.note, "first", f"{short.base['duration']:.2g} s", "--quick")
    with raises_naming(SceneError, "--duration", "--quick"):
        plan(Subject("tripod", words, duration=whole.base["duration"]), quick=True)
