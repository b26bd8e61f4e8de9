"""From linear elements to other elements on the same cells."""

from collections.abc import Mapping
from itertools import groupby

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import SolidMesh


def convert(mesh: SolidMesh, name: str) -> SolidMesh:
    """Return a mesh of the element `name` on the cells of a mesh of linear elements of one kind.

    Hexahedra are divided as the element has it; neighbouring cells agree when their local axes point alike across the
    shared face. Quadratic elements: nodes halfway, straight
    edges.

    Raises:
        SceneError: the mesh has several kinds of elements; its cells do not become such elements; hexahedra are to be
            divided and local axes of neighbouring cells do not point alike.
    """
    kind = ELEMENTS[name]
    nodes, elements, groups = mesh.nodes, np.asarray(mesh.elements), dict(mesh.groups)
    cell_groups = mesh.cell_groups
    if (before := mesh.kind.plain.cell) != (cell := kind.plain.cell):
        if before not in kind.plain.divisions:
            raise SceneError(
                f"mesh.element is {name!r}, but {before} cells cannot be divided into {cell} cells; name an element "
                f"of {before} cells"
            )
        parts = np.array(kind.plain.divisions[before])
        elements = elements[:, parts].reshape(-1, kind.corners)
        cell_groups = divided_groups(cell_groups, len(parts))
        if len(SolidMesh.of(nodes, elements, kind.plain).surface) != len(mesh.surface):
            raise SceneError(
                f"mesh.element is {name!r}, but the hexahedra of this mesh cannot be divided into {cell} cells: "
                "the axes of neighbouring cells differ; take a hexahedral mesh.element, such as h8_modes, or "
                f"a mesh of {cell} cells"
            )
    for _, corners in groupby(kind.centres, len):  # those of edges, of faces, of the cell
        nodes, elements = _add_centres(nodes, elements, tuple(corners), groups)
    return SolidMesh.of(nodes, elements, kind, groups, cell_groups)


def linear(mesh: SolidMesh) -> SolidMesh:
    """Return the mesh of linear elements on the corners of a mesh of one kind; their edges are straight."""
    kind = mesh.kind
    used, corners = np.unique(mesh.elements[:, : kind.corners], return_inverse=True)
    groups = {name: np.flatnonzero(np.isin(used, group)) for name, group in mesh.groups.items()}
    return SolidMesh.of(
        mesh.nodes[used], corners.reshape(-1, kind.corners), kind.plain, groups, mesh.cell_groups
    )


def divided_groups(groups: Mapping[str, IndexArray], count: int) -> dict[str, IndexArray]:
    """Return groups of elements of which each is divided into `count` that follow each other."""
    return {name: (count * group[:, None] + np.arange(count)).ravel() for name, group in groups.items()}


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
