"""Text of a message type with everything it is made of, as mcap's `ros2msg` schemas want it.

The text is the `.msg` file that the type was built from, comments and all, followed by those of its parts. A
type without such a file (one made from a `.srv`, `.action` or `.idl`) gets a text generated from its Python
class.
"""

import os
import re
import sys
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

from tripod_record.errors import RecordError

SEPARATOR = "=" * 80
NUMBERS = ("float32", "float64", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
PRIMITIVES = frozenset({"bool", "byte", "char", "string", "wstring", *NUMBERS})
IDL_NAMES = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}

TYPE_NAME = re.compile(r"([a-z]\w*)/(msg|srv|action)/([A-Z]\w*)")
FIELD = re.compile(r"\s*((?:[a-z]\w*/)?(?:msg/)?[A-Za-z]\w*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[A-Za-z]\w*")


def split_type(name: str) -> tuple[str, str, str]:
    """Return package, kind and name of "package/msg/Name"; raises RecordError for anything else."""
    match = TYPE_NAME.fullmatch(name)
    if match is None:
        raise RecordError(f"type {name!r} is not of the form package/msg/Name; correct it")
    return match[1], match[2], match[3]


def definition_text(name: str, own_text: Callable[[str], str] | None = None) -> str:
    """Return the definition of type `name` and, after separators, of every type it contains.

    Args:
        name: Full type name, "tripod_msgs/msg/BodyState".
        own_text: Gives the definition of one type without its parts; None takes `installed_text`.

    Raises:
        RecordError: a type is not installed.
    """
    own_text = own_text or installed_text
    texts: dict[str, str] = {}
    waiting = [name]
    while waiting:
        kind = waiting.pop(0)
        if kind not in texts:
            texts[kind] = own_text(kind)
            waiting += parts(texts[kind], split_type(kind)[0])
    blocks = [texts.pop(name).rstrip("\n") + "\n"]
    for kind, text in texts.items():
        package, _, short = split_type(kind)
        blocks.append(f"{SEPARATOR}\nMSG: {package}/{short}\n" + text.rstrip("\n") + "\n")
    return "".join(blocks)


def parts(text: str, package: str) -> list[str]:
    """Return the full names of the types that the fields of a definition have; `package` is its own."""
    names: list[str] = []
    for line in text.splitlines():
        match = FIELD.match(line)
        if match is None or match[1] in PRIMITIVES:  # constants are primitive, too
            continue
        words = match[1].split("/")
        full = f"{package if len(words) == 1 else words[0]}/msg/{words[-1]}"
        if full not in names:
            names.append(full)
    return names


def share_directories() -> list[Path]:
    """Where installed packages keep their files: every ament prefix, and this Python's own."""
    prefixes = [p for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    return [Path(p) / "share" for p in (*prefixes, sys.prefix)]


def installed_text(name: str, directories: Iterable[Path] | None = None) -> str:
    """Return the definition of type `name` from its installed `.msg` file, else from its Python class."""
    package, kind, short = split_type(name)
    for directory in share_directories() if directories is None else directories:
        try:
            return (directory / package / kind / f"{short}.msg").read_text(encoding="utf-8")
        except OSError:
            continue
    return text_from_fields(message_class(name).get_fields_and_field_types())


def message_class(name: str) -> Any:
    """Return the Python class of message type `name`; raises RecordError if it is not installed."""
    package, kind, short = split_type(name)
    try:
        return getattr(import_module(f"{package}.{kind}"), short)
    except (ImportError, AttributeError):
        raise RecordError(f"type {name!r} is not installed; build its package in this environment") from None


def text_from_fields(fields: dict[str, str]) -> str:
    """Return a definition made of field names and types as rclpy names them; it has no constants.

    >>> text_from_fields({"values": "sequence<double, 3>", "name": "string<8>", "pose": "geometry_msgs/Pose"})
    'float64[<=3] values\\nstring<=8 name\\ngeometry_msgs/Pose pose\\n'
    """
    return "".join(f"{_field_type(kind)} {name}\n" for name, kind in fields.items())


def _field_type(kind: str) -> str:
    if match := re.fullmatch(r"sequence<(.+?)(?:, (\d+))?>", kind):
        return _field_type(match[1]) + (f"[<={match[2]}]" if match[2] else "[]")
    if match := re.fullmatch(r"(.+)(\[\d+\])", kind):
        return _field_type(match[1]) + match[2]
    if match := re.fullmatch(r"(w?string)<(\d+)>", kind):
        return f"{match[1]}<={match[2]}"
    return IDL_NAMES.get(kind, kind)
