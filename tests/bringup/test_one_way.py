"""Scene, `--set`, `--accuracy` are said alike to `run`, `up`, `sim`; what is wrong is told before anything starts."""

import json
import os
import subprocess
import sys
from importlib import resources
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from tests.messages import assert_names, raises_naming
from tripod_bringup import cli, up_cli, up_command
from tripod_bringup.node_values import RawYaml
from tripod_bringup.script import joint_path
from tripod_bringup.up_command import add_overrides, named_scene, sim_words, words_of_set
from tripod_sim import load_scene, scene_names
from tripod_sim.scene.file import field_names


def tripod(*words: str) -> Result:
    return CliRunner().invoke(cli.app, list(words))


@pytest.fixture(autouse=True)
def nothing_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    def started(*_: object, **__: object) -> int:
        pytest.fail("something was started")

    monkeypatch.setattr(up_command, "up", started)
    monkeypatch.setattr(up_cli, "run_node_command", started)


@pytest.mark.parametrize("command", ["run", "up", "sim"])
@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--set", "young=1e5"], ("young", "'material.young'")),
        (["--set", "dt=5"], ("dt", "5.0", "at most 1 s", "milliseconds", "5ms")),
        (["--set", "servos.axis_radius=60"], ("servos.axis_radius", "60.0", "millimetres", "60mm")),
        (["--set", "mesh.level=15"], ("mesh.level", 15, "at most 14")),
        (["--accuracy", "much"], ("--accuracy", "'much'", "5%", "draft, real-time, reference")),
    ],
)
def test_what_is_wrong_with_a_scene_is_told_alike_before_anything_starts(
    command: str, words: list[str], named: tuple[object, ...]
) -> None:
    result = tripod(command, "tripod", *words)
    assert result.exit_code == 2
    assert result.output.startswith(f"tripod {command}: ")
    assert_names(result.output, *named)
    assert result.output.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--servo", "0:-85,0,0"], ("servo_0", "-2.1 to 0.6 rad", "degrees", "-85deg")),
        (["--slide", "35"], ("0 to 0.04 m", "millimetres", "35mm")),
    ],
)
def test_likely_units_are_named_where_they_would_fit(words: list[str], named: tuple[str, ...]) -> None:
    assert_names(tripod("run", "tripod", *words).output, words[0], *named)


@pytest.mark.parametrize("script", ["0:-1000,0,0", "0:-400deg,0,0", "0:1,0,0"])
def test_no_unit_is_named_where_none_would_fit(script: str) -> None:
    output = tripod("run", "tripod", "--servo", script).output
    assert_names(output, "--servo", "servo_0", "-2.1 to 0.6 rad")
    assert "deg" not in output


@pytest.mark.parametrize(
    ("field", "meant"),
    [
        ("yung", "'material.young'"),
        ("dtt", "'dt'"),
        ("clamp_radiu", "'servos.clamp_radius'"),
        ("angle_min", "'servos.angle_min'"),
    ],
)
def test_fields_of_tables_are_suggested_with_their_table(field: str, meant: str) -> None:
    assert_names(tripod("run", "tripod", "--set", f"{field}=1").output, field, meant)


def test_the_scene_is_the_first_word_or_the_option() -> None:
    assert named_scene([], "") == ("tripod", [])
    assert named_scene(["driver.angle_max:=1"], "maze") == ("maze", ["driver.angle_max:=1"])
    assert named_scene(["maze", "a.b:=1"], "") == ("maze", ["a.b:=1"])
    with raises_naming(ValueError, "'maze'", "--scene", "'tripod'"):
        named_scene(["maze"], "tripod")


def test_overrides_come_behind_those_of_the_parameter() -> None:
    values: dict[str, dict[str, object]] = {"sim": {"set": RawYaml("'dt=0.01; mesh.level=1'")}}
    add_overrides(values, ["mesh.level=3"])
    assert words_of_set(values) == ["dt=0.01", "mesh.level=1", "mesh.level=3"]
    assert load_scene("tripod", words_of_set(values)).mesh.level == 3


def test_the_simulator_gets_its_scene_and_its_overrides_as_parameters() -> None:
    assert sim_words(["rate:=30.0"], [], None, None) == ["rate:=30.0"]
    assert sim_words(["maze", "rate:=30.0"], ["dt=0.01"], None, None) == [
        "rate:=30.0",
        "scene:=maze",
        "set:=dt=0.01",
    ]
    with raises_naming(ValueError, "'maze'", "--set scene=tripod"):
        sim_words(["maze", "scene:=tripod"], [], None, None)


@pytest.mark.parametrize("name", scene_names())
def test_a_scene_is_printed_as_it_is_written(name: str, tmp_path: Path) -> None:
    copy = tmp_path / "copy.toml"
    copy.write_text(tripod("print", "scene", name).stdout)
    assert load_scene(copy).name == name
    assert json.loads(tripod("print", "scene", name, "--json").stdout)["name"] == name
    shipped = Path(str(resources.files("tripod_sim"))) / "scenes" / f"{name}.toml"
    assert copy.read_text().rstrip() == shipped.read_text().rstrip()  # comments and all


def test_a_scene_that_is_not_there_is_not_printed() -> None:
    result = tripod("print", "scene", "tripd")
    assert result.exit_code == 2
    assert_names(result.output, "'tripd'", "'tripod'")


def completed(line: str, cwd: Path | None = None) -> list[str]:
    """Return what a shell offers for the last word of a line."""
    environment = {**os.environ, "_TRIPOD_COMPLETE": "complete_bash", "COMP_WORDS": line}
    environment["COMP_CWORD"] = str(len(line.split(" ")) - 1)
    done = subprocess.run(
        [sys.executable, "-m", "tripod_bringup"],
        env=environment,
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert not done.stderr
    return done.stdout.split()


def test_a_shell_completes_scenes_and_fields() -> None:
    assert completed("tripod run ma") == ["maze"]
    assert completed("tripod run tripod --set material.y") == ["material.young="]
    assert "material.young" in field_names()
    assert "dt" in field_names()


def test_a_shell_completes_ports_and_recordings(tmp_path: Path) -> None:
    assert completed("tripod up --port mo") == ["mock"]
    (tmp_path / "recordings" / "rec_one").mkdir(parents=True)
    (tmp_path / "recordings" / "rec_one" / "metadata.yaml").touch()
    for name in ("rec_two.mcap", "rec_three.txt"):
        (tmp_path / name).touch()
    assert completed("tripod bag info rec", tmp_path) == ["rec_two.mcap", "recordings/rec_one"]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["tripod", "--servo", "0:-85,0,0"], ("--servo", "degrees", "-85deg")),
        (["tripod", "--servo", "0:0,0,0", "--slide", "35"], ("--slide", "millimetres", "35mm")),
        (["tripod", "--servo", "0:1,0,0"], ("--servo", "servo_0", "1 rad", "-2.1 to 0.6 rad")),
        (["tripod", "--servo", "0:0,0"], ("--servo", "'0:0,0'", "3 finite values")),
        (["tripod", "--slide", "0.01"], ("--slide", "--servo")),
        (["tripod", "--servo", "0:0,0,0", "--demo"], ("--demo", "--servo")),
        (["pendulum", "--servo", "0:0,0,0"], ("--servo", "scene 'pendulum'", "no servos")),
        (["pendulum", "--actuate", "left=0:0"], ("--actuate", "scene 'pendulum'", "no actuators")),
        (["finger_cable", "--servo", "0:0,0,0"], ("--servo", "scene 'finger_cable'", "no servos")),
        (["finger_cable", "--actuate", "middle=0:0"], ("--actuate", "middle", "left, right")),
        (["finger_cable", "--actuate", "left=0:0; 1:90mm"], ("--actuate left", "0.09 m", "0 to 0.03 m")),
        (["finger_cable", "--actuate", "left=0:0; 1:90kPa"], ("--actuate left", "90kPa", "no number in m")),
        (["finger_cable", "--actuate", "left=0:0", "--actuate", "left=0:0"], ("--actuate", "left", "twice")),
    ],
)
def test_a_script_is_checked_before_anything_starts(words: list[str], named: tuple[str, ...]) -> None:
    for command in ("up", "sim") if "--demo" not in words else ("up",):
        result = tripod(command, *words)
        assert result.exit_code == 2
        assert_names(result.output, f"tripod {command}: ", *named)
        assert result.output.count("\n") == 1


def test_a_servo_script_is_a_motion_of_angles_and_slide() -> None:
    path = joint_path("tripod", [], "0:0,0,0; 2:-0.5,-0.5,-0.5", "0.01")
    assert path is not None
    assert path.at(1.0).tolist() == pytest.approx([-0.25, -0.25, -0.25, 0.005])
    still = joint_path("tripod", [], "1:-0.1,0,0", None)
    assert still is not None
    assert still.joints.tolist() == [[-0.1, 0, 0]] * 2
    assert joint_path("tripod", [], None, None) is None


def test_joints_that_a_script_does_not_name_stay_where_they_start() -> None:
    path = joint_path("finger_cable", [], None, None, ["right = 0.5: 2mm; 1: 4mm"])
    assert path is not None
    assert (path.servos, path.others) == (0, ("left", "right"))
    assert path.at(0.75).tolist() == pytest.approx([0.0, 0.003])
    push = 'force=[{name="push", set="all", direction=[1, 0, 1], range=[-0.3, 0.3]}]'
    words = [push, "servos.angles=[-0.8, -0.7, -0.6]", "motion=off"]
    mixed = joint_path("tripod", words, None, None, ["push=0:0; 1:0.2N"])
    assert mixed is not None
    assert (mixed.servos, mixed.others) == (3, ("push",))
    assert mixed.at(1.0).tolist() == pytest.approx([-0.8, -0.7, -0.6, 0.2])
    both = joint_path("tripod", words, "0:0,0,0; 2:-0.5,-0.5,-0.5", "0.01", ["push=0:0; 1:0.2N"])
    assert both is not None
    assert both.at(1.0).tolist() == pytest.approx([-0.25, -0.25, -0.25, 0.2, 0.005])
