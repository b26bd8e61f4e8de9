"""`tripod play`: exit codes, one line for an error, JSON; `tripod print maze`."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from tests.messages import assert_names, line_naming
from tripod_bringup import cli

COARSE = ("--set", "mesh.level=1")


def tripod(*words: str) -> Any:
    return CliRunner().invoke(cli.app, list(words))


def test_maze_prints_what_it_reads_again(tmp_path: Path) -> None:
    assert tripod("print", "maze").stdout.split() == ["first", "holes", "labyrinth"]
    result = tripod("print", "maze", "random:7:5x3")
    assert result.exit_code == 0
    assert result.stdout.count("\n") == 7
    file = tmp_path / "m.txt"
    file.write_text(result.stdout)
    assert tripod("print", "maze", str(file)).stdout == result.stdout


def test_solve_wins_a_game_and_says_so_in_json() -> None:
    result = tripod("play", "first", "--seed", "3", "--json", *COARSE)
    assert result.exit_code == 0
    told = json.loads(result.stdout)
    assert (told["maze"], told["solved"]) == ("first", 1)
    assert told["games"][0]["seed"] == 3
    assert told["median_time"] == told["games"][0]["time"]


def test_a_game_that_is_not_won_is_exit_code_1() -> None:
    result = tripod("play", "first", "--limit", "0.5", *COARSE)
    assert result.exit_code == 1
    line_naming(result.stdout, "seed 0", "goal", "not", "0.5 s")
    line_naming(result.stdout, "first", "0 of 1", "solved")


def test_path_plays_and_names_where_servos_are_too_slow(tmp_path: Path) -> None:
    file = tmp_path / "p.csv"
    file.write_text("time,tilt_x,tilt_y\n0,0,0\n0.1,0.05,0\n0.3,0,0\n")
    result = tripod("play", str(file), "--speed", "0.5", "--json", *COARSE)
    assert result.exit_code == 0
    told = json.loads(result.stdout)
    assert told["key_points"] == 3
    assert told["time"] > told["file_time"] == 0.3
    assert_names(told["limits"][0], "0 to 0.1 s", "slowed", "servo_1", "rad/s", 0.5)
    assert f"tripod play: {told['limits'][0]}" in result.stderr


def test_a_path_is_played_by_as_many_servos_as_the_scene_has(tmp_path: Path) -> None:
    file = tmp_path / "p.csv"
    file.write_text("time,x,y,z\n0,0,0,-0.0027\n0.1,0,0,-0.003\n")
    result = tripod("play", str(file), "--scene", "cross", "--json", *COARSE)
    assert result.exit_code == 0, result.stderr
    told = json.loads(result.stdout)
    assert len(told["angles"]) == 4
    assert max(told["angles"]) - min(told["angles"]) < 1e-6, "a move of the disc up or down turns all alike"
    assert abs(told["angles"][3]) > 1e-4


def test_the_example_of_the_page_of_mazes_is_told_as_there(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "maze.md").read_text(encoding="utf-8")
    file = tmp_path / "p.csv"
    file.write_text(page.partition("## Path files")[2].split("```")[1])
    result = tripod("play", str(file), "--speed", "3", "--json")
    (limit,) = json.loads(result.stdout)["limits"]
    (paragraph,) = (text for text in page.split("\n\n") if f"`{limit}`" in text)
    assert_names(paragraph, "--speed 3")


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("play", "nowhere.csv"), ("'nowhere.csv'", "No such file")),
        (("play", "BAD"), ("BAD.csv", "line 3", "0.5 s", "1 s")),
        (("play", "labyrinth", "--speed", "3"), ("--speed", "path file")),
        (("play", "GOOD", "--seed", "1"), ("--seed", "maze")),
        (("play", "GOOD", "--scene", "silicone"), ("scene 'silicone'", "no servos", "no effector")),
        (("play", "labyrint"), ("maze.source", "'labyrint'", "first", "holes", "labyrinth", "random:SEED")),
        (("play", "--scene", "tripod"), ("scene 'tripod'", "no maze")),
        (("print", "maze", "random:x"), ("maze.source", "'random:x'", "random:SEED")),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    tmp_path: Path, words: tuple[str, ...], named: tuple[str, ...]
) -> None:
    files = {"BAD": "time,tilt_x,tilt_y\n1,0,0\n0.5,0,0\n", "GOOD": "time,tilt_x,tilt_y\n0,0,0\n"}
    for name, text in files.items():
        (tmp_path / f"{name}.csv").write_text(text)
    result = tripod(*(str(tmp_path / f"{w}.csv") if w in files else w for w in words))
    assert result.exit_code == 2
    command = " ".join(words[:2]) if words[0] == "print" else words[0]
    assert_names(result.stderr, f"tripod {command}: ", *named)
    assert result.stderr.count("\n") == 1
