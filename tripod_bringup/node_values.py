"""Values of node parameters on their way from a command line or from Python to a node's command line."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

PACKAGES = {"sim": "tripod_runtime"}
"""Packages of the nodes that are not named like their package."""


def node_package(name: str) -> str:
    """Return the package that holds the modules `node` and `settings` of the node `name`.

    >>> node_package("sim"), node_package("ik")
    ('tripod_runtime', 'tripod_ik')
    """
    return PACKAGES.get(name, f"tripod_{name}")


class ValueSyntaxError(ValueError):
    """A word that is no `NAME:=VALUE`; the message says which."""


def split_word(word: str) -> tuple[str, str]:
    """Return name and value of `NAME:=VALUE`. Raises ValueSyntaxError.

    >>> split_word("port:=mock")
    ('port', 'mock')
    """
    name, sign, value = word.partition(":=")
    if not sign or not name:
        raise ValueSyntaxError(f"{word!r} is no setting; write --set NAME=VALUE, such as --set port=mock")
    return name, value


def node_arguments(values: Mapping[str, object]) -> list[str]:
    """Return the words NAME:=VALUE that set `values`, as `tripod_graph.run.run_node` takes them.

    rclpy reads a value as YAML, so that text is quoted: a directory named 2024 stays text.

    >>> node_arguments({"scene": "tripod", "port": 8080})
    ['scene:="tripod"', 'port:=8080']
    """
    return [f"{name}:={yaml_value(value)}" for name, value in values.items()]


class RawYaml(str):
    """YAML as the user wrote it."""

    __slots__ = ()


def typed(text: str, kind: type) -> object:
    """Return `text` from a command line for a parameter of type `kind`: as text where text is wanted."""
    quoted = len(text) > 1 and text[0] == text[-1] and text[0] in "'\""
    return text if kind is str and not quoted else RawYaml(text)


def read(text: str) -> object:
    """Return what ROS reads of YAML that sets a parameter. Raises ValueSyntaxError where it is none.

    >>> read("1e3"), read("[1, y]"), read("'1e3'")
    (1000.0, [1, True], '1e3')
    """
    import yaml  # noqa: PLC0415 - only where a parameter is set

    try:
        value: object = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError):
        raise ValueSyntaxError(f"{text!r} is not YAML; quote it") from None
    if text[:1] in ("'", '"'):
        return value
    return [_plain(v) for v in value] if isinstance(value, list) else _plain(value)


def _plain(value: object) -> object:
    """Return what ROS takes unquoted text for: numbers of C, which YAML 1.1 writes with a point, and y for yes."""
    if not isinstance(value, str):
        return value
    if value in ("y", "Y", "n", "N"):
        return value in ("y", "Y")
    try:
        return float(value)
    except ValueError:
        return value


def yaml_value(value: object) -> str:
    """Return `value` as YAML on one line."""
    if isinstance(value, RawYaml):
        return value
    if isinstance(value, str | Path):
        return json.dumps(str(value), ensure_ascii=False)  # a JSON string is a YAML string
    if isinstance(value, Sequence):
        return "[" + ", ".join(yaml_value(v) for v in value) + "]"
    return json.dumps(value)
