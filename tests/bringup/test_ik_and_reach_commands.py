"""`tripod ik --target` and `tripod reach`: options in, text and exit codes out."""

import csv
import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from tests.messages import assert_names, line_naming
from tripod_bringup import cli, ik_command
from tripod_sim.scene import file as scene_file

COARSE = ["--set", "mesh.level=1"]


def tripod(*words):
    return CliRunner().invoke(cli.app, list(words))


@pytest.mark.parametrize(
    "words", [["0.004 -0.002 -0.006"], ["4mm,-0.002,-6mm"], ["0.4cm -2mm -6mm", "--slide", "3.5 cm"]]
)
def test_a_target_is_solved_once_and_printed(words: list[str]) -> None:
    result = tripod("ik", "--target", *words, *COARSE)
    assert result.exit_code == 0
    text = dict(line.split("  ", 1) for line in result.stdout.splitlines() if line[0] != " ")
    assert text["outcome"].strip() == "reached"
    assert text["effector"].strip() == "4.000, -2.000, -6.000 mm"
    assert text["still missing"].strip() == "position 0.000 mm"
    assert text["active limits"].strip() == "none"
    assert text["torques"].strip().endswith("N m")


def test_further_places_have_targets_of_their_own() -> None:
    words = [
        "ik",
        "trunk",
        "--set",
        'effector.more=[{name="middle", point=[0, 0, -0.0975], weight=0.5}]',
        "--target",
    ]
    result = tripod(*words, "0.01 0 -0.19; middle = 8mm 0 -97mm")
    text = dict(line.split("  ", 1) for line in result.stdout.splitlines() if line[0] != " ")
    assert (result.exit_code, text["outcome"].strip().split(":")[0]) == (1, "closest pose")
    assert len(text["middle"].split(",")) == 3 and "middle" in text["still missing"]
    bare = tripod(*words, "0.01 0 -0.19; middle")
    assert bare.exit_code == 2
    assert_names(bare.stderr, "--target", "'middle'", "effector.more")
    short = tripod(*words, "0.01 0 -0.19; middle = 1 2")
    assert_names(short.stderr, "--target middle", "3 finite numbers")


@pytest.mark.parametrize("words", [["ik", "--target", "0 0 0"], ["reach"]])
def test_a_slide_that_is_no_length_is_refused(words: list[str]) -> None:
    result = tripod(*words, "--slide", "3 ft")
    assert result.exit_code == 2
    assert_names(result.stderr, "--slide", "'3 ft'", "m", "mm", "cm")


def test_the_scene_may_come_first_but_not_twice() -> None:
    twice = tripod("ik", "cross", "--scene", "tripod", "--target", "0 0 -0.0065")
    assert twice.exit_code == 2
    assert_names(twice.stderr, "'cross'", "--scene", "'tripod'")


def test_a_start_has_an_angle_for_each_servo_of_the_scene() -> None:
    words = ["ik", "cross", *COARSE, "--target", "0 0 -0.0065", "--start"]
    assert tripod(*words, "-1.5 -1.5 -1.5 -1.5").exit_code == 0
    short = tripod(*words, "-1.5 -1.5 -1.5").stderr
    assert_names(short, "--start", "'-1.5 -1.5 -1.5'", "4 finite numbers")


def test_json_holds_the_same_and_a_target_out_of_reach_ends_with_1() -> None:
    quick = [*COARSE, "--set", "mesh.element=h8"]  # the search looks at many poses
    result = tripod("ik", "--target", "0,0,0.1", "--torque-max", "0.2", "--json", *quick)
    assert result.exit_code == 1
    given = json.loads(result.stdout)
    assert given["reached"] is False
    assert_names(given["outcome"], "closest pose")
    assert len(given["angles"]) == len(given["torques"]) == 3
    assert given["error"] > 0.05


def test_a_tilt_is_printed_in_degrees() -> None:
    words = ["--goal", "orientation", "--tilt", "0.2 -0.1"]
    result = tripod("ik", "--target", "0 0 0.006", *words, *COARSE)
    assert result.exit_code == 0
    line_naming(result.stdout, "roll, pitch", "11.46, -5.73 degrees")
    line_naming(result.stdout, "still missing", "tilt 0.000 degrees", "height 0.000 mm")


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["ik", "--target", "1 2"], ("--target", "'1 2'", "3 finite numbers", "m, mm, cm")),
        (["ik", "--target", "0 0 5deg"], ("--target", "'0 0 5deg'", "3 finite numbers", "m, mm, cm")),
        (["ik", "--target", "a b c"], ("--target", "'a b c'")),
        (["ik", "--target", "0 nan 0"], ("--target", "'0 nan 0'")),
        (["ik", "--target", "0 0 0", "--goal", "yaw"], ("--goal", "'yaw'", "position, orientation, pose")),
        (["ik", "--target", "0 0 0", "--tilt", "1"], ("--tilt", "'1'", "2 finite numbers", "rad, deg")),
        (["ik", "--target", "0 0 0", "--box", "0 0 0"], ("--box", "'0 0 0'", "6 finite numbers")),
        (
            ["ik", "--target", "0 0 0", "--box", "1 0 0 0 1 1"],
            ("box", "[1.0, 0.0, 0.0] m", "[0.0, 1.0, 1.0] m"),
        ),
        (
            ["ik", "--target", "0 0 0", "--scene", "silicone"],
            ("scene 'silicone'", "no servos", "no effector"),
        ),
        (["ik", "--target", "0 0 0", "--slide", "0.05"], ("slide", "0.05 m", "0 to 0.04 m")),
        (["ik", "--target", "0 0 0", "goal:=pose"], ("'goal:=pose'", "parameter", "node", "--target")),
        (["reach", "nowhere"], ("scene 'nowhere'", "tripod", ".toml")),
        (["reach", "--low", "1"], ("1 to -0.5965 rad", "11 steps")),
        (["reach", "--plot", "x.txt"], ("--plot", "'x.txt'", ".png", ".svg", ".pdf")),
        (["reach", "--out", "/nowhere/at/all.csv"], ("/nowhere/at/all.csv", "no directory /nowhere/at")),
    ],
)
def test_bad_words_are_refused_in_one_line_with_code_2(words: list[str], named: tuple[str, ...]) -> None:
    result = tripod(*words)
    assert result.exit_code == 2
    assert_names(result.stderr, f"tripod {words[0]}: ", *named)
    assert len(result.stderr.splitlines()) == 1
    assert result.stdout == ""


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["ik", "--target", "0 0 0", "--torque-max", "nan"], ("nan N m", "0 N m", "0.3")),
        (["ik", "--target", "0 0 0", "--slide", "1"], ("1 m", "0 to 0.1 m", "35mm")),
        (["reach", "--torque-max", "-1"], ("-1 N m", "0 N m", "0.17")),
    ],
)
def test_an_option_out_of_range_is_refused_with_a_value_to_try(
    words: list[str], named: tuple[str, ...]
) -> None:
    result = tripod(*words)
    assert result.exit_code == 2
    assert_names(result.stderr.replace("│", " "), words[-2], *named)
    assert result.stdout == ""


def test_reach_writes_table_picture_and_summary(tmp_path) -> None:
    pytest.importorskip("matplotlib")
    table, picture = tmp_path / "reach.csv", tmp_path / "reach.png"
    words = [
        "--count",
        "2",
        "--low",
        "-1.8",
        "--high",
        "-1.2",
        "--torque-max",
        "0.12",
        "--out",
        str(table),
        "--plot",
        str(picture),
    ]
    result = tripod("reach", *words, *COARSE)
    assert result.exit_code == 0
    line_naming(result.stdout, "8 poses of 8", "branch", "working pose", "0.12 N m")
    with table.open(encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head[:4] == ["servo_0 [rad]", "servo_1 [rad]", "servo_2 [rad]", "x [m]"]
    assert len(rows) == 8
    assert all(len(row) == len(head) for row in rows)
    assert picture.read_bytes()[:4] == b"\x89PNG"
    given = json.loads(tripod("reach", *words[:6], "--json", *COARSE).stdout)
    assert given["tried"] == 8
    assert given["layers"]


def test_the_first_line_of_progress_comes_before_a_scene_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a terminal; the last line before the answer has the answer's number of linearisations and distance."""
    said, load = list[str](), scene_file.load_scene

    def read(*words: object) -> object:
        assert said
        return load(*words)

    terminal = SimpleNamespace(isatty=lambda: True, write=said.append, flush=lambda: None)
    monkeypatch.setattr(ik_command, "sys", SimpleNamespace(stderr=terminal))
    monkeypatch.setattr(scene_file, "load_scene", read)
    result = tripod("ik", "--target", "0,0,0.02", *COARSE, "--set", "mesh.element=h8")
    text = dict(line.split("  ", 1) for line in result.stdout.splitlines() if line[0] != " ")
    told = [line for line in said if " linearisations" in line]
    count, missing = text["solved in"].split()[2], text["still missing"].split()[1]
    assert_names(told[-1], f"{count} linearisations", f"{float(missing):.3f} mm left")


@pytest.mark.parametrize("command", [["ik", "--target", "0 0 0"], ["reach"]])
def test_what_is_wrong_in_building_names_the_file_of_the_scene(command: list[str], tmp_path: Path) -> None:
    path = tmp_path / "loose.toml"
    path.write_text(
        f"{scene_file.scene_text('tripod')}\n[[fixed]]\nlow = [1.0, 1.0, 1.0]\nhigh = [2.0, 2.0, 2.0]\n"
    )
    result = tripod(command[0], str(path), *command[1:], "--set", "inertia=off", "--set", "damping=off")
    assert result.exit_code == 2
    assert_names(result.output, "loose.toml, line", "fixed.0")
