"""The names that a STEP file gives to its faces."""

import re
from pathlib import Path

from tripod_host.reading import read_file
from tripod_sim.mesh.lines import MAX_BYTES

SHELL = re.compile(rb"(?:CLOSED|OPEN)_SHELL\s*\(\s*'(?:[^']|'')*'\s*,\s*\(([^)]*)\)")
FACE = re.compile(rb"#(\d+)\s*=\s*ADVANCED_FACE\s*\(\s*'((?:[^']|'')*)'")


def face_names(path: Path) -> list[str]:
    """Return the name of each face of a STEP file, in the order of its shells; empty where it has none.

    Raises OSError where the file cannot be read.
    """
    text = read_file(path, MAX_BYTES)
    named = {number: name.decode("ascii", errors="replace") for number, name in FACE.findall(text)}
    shells = [re.findall(rb"#(\d+)", inside) for inside in SHELL.findall(text)]
    return [named.get(number, "").replace("''", "'").strip() for shell in shells for number in shell]
