"""Parameter files of ROS: which of their blocks are for a node, and which for several."""

import itertools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml

from tripod_host.reading import open_file, read_file

KEY = "ros__parameters"

LARGEST = 1_000_000
"""Bytes that a file may have."""


def parameter_files(ros_arguments: Sequence[str]) -> list[Path]:
    """Return the files that `--params-file` names, in their order.

    Raises:
        ValueError: one is no file, or larger than `LARGEST`: ROS would wait for it, or read it to the end of memory.
    """
    files = [Path(file) for word, file in itertools.pairwise(ros_arguments) if word == "--params-file"]
    for file in files:
        try:
            open_file(file, LARGEST).close()
        except OSError as error:
            raise ValueError(f"parameter file {file} cannot be read: {error.strerror}") from None
    return files


def blocks(file: Path) -> list[tuple[str, frozenset[str]]]:
    """Return pattern of node names (`/left/driver`, `/**`) and names of parameters of each block.

    Empty for a file that is no such file: ROS has read it before, and told what is wrong with it.
    """
    try:
        content = yaml.safe_load(read_file(file, LARGEST).decode("utf-8"))
    except (OSError, ValueError, RecursionError, yaml.YAMLError):
        return []
    return list(_blocks("", content))


def shared_names(files: Sequence[Path]) -> frozenset[str]:
    """Return the parameters in blocks for several nodes: one that does not know a name leaves it alone."""
    return frozenset().union(*(names for file in files for where, names in blocks(file) if "*" in where))


def strangers(files: Sequence[Path], node: str) -> list[str]:
    """Return a line for each file that has blocks, but none for the node of this full name: of another robot?"""
    told = [(file, [where for where, _ in blocks(file)]) for file in files]
    return [
        f"parameter file {file} sets nothing for {node}: its blocks are for {', '.join(found)}"
        for file, found in told
        if found and not any(is_for(where, node) for where in found)
    ]


def is_for(pattern: str, node: str) -> bool:
    """Whether a block of this pattern is for the node of this full name: `*` is one part of it, `**` any number.

    >>> is_for("/**", "/left/driver"), is_for("/*/driver", "/driver"), is_for("driver", "/driver")
    (True, False, True)
    """
    parts = [
        {"**": "(/[^/]+)*", "*": "/[^/]+"}.get(p, "/" + re.escape(p)) for p in pattern.strip("/").split("/")
    ]
    return re.fullmatch("".join(parts), node) is not None


def _blocks(where: str, content: Any) -> Iterator[tuple[str, frozenset[str]]]:
    for key, inner in content.items() if isinstance(content, dict) else ():
        if key == KEY:
            yield where, frozenset(_names("", inner))
        else:
            yield from _blocks(f"{where}/{str(key).strip('/')}", inner)


def _names(prefix: str, content: Any) -> Iterator[str]:
    for key, value in content.items() if isinstance(content, dict) else ():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            yield from _names(f"{name}.", value)
        else:
            yield name
