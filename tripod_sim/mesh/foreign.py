"""Reads one mesh file with meshio, as a program of its own: `python foreign.py FILE vtk 20 tetra=4 hexahedron=8`.

Parsers of mesh files print, exit, and loop for ever on files cut short; here they can do no harm. What was read leaves
on standard output as an npz archive: `points` (n, 3) and one array per kind of cell that the command line names with
its size, (m, nodes of a cell). Of the other kinds `others` are the names, `solid` tells which have a volume, and
`skipped` how many cells there are of those that meshio does not know, else 0. Groups of the file leave as `groups`
(names) and two arrays each: `group 0` holds its points, `cells 0` its cells, numbered over the arrays of cells in the
order of the command line. With exit code 1 standard output holds the reason instead.

The second word is the format; if it is empty, the ending of the file's name decides. Memory is bounded where the system
can, and so is the processor time, by the third word [s]: beyond it the program is ended by SIGXCPU. Time that passes
while others have the processor does not count.
"""

import contextlib
import io
import os
import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

MAX_MEMORY = 4 << 30
"""Address space of this program [bytes]: a file may claim, or expand to, far more than its size."""

MAX_ANSWER = 1 << 30
"""Bytes of points and cells."""

BROKEN = (
    "it is cut short or damaged, or meshio does not know some of its parts; write it again, for "
    "instance as gmsh's .msh or VTK's .vtu"
)

MARKED = ("vtk", "vtu", "gmsh", "abaqus")
"""Formats whose files are recognised by how they begin (`file_format`); an ending alone does not make one."""

Skipped = Counter[tuple[str, bool]]
"""How many cells were left out that meshio does not know, by the name of their kind and whether it has a volume."""

MOST_NUMBERS = 100
"""Different numbers of an array that divides a mesh into groups."""


class UnreadableError(Exception):
    """A file that is not read; the message says why."""


def main() -> int:
    """Read the file that the command line names; return the exit code."""
    with contextlib.suppress(ImportError, ValueError, OSError):  # Windows has no limits
        import resource  # noqa: PLC0415

        resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[3]), int(sys.argv[3]) + 1))
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)  # what parsers print goes to standard error
        try:
            answer.write(archive(sys.argv[1], sys.argv[2], sys.argv[4:]))
        except Exception as error:  # noqa: BLE001 - whatever a parser meets in a file that is not what it says
            answer.write(reason(error, sys.argv[2]).encode())
            return 1
    return 0


def reason(error: Exception, file_format: str) -> str:
    """Return why a file is not read: what a parser stumbled over in it would tell nobody more than `BROKEN`."""
    import meshio  # noqa: PLC0415

    if isinstance(error, UnreadableError):
        return str(error)
    if isinstance(error, meshio.ReadError) and str(error):
        return f"{BROKEN} ({error})"
    if isinstance(error, KeyError) and file_format == "gmsh":  # the tables of cells alone are looked up there
        return (
            f"it has gmsh cells of kind {error.args[0]}, which meshio does not know; write it with "
            "tetrahedra or hexahedra"
        )
    if (
        isinstance(error, KeyError)
        and file_format == "abaqus"
        and isinstance(error.args[0], int | np.integer)
    ):
        return f"it is cut short or damaged: an element or a set names {error.args[0]}, which the file does not have"
    if isinstance(error, MemoryError | ImportError | OSError):
        return f"{type(error).__name__}: {error}"
    return BROKEN if file_format else f"{BROKEN}, or is not in the format that its name says"


def archive(path: str, file_format: str, wanted: list[str]) -> bytes:
    """Return what meshio reads from the file at `path`, as an npz archive."""
    skipped = Skipped()
    mesh = mesh_of(path, file_format, skipped)
    sizes = {kind: int(size) for kind, _, size in (word.partition("=") for word in wanted)}
    others = sorted({(b.type, b.dim == 3) for b in mesh.cells if b.type not in sizes} | set(skipped))
    found = {
        "points": np.asarray(mesh.points, dtype=np.float64),
        "others": np.array([name for name, _ in others], dtype=str),
        "solid": np.array([solid for _, solid in others], dtype=bool),
        "skipped": np.array([skipped[other] for other in others], dtype=np.int64),
    }
    first, total = dict[int, int](), 0  # number of the first cell of each block
    for kind, size in sizes.items():
        blocks = [(i, b) for i, b in enumerate(mesh.cells) if b.type == kind]
        if blocks:
            found[kind] = np.concatenate([np.asarray(b.data).reshape(-1, size) for _, b in blocks]).astype(
                np.int64
            )
        for i, block in blocks:
            first[i] = total
            total += len(block.data)
    groups = named_groups(mesh)
    found["groups"] = np.array(list(groups), dtype=str)
    for i, (points, members) in enumerate(groups.values()):
        found[f"group {i}"] = np.unique(points).astype(np.int64)
        own = [first[k] + np.asarray(cells) for k, cells in members if k in first]
        found[f"cells {i}"] = np.unique(np.concatenate([_none(), *own])).astype(np.int64)
    if (total := sum(a.nbytes for a in found.values())) > MAX_ANSWER:
        raise MemoryError(f"points and cells take {total} bytes; at most {MAX_ANSWER} are read")
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **found)
    return file.getvalue()


def mesh_of(path: str, file_format: str, skipped: Skipped) -> Any:
    """Return the mesh of meshio's in a file.

    Args:
        path: The file.
        file_format: By meshio's names; empty: the ending of the file's name decides.
        skipped: Takes the cells that are left out.
    """
    import meshio  # noqa: PLC0415

    if not Path(path).stat().st_size:
        raise UnreadableError("it is empty")
    if not file_format:
        endings = "".join(Path(path).suffixes).lower().split(".")[1:]
        named = [f for i in range(len(endings)) for f in _named(".".join(["", *endings[i:]]))]
        formats = [name for name in named if name not in MARKED]
        if named and not formats:
            raise UnreadableError(
                f"its name says {' or '.join(named)}, but it does not begin as such files do"
            )
        if not formats:
            raise UnreadableError(
                "its format is unknown: neither its first lines nor the ending of its name match a known "
                "format; write it as .msh, .vtu or another format of meshio"
            )
        file_format = formats[0]
    if file_format == "abaqus":
        return meshio.abaqus.read(abaqus_text(path, skipped))
    if file_format in ("vtk", "vtu"):
        read_vtk_cells(skipped)
    return getattr(meshio, file_format.removesuffix("-xml")).read(path)


def _named(ending: str) -> list[str]:
    """Return the formats that meshio knows by the ending of a name."""
    import meshio  # noqa: PLC0415

    return list(meshio.extension_to_filetypes.get(ending, []))


# cells of VTK ---------------------------------------------------------------------------------------------------------

VTK_FLAT = frozenset((*range(10), 21, 22, 23, 28, 30, 34, 35, 36, *range(51, 55), *range(60, 64), *range(68, 71),
                      *range(75, 78)))  # fmt: skip
"""Numbers of the cells without a volume."""

VTK_NAMES = {
    2: "vertices", 4: "polyline", 6: "triangle strip", 11: "voxel", 36: "quadratic polygon", 37: "pyramid19",
    41: "convex point set",
}  # fmt: skip
"""Names of cells for which meshio has none; others are called by their number."""


def read_vtk_cells(skipped: Skipped) -> None:
    """Let meshio's three readers of VTK files leave out the cells that they do not know, and count them.

    By themselves one of them refuses such files, two leave out the cells without a word, and of a file of several
    pieces one has only the last.
    """
    import meshio  # noqa: PLC0415

    def cells(
        connectivity: Any, ends: Any, types: Any, data: dict[str, Any]
    ) -> tuple[list[Any], dict[str, list[Any]]]:
        return vtk_blocks(np.asarray(connectivity), np.asarray(ends), np.asarray(types), data, skipped)

    def legacy(connectivity: Any, types: Any, data: dict[str, Any]) -> tuple[list[Any], dict[str, list[Any]]]:
        row, at, ends = connectivity.tolist(), 0, []  # each cell is its number of points, then these
        for _ in range(len(types)):
            at += row[at] + 1
            ends.append(at)
        counts = np.zeros(len(row), dtype=bool)
        counts[np.array([0, *ends[:-1]], dtype=np.int64)] = len(types) > 0
        return cells(connectivity[~counts], np.array(ends) - np.arange(1, len(types) + 1), types, data)

    def pieces(
        first: Any, parts: list[dict[str, Any]], data: list[dict[str, Any]]
    ) -> tuple[list[Any], dict[str, list[Any]]]:
        blocks, values = list[Any](), {name: list[Any]() for name in set.intersection(*map(set, data))}
        for point, part, own in zip(first, parts, data, strict=True):
            connectivity, ends, types = (part[k].ravel() for k in ("connectivity", "offsets", "types"))
            more, named = cells(connectivity, ends, types, {name: own[name] for name in values})
            for block in more:
                block.data = block.data + point
            for name, rows in named.items():
                values[name] += rows
            blocks += more
        return blocks, values

    meshio.vtk._vtk_42.translate_cells = legacy
    meshio.vtk._vtk_51.vtk_cells_from_data = cells
    meshio.vtu._vtu._organize_cells = pieces


def vtk_blocks(
    connectivity: Any, ends: Any, types: Any, data: dict[str, Any], skipped: Skipped
) -> tuple[list[Any], dict[str, list[Any]]]:
    """Return the cells of a VTK file as blocks of one kind, and their data.

    Args:
        connectivity: Points of all cells, one after the other.
        ends: Where those of each cell end, shape (m,).
        types: Of the cells, shape (m,).
        data: Arrays of m rows.
        skipped: Takes the cells that are left out.
    """
    import meshio  # noqa: PLC0415

    ends = np.asarray(ends, dtype=np.int64)
    sizes = np.diff(ends, prepend=0)
    if len(sizes) != len(types) or (sizes < 0).any() or sizes.sum() != len(connectivity):
        raise UnreadableError(
            "it is cut short or damaged: its cells name more or fewer points than there are"
        )
    blocks, values = list[Any](), {name: list[Any]() for name in data}
    for number in np.unique(types).tolist():
        own = np.flatnonzero(types == number)
        name = meshio._vtk_common.vtk_to_meshio_type.get(number, VTK_NAMES.get(number, f"VTK type {number}"))
        size = meshio._common.num_nodes_per_cell.get(name)
        if size is None or name not in meshio._mesh.topological_dimension:
            skipped[name, number not in VTK_FLAT] += len(own)
            continue
        if (sizes[own] != size).any():
            raise UnreadableError(f"it is damaged: not all its {name} cells have {size} points")
        order = meshio._vtk_common.vtk_to_meshio_order(number)
        points = connectivity[(ends[own] - size)[:, None] + np.arange(size)]
        blocks.append(meshio.CellBlock(name, points if order is None else points[:, order]))
        for key, rows in data.items():
            values[key].append(np.asarray(rows)[own])
    return blocks, values


# Abaqus ---------------------------------------------------------------------------------------------------------------

ABAQUS = (
    (r"[TB][23]D?\d\w*", {2: "T3D2", 3: "T3D3"}),
    (r"(CP[SE]|CPEG|CG?AX|S|M3D|SFM3D|R3D|DS|STRI|F3D|DC2D|AC2D)\d\w*",
     {3: "CPS3", 4: "CPS4", 6: "CPE6", 8: "S8R", 9: "S9R5"}),
    (r"[AD]?C3D\d\w*", {4: "C3D4", 6: "C3D6", 8: "C3D8", 10: "C3D10", 20: "C3D20"}),
)  # fmt: skip
"""Families of lines, surfaces and solids by the pattern of their names, and by number of nodes an element of each that
meshio knows."""

ABAQUS_SOLID = re.compile(r"[A-Z]{0,2}C3D|SC\d|CSS|CCL|COH3D|GK3D")
"""How the names of elements with a volume begin."""


def abaqus_text(path: str, skipped: Skipped) -> io.StringIO:
    """Return the file at `path` as meshio's reader of Abaqus files takes it.

    That knows few names of elements, keeps only the last block of nodes, and mistakes sets that are made of sets. Here
    the blocks of nodes are one, elements have the name of one with as many nodes that it knows, those without such a
    name are left out and counted, and sets have numbers.
    """

    nodes, rest, sets = list[str](), list[str](), dict[str, list[str]]()
    for keyword, rows in _abaqus_blocks(path):
        name = keyword.partition(",")[0].replace(" ", "").upper()
        if name == "*NODE":
            nodes += [",".join(row.split(",")[:4]) for row in rows]  # no comma at the end, no normals
        elif name == "*ELEMENT" and (kind := _abaqus_parameter(keyword, "TYPE")):
            numbers, known = _abaqus_elements(rows), ""
            if numbers:
                known = _abaqus_name(kind.upper(), len(numbers[0]) - 1)
            if known:
                rest += [re.sub(r"(?i)(TYPE\s*=\s*)[^,\s]+", rf"\g<1>{known}", keyword), *rows]
            else:
                skipped[kind.upper(), bool(ABAQUS_SOLID.match(kind.upper()))] += len(numbers)
            if group := _abaqus_parameter(keyword, "ELSET"):
                sets.setdefault(group, []).extend(row[0] for row in numbers)
        elif name == "*ELSET" and (group := _abaqus_parameter(keyword, "ELSET")):
            sets.setdefault(group, []).extend(_abaqus_members(keyword, rows, sets))
        else:
            rest += [keyword, *rows]
    (number, most), *_ = [*Counter(row.partition(",")[0] for row in nodes).most_common(1), ("", 1)]
    if most > 1:
        raise UnreadableError(f"it has {most} nodes with the number {number}: write its parts as one mesh")
    for group, members in sets.items():
        rest += [f"*ELSET, ELSET={group}", *members]
    text = io.StringIO("\n".join([*(["*NODE", *nodes] if nodes else []), *rest, ""]))
    text.name = path  # where files are looked for that it includes
    return text


def _abaqus_blocks(path: str) -> Iterator[tuple[str, list[str]]]:
    """Yield each keyword line with the data lines below it; comments and blank lines are left out."""
    keyword, rows = "", list[str]()
    with Path(path).open(encoding="utf-8", errors="replace") as file:
        for line in file:
            text = line.strip()
            if not text or text.startswith("**"):
                continue
            if not text.startswith("*"):
                rows.append(text)
                continue
            if keyword:
                yield keyword, rows
            keyword, rows = text, []
    if keyword:
        yield keyword, rows


def _abaqus_parameter(keyword: str, name: str) -> str:
    """Return a parameter of a keyword line; empty if it has none of that name."""
    found = re.search(rf"(?i),\s*{name}\s*=\s*([^,]+)", keyword)
    return found[1].strip().strip('"') if found else ""


def _abaqus_elements(rows: list[str]) -> list[list[str]]:
    """Return the numbers of each element, its own first: a line that ends with a comma is continued."""
    found, more = list[list[str]](), False
    for row in rows:
        numbers = [word.strip() for word in row.split(",") if word.strip()]
        if more:
            found[-1] += numbers
        else:
            found.append(numbers)
        more = row.endswith(",")
    return found


def _abaqus_members(keyword: str, rows: list[str], sets: dict[str, list[str]]) -> list[str]:
    """Return the numbers in a set that its lines list, give as spans, or take from other sets."""
    words = [[word.strip() for word in row.split(",") if word.strip()] for row in rows]
    if re.search(r"(?i)\bGENERATE\b", keyword):
        spans = [[int(word) for word in row] for row in words]
        return [str(n) for low, high, *by in spans for n in range(low, high + 1, *by)]
    return [n for row in words for word in row for n in ([word] if word.isdigit() else sets.get(word, []))]


def _abaqus_name(name: str, size: int) -> str:
    """Return an element of the same family and with `size` nodes that meshio knows; empty if there is none."""
    for pattern, known in ABAQUS:
        if re.fullmatch(pattern, name):
            return known.get(size, "")
    return ""


# groups ---------------------------------------------------------------------------------------------------------------

Groups = dict[str, tuple[np.ndarray, list[tuple[int, np.ndarray]]]]
"""Points of each group, and the cells in it by the number of their block."""


def named_groups(mesh: Any) -> Groups:
    """Return the groups of a mesh of meshio's.

    Groups are the named sets of points and of cells of the file (gmsh's physical groups, Abaqus' NSET and ELSET), and
    of arrays of whole numbers on cells or points, as VTK files have them, `NAME:NUMBER`.
    """
    found = Groups()

    def add(name: str, points: Any, members: list[tuple[int, np.ndarray]]) -> None:
        before, own = found.get(name, (_none(), []))
        if len(points):
            found[name] = np.concatenate([before, np.asarray(points, dtype=np.int64)]), own + members

    def add_cells(name: str, members: list[tuple[int, np.ndarray]]) -> None:
        points = [np.asarray(mesh.cells[k].data)[cells].ravel() for k, cells in members]
        add(name, np.concatenate([_none(), *points]), members)

    for name, blocks in mesh.cell_sets.items():
        if not name.startswith("gmsh:"):  # of meshio's own
            add_cells(
                name, [(k, np.asarray(p, dtype=np.int64)) for k, p in enumerate(blocks) if p is not None]
            )
    for key, values in mesh.cell_data.items():
        blocks = [(k, v) for k, v in enumerate(map(_column, values)) if v.ndim == 1]
        named = {}
        if key == "gmsh:physical":
            named = {(int(number), int(dim)): name for name, (number, dim) in mesh.field_data.items()}
        elif key.startswith("gmsh:"):  # shapes of the geometry
            continue
        for number in _numbers(np.concatenate([v for _, v in blocks])) if blocks else ():
            for dim in sorted({mesh.cells[k].dim for k, _ in blocks}):
                own = [(k, np.flatnonzero(v == number)) for k, v in blocks if mesh.cells[k].dim == dim]
                add_cells(named.get((number, dim), f"{key}:{number}"), own)
    for key, values in mesh.point_data.items():
        column = _column(values)
        for number in _numbers(column) if column.ndim == 1 else ():
            add(f"{key}:{number}", np.flatnonzero(column == number), [])
    for name, points in mesh.point_sets.items():  # of a set of points and one of cells each has its own
        found[name] = np.asarray(points, dtype=np.int64), found.get(name, (_none(), []))[1]
    return found


def _column(values: Any) -> np.ndarray:
    """Return an array, and one of a single column as the numbers in it."""
    array = np.asarray(values)
    return array[:, 0] if array.ndim == 2 and array.shape[1] == 1 else array


def _none() -> np.ndarray:
    return np.zeros(0, dtype=np.int64)


def _numbers(values: np.ndarray) -> list[int]:
    """Return the numbers by which an array divides a mesh, none if it is one of measurements."""
    if values.dtype.kind not in "iu":
        return []
    numbers = np.unique(values)
    return numbers.tolist() if len(numbers) <= MOST_NUMBERS else []


if __name__ == "__main__":
    sys.exit(main())
