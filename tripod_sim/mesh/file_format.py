"""Which format a mesh file has: its first bytes decide, and its name only where a format has no mark of its own."""

import os
import re
from pathlib import Path

from tripod_host.reading import open_file
from tripod_sim.errors import SceneError
from tripod_sim.mesh.lines import MAX_BYTES
from tripod_sim.mesh.stl import HEADER, RECORD

HEAD = 4096
"""Bytes by which a format is recognised."""

COMMENTS = rb"(?:\s*#[^\n]*\n)*\s*"
"""Blank lines and lines that begin with `#`."""

MARKS = (
    ("vtk", rb"\s*# vtk DataFile"),
    ("vtu", rb"\s*(?:<\?xml.*?\?>|<!--.*?-->|\s)*<VTKFile"),
    ("xdmf", rb"\s*(?:<\?xml.*?\?>|<!.*?>|\s)*<Xdmf"),
    ("gmsh", rb"\s*\$(?:MeshFormat|Comments|NOD)\b"),
    ("gid", COMMENTS + rb"(?i:MESH)\s[^\n]*\b(?i:ElemType)\b"),
    ("medit", COMMENTS + rb"MeshVersionFormatted\b"),
    ("abaqus", rb"\s*\*+[^\n]*\n"),
    ("avsucd", COMMENTS + rb"\d+[ \t]+\d+[ \t]+\d+[ \t]+\d+[ \t]+\d+[ \t]*\r?\n"),
    ("step", rb"\s*ISO-10303-21;"),
    ("ply", rb"ply\r?\n"),
    ("stl", rb"\s*solid\b[^\n]*\n\s*facet\b"),
    ("obj", COMMENTS + rb"(?:vn?|vt|f|o|g|s|mtllib|usemtl)[ \t]"),
)
"""How files of each format begin, by meshio's names, and `gid`."""

ENDINGS = {".gidmsh": "gid", ".obj": "obj", ".stl": "stl", ".step": "step", ".stp": "step"}
"""Formats by the ending of a name, of those that meshio does not read or that have readers here."""


SURFACES, CAD = ("stl", "obj"), ("step",)
"""Formats of surfaces and of CAD files."""

PARTS = (*SURFACES, *CAD)
"""Formats without cells: parts that are to be filled."""


def checked_format(path: Path, field: str) -> str:
    """Return the format of a file, as `format_of`.

    Raises SceneError, which begins with the name of the scene's `field`: it is no file, too large, or not readable.
    """
    try:
        return format_of(path)
    except FileNotFoundError:
        raise SceneError(
            f"{field}: file {str(path)!r} does not exist; paths count from the folder of the scene file"
        ) from None
    except OSError as error:
        raise SceneError(f"{field}: file {str(path)!r} cannot be read: {error.strerror or error}") from None


def format_of(path: Path) -> str:
    """Return the format of a file by its content, else by the ending of its name.

    Returns:
        `gid`, or the name that meshio gives to the format; empty where neither content nor `ENDINGS` tell it.

    Raises:
        OSError: the file cannot be read.
    """
    with open_file(path, MAX_BYTES) as file:
        head = file.read(HEAD).removeprefix(b"\xef\xbb\xbf")  # the mark of UTF-8
        size = os.fstat(file.fileno()).st_size
    for name, mark in MARKS:
        if re.match(mark, head, re.DOTALL):
            return name
    count = int.from_bytes(head[HEADER : HEADER + 4], "little")
    if len(head) >= HEADER + 4 and size == HEADER + 4 + count * RECORD.itemsize:
        return "stl"
    return ENDINGS.get(path.suffix.lower(), "")
