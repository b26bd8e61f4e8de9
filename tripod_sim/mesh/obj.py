"""Reads vertices and faces of Wavefront OBJ files; normals, texture coordinates, groups, materials are left out."""

from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.errors import SceneError
from tripod_sim.mesh.lines import (
    MOST_TRIANGLES,
    check_count,
    numbered_lines,
    to_coordinates,
    to_integer,
    word,
)
from tripod_sim.mesh.polygon import MOST_CORNERS, triangulate

LEFT_OUT = frozenset(
    b"vt vn vp g o s l p usemtl mtllib mg lod bevel c_interp d_interp usemap maplib shadow_obj trace_obj".split()
)
"""Statements that say nothing about the shape of polygons."""

MOST_WORDS = 100_000
"""Words of one statement, continued lines included."""


def read_obj(
    path: Path, name: str, owner: "array[int] | None" = None, most: int = MOST_TRIANGLES
) -> tuple[FloatArray, IndexArray]:
    """Return the vertices (n, 3), in the file's unit, and the triangles (m, 3) of an OBJ file.

    Polygons are divided into triangles, convex ones from their first vertex. Negative numbers count back from the last
    vertex so far.

    Args:
        path: The file.
        name: What messages call it.
        owner: Takes the number of the face that each triangle is part of.
        most: Triangles of the file.

    Raises:
        SceneError: not such a file; the message names the line and what is wrong with it.
    """
    xyz, corners, faces = array("d"), array("q"), 0
    for number, tokens in _statements(path, name):
        where = f"{name}, line {number}"
        keyword, values = tokens[0], tokens[1:]
        if keyword == b"v":
            if len(values) not in (3, 4, 6, 7):  # a weight, a colour
                raise SceneError(f"{where}: a vertex needs 3 coordinates, found {len(values)} words")
            xyz.extend(to_coordinates(values[:3], where))
        elif keyword == b"f":
            count = len(xyz) // 3
            polygon = [_vertex(value, count, where) for value in values]
            if len(polygon) < 3:
                raise SceneError(f"{where}: a face needs at least 3 vertices, found {len(polygon)}")
            if len(polygon) == 3:
                corners.extend(polygon)
            else:
                corners.extend(_divided(polygon, xyz, where))
            if owner is not None:
                owner.extend([faces] * (len(polygon) - 2))
            faces += 1
            check_count(len(corners) // 3, most, name)
        elif keyword not in LEFT_OUT:
            raise SceneError(f"{where}: {word(keyword)} is no OBJ statement for polygons")
    return np.array(xyz).reshape(-1, 3), np.array(corners, dtype=np.int64).reshape(-1, 3)


def _divided(polygon: list[int], xyz: "array[float]", where: str) -> list[int]:
    """Return the triangles of a polygon, one after the other. Raises SceneError."""
    found = triangulate([(xyz[3 * v], xyz[3 * v + 1], xyz[3 * v + 2]) for v in polygon])
    if not found:
        raise SceneError(
            f"{where}: a face of {len(polygon)} vertices crosses itself, or is not convex and has more than "
            f"{MOST_CORNERS}; divide it into triangles"
        )
    return [polygon[corner] for triangle in found for corner in triangle]


def _statements(path: Path, name: str) -> Iterator[tuple[int, list[bytes]]]:
    """Yield the words of each statement with its line number; a backslash at the end of a line continues it."""
    kept: list[bytes] = []
    for number, line in numbered_lines(path, name):
        text = line.partition(b"#")[0].rstrip()
        more = text.endswith(b"\\")
        kept += text[: len(text) - more].split()
        if len(kept) > MOST_WORDS:
            raise SceneError(f"{name}, line {number}: a statement of more than {MOST_WORDS} words")
        if kept and not more:
            yield number, kept
            kept = []
    if kept:
        raise SceneError(f"{name}: the last line is continued, but the file ends; is it cut short?")


def _vertex(token: bytes, count: int, where: str) -> int:
    """Return the index of the vertex that a word of a face names (`7`, `7/1`, `7//3` or `7/1/3`). Raises SceneError."""
    number = to_integer(token.partition(b"/")[0], where, "the number of a vertex")
    index = number - 1 if number > 0 else count + number
    if not 0 <= index < count:
        raise SceneError(f"{where}: vertex {number} of a face is not among the {count} vertices before it")
    return index
