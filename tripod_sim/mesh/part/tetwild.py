"""Fills a closed surface with tetrahedra by fTetWild, as a program: `tetwild.py PARENT IN.npz OUT.npz`.

IN.npz has `points` (n, 3), `triangles` (m, 3), `size`, the length of an edge, and `distance`, how far the new surface
may be from the old one. OUT.npz has `points` (k, 3) and `cells` (l, 4). With exit code 1 standard output holds the
reason instead. The program ends with the process PARENT.
"""

import importlib.util
import sys
from types import ModuleType

import numpy as np

from tripod_host.parent import helped

MANY = 100_000
"""Triangles from which on the surface is simplified first: below that, it takes longer than it saves."""


def work(source: str, target: str) -> None:
    """Read, fill, write."""
    with np.load(source, allow_pickle=False) as given:
        points, triangles = given["points"], given["triangles"]
        size, distance = float(given["size"]), float(given["distance"])
    if importlib.util.find_spec("pyvista") is None:  # which it imports for its pictures, and does not require
        sys.modules["pyvista"] = ModuleType("pyvista")
    from pytetwild import tetrahedralize  # noqa: PLC0415 - an optional package

    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    nodes, cells = tetrahedralize(
        points,
        triangles.astype(np.int32),
        edge_length_abs=size,
        epsilon=distance / diagonal,
        simplify=len(triangles) > MANY,
        num_threads=1,  # with more it makes another mesh each time
    )
    np.savez(target, points=nodes, cells=cells.astype(np.int64))


if __name__ == "__main__":
    sys.exit(helped(int(sys.argv[1]), lambda: work(*sys.argv[2:])))
