"""Dividing every cell of a mesh into eight: the edges are halved."""

from typing import Final

import numpy as np

from tripod_host.arrays import IndexArray
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.hexahedron import CORNERS
from tripod_sim.elements.tetrahedron import right_handed
from tripod_sim.errors import SceneError
from tripod_sim.mesh.convert import convert, divided_groups, linear
from tripod_sim.mesh.solid_mesh import SolidMesh

AT_CORNERS = ((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3))
INSIDE = ((6, 8, 4, 5), (6, 8, 5, 9), (6, 8, 9, 7), (6, 8, 7, 4))
"""Parts of a ten-node tetrahedron: those at its corners, and those about the line from node 6 to node 8 [Bey1995]."""


def refine(mesh: SolidMesh) -> SolidMesh:
    """Return a mesh of the same element with eight times as many, every cell divided at the middles of its edges.

    The nodes of the corners stay where they are, and those in the middles of edges and faces that a part has as
    corners; edges become straight.

    Raises:
        SceneError: there is no such division of the mesh's cells, or it has several kinds of them.
    """
    if bad := [block.kind.cell for block in mesh.blocks if block.kind.plain.cell not in HALVED]:
        raise SceneError(
            f"mesh.refine cannot halve the edges of {', '.join(bad)} cells; refine the mesh in the program that made "
            "it, and set mesh.refine = 0"
        )
    if len(mesh.blocks) > 1:
        raise SceneError(
            f"mesh.refine cannot halve the edges of a mesh of several kinds of elements ({mesh.kinds}); refine the "
            "mesh in the program that made it, and set mesh.refine = 0"
        )
    kind, plain = mesh.kind, mesh.kind.plain
    full, parts = HALVED[plain.cell]
    fine = mesh if kind.name == full else convert(linear(mesh), full)
    cells = np.asarray(fine.elements)[:, parts()]
    cell_groups = divided_groups(mesh.cell_groups, cells.shape[1])
    cells = cells.reshape(-1, kind.corners)
    return convert(SolidMesh.of(fine.nodes, cells, plain, fine.groups, cell_groups), kind.name)


def _tetrahedra() -> IndexArray:
    """Return the eight parts of a ten-node tetrahedron as its node numbers, shape (8, 4)."""
    return np.array([right_handed(part, ELEMENTS["t10"].reference) for part in AT_CORNERS + INSIDE])


def _octants() -> IndexArray:
    """Return the eight parts of a 27-node hexahedron as its node numbers, shape (8, 8)."""
    places = {tuple(p): i for i, p in enumerate(np.round(ELEMENTS["h27"].reference).astype(int).tolist())}
    middles = (CORNERS[:, None] + CORNERS[None]) / 2
    return np.array([[places[tuple(m)] for m in row] for row in middles.astype(int).tolist()])


HALVED: Final = {"tetra": ("t10", _tetrahedra), "hexahedron": ("h27", _octants)}
"""Of linear cells, the element with nodes at all the middles that the parts need, and the parts as its node numbers."""
