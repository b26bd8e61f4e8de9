"""From linear hexahedra or tetrahedra to other elements on the same cells."""

from collections.abc import Mapping, Sequence
from itertools import permutations

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.elements import quadratic_hexahedron, tetrahedron
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.hexahedron import CORNERS
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import SolidMesh


def convert(mesh: SolidMesh, name: str) -> SolidMesh:
    """Return a mesh of the element `name` on the cells of a mesh of eight-node hexahedra or four-node tetrahedra.

    Tetrahedra on hexahedra: six to a cell (Kuhn's division along the diagonal from node 0 to node 6); neighbouring
    cells agree when their local axes point alike across the shared face. Quadratic elements: nodes halfway, straight
    edges.

    Raises:
        SceneError: hexahedra are to be divided and local axes of neighbouring cells do not point alike.
    """
    kind = ELEMENTS[name]
    nodes, elements, groups = mesh.nodes, np.asarray(mesh.elements), dict(mesh.groups)
    cell_groups = mesh.cell_groups
    if kind.corners == 4 < elements.shape[1]:
        elements = elements[:, _kuhn()].reshape(-1, 4)
        cell_groups = divided_groups(cell_groups, len(_kuhn()))
        if len(SolidMesh(nodes, elements, ELEMENTS["t4"]).boundary) != 2 * len(mesh.boundary):
            raise SceneError(
                f"mesh.element is {name!r}, but the hexahedra of this mesh cannot be divided into tetrahedra: "
                "the axes of neighbouring cells differ; take a hexahedral mesh.element, such as h8_modes, or "
                "a tetrahedral mesh"
            )
    if kind.size in (10, 20, 27):
        quadratic = tetrahedron if kind.corners == 4 else quadratic_hexahedron
        nodes, elements = _add_centres(nodes, elements, quadratic.EDGES, groups)
        if kind.size == 27:
            nodes, elements = _add_centres(nodes, elements, quadratic_hexahedron.FACE_CENTRES, groups)
            nodes, elements = _add_centres(nodes, elements, (tuple(range(8)),), groups)
    return SolidMesh(nodes, elements, kind, groups, cell_groups)


def divided_groups(groups: Mapping[str, IndexArray], count: int) -> dict[str, IndexArray]:
    """Return groups of elements of which each is divided into `count` that follow each other."""
    return {name: (count * group[:, None] + np.arange(count)).ravel() for name, group in groups.items()}


def _kuhn() -> IndexArray:
    """Return the six tetrahedra of a cell as its node numbers, shape (6, 4), each right-handed."""
    number = {tuple(corner): i for i, corner in enumerate(((CORNERS + 1) // 2).astype(int).tolist())}
    found = []
    for order in permutations(range(3)):
        corner, path = [0, 0, 0], [0]
        for axis in order:
            corner[axis] = 1
            path.append(number[tuple(corner)])
        found.append(right_handed(path, CORNERS))
    return np.array(found)


def right_handed(nodes: Sequence[int], places: FloatArray) -> list[int]:
    """Return the four nodes of a tetrahedron in an order that makes its volume positive; `places`: by node, (n, 3)."""
    a, b, c, d = nodes
    legs = places[[b, c, d]] - places[a]
    return [a, b, c, d] if np.linalg.det(legs) > 0 else [a, c, b, d]


def _add_centres(
    nodes: FloatArray,
    elements: IndexArray,
    parts: tuple[tuple[int, ...], ...],
    groups: dict[str, IndexArray],
) -> tuple[FloatArray, IndexArray]:
    """Add one node at the centre of each of some parts of an element's nodes; elements share those of equal parts.

    To `groups`, nodes by name, those nodes are added whose part is in the group.
    """
    members = elements[:, np.array(parts)]  # (m, g, k)
    keys = np.sort(members.reshape(-1, members.shape[2]), axis=1)
    unique, inverse = np.unique(keys, axis=0, return_inverse=True)
    added = len(nodes) + inverse.reshape(len(elements), len(parts))
    for name, group in groups.items():
        inside = np.flatnonzero(np.isin(unique, group).all(axis=1))
        groups[name] = np.concatenate([group, len(nodes) + inside])
    return np.concatenate([nodes, nodes[unique].mean(axis=1)]), np.hstack([elements, added])
