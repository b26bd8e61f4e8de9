"""The commands of `tripod`: their groups, old names, one way of setting values, examples that can be typed."""

import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.main import get_command
from typer.testing import CliRunner

from tests.messages import assert_names, raises_naming
from tripod_bringup import cli
from tripod_bringup.command_groups import GROUPS, RENAMED
from tripod_bringup.node_command import NODES, name_new_form, split_settings
from tripod_bringup.node_values import ValueSyntaxError
from tripod_bringup.options import recording, within
from tripod_sim.scene.file import field_names

ROOT = Path(__file__).parents[2]
TRIPOD: Any = get_command(cli.app)


def tripod(*words: str) -> Any:
    return CliRunner().invoke(cli.app, list(words))


def commands(group: Any = TRIPOD, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the words and the object of every command that does something."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*path, name))
        else:
            yield (*path, name), command


COMMANDS = dict(commands())


def examples_of(command: Any) -> list[str]:
    return [line.removeprefix("[dim]$[/] ") for line in (command.epilog or "").splitlines()[1:]]


@pytest.fixture
def recordings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path / "recordings"


def test_each_command_is_in_one_group_and_groups_are_sorted() -> None:
    listed = [name for names in GROUPS.values() for name in names]
    assert sorted(listed) == sorted(TRIPOD.commands)
    assert all(list(names) == sorted(names) for names in GROUPS.values())
    assert not RENAMED.keys() & set(listed)


def test_the_help_shows_the_groups_in_order() -> None:
    text = tripod("--help").stdout
    places = [text.index(f"─ {title} ─") for title in GROUPS]
    assert places == sorted(places)
    assert not any(re.search(rf"^. {old} ", text, re.MULTILINE) for old in RENAMED)


@pytest.mark.parametrize(("old", "new"), RENAMED.items())
def test_an_old_name_still_works_and_names_the_new_one(old: str, new: tuple[str, ...]) -> None:
    result = tripod(old, "--help")
    assert result.exit_code == 0
    assert result.stderr.count("\n") == 1
    assert_names(result.stderr, f"tripod {old}", f"tripod {' '.join(new)}")
    assert result.stdout == tripod(*new, "--help").stdout


@pytest.mark.parametrize("path", COMMANDS)
def test_examples_can_be_typed(path: tuple[str, ...], recordings: Path) -> None:
    """Each is an example of its own command, and its options and arguments are such as it takes."""
    (recordings / "one").mkdir(parents=True)
    (recordings / "one" / "metadata.yaml").touch()
    examples = examples_of(COMMANDS[path])
    assert examples
    for line in examples:
        words = shlex.split(line.partition(" > ")[0])
        assert tuple(words[1 : 1 + len(path)]) == path, line
        with TRIPOD.make_context("tripod", words[1:], resilient_parsing=False) as context:
            group, rest, command = TRIPOD, context._protected_args + context.args, TRIPOD
            while hasattr(command, "commands"):
                _, command, rest = group.resolve_command(context, rest)
                group = command
            command.make_context(command.name, list(rest), parent=context)


MADE = re.compile(
    r"(?:--(?:out|html|plot|gif|mp4|report)|>|calibrate|bag (?:export|plot|html) \S+) (\S+\.\w+)"
)
"""A file that an example writes."""


def test_the_files_of_examples_exist_or_are_written_by_an_example() -> None:
    lines = [line for command in COMMANDS.values() for line in examples_of(command)]
    made = {name for line in lines for name in MADE.findall(line)}
    read = {
        word
        for line in lines
        for word in re.split(r"[\s=]", line)
        if re.fullmatch(r"[^'\"]*\.(?:csv|npz|toml|yaml|json|txt|mcap)", word)
    }
    assert [name for name in sorted(read - made) if not (ROOT / name).is_file()] == []


def test_the_last_recording_is_the_newest_one(recordings: Path) -> None:
    with pytest.raises(typer.BadParameter, match="--record"):
        recording("last")
    for age, name in enumerate(("new", "old")):
        (recordings / name).mkdir(parents=True)
        (recordings / name / "metadata.yaml").touch()
        os.utime(recordings / name, (1e9 - age, 1e9 - age))
    assert recording("last") == Path("recordings/new")
    assert recording("recordings/old") == Path("recordings/old")


@pytest.mark.parametrize("path", COMMANDS)
def test_a_setting_and_the_port_of_the_page_are_said_alike_everywhere(path: tuple[str, ...]) -> None:
    names = [name for parameter in COMMANDS[path].params for name in parameter.opts]
    assert not {"--param", "--override", "--page-port"} & set(names)
    assert ("--view" in names or path in (("show",), ("view",))) == ("--view-port" in names)
    assert "--set" in names or path[0] not in NODES


def test_no_table_of_a_scene_is_named_like_a_node() -> None:
    assert not {name.partition(".")[0] for name in field_names()} & NODES.keys()


def test_settings_go_to_the_scene_or_to_a_node() -> None:
    assert split_settings(["driver.rate=25", "material.young=1e5", "dt=auto"]) == (
        ["driver.rate:=25"],
        ["material.young=1e5", "dt=auto"],
    )
    known = ("scene", "body_rate")
    assert split_settings(["body_rate=5", "sim.body_rate=6", "dt=0.01"], "sim", known) == (
        ["body_rate:=5", "body_rate:=6"],
        ["dt=0.01"],
    )
    assert split_settings(["port=a=b"], "driver", ("port",)) == (["port:=a=b"], [])


@pytest.mark.parametrize(
    ("word", "node", "named"),
    [
        ("rate", None, ("'rate'", "--set NAME=VALUE")),
        ("=5", "driver", ("'=5'", "--set NAME=VALUE")),
        ("drvier.rate=5", None, ("'drvier'", "'driver'")),
        ("view.port=5", "driver", ("view", "driver", "leave it out")),
    ],
)
def test_a_setting_that_is_none_is_refused(word: str, node: str | None, named: tuple[str, ...]) -> None:
    with raises_naming(ValueSyntaxError, *named):
        split_settings([word], node, ("rate",))


def test_the_old_form_of_a_setting_names_the_new_one(capsys: pytest.CaptureFixture[str]) -> None:
    name_new_form("tripod up", ["maze", "ik.goal:=pose", "driver.start:=[0, 1]", "__ns:=/left"])
    assert_names(capsys.readouterr().err, "tripod up: ", "--set ik.goal=pose --set 'driver.start=[0, 1]'")
    name_new_form("tripod up", ["maze"])
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["run", "tripod", "--duration", "nan"], ("--duration", "nan s", "above 0", "such as 2")),
        (["run", "tripod", "--duration", "-1"], ("--duration", "-1 s", "such as 2")),
        (["run", "tripod", "--view", "--view-port", "70000"], ("--view-port", 70000, "1 to 65535", "8080")),
        (["up", "--duration", "inf"], ("--duration", "inf s", "at least 0 s", "20")),
        (["ik", "--target", "0 0 0", "--torque-max", "-1"], ("--torque-max", "-1 N m", "above 0", "0.3")),
        (["ik", "--target", "0 0 0", "--slide", "1"], ("--slide", "1 m", "0 to 0.1", "35mm")),
        (["reach", "--count", "1"], ("--count", 1, "2 to 101", 11)),
        (["reach", "--torque-max", "nan"], ("--torque-max", "nan N m", "above 0", "0.17")),
        (["play", "--delay", "-1"], ("--delay", "-1 s", "0 to 1", "0.05")),
        (["play", "docs/tilts.csv", "--speed", "0"], ("--speed", "0 rad/s", "above 0", 6)),
        (["explain", "tripod", "--at", "nan"], ("--at", "nan s", "1.5")),
        (["calibrate", "--poses", "-3"], ("--poses", -3, "1 to 1000", 20)),
        (["bag", "info", "x", "--segment", "0"], ("--segment",)),
        (["study", "tripod", "--jobs", "0"], ("--jobs", 0, "1 to 1024", 4)),
    ],
)
def test_a_value_out_of_range_is_refused_with_its_option_its_range_and_an_example(
    words: list[str], named: tuple[object, ...]
) -> None:
    result = tripod(*words)
    assert result.exit_code == 2
    plain = re.sub(r"[\s│]+", " ", result.stderr)
    assert_names(plain, *named)


def test_the_bounds_of_an_option_are_its_own() -> None:
    check = within(0, 2, such_as="1", above=True)
    assert [check(value) for value in (1, 2, None)] == [1, 2, None]
    for value in (0, 2.1, float("nan"), float("inf")):
        with pytest.raises(Exception, match="such as 1"):
            check(value)


def test_what_belongs_to_another_use_of_a_command_is_refused_by_name() -> None:
    fit = tripod("identify", "tripod", "examples/poses.csv", "--score", "--fit", "servos.zero")
    plot = tripod("identify", "tripod", "examples/poses.csv", "--plot", "a.png")
    assert (fit.exit_code, plot.exit_code) == (2, 2)
    assert_names(fit.stderr, "--fit", "--score")
    assert_names(plot.stderr, "--plot", "--score", "--report")
