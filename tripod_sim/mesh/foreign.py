"""Reads one mesh file with meshio, as a program of its own: `python foreign.py FILE 20 tetra=4 hexahedron=8`.

Parsers of mesh files print, exit, and loop for ever on files cut short; here they can do no harm. What was read leaves
on standard output as an npz archive: `points` (n, 3), `kinds` (names of all cell types), and one array per kind of cell
that the command line names with its size, (m, nodes of a cell). With exit code 1 standard output holds the reason
instead. Memory is bounded where the system can, and so is the processor time, by the second word [s]: beyond it the
program is ended by SIGXCPU. Time that passes while others have the processor does not count.
"""

import contextlib
import io
import os
import sys

import numpy as np

MAX_MEMORY = 4 << 30
"""Address space of this program [bytes]: a file may claim, or expand to, far more than its size."""

MAX_ANSWER = 1 << 30
"""Bytes of points and cells."""


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
            answer.write((said.getvalue().strip() or "not in the format that its name says").encode())
            return 1
        except Exception as error:  # noqa: BLE001 - whatever a parser meets in a file that is not what it says
            answer.write(f"{type(error).__name__}: {error}".encode())
            return 1
    return 0


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
    if (total := sum(a.nbytes for a in found.values())) > MAX_ANSWER:
        raise MemoryError(f"points and cells take {total} bytes; at most {MAX_ANSWER} are read")
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **found)
    return file.getvalue()


if __name__ == "__main__":
    sys.exit(main())
