"""Reads STL files, binary and ASCII. Corners at the same position become one vertex; normals are left out."""

import os
from array import array
from pathlib import Path

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_host.reading import open_file
from tripod_sim.errors import SceneError
from tripod_sim.mesh.lines import MAX_BYTES, MOST_TRIANGLES, check_count, numbered_lines, to_coordinates, word

HEADER = 80
"""Bytes before the number of triangles in a binary file."""

RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""A triangle of a binary file."""

LOOP = ((b"outer", b"loop"), (b"vertex",), (b"vertex",), (b"vertex",), (b"endloop",), (b"endfacet",))
"""How the lines of an ASCII facet begin, after the first."""


def read_stl(path: Path, name: str, most: int = MOST_TRIANGLES) -> tuple[FloatArray, IndexArray]:
    """Return the vertices (n, 3), in the file's unit, and the triangles (m, 3) of an STL file.

    A file is binary if its length is what its number of triangles asks for; else it must be ASCII, from `solid` on.

    Args:
        path: The file.
        name: What messages call it.
        most: Triangles of the file.

    Raises:
        SceneError: not such a file, or too many triangles; the message says what is wrong, and where in ASCII files.
    """
    try:
        with open_file(path, MAX_BYTES) as file:
            size = os.fstat(file.fileno()).st_size
            start = file.read(HEADER + 4)
            count = int.from_bytes(start[HEADER:], "little")
            expected = HEADER + 4 + count * RECORD.itemsize
            binary = len(start) == HEADER + 4 and size == expected
            check_count(count if binary else 0, most, name)
            data = file.read(count * RECORD.itemsize) if binary else b""
    except OSError as error:
        raise SceneError(f"{name} cannot be read: {error.strerror or error}") from None
    if binary and len(data) == count * RECORD.itemsize:
        corners = np.frombuffer(data, RECORD)["corners"].reshape(-1, 3).astype(np.float64)
    elif start.lstrip()[:5].lower() == b"solid":
        corners = _ascii(path, name, most)
    else:
        claim = f"; a binary one of {count} triangles has {expected}" if len(start) == HEADER + 4 else ""
        raise SceneError(
            f"{name} is not an STL file: it does not begin with 'solid' and has {size} bytes{claim}"
        )
    vertices, triangles = np.unique(corners, axis=0, return_inverse=True)
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def _ascii(path: Path, name: str, most: int) -> FloatArray:
    """Return the corners of the facets of an ASCII file, shape (3 m, 3). Raises SceneError."""
    xyz = array("d")
    inside, stage, number = False, len(LOOP), 0
    for number, line in numbered_lines(path, name):
        tokens = line.split()
        if not tokens:
            continue
        where, begins = f"{name}, line {number}", [t.lower() for t in tokens[:2]]
        if stage < len(LOOP):
            wanted = LOOP[stage]
            if tuple(begins[: len(wanted)]) != wanted:
                raise SceneError(f"{where}: expected '{b' '.join(wanted).decode()}', found {word(tokens[0])}")
            if wanted == (b"vertex",):
                if len(tokens) != 4:
                    raise SceneError(f"{where}: a vertex needs 3 coordinates, found {len(tokens) - 1} words")
                xyz.extend(to_coordinates(tokens[1:], where))
            stage += 1
        elif not inside and begins[0] == b"solid":
            inside = True
        elif inside and begins == [b"facet", b"normal"]:
            stage = 0
            check_count(len(xyz) // 9 + 1, most, name)
        elif inside and begins[0] == b"endsolid":
            inside = False
        else:
            wanted_word = "'facet normal' or 'endsolid'" if inside else "'solid'"
            raise SceneError(f"{where}: expected {wanted_word}, found {word(tokens[0])}")
    if inside or stage < len(LOOP):
        raise SceneError(f"{name}: the file ends in line {number} without 'endsolid'; is it cut short?")
    return np.array(xyz).reshape(-1, 3)
