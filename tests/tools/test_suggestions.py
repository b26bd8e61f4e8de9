"""What messages suggest can be typed: commands and their options, tables and fields of a scene, choices."""

import ast
import re
from pathlib import Path
from typing import Any

import pytest
import typer

from tripod_bringup.cli import app
from tripod_bringup.node_command import NODES, parameter_table
from tripod_sim import SceneError, load_scene
from tripod_sim.scene import Scene
from tripod_sim.scene.file import field_names
from tripod_sim.tables.kinds import hints_of

ROOT = Path(__file__).parents[2]
GAP = "…"
"""Stands in a text of the code for what is only known when it is said."""


def texts() -> list[str]:
    """Every string of the programs that is not a docstring, f-strings with a gap for each value."""
    found = []
    for path in ROOT.glob("tripod_*/**/*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        documentation = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        inner = {id(v) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for v in node.values}
        for node in ast.walk(tree):
            if id(node) in documentation | inner:
                continue
            if isinstance(node, ast.JoinedStr):
                found.append(
                    "".join(str(v.value) if isinstance(v, ast.Constant) else GAP for v in node.values)
                )
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append(node.value)
    return found


TEXTS = texts()
TYPED = sorted({match for text in TEXTS for match in re.findall(r"`(tripod [a-z][^`]*)`", text)})
TABLES = sorted(
    {name for text in TEXTS for name in re.findall(r"\b(?:add|or|and|take|with) \[{1,2}(\w+)\]", text)}
)
FIELDS = sorted(
    {
        match
        for text in TEXTS
        for match in re.findall(r"\bset ([a-z_]+(?:\.[a-z_]+)+)(?: = ('?[\w.]+'?))?", text)
    }
)


def test_messages_suggest_something() -> None:
    assert len(TYPED) > 10
    assert len(TABLES) > 10
    assert len(FIELDS) > 10


@pytest.mark.parametrize("command", TYPED)
def test_a_command_and_its_options_exist(command: str) -> None:
    group: Any = typer.main.get_command(app)
    words = command.split()[1:]
    while hasattr(group, "commands") and words and GAP not in words[0]:
        assert words[0] in group.commands
        group = group.commands[words.pop(0)]
    known = {option for parameter in group.params for option in (*parameter.opts, *parameter.secondary_opts)}
    assert {word for word in words if word.startswith("--")} <= known


@pytest.mark.parametrize("name", TABLES)
def test_a_table_exists(name: str) -> None:
    assert name in hints_of(Scene)


@pytest.mark.parametrize(("field", "value"), FIELDS)
def test_a_field_exists_and_takes_the_value(field: str, value: str) -> None:
    node, _, name = field.partition(".")
    if node in NODES:
        pytest.importorskip("rclpy")
        assert name in [parameter.name for parameter in parameter_table(node)]
        return
    assert field in field_names()
    if value and not value.strip("'").replace(".", "").isdigit():
        with pytest.raises(SceneError) as refused:
            load_scene("tripod", [f"{field}='none such'"])
        assert value.strip("'") in str(refused.value) or value in ("true", "false")
