"""Reference of all commands and of the parameters of the nodes, from the code that reads them."""

import re
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any, get_args

from typer.main import get_command

from tools.reference.docstrings import cell
from tripod_bringup.cli import app
from tripod_bringup.command_groups import GROUPS, RENAMED
from tripod_bringup.node_command import NODES, parameter_table
from tripod_bringup.node_values import yaml_value

PARAMETERS_HEAD = """\
# Parameters of the nodes

Set by `--set NAME=VALUE` of the command of a node, by `--set NODE.NAME=VALUE` of `tripod up`, by ROS's own
`--ros-args -p NAME:=VALUE`, or in a parameter file of ROS (`tripod print parameters` prints one; [ROS](../ros.md)).

This page is written from the code.
"""
_SEE_BELOW = re.compile("; see (the table )?below")  # where a screen shows the parameters
_MARKUP = re.compile(r"\[/?(?:dim|bold|cyan|yellow|green|red)?\]")


def command_sections() -> str:
    """Return one Markdown section for each command, in the groups of `tripod --help`; then the old names."""
    lines, commands = list[str](), get_command(app).commands  # type: ignore[attr-defined]
    for title, names in GROUPS.items():
        lines.append(f"## {title}\n")
        for name in names:
            lines += _commands(commands[name], f"tripod {name}")
    lines.append("## Old names\n\nThese still work and name the new command on standard error.\n")
    lines += ["| old | new |", "|---|---|"]
    lines += [f"| `tripod {old}` | `tripod {' '.join(new)}` |" for old, new in RENAMED.items()]
    return "\n".join(lines) + "\n"


def _commands(command: Any, path: str) -> Iterator[str]:
    if not hasattr(command, "commands"):
        yield from _command(command, path)
        return
    for name in sorted(command.commands):
        yield from _command(command.commands[name], f"{path} {name}")


def _command(command: Any, path: str) -> Iterator[str]:
    shown = [p for p in command.params if p.name != "help" and not getattr(p, "hidden", False)]
    words = [_word(p) for p in shown if p.param_type_name == "argument"]
    if len(words) < len(shown):
        words.append("[OPTIONS]")
    yield f"### {path}\n\n```\n{' '.join([path, *words])}\n```\n\n{plain(command.help or '')}\n"
    if shown:
        yield "| | default | |\n|---|---|---|"
    for p in shown:
        yield f"| `{_names(p)}` | {_default(p)} | {_help(p)} |"
    if path.removeprefix("tripod ") in NODES:
        node = path.removeprefix("tripod ")
        yield f"\nParameters of the node: [`{node}`](reference/parameters.md#{node})."
    lines = [line.removeprefix("$ ") for line in plain(command.epilog or "").splitlines()[1:]]
    if lines:
        yield "\n```sh\n" + "\n".join(lines) + "\n```"
    yield ""


def _word(argument: Any) -> str:
    word: str = argument.metavar or str(argument.name).upper()
    return word if argument.required or word.startswith("[") else f"[{word}]"


def _names(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return _word(parameter)
    names = ", ".join([*parameter.opts, *parameter.secondary_opts])
    if parameter.is_flag:
        return names
    return f"{names} {parameter.metavar or _kind(parameter.type_descriptor.annotation)}"


def _kind(annotation: Any) -> str:
    kinds = [a for a in (*get_args(annotation), annotation) if isinstance(a, type) and a is not type(None)]
    kind = kinds[0] if kinds else str
    if issubclass(kind, Enum):
        return " or ".join(str(member.value) for member in kind)
    return {int: "INTEGER", float: "NUMBER", Path: "FILE"}.get(kind, "TEXT")


def _help(parameter: Any) -> str:
    return _SEE_BELOW.sub("", cell(plain(parameter.help or "")))


def _default(parameter: Any) -> str:
    value = parameter.default
    if parameter.required:
        return "must be given"
    if callable(value) or value is None or value is False or value in ("", ()):
        return ""
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def plain(text: str) -> str:
    """Return `text` without the marks of a screen's colours."""
    return _MARKUP.sub("", text).replace("\\[", "[")


def parameters_page() -> str:
    """Return the page of the parameters as Markdown. Raises ImportError where ROS is not installed."""
    lines = [PARAMETERS_HEAD]
    for node, info in NODES.items():
        lines += [
            f"## {node}\n\n{info.help}\n",
            "| parameter | default | unit | allowed | |\n|---|---|---|---|---|",
        ]
        for p in parameter_table(node):
            unit = "" if p.unit == "" else p.unit
            allowed = p.allowed.removesuffix(f" {p.unit}") if p.unit else p.allowed
            lines.append(
                f"| `{p.name}` | `{yaml_value(p.default)}` | {unit} | {cell(allowed)} | {cell(p.help + p.note)} |"
            )
        lines.append("")
    return "\n".join(lines)
