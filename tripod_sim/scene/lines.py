"""Where a scene file writes a field, so that a message can name the line."""

import re

_HEADER = re.compile(r"\s*(\[\[?)\s*([\w.\s\"'-]+?)\s*\]\]?\s*(?:#.*)?$")
_ENTRY = re.compile(r"\s*([\w.\s\"'-]+?)\s*=")
_FIELD = re.compile(r"(?:field )?([\w-]+(?:\.[\w-]+)*)")


def field_named(message: str) -> str:
    """Return the path of the field with which a message begins, or its first word.

    >>> field_named("field mesh.leevl is unknown")
    'mesh.leevl'
    """
    found = _FIELD.match(message)
    return found[1] if found else ""


def line_of(text: str, field: str) -> int | None:
    """Return the line, from 1, in which a TOML text writes a field, or the table that holds it; None if it does not.

    >>> line_of('dt = 0.1\\n[[body]]\\nname = "a"\\n[body.mesh]\\nlevel = 2\\n', "body.0.mesh.level")
    5
    """
    wanted = field.split(".")
    best, found = 0, None
    for path, number in _written(text):
        if len(path) > best and path == wanted[: len(path)]:
            best, found = len(path), number
    return found


def _written(text: str) -> list[tuple[list[str], int]]:
    """Return the paths of the tables and fields that a TOML text writes, and their lines."""
    paths: list[tuple[list[str], int]] = []
    counts: dict[str, int] = {}
    table: list[str] = []
    in_string = False
    for number, line in enumerate(text.splitlines(), 1):
        quoted = (line.count('"""') + line.count("'''")) % 2 == 1
        if not in_string:
            if header := _HEADER.match(line):
                table = _numbered(_keys(header[2]), counts, is_list=header[1] == "[[")
                paths.append((table, number))
                if table[-1] == "0":  # a message may name the list as a whole
                    paths.append((table[:-1], number))
            elif entry := _ENTRY.match(line):
                paths.append(([*table, *_keys(entry[1])], number))
        in_string ^= quoted
    return paths


def _numbered(keys: list[str], counts: dict[str, int], *, is_list: bool) -> list[str]:
    """Return the keys of a header with the number of the entry behind each that is a list; count a new entry."""
    path: list[str] = []
    for depth, key in enumerate(keys):
        path.append(key)
        name = ".".join(path)
        if is_list and depth == len(keys) - 1:
            counts[name] = counts.get(name, -1) + 1
        if name in counts:
            path.append(str(counts[name]))
    return path


def _keys(text: str) -> list[str]:
    return [key.strip().strip("\"'") for key in text.split(".")]
