"""`tripod print parameters`: the parameters of all nodes as a parameter file of ROS."""

import sys
import textwrap
from collections.abc import Iterator, Sequence

from tripod_bringup.node_command import NODES, missing_import, parameter_table
from tripod_bringup.node_values import yaml_value

WIDTH = 100
"""Longest line of a comment."""

HEAD = """\
# Every parameter of every node with its default, written by `tripod print parameters`.
# ros2 launch tripod tripod.launch.py params_file:=FILE, or: ros2 run tripod sim --ros-args --params-file FILE
# `/**/sim` is the node `sim` in any namespace; `/left/sim` is the one of the robot `left`.
"""


def parameters_command(nodes: Sequence[str]) -> int:
    """Print the parameters of `nodes`, of all if none is named; return the exit code."""
    if unknown := [name for name in nodes if name not in NODES]:
        print(
            f"tripod print parameters: no node is named {unknown[0]!r}; nodes: {', '.join(NODES)}",
            file=sys.stderr,
        )
        return 2
    try:
        print(parameter_file(nodes or list(NODES)), end="")
    except ImportError as error:
        print(f"tripod print parameters: {missing_import(error)}", file=sys.stderr)
        return 1
    return 0


def parameter_file(nodes: Sequence[str]) -> str:
    """Return the text of a parameter file that sets every parameter of `nodes` to its default."""
    return HEAD + "".join(f"\n{text}" for name in nodes for text in ["\n".join(_block(name)) + "\n"])


def _block(name: str) -> Iterator[str]:
    yield f"/**/{name}:"
    yield "  ros__parameters:"
    for p in parameter_table(name):
        indent = "    # "
        unit, allowed = f" [{p.unit}]" if p.unit else "", f"; {p.allowed}" if p.allowed else ""
        text = f"{p.help}{unit}{allowed}{p.note}"
        yield from textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent)
        yield f"    {p.name}: {yaml_value(p.default)}"
