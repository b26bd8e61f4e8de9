"""Dividing every cell of a mesh into eight: the edges are halved."""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.hexahedron import CORNERS
from tripod_sim.mesh.convert import convert_hexahedra, convert_tetrahedra
from tripod_sim.mesh.solid_mesh import SolidMesh

IndexArray = NDArray[np.int64]

AT_CORNERS = ((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3))
INSIDE = ((6, 8, 4, 5), (6, 8, 5, 9), (6, 8, 9, 7), (6, 8, 7, 4))
"""Parts of a ten-node tetrahedron: those at its corners, and those about the line from node 6 to node 8 [Bey1995]."""


def refine(mesh: SolidMesh) -> SolidMesh:
    """Return a mesh of the same element with eight times as many, every cell divided at the middles of its edges.

    The nodes of the corners stay where they are; edges become straight.
    """
    kind = mesh.kind
    used, corners = np.unique(np.asarray(mesh.elements)[:, : kind.corners], return_inverse=True)
    nodes, corners = mesh.nodes[used], corners.reshape(-1, kind.corners)
    groups = {name: np.flatnonzero(np.isin(used, group)) for name, group in mesh.groups.items()}
    if kind.corners == 4:
        fine = convert_tetrahedra(SolidMesh(nodes, corners, ELEMENTS["t4"], groups), "t10")
        parts = np.array([_right_handed(p, ELEMENTS["t10"].reference) for p in AT_CORNERS + INSIDE])
        cells = np.asarray(fine.elements)[:, parts].reshape(-1, 4)
        divided = SolidMesh(fine.nodes, cells, ELEMENTS["t4"], fine.groups)
        return convert_tetrahedra(divided, kind.name)
    fine = convert_hexahedra(SolidMesh(nodes, corners, ELEMENTS["h8"], groups), "h27")
    cells = np.asarray(fine.elements)[:, _octants()].reshape(-1, 8)
    divided = SolidMesh(fine.nodes, cells, ELEMENTS["h8"], fine.groups)
    return convert_hexahedra(divided, kind.name)


def _right_handed(part: tuple[int, ...], places: NDArray[np.float64]) -> tuple[int, ...]:
    """Return the nodes of a tetrahedron so that its volume is positive; `places`: of the nodes, shape (10, 3)."""
    a, b, c, d = (places[i] for i in part)
    return part if np.linalg.det([b - a, c - a, d - a]) > 0 else (part[0], part[2], part[1], part[3])


def _octants() -> IndexArray:
    """Return the eight parts of a 27-node hexahedron as its node numbers, shape (8, 8)."""
    places = {tuple(p): i for i, p in enumerate(np.round(ELEMENTS["h27"].reference).astype(int).tolist())}
    middles = (CORNERS[:, None] + CORNERS[None]) / 2
    return np.array([[places[tuple(m)] for m in row] for row in middles.astype(int).tolist()])
