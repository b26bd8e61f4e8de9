"""Scenes as text: what is read back equals what was written, and whatever else is written is refused in one line."""

import json
import math
import os
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
from tripod_sim import SceneError, load_scene, scene_names
from tripod_sim.effects import EFFECTS
from tripod_sim.effects.damping import Damping
from tripod_sim.effects.fixed import Fixed
from tripod_sim.effects.gravity import Gravity
from tripod_sim.effects.inertia import Inertia
from tripod_sim.effects.initial_velocity import InitialVelocity
from tripod_sim.effects.load import Load
from tripod_sim.effects.prescribed import Prescribed
from tripod_sim.maze.board import read_maze
from tripod_sim.maze.grid import maze_to_text
from tripod_sim.scene import Scene
from tripod_sim.scene_file import MAX_BYTES, scene_from_toml, scene_text, scene_to_toml
from tripod_sim.tables.bodies import Material, Mesh
from tripod_sim.tables.fields import unusual
from tripod_sim.tables.method import Solver
from tripod_sim.tables.robot import Effector, Servos
from tripod_sim.tables.sets import Marker, NodeSet
from tripod_sim.tables.unread import unread

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
    servos=Servos(axis_radius=0.07, angle_min=-1.5, angle_max=0.25, angles=(-1.5, 0.25, 0.1), slide=0.01),
    effector=Effector(radius=0.01),
    solver=Solver(tolerance=1e-9, max_iterations=7, max_halvings=0),
)
OF_SOLIDS = [e for e in EFFECTS if e not in ("strain_limit", "contact", "obstacles", "rigid", "mesh_error")]
for _effect in OF_SOLIDS:
    if not getattr(EVERYTHING, _effect):  # effects that came after this test: as they are by default
        EVERYTHING = replace(EVERYTHING, **{_effect: get_args(get_type_hints(Scene)[_effect])[0]()})

NEEDED_BY = {
    "gravity": ["ball"],
    "inertia": ["damping", "time_error", "sleep", "initial_velocity"],
    "servos": ["servo_dynamics", "clamp"],
    "effector": ["maze"],
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
    assert len(message) < 400
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
    ("word", "note"),
    [
        (
            "material.young=250",
            "material.young is 250 Pa; usual is 1000 to 1e+12 Pa; kPa? 250 kPa are 2.5e+05 Pa",
        ),
        (
            "material.young=0.25",
            "material.young is 0.25 Pa; usual is 1000 to 1e+12 Pa; MPa? 0.25 MPa are 2.5e+05 Pa",
        ),
        (
            "material.density=1.1",
            "material.density is 1.1 kg/m³; usual is 10 to 25000 kg/m³; g/cm³? 1.1 g/cm³ are 1100",
        ),
        (
            "gravity.acceleration=[0,0,-9810]",
            "gravity.acceleration is -9810 m/s²; usual is 0 to 1000 m/s²; mm/s²? ",
        ),
        ("material.density=1100", ""),
        ("gravity.acceleration=[0,0,0]", ""),
    ],
)
def test_a_number_of_an_unusual_size_is_told_with_the_unit_in_which_it_would_not_be(
    word: str, note: str
) -> None:
    said = unusual(load_scene("tripod", [word]))
    assert len(said) == bool(note)
    assert all(text.startswith(note) for text in said)


def test_the_shipped_scenes_have_no_unusual_numbers_and_no_idle_fields() -> None:
    scenes = [load_scene(name) for name in scene_names()]
    assert not [said for scene in scenes for said in (*unusual(scene), *unread(scene))]


@pytest.mark.parametrize(
    ("scene", "word", "note"),
    [
        ("tripod", "mesh.cells=[2,2,2]", "mesh.cells: without effect where mesh.source is 'y_piece'"),
        ("pendulum", "springs.scale=0.001", "springs.scale: without effect where springs.source is 'chain'"),
        ("drape", "springs.size=2", "springs.size: without effect where springs.source is"),
        ("stack", "rigid.1.radius=0.2", "rigid.1.radius: without effect where rigid.1.shape is 'box'"),
        (BEAM, "material.mass=2", "material.mass: without effect where material.density is given"),
        ("silicone", 'motion={servo="0:0,0,0"}', "motion: without effect where there are no servos"),
        ("maze", "maze.start=[0.01,0]", "maze.start: without effect where maze.source is 'labyrinth'"),
        ("maze", 'maze={source="a.stl",wall=0.002}', "maze.wall: without effect where maze.source is "),
        (EMIO, "servos.slide=0.01", "servos.slide: without effect where no servo has a direction inward"),
        (EMIO, 'motion={servo="0:0,0,0,0",slide="0.01"}', "motion.slide: without effect where no servo"),
        (EMIO, "servos.clamp_radius=0.1", "servos.clamp_radius: without effect where servos have tables"),
    ],
)
def test_a_field_that_has_no_effect_is_told(scene: str, word: str, note: str) -> None:
    (said,) = unread(load_scene(scene, [word]))
    assert said.startswith(note)


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
    ("scene", "words", "message"),
    [
        ("tripod", "material.young=100 bar", "it must be a number in Pa, or with its unit: Pa, kPa, MPa, GPa"),
        ("tripod", "material.young=-1kPa", "material.young is -1000.0; it must be above 0 Pa"),
        ("tripod", "material.young=nan kPa", "material.young is nan; it must be above 0 Pa"),
        ("tripod", "material.poisson='0.3'", "material.poisson is '0.3'; it must be a number"),
        ("tripod", "material.young=0", "material.young is 0.0; it must be above 0 Pa"),
        ("tripod", "material.young=nan", "material.young is nan; it must be above 0 Pa"),
        ("tripod", "material.young=inf", "material.young is inf; it must be above 0 Pa"),
        ("tripod", "material.young=hard", "material.young is 'hard'; it must be a number"),
        ("tripod", "material.young=true", "material.young is True; it must be a number"),
        ("tripod", "material.young={}", "material.young is {}; it must be a number"),
        ("tripod", f"material.young={2**63}", "material.young is a whole number of more than 64 bits"),
        ("tripod", f"mesh.level=0x{'f' * 5000}", "mesh.level is a whole number of more than 64 bits"),
        ("tripod", "material.yung=1", "field material.yung is unknown; fields: law, young,"),
        ("tripod", "material.yung=1", "did you mean 'young'?"),
        ("tripod", "materiel.young=1", "field materiel is unknown"),
        ("tripod", "materiel.young=1", "did you mean 'material'?"),
        ("tripod", "material.poisson=0.5", "material.poisson is 0.5; it must be at least 0 and at most 0.499"),
        ("tripod", "mesh.level=15", "mesh.level is 15; it must be at least 1 and at most 14"),
        ("tripod", "mesh.level=2.0", "mesh.level is 2.0; it must be a whole number"),
        ("tripod", "mesh.level=true", "mesh.level is True; it must be a whole number"),
        ("tripod", "material.law=rubber", "material.law is 'rubber'; allowed: corotational, mooney_rivlin"),
        ("tripod", f"material.law={'b' * 9999}", "material.law is 'bbb"),
        ("tripod", "name=5", "name is 5; it must be text"),
        ("tripod", "dt=2", "dt is 2.0; it must be at least 1e-09 s and at most 1 s"),
        ("tripod", "material.young=1e300", "material.young is 1e+300; it must be above 0 Pa and at most 1e+13 Pa"),
        ("tripod", "solver.max_turn=1e-9", "solver.max_turn is 1e-09; it must be at least 0.0001 rad and at most 7"),
        ("tripod", "dt=0", "dt is 0.0; it must be at least 1e-09 s"),
        ("tripod", "gravity=5", "gravity is 5; it must be a table"),
        ("tripod", "gravity.acceleration=9.81", "gravity.acceleration is 9.81; it must be a list"),
        ("tripod", "gravity.acceleration=[0, 0]", "gravity.acceleration has 2 values; it needs 3"),
        ("tripod", "gravity.acceleration=[0, 0, 'g']", "gravity.acceleration.2 is 'g'; it must be a number"),
        ("tripod", "gravity.acceleration=[0, nan, 0]", "gravity.acceleration is (0.0, nan, 0.0); it must be at least"),
        ("tripod", "servos.angles=[0, 0, 1]", "servos.angles.2 is 1.0 rad; allowed is -2.1 to 0.6 rad"),
        ("tripod", "servos.slide=0.05", "servos.slide is 0.05 m; allowed is 0 to 0.04 m"),
        ("tripod", "servos.angles=[45, 0, 0]", "degrees? 45 degrees are 0.7854 rad"),
        ("tripod", "servos.slide=35", "millimetres? 35 millimetres are 0.035 m"),
        ("tripod", "servos.slide=5", "servos.slide is 5.0 m; allowed is 0 to 0.04 m; millimetres? 5 millimetres are"),
        ("silicone", "fixed.1.low=[0, 0, 0]", "fixed.1: there is no entry '1'; it has entries 0 to 0"),
        ("silicone", "fixed.-1.low=[0, 0, 0]", "fixed.-1: there is no entry '-1'; it has entries 0 to 0"),
        ("silicone", f"fixed.{'9' * 5000}=1", "is not of the form dotted.path=value"),
        ("silicone", "fixed=[];fixed.0.low=1", "fixed.0: there is no entry '0'; it is empty"),
        ("silicone", "fixed=[{low=[0, 0, 0]}]", "fixed.0: give either set or low and high"),
        ("silicone", "fixed.0.low=[1, 0, 0]", "fixed.0: low (1.0, 0.0, 0.0) must not exceed high (0.06, "),
        ("tripod", "material.young.x=3", "override 'material.young.x=3': material.young is a value, not a table"),
        ("tripod", "material.young.x.y=3", "material.young.x: material.young is a value, not a table"),
        ("tripod", "material.young", "override 'material.young' is not of the form dotted.path=value"),
        ("tripod", "=3", "override '=3' is not of the form dotted.path=value"),
        ("tripod", "material..young=3", "is not of the form dotted.path=value"),
        ("tripod", f"{'a.' * 5000}a=3", "is not of the form dotted.path=value"),
        ("tripod", "material.a\nb=3", r"field material.'a\nb' is unknown"),
        ("tripod", "material=off", "only an effect can be off; effects: gravity, inertia, damping, fixed, prescr"),
        ("tripod", "gravity.acceleration=off", "gravity.acceleration=off: only an effect can be off"),
        ("silicone", "fixed.1=off", "fixed.1: there is no entry '1'"),
        ("tripod", "inertia=off", "damping needs inertia"),
        ("tripod", "inertia=off;damping=off;servos=off;clamp=off", "nothing holds the body"),
    ],
)  # fmt: skip
def test_a_bad_override_is_refused_by_its_path(scene: str, words: str, message: str) -> None:
    assert message in refusal(scene, *words.split(";"))


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
    with pytest.raises(SceneError, match=r"overrides is 'dt=0.01'; it must be a list: \['dt=0.01'\]"):
        load_scene("tripod", "dt=0.01")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (None, r"overrides is None; it must be a list: \['dt=0.01'\]"),
        ([("dt", 0.01)], r"override \('dt', 0.01\) is not of the form dotted.path=value"),
        ([b"dt=0.01"], "override b'dt=0.01' is not of the form dotted.path=value"),
    ],
)
def test_overrides_that_are_no_texts_are_told(words: Any, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        load_scene("tripod", words)


def test_a_scene_is_found_by_a_path_that_is_its_name() -> None:
    assert load_scene(Path("tripod")) == load_scene("tripod")


@pytest.mark.parametrize("text", [None, b'name = "a"', Path("tripod")])
def test_what_is_no_text_is_no_scene(text: Any) -> None:
    with pytest.raises(SceneError, match=r"the scene is .*; it must be text in TOML"):
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
    ("changes", "message"),
    [
        (
            {"mesh": replace(load_scene("tripod").mesh, level=2.5)},
            "mesh.level is 2.5; it must be a whole number",
        ),
        ({"gravity": Gravity((0.0, -9.81))}, "gravity.acceleration has 2 values; it needs 3"),
        ({"mesh": "y_piece"}, "mesh is 'y_piece'; it must be a Mesh"),
        ({"marker": {"set": "all"}}, "marker is one table; it must be a list of them"),
        ({"name": None}, "name is None; it must be text"),
        ({"dt": "auto"}, r"dt is 'auto'; that is for load_scene: load_scene\(..., \['dt=auto'\]\)"),
    ],
)
def test_a_scene_of_a_program_is_checked_as_one_of_a_file(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
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
    assert "fixed.2: there is no entry '2'" in refusal("silicone", f"fixed.2={box}")


def test_the_number_0_begins_a_list_that_the_scene_has_not() -> None:
    scene = load_scene("silicone", ["load.0={set='all', force=[0, 0, 1]}", "load.1={set='all', mass=0.1}"])
    assert scene.load == (Load("all", force=(0, 0, 1)), Load("all", mass=0.1))
    assert "load.0: there is no entry '0'; it is empty" in refusal("silicone", "load.0.mass=0.1")


def test_a_file_without_its_suffix_is_what_is_meant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("beam.toml").write_text(scene_text("silicone"))
    with pytest.raises(SceneError, match=r"scene 'beam' is unknown; .*; did you mean 'beam.toml'\?"):
        load_scene("beam")


def test_an_effect_that_is_not_there_can_be_off() -> None:
    assert load_scene("tripod", ["fixed=off"]) == load_scene("tripod")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("tripd", "scene 'tripd' is unknown; scenes: "),
        ("tripd", ", or the path of a .toml file; did you mean 'tripod'?"),
        ("Silicone", "did you mean 'silicone'?"),
        ("", "scene '' is unknown"),
        ("../scenes/tripod", "is unknown"),
        ("no/such/place.toml", "scene file 'no/such/place.toml' cannot be read: No such file or directory"),
        ("zero\0byte.toml", r"scene file 'zero\x00byte.toml' cannot be read: embedded null byte"),
    ],
)
def test_an_unknown_scene_is_refused_with_the_nearest_name(name: str, message: str) -> None:
    assert message in refusal(name)


def test_a_name_like_no_other_gets_no_hint() -> None:
    assert "did you mean" not in refusal("xyzzy")


BASE = scene_to_toml(load_scene("tripod"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "field name is missing; it must be text"),
        (
            'name = "a"\ndescription = "b"\n[[servo]]\nset = "end"',
            "field servo.0.hub is missing; it must be 3 numbers in m",
        ),
        (
            'name = "a"\n[servo]\nset = "end"',
            "servo is one table; it must be a list of them: in a file [[servo]]",
        ),
        ('name = "a"\n[[platform]]\nposition = [0, 0, 0]', "field platform.0.hold is missing"),
        ("name = ", "is not valid TOML: Invalid value (at end of document)"),
        (BASE + "[material]\n", "is not valid TOML"),
        (b'name = "\xff"', "is not UTF-8 text"),
        ("#" * (MAX_BYTES + 1), f"is larger than {MAX_BYTES} bytes"),
        ("v = " + "[" * 20_000, "is not valid TOML: nested too deeply"),
        ("v = " + "[" * 20_000 + "]" * 20_000, "is not valid TOML: nested too deeply"),
        ("v = " + "{a=" * 20_000, "is not valid TOML: nested too deeply"),
        (".".join("a" * 40_000) + " = 1", "is not valid TOML: a line with more than 1000 dots"),
        ("name." + ".".join("a" * 900) + " = {" + ".".join("b" * 90) + " = 1}", "name is <dict>; it must be text"),
        ("name." * 30 + "a = 1", "name is {'name': {'name': "),
        ("dt = " + "9" * 5000, "is not valid TOML: Exceeds the limit"),
        (f"{BASE}[friction]\n", "field friction is unknown"),
        (f'"a\\nb\\u0000" = 1\n{BASE}', r"field 'a\nb\x00' is unknown"),
        (f"{'b' * 9000} = 1\n{BASE}", "field 'bbb"),
        (f"mesh = 1\n{BASE.split('[mesh]', maxsplit=1)[0]}", "mesh is 1; it must be a table"),
    ],
)  # fmt: skip
def test_a_hostile_file_is_refused_in_one_line(text: str | bytes, message: str, tmp_path: Path) -> None:
    assert message in refusal(written(tmp_path, text))


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
    assert "is not a file" in refusal(tmp_path / "folder.toml")
    os.mkfifo(tmp_path / "pipe.toml")
    said: list[str] = []
    asker = threading.Thread(target=lambda: said.append(refusal(tmp_path / "pipe.toml")), daemon=True)
    asker.start()
    asker.join(10)  # who opened it would wait for ever
    assert "is not a file" in said[0]


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
    with pytest.raises(AttributeError, match="module 'tripod_sim' has no attribute 'Simulator'"):
        _ = tripod_sim.Simulator
