"""Scenes as text: what is read back equals what was written, and whatever else is written is refused in one line."""

import json
import math
import os
import re
import subprocess
import sys
import threading
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tripod_sim
from tests.messages import assert_names, raises_naming
from tripod_sim import SceneError, load_scene, scene_names
from tripod_sim.effects import EFFECTS
from tripod_sim.effects.damping import Damping
from tripod_sim.effects.gravity import Gravity
from tripod_sim.effects.inertia import Inertia
from tripod_sim.effects.initial_velocity import InitialVelocity
from tripod_sim.effects.prescribed import Prescribed
from tripod_sim.materials.laws import NAMES as LAWS
from tripod_sim.maze.board import read_maze
from tripod_sim.maze.grid import maze_to_text
from tripod_sim.scene import Scene
from tripod_sim.scene.file import MAX_BYTES, scene_from_toml, scene_text, scene_to_toml
from tripod_sim.scene.lines import line_of
from tripod_sim.scene.unread import unread
from tripod_sim.tables.actuators import Cable, Chamber, Force, Via
from tripod_sim.tables.bodies import Material, Mesh
from tripod_sim.tables.fields import unusual
from tripod_sim.tables.method import Solver
from tripod_sim.tables.robot import Effector, Servos
from tripod_sim.tables.sets import Fixed, Load, Marker, NodeSet

EMIO, BEAM = (
    str(Path(__file__).parents[2] / "examples" / f"{name}.toml") for name in ("emio", "silicone_beam")
)

BOX = Fixed(low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 1.0))

EVERYTHING = Scene(
    name='quotes " and \\ backslashes',
    description="lines\nand\ttabs, \x00, \x7f, \u2028, µ, 😀",
    mesh=Mesh(source="/somewhere/piece.vtk", level=3, scale=1e-3),
    material=Material(law="corotational", young=1 / 3, poisson=0.0, mass=1e-300),
    dt=0.1 + 0.2,
    duration=1e8 / 3,
    gravity=Gravity((5e-324, -1e6, -0.0)),
    inertia=Inertia(),
    damping=Damping(mass=2.5, stiffness=0.0),
    fixed=(Fixed(low=(-1.0, -2.0, -3.0), high=(1.0, 2.0, 3.0)), BOX),
    set=(
        NodeSet("a", low=(0.0, 1 / 3, -1.0)),
        NodeSet("b", along=(1.0, 2.0, 3.0), at=0.1, tolerance=1e-3, group="g"),
    ),
    prescribed=(Prescribed("a", move="0: 0,0,0; 1: 1,2,3", axes="xz"),),
    load=(Load("b", force=(1.0, 2.0, -3.0)), Load("all", pressure=-1e5), Load("a", mass=0.1, share="even")),
    initial_velocity=(InitialVelocity("a", spin=(0.0, 0.0, 1.0)),),
    marker=(Marker("b"),),
    cable=(
        Cable(
            "tendon", (Via(((0.0, 0.1, 0.2),)), Via(((1.0, 2.0, 3.0),), body="world")), (0.0, 0.1), slack=1e-3
        ),
        Cable("routed", (Via(source="/somewhere/route.csv"),), (0.0, 9.0), command="tension"),
    ),
    chamber=(
        Chamber("air", (0.0, 1e5), start=1e3, cavity=2),
        Chamber("gas", (-1e4, 0.0), set="b", cap=True),
        Chamber("water", (-1e-6, 1 / 3), command="volume", bulk=1e7),
    ),
    force=(Force("push", "b", (0.0, 0.0, 1.0), (-0.5, 1 / 3), start=0.1, share="even"),),
    servos=Servos(axis_radius=0.07, angle_min=-1.5, angle_max=0.25, angles=(-1.5, 0.25, 0.1), slide=0.01),
    effector=Effector(radius=0.01),
    solver=Solver(tolerance=1e-9, max_iterations=7, max_halvings=0),
)
OF_SOLIDS = [e for e in EFFECTS if e not in ("strain_limit", "contact", "obstacles", "rigid", "mesh_error")]
for _effect in OF_SOLIDS:
    if not getattr(EVERYTHING, _effect):  # effects that came after this test: as they are by default
        EVERYTHING = replace(EVERYTHING, **{_effect: get_args(get_type_hints(Scene)[_effect])[0]()})

NEEDED_BY = {
    name: [e for e in OF_SOLIDS if name in {need.name for need in EFFECTS[e].needs}] for name in EFFECTS
}


def written(folder: Path, text: str | bytes) -> Path:
    path = folder / "scene.toml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def refusal(source: str | Path, *overrides: str) -> str:
    """Return the message with which a scene is refused; it must be one line that a person can read."""
    with pytest.raises(SceneError) as caught:
        load_scene(source, overrides)
    message = str(caught.value)
    assert message.isprintable()
    assert len(message) < 500
    return message


@pytest.mark.parametrize("name", scene_names())
def test_every_shipped_scene_loads_by_its_name(name: str) -> None:
    scene = load_scene(name)
    assert scene.name == name
    assert scene.description


def test_the_shipped_scenes_are_there() -> None:
    assert {"tripod", "silicone"} <= set(scene_names())


@pytest.mark.parametrize("scene", [*map(load_scene, scene_names()), EVERYTHING], ids=lambda s: s.name[:8])
def test_a_written_scene_reads_back_equal(scene: Scene, tmp_path: Path) -> None:
    again = load_scene(written(tmp_path, scene_to_toml(scene)))
    assert again == scene
    assert repr(again) == repr(scene)  # equality does not see -0.0 or 1 for 1.0


def test_a_mesh_file_is_looked_for_beside_the_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scenes").mkdir()
    text = scene_to_toml(replace(load_scene("tripod"), mesh=Mesh("meshes/piece.vtk")))
    written(tmp_path / "scenes", text)
    monkeypatch.chdir(tmp_path)
    scene = load_scene("scenes/scene.toml")
    assert scene.mesh.source == str(tmp_path / "scenes/meshes/piece.vtk")
    (tmp_path / "copies").mkdir()
    assert load_scene(written(tmp_path / "copies", scene_to_toml(scene))) == scene


@pytest.mark.parametrize(
    ("scene", "word", "read", "value"),
    [
        ("tripod", "material.young=3e5", lambda s: s.material.young, 3e5),
        ("tripod", " material.young = 300000 ", lambda s: s.material.young, 300000.0),
        ("tripod", "mesh.level=1", lambda s: s.mesh.level, 1),
        ("tripod", "material.law=corotational", lambda s: s.material.law, "corotational"),
        ("tripod", 'material.law="corotational"', lambda s: s.material.law, "corotational"),
        ("tripod", "name=two words", lambda s: s.name, "two words"),
        ("tripod", 'description="off"', lambda s: s.description, "off"),
        ("tripod", "description=", lambda s: s.description, ""),
        ("tripod", "description=a=b", lambda s: s.description, "a=b"),
        ("tripod", 'description=1\nname = "x"', lambda s: (s.description, s.name), ('1\nname = "x"', "tripod")),
        ("tripod", "gravity.acceleration=[0, 0, -1.62]", lambda s: s.gravity.acceleration, (0.0, 0.0, -1.62)),
        ("tripod", "servos.angles=[0.1, -1, 0]", lambda s: s.servos.angles, (0.1, -1.0, 0.0)),
        ("tripod", "solver.max_iterations=7", lambda s: s.solver.max_iterations, 7),
        ("tripod", "fixed=[{low=[0,0,0], high=[1,1,1]}]", lambda s: s.fixed, (BOX,)),
        ("silicone", "fixed.0.low.0=0.05", lambda s: s.fixed[0].low, (0.05, -0.02, -0.01)),
        ("silicone", "effector.radius=0.009", lambda s: s.effector, Effector(0.009)),
    ],
)  # fmt: skip
def test_an_override_changes_what_it_names_and_nothing_else(scene, word, read, value) -> None:
    before, after = load_scene(scene), load_scene(scene, [word])
    assert read(after) == value
    assert repr(read(after)) == repr(value)
    assert read(before) != value
    changed = {f for f in before.__dict__ if getattr(before, f) != getattr(after, f)}
    assert changed == {word.split("=")[0].split(".")[0].strip()}


@pytest.mark.parametrize(
    ("word", "named"),
    [
        ("material.young=250", ("material.young", "250 Pa", "1000 to 1e+12 Pa", "250kPa")),
        ("material.young=0.25", ("material.young", "0.25 Pa", "1000 to 1e+12 Pa", "0.25MPa")),
        (
            "material.density=1.1",
            ("material.density", "1.1 kg/m³", "10 to 25000 kg/m³", "1.1g/cm³"),
        ),
        (
            "gravity.acceleration=[0,0,-9810]",
            ("gravity.acceleration", "-9810 m/s²", "0 to 1000 m/s²", "-9810mm/s²"),
        ),
        ("material.density=1100", ()),
        ("gravity.acceleration=[0,0,0]", ()),
    ],
)
def test_a_number_of_an_unusual_size_is_told_with_the_unit_in_which_it_would_not_be(
    word: str, named: tuple[str, ...]
) -> None:
    said = unusual(load_scene("tripod", [word]))
    assert len(said) == bool(named)
    for text in said:
        assert_names(text, *named)
        for typed in re.findall(r"write (\S+)$", text):
            again = word.replace(word.rpartition("," if "[" in word else "=")[2].rstrip("]"), typed)
            assert not unusual(load_scene("tripod", [again]))


def test_the_shipped_scenes_have_no_unusual_numbers_and_no_idle_fields() -> None:
    scenes = [load_scene(name) for name in scene_names()]
    assert not [said for scene in scenes for said in (*unusual(scene), *unread(scene))]


@pytest.mark.parametrize(
    ("scene", "word", "field", "cause"),
    [
        ("tripod", "mesh.cells=[2,2,2]", "mesh.cells", ("mesh.source", "'y_piece'")),
        ("pendulum", "springs.scale=0.001", "springs.scale", ("springs.source", "'chain'")),
        ("drape", "springs.size=2", "springs.size", ("springs.source",)),
        ("stack", "rigid.1.radius=0.2", "rigid.1.radius", ("rigid.1.shape", "'box'")),
        (BEAM, "material.mass=2", "material.mass", ("material.density",)),
        ("silicone", 'motion={servo="0:0,0,0"}', "motion", ("no servos",)),
        ("maze", "maze.start=[0.01,0]", "maze.start", ("maze.source", "'labyrinth'")),
        ("maze", 'maze={source="a.stl",wall=0.002}', "maze.wall", ("maze.source",)),
        (EMIO, "servos.slide=0.01", "servos.slide", ("no servo", "no servo slides")),
        (EMIO, 'motion={servo="0:0,0,0,0",slide="0.01"}', "motion.slide", ("no servo",)),
        (EMIO, "servos.clamp_radius=0.1", "servos.clamp_radius", ("[[servo]]",)),
    ],
)
def test_a_field_that_has_no_effect_is_told(
    scene: str, word: str, field: str, cause: tuple[str, ...]
) -> None:
    (said,) = unread(load_scene(scene, [word]))
    assert said.startswith(f"{field}: ")
    assert_names(said, "ignored", *cause)


def test_the_last_override_of_a_field_counts() -> None:
    assert load_scene("tripod", ["dt=0.001", "dt=0.002"]).dt == 0.002


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ('material.young="100 kPa"', 1e5),
        ("material.young=0.1MPa", 1e5),
        ("material.young=1e5 Pa", 1e5),
        ("material.density=1.07 g/cm3", 1070.0),
        ("servos.axis_radius=60mm", 0.06),
        ("servos.axis_radius=6 cm", 0.06),
        ("servos.angle_max=30deg", math.pi / 6),
        ("dt=2ms", 0.002),
        ('gravity.acceleration=["0 m/s2", 0, "-9810 mm/s²"]', (0.0, 0.0, -9.81)),
    ],
)
def test_a_number_may_say_its_unit(word: str, value: object) -> None:
    scene: Any = load_scene("tripod", [word])
    for name in word.partition("=")[0].split("."):
        scene = getattr(scene, name)
    assert scene == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("scene", "words", "named"),
    [
        ("tripod", "material.young=100 bar", ("material.young", "'100 bar'", "Pa, kPa, MPa, GPa")),
        ("tripod", "material.young=-1kPa", ("material.young", "-1000.0", "above 0 Pa")),
        ("tripod", "material.young=nan kPa", ("material.young", "nan", "above 0 Pa")),
        ("tripod", "material.poisson='0.3'", ("material.poisson", "'0.3'", "number")),
        ("tripod", "material.young=0", ("material.young", "0.0", "above 0 Pa")),
        ("tripod", "material.young=nan", ("material.young", "nan", "above 0 Pa")),
        ("tripod", "material.young=inf", ("material.young", "inf", "above 0 Pa")),
        ("tripod", "material.young=hard", ("material.young", "'hard'", "number")),
        ("tripod", "material.young=true", ("material.young", "True", "number")),
        ("tripod", "material.young={}", ("material.young", "{}", "number")),
        ("tripod", f"material.young={2**63}", ("material.young", "whole number", "64 bits")),
        ("tripod", f"mesh.level=0x{'f' * 5000}", ("mesh.level", "whole number", "64 bits")),
        ("tripod", "material.yung=1", ("material.yung", "unknown", "fields: law, young,", "'young'?")),
        ("tripod", "materiel.young=1", ("materiel", "unknown", "'material'?")),
        ("tripod", "material.poisson=0.5", ("material.poisson", 0.5, "at least 0", "at most 0.499")),
        ("tripod", "mesh.level=15", ("mesh.level", 15, "at least 1", "at most 14")),
        ("tripod", "mesh.level=2.0", ("mesh.level", "2.0", "whole number")),
        ("tripod", "mesh.level=true", ("mesh.level", "True", "whole number")),
        ("tripod", "material.law=rubber", ("material.law", "'rubber'", *LAWS)),
        ("tripod", f"material.law={'b' * 9999}", ("material.law is '", "...", "allowed")),
        ("tripod", "name=5", ("name is 5", "text")),
        ("tripod", "dt=2", ("dt is 2.0", "at least 1e-09 s", "at most 1 s")),
        ("tripod", "material.young=1e300", ("material.young", "1e+300", "above 0 Pa", "at most 1e+13 Pa")),
        ("tripod", "solver.max_turn=1e-9", ("solver.max_turn", "1e-09", "at least 0.0001 rad", "at most 7")),
        ("tripod", "dt=0", ("dt is 0.0", "at least 1e-09 s")),
        ("tripod", "gravity=5", ("gravity is 5", "table", "acceleration")),
        ("tripod", "gravity.acceleration=9.81", ("9.81", "list of 3 numbers", "[0, 0, -9.81]")),
        ("tripod", "gravity.acceleration=[0, 0]", ("gravity.acceleration", "2 values", 3)),
        ("tripod", "gravity.acceleration=[0, 0, 'g']", ("gravity.acceleration.2", "'g'", "number")),
        ("tripod", "gravity.acceleration=[0, nan, 0]", ("gravity.acceleration", "(0.0, nan, 0.0)", "at least")),
        ("tripod", "servos.angles=[0, 0, 1]", ("servos.angles.2", "1.0 rad", "-2.1 to 0.6 rad")),
        ("tripod", "servos.slide=0.05", ("servos.slide", "0.05 m", "0 to 0.04 m")),
        ("tripod", "servos.angles=[45, 0, 0]", ("servos.angles", "45.0", "3.2 rad", "degrees", "45deg")),
        ("tripod", "servos.slide=35", ("servos.slide", "millimetres", "35mm")),
        ("tripod", "servos.slide=5", ("servos.slide", "5.0 m", "0 to 0.04 m", "millimetres", "5mm")),
        ("silicone", "fixed.1.low=[0, 0, 0]", ("fixed.1", "no entry '1'", "0 to 0")),
        ("silicone", "fixed.-1.low=[0, 0, 0]", ("fixed.-1", "no entry '-1'", "0 to 0")),
        ("silicone", f"fixed.{'9' * 5000}=1", ("table.field=value",)),
        ("silicone", "fixed=[];fixed.0.low=1", ("fixed.0", "no entry '0'", "empty")),
        ("silicone", "fixed=[{low=[0, 0, 0]}]", ("fixed.0", "either set", "low and high")),
        ("silicone", "fixed.0.low=[1, 0, 0]", ("fixed.0", "low (1.0, 0.0, 0.0)", "high (0.06, ")),
        ("tripod", "material.young.x=3", ("'material.young.x=3'", "material.young is a value", "fields")),
        ("tripod", "material.young.x.y=3", ("material.young.x: ", "material.young is a value", "fields")),
        ("tripod", "material.young", ("setting 'material.young'", "table.field=value")),
        ("tripod", "=3", ("setting '=3'", "table.field=value")),
        ("tripod", "material..young=3", ("setting 'material..young=3'", "table.field=value")),
        ("tripod", f"{'a.' * 5000}a=3", ("table.field=value",)),
        ("tripod", "material.a\nb=3", (r"material.'a\nb'", "unknown")),
        ("tripod", "material=off", ("material=off", *EFFECTS)),
        ("tripod", "gravity.acceleration=off", ("gravity.acceleration=off", "effect can be off")),
        ("silicone", "fixed.1=off", ("fixed.1", "no entry '1'")),
        ("tripod", "inertia=off", ("damping", "inertia")),
        ("tripod", "inertia=off;damping=off;servos=off;clamp=off", ("nothing holds the body",)),
    ],
)  # fmt: skip
def test_a_bad_override_is_refused_by_its_path(scene: str, words: str, named: tuple[object, ...]) -> None:
    assert_names(refusal(scene, *words.split(";")), *named)


@pytest.mark.parametrize("effect", OF_SOLIDS)
def test_an_effect_goes_with_off_and_returns_as_it_was(effect: str) -> None:
    table = tomllib.loads(scene_to_toml(EVERYTHING))
    present = [f"{e}={inline(table[e])}" for e in OF_SOLIDS if e not in NEEDED_BY.get(effect, [])]
    missing = [f"{e}=off" for e in NEEDED_BY.get(effect, [])]
    before = load_scene("tripod", present + missing)
    assert getattr(before, effect) == getattr(EVERYTHING, effect)
    off = load_scene("tripod", [*present, *missing, f"{effect}=off"])
    assert off == replace(before, **{effect: () if isinstance(getattr(EVERYTHING, effect), tuple) else None})
    assert off != before
    again = load_scene("tripod", [*present, *missing, f"{effect}=off", f"{effect}={inline(table[effect])}"])
    assert again == before


def test_overrides_that_are_no_list_are_told() -> None:
    with raises_naming(SceneError, "overrides is 'dt=0.01'", "list", "['dt=0.01']"):
        load_scene("tripod", "dt=0.01")


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (None, ("overrides", "None", "list", "['dt=0.01']")),
        ([("dt", 0.01)], ("setting ('dt', 0.01)", "table.field=value")),
        ([b"dt=0.01"], ("setting b'dt=0.01'", "table.field=value")),
    ],
)
def test_overrides_that_are_no_texts_are_told(words: Any, named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named):
        load_scene("tripod", words)


def test_a_scene_is_found_by_a_path_that_is_its_name() -> None:
    assert load_scene(Path("tripod")) == load_scene("tripod")


@pytest.mark.parametrize("text", [None, b'name = "a"', Path("tripod")])
def test_what_is_no_text_is_no_scene(text: Any) -> None:
    with raises_naming(SceneError, "scene", "text in TOML"):
        scene_from_toml(text)


@pytest.mark.parametrize(
    ("table", "field", "given", "plain"),
    [
        ("", "dt", np.float64(0.004), 0.004),
        ("", "dt", np.array(0.004), 0.004),
        ("material", "young", np.float32(2.5e5), 2.5e5),
        ("mesh", "level", np.int64(2), 2),
        ("gravity", "acceleration", np.array([0.0, 0.0, -1.6]), (0.0, 0.0, -1.6)),
        ("servos", "angles", [-1, -1.0, np.float64(-1)], (-1.0, -1.0, -1.0)),
        ("servos", "angles", np.full(3, -1.0), (-1.0, -1.0, -1.0)),
    ],
)
def test_numbers_of_numpy_become_those_of_a_file(table: str, field: str, given: Any, plain: Any) -> None:
    """As a program gives them that sweeps one: the scene is then written, hashed and told as any other."""
    scenes = []
    for value in (given, plain):
        own = load_scene("tripod")
        change = {field: value}
        scenes.append(replace(own, **({table: replace(getattr(own, table), **change)} if table else change)))
    assert repr(scenes[0]) == repr(scenes[1])
    assert scene_from_toml(scene_to_toml(scenes[0])) == scenes[1]
    assert hash(scenes[0]) == hash(scenes[1])


def test_a_scene_keeps_no_array_of_whoever_makes_it() -> None:
    own, down = load_scene("tripod"), np.array([0.0, 0.0, -9.81])
    scene = replace(own, gravity=replace(own.gravity, acceleration=down))
    down[2] = 0.0
    assert scene == own


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"mesh": replace(load_scene("tripod").mesh, level=2.5)}, ("mesh.level", 2.5, "whole number")),
        ({"gravity": Gravity((0.0, -9.81))}, ("gravity.acceleration", "2 values", 3)),
        ({"mesh": "y_piece"}, ("mesh", "'y_piece'", "Mesh")),
        ({"marker": {"set": "all"}}, ("marker", "one table", "list")),
        ({"name": None}, ("name", "None", "text")),
        ({"dt": "auto"}, ("dt", "'auto'", "load_scene(..., ['dt=auto'])")),
    ],
)
def test_a_scene_of_a_program_is_checked_as_one_of_a_file(
    changes: dict[str, Any], named: tuple[object, ...]
) -> None:
    with raises_naming(SceneError, *named):
        replace(load_scene("tripod"), **changes)


def test_one_entry_of_a_list_goes_with_off() -> None:
    boxes = "fixed=[{low=[0,0,0], high=[1,1,1]}, {low=[2,2,2], high=[3,3,3]}]"
    assert load_scene("tripod", [boxes, "fixed.0=off"]).fixed == (Fixed(low=(2, 2, 2), high=(3, 3, 3)),)


@pytest.mark.parametrize("name", scene_names())
def test_a_shipped_scene_that_is_written_elsewhere_finds_its_files(name: str, tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    path.write_text(scene_text(name))
    assert load_scene(path) == load_scene(name)


def test_a_file_beside_the_scene_goes_before_one_that_comes_along(tmp_path: Path) -> None:
    path, own = tmp_path / "my.toml", tmp_path / "plate.obj"
    path.write_text(scene_text("incline"))
    own.write_text("")
    assert load_scene(path).obstacles[0].source == str(own)


def test_the_number_after_the_last_entry_of_a_list_adds_one() -> None:
    box = "{low=[2, 2, 2], high=[3, 3, 3]}"
    scene = load_scene("silicone", [f"fixed.1={box}"])
    assert scene.fixed == (*load_scene("silicone").fixed, Fixed(low=(2, 2, 2), high=(3, 3, 3)))
    assert_names(refusal("silicone", f"fixed.2={box}"), "fixed.2", "no entry '2'")


def test_the_number_0_begins_a_list_that_the_scene_has_not() -> None:
    scene = load_scene("silicone", ["load.0={set='all', force=[0, 0, 1]}", "load.1={set='all', mass=0.1}"])
    assert scene.load == (Load("all", force=(0, 0, 1)), Load("all", mass=0.1))
    assert_names(refusal("silicone", "load.0.mass=0.1"), "load.0", "no entry '0'", "empty")


def test_a_file_without_its_suffix_is_what_is_meant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("beam.toml").write_text(scene_text("silicone"))
    with raises_naming(SceneError, "scene 'beam'", "unknown", "'beam.toml'?"):
        load_scene("beam")


def test_an_effect_that_is_not_there_can_be_off() -> None:
    assert load_scene("tripod", ["fixed=off"]) == load_scene("tripod")


@pytest.mark.parametrize(
    ("name", "named"),
    [
        ("tripd", ("scene 'tripd'", "unknown", "scenes: ", ".toml file", "'tripod'?")),
        ("Silicone", ("'silicone'?",)),
        ("", ("scene ''", "unknown")),
        ("../scenes/tripod", ("unknown",)),
        ("no/such/place.toml", ("scene file 'no/such/place.toml'", "no such file")),
        ("zero\0byte.toml", (r"scene file 'zero\x00byte.toml'", "null byte")),
    ],
)
def test_an_unknown_scene_is_refused_with_the_nearest_name(name: str, named: tuple[str, ...]) -> None:
    assert_names(refusal(name), *named)


def test_a_name_like_no_other_gets_no_hint() -> None:
    assert "?" in refusal("Silicone")
    assert "?" not in refusal("xyzzy")


BASE = scene_to_toml(load_scene("tripod"))


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (b"", ("field name is missing", "text")),
        ('name = "a"\ndescription = "b"\n[[servo]]\nset = "end"', ("servo.0.hub", "missing", "3 numbers in m")),
        ('name = "a"\n[servo]\nset = "end"', ("servo is one table", "list", "[[servo]]")),
        ('name = "a"\n[[platform]]\nposition = [0, 0, 0]', ("platform.0.hold", "missing")),
        ("name = ", ("scene.toml", "not valid TOML", "invalid value", "end of document")),
        (BASE + "[material]\n", ("scene.toml", "not valid TOML",)),
        ('name = "a"\ndt = 5ms\n', ("scene.toml, line 2", "not valid TOML", "quotes", '"5ms"')),
        (b'name = "\xff"', ("scene.toml", "not UTF-8",)),
        ("#" * (MAX_BYTES + 1), ("scene.toml", "larger", f"{MAX_BYTES} bytes")),
        ("v = " + "[" * 20_000, ("scene.toml", "not valid TOML", "nested")),
        ("v = " + "[" * 20_000 + "]" * 20_000, ("scene.toml", "not valid TOML", "nested")),
        ("v = " + "{a=" * 20_000, ("scene.toml", "not valid TOML", "nested")),
        (".".join("a" * 40_000) + " = 1", ("scene.toml", "not valid TOML", "line", "1000 dots")),
        ("name." + ".".join("a" * 900) + " = {" + ".".join("b" * 90) + " = 1}", ("name is <dict>", "text")),
        ("name." * 30 + "a = 1", ("name is {'name': {'name': ",)),
        ("dt = " + "9" * 5000, ("scene.toml", "not valid TOML", "limit")),
        (f"{BASE}[friction]\n", ("field friction", "unknown")),
        (f'"a\\nb\\u0000" = 1\n{BASE}', (r"field 'a\nb\x00'", "unknown")),
        (f"{'b' * 9000} = 1\n{BASE}", ("field '", "unknown")),
        (f"mesh = 1\n{BASE.split('[mesh]', maxsplit=1)[0]}", ("mesh is 1", "table")),
    ],
)  # fmt: skip
def test_a_hostile_file_is_refused_in_one_line(
    text: str | bytes, named: tuple[str, ...], tmp_path: Path
) -> None:
    assert_names(refusal(written(tmp_path, text)), *named)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (BASE.replace("dt = 0.002", "dt = -1"), ("scene.toml, line 3", "dt is -1.0")),
        (BASE + "[friction]\n", ("scene.toml, line", "friction")),
        (BASE.replace("young =", "yuong ="), ("scene.toml, line", "material.yuong", "young")),
        (BASE.replace('"neo_hooke"', "'wood'"), ("scene.toml, line", "material.law is 'wood'")),
        (BASE.replace("description =", "descripton ="), ("scene.toml, line", "descripton")),
        (BASE + '[[set]]\nname = "a"\n[[set]]\nname = "b"\nradius = -1\n', ("scene.toml, line", "set.1.radius")),
    ],
)  # fmt: skip
def test_a_bad_field_is_named_with_its_file_and_line(
    text: str, named: tuple[str, ...], tmp_path: Path
) -> None:
    path = written(tmp_path, text)
    message = refusal(path)
    assert_names(message, *named)
    if found := re.search(r"line (\d+): (?:field )?([\w.]+)", message):
        line = path.read_text().splitlines()[int(found[1]) - 1]
        assert found[2].rpartition(".")[2] in line


def test_a_bad_override_is_not_blamed_on_the_file(tmp_path: Path) -> None:
    message = refusal(written(tmp_path, BASE), "mesh.level=99")
    assert message.startswith("mesh.level is 99")


@pytest.mark.parametrize(
    ("field", "line"),
    [("dt", 1), ("body.0", 2), ("body.0.mesh.level", 5), ("body.1.name", 7), ("body.1.mass", 6), ("a", None)],
)
def test_the_line_of_a_field_is_found(field: str, line: int | None) -> None:
    text = 'dt = 1\n[[body]]\nname = """\na = 1"""\nmesh.level = 2\n[[ body ]] # next\n"name" = "b"\n'
    assert line_of(text, field) == line


def test_files_with_a_mark_of_the_byte_order_are_read(tmp_path: Path) -> None:
    """As editors of Windows write them."""
    path, maze = tmp_path / "own.toml", tmp_path / "own.txt"
    path.write_text(scene_text("maze"), encoding="utf-8-sig")
    labyrinth = maze_to_text(read_maze("labyrinth"))
    maze.write_text(labyrinth, encoding="utf-8-sig")
    assert load_scene(path) == load_scene("maze")
    assert maze_to_text(read_maze(str(maze))) == labyrinth


def test_what_is_not_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "folder.toml").mkdir()
    assert_names(refusal(tmp_path / "folder.toml"), "folder.toml", "not a file")
    os.mkfifo(tmp_path / "pipe.toml")
    said: list[str] = []
    asker = threading.Thread(target=lambda: said.append(refusal(tmp_path / "pipe.toml")), daemon=True)
    asker.start()
    asker.join(60)  # who opened it would wait for ever
    assert_names(said[0], "pipe.toml", "not a file")


PARTS = {"mesh": Mesh, "material": Material, "solver": Solver, "gravity": Gravity, "inertia": Inertia} | {
    "damping": Damping, "servos": Servos, "effector": Effector, "fixed.0": Fixed
}  # fmt: skip
PATHS = [
    *Scene.__dataclass_fields__,
    *(f"{p}.{f}" for p, kind in PARTS.items() for f in kind.__dataclass_fields__),
]
WORDS = sorted({word for path in PATHS for word in path.split(".")})
ANY_PATH = st.one_of(
    st.sampled_from(PATHS),
    st.tuples(st.sampled_from(PATHS), st.sampled_from(["0", "1", "-1", "x"])).map(".".join),
    st.lists(st.sampled_from(WORDS), min_size=1, max_size=4).map(".".join),
)
TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\x7f"), max_size=8)
NUMBERS = (
    st.integers() | st.floats() | st.floats(0, 1) | st.sampled_from([2**63, -(10**400), int("9" * 4000)])
)
VALUES = st.recursive(
    st.one_of(st.booleans(), NUMBERS, TEXT, st.dates(), st.sampled_from(["y_piece", "neo_hooke", "off"])),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(WORDS) | TEXT, inner, max_size=3)
    ),
    max_leaves=8,
)


def inline(value: object) -> str:
    """Return a TOML value on one line."""
    if isinstance(value, dict):
        return (
            "{"
            + ", ".join(f"{json.dumps(k, ensure_ascii=False)} = {inline(v)}" for k, v in value.items())
            + "}"
        )
    if isinstance(value, list):
        return "[" + ", ".join(inline(v) for v in value) + "]"
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    return str(value)


def assert_kept_or_refused(source: str | Path, overrides: list[str], folder: Path) -> None:
    """Whatever the input: a SceneError of one line, or a scene that can be written and read."""
    try:
        scene = load_scene(source, overrides)
    except SceneError as error:
        assert str(error).isprintable()
        return
    again = load_scene(written(folder, scene_to_toml(scene)))
    assert again == scene


@given(st.lists(st.tuples(ANY_PATH, VALUES), min_size=1, max_size=3))
def test_any_value_at_any_path_is_kept_or_refused(tmp_path_factory, values) -> None:
    words = [f"{path}={inline(value)}" for path, value in values]
    assert_kept_or_refused("tripod", words, tmp_path_factory.getbasetemp())


@given(data=st.data())
def test_any_damage_to_a_file_is_survived(tmp_path_factory, data: st.DataObject) -> None:
    at = data.draw(st.integers(0, len(BASE)))
    end = data.draw(st.integers(at, min(len(BASE), at + 40)))
    patch = data.draw(st.binary(max_size=6) | TEXT.map(str.encode) | VALUES.map(inline).map(str.encode))
    path = written(tmp_path_factory.getbasetemp(), BASE.encode()[:at] + patch + BASE.encode()[end:])
    assert_kept_or_refused(path, [], tmp_path_factory.getbasetemp())


def test_listing_scenes_loads_no_compiler() -> None:
    code = "import sys, tripod_sim; assert tripod_sim.scene_names(); assert not {'numba', 'rclpy'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_public_names_are_listed_before_they_are_imported() -> None:
    told = "import pydoc, tripod_sim; print(dir(tripod_sim)); print(pydoc.plaintext.document(tripod_sim))"
    text = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True).stdout
    names, page = text.split("\n", 1)
    assert all(f"'{name}'" in names for name in tripod_sim.__all__)
    assert all(f"{name}(" in page for name in ("Simulation", "load_scene", "scene_names"))


def test_an_unknown_public_name_is_an_attribute_error() -> None:
    with raises_naming(AttributeError, "'tripod_sim'", "attribute 'Simulator'"):
        _ = tripod_sim.Simulator
