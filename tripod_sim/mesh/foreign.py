"""Reads one mesh file with meshio, as a program of its own: `python foreign.py FILE`.

Parsers of mesh files print, exit, and loop for ever on files cut short; here they can do no harm. What was read leaves
on standard output as an npz archive: `points` (n, 3), `hexahedra` (m, 8), `kinds` (names of all cell types). With exit
code 1 standard output holds the reason instead.
"""

import io
import os
import sys

import numpy as np


def main() -> int:
    """Read the file that the command line names; return the exit code."""
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)  # what parsers print goes to standard error
        sys.stdout = said = io.StringIO()
        try:
            answer.write(archive(sys.argv[1]))
        except SystemExit:  # meshio prints its reason and exits
            answer.write((said.getvalue().strip() or "not in the format that its name says").encode())
            return 1
        except Exception as error:  # noqa: BLE001 - whatever a parser meets in a file that is not what it says
            answer.write(f"{type(error).__name__}: {error}".encode())
            return 1
    return 0


def archive(path: str) -> bytes:
    """Return what meshio reads from the file at `path`, as an npz archive."""
    import meshio  # noqa: PLC0415

    mesh = meshio.read(path)
    blocks = [np.asarray(b.data).reshape(-1, 8) for b in mesh.cells if b.type == "hexahedron"]
    found = {
        "points": np.asarray(mesh.points, dtype=np.float64),
        "hexahedra": np.concatenate([np.zeros((0, 8), dtype=np.int64), *blocks]).astype(np.int64),
        "kinds": np.array(sorted({block.type for block in mesh.cells}), dtype=str),
    }
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **found)
    return file.getvalue()


if __name__ == "__main__":
    sys.exit(main())
