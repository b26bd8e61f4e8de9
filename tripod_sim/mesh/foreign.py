"""Reads one mesh file with meshio, as a program of its own: `python foreign.py FILE 20 tetra=4 hexahedron=8`.

Parsers of mesh files print, exit, and loop for ever on files cut short; here they can do no harm. What was read leaves
on standard output as an npz archive: `points` (n, 3), `kinds` (names of all cell types), and one array per kind of cell
that the command line names with its size, (m, nodes of a cell). Groups of the file leave as `groups` (names) and one
array of points each, `group 0` and so on. With exit code 1 standard output holds the reason
instead. Memory is bounded where the system can, and so is the processor time, by the second word [s]: beyond it the
program is ended by SIGXCPU. Time that passes while others have the processor does not count.
"""

import contextlib
import io
import os
import sys
from typing import Any

import numpy as np

MAX_MEMORY = 4 << 30
"""Address space of this program [bytes]: a file may claim, or expand to, far more than its size."""

MAX_ANSWER = 1 << 30
"""Bytes of points and cells."""

BROKEN = "it is cut short or damaged, or not in the format that its name says"

MOST_NUMBERS = 100
"""Different numbers of an array that divides a mesh into groups."""


def main() -> int:
    """Read the file that the command line names; return the exit code."""
    with contextlib.suppress(ImportError, ValueError, OSError):  # Windows has no limits
        import resource  # noqa: PLC0415

        resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[2]), int(sys.argv[2]) + 1))
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)  # what parsers print goes to standard error
        sys.stdout = said = io.StringIO()
        try:
            answer.write(archive(sys.argv[1], sys.argv[3:]))
        except SystemExit:  # meshio prints its reason and exits
            why = said.getvalue().strip()
            answer.write((f"{BROKEN} ({why})" if why else BROKEN).encode())
            return 1
        except Exception as error:  # noqa: BLE001 - whatever a parser meets in a file that is not what it says
            answer.write(reason(error).encode())
            return 1
    return 0


def reason(error: Exception) -> str:
    """Return why a file is not read: what a parser stumbled over in it would tell nobody more than `BROKEN`."""
    import meshio  # noqa: PLC0415

    if isinstance(error, meshio.ReadError):
        return str(error)
    lacking = isinstance(error, MemoryError | ImportError | OSError)
    return f"{type(error).__name__}: {error}" if lacking else BROKEN


def archive(path: str, wanted: list[str]) -> bytes:
    """Return what meshio reads from the file at `path`, as an npz archive."""
    import meshio  # noqa: PLC0415

    mesh = meshio.read(path)
    found = {
        "points": np.asarray(mesh.points, dtype=np.float64),
        "kinds": np.array(sorted({block.type for block in mesh.cells}), dtype=str),
    }
    for kind, _, size in (word.partition("=") for word in wanted):
        blocks = [np.asarray(b.data).reshape(-1, int(size)) for b in mesh.cells if b.type == kind]
        if blocks:
            found[kind] = np.concatenate(blocks).astype(np.int64)
    groups = named_points(mesh)
    found["groups"] = np.array(list(groups), dtype=str)
    found |= {f"group {i}": points for i, points in enumerate(groups.values())}
    if (total := sum(a.nbytes for a in found.values())) > MAX_ANSWER:
        raise MemoryError(f"points and cells take {total} bytes; at most {MAX_ANSWER} are read")
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **found)
    return file.getvalue()


def named_points(mesh: Any) -> dict[str, np.ndarray]:
    """Return the points of each group of a mesh of meshio's, shape (k,).

    Groups are the named sets of points and of cells of the file (gmsh's physical groups, Abaqus' NSET and ELSET), and
    of arrays of whole numbers on cells or points, as VTK files have them, `NAME:NUMBER`.
    """
    found = {name: np.asarray(points) for name, points in mesh.point_sets.items()}
    for name, blocks in mesh.cell_sets.items():
        if not name.startswith("gmsh:"):  # of meshio's own
            found[name] = _points(
                [b.data[p] for b, p in zip(mesh.cells, blocks, strict=True) if p is not None]
            )
    for key, values in mesh.cell_data.items():
        pairs = [
            (block, np.asarray(v)) for block, v in zip(mesh.cells, values, strict=True) if np.ndim(v) == 1
        ]
        named = {}
        if key == "gmsh:physical":
            named = {(int(number), int(dim)): name for name, (number, dim) in mesh.field_data.items()}
        elif key.startswith("gmsh:"):  # shapes of the geometry
            continue
        for number in _numbers(np.concatenate([v for _, v in pairs])) if pairs else ():
            for dim in sorted({block.dim for block, _ in pairs}):
                name = named.get((number, dim), f"{key}:{number}")
                cells = [block.data[v == number] for block, v in pairs if block.dim == dim]
                found[name] = np.concatenate([found.get(name, _points([])), _points(cells)])
    for key, values in mesh.point_data.items():
        for number in _numbers(np.asarray(values)) if np.ndim(values) == 1 else ():
            found[f"{key}:{number}"] = np.flatnonzero(np.asarray(values) == number)
    return {name: np.unique(points).astype(np.int64) for name, points in found.items() if len(points)}


def _points(cells: list[Any]) -> np.ndarray:
    """Return the points of some cells."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *(np.asarray(c).ravel() for c in cells)])


def _numbers(values: np.ndarray) -> list[int]:
    """Return the numbers by which an array divides a mesh, none if it is one of measurements."""
    if values.dtype.kind not in "iu":
        return []
    numbers = np.unique(values)
    return numbers.tolist() if len(numbers) <= MOST_NUMBERS else []


if __name__ == "__main__":
    sys.exit(main())
