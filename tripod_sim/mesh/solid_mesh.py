"""A volume mesh of hexahedra, and the checks that name what is wrong with one."""

import zlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tripod_sim.errors import SceneError

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

HEXAHEDRON_FACES = np.array(
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
)
"""Faces of an eight-node hexahedron, each counter-clockwise seen from outside; nodes in VTK order."""


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """Eight-node hexahedra.

    Attributes:
        nodes: Undeformed positions [m], shape (n, 3).
        elements: Node indices, shape (m, 8), in VTK order (bottom face counter-clockwise from above, then top face).
    """

    nodes: FloatArray
    elements: IndexArray

    def __post_init__(self) -> None:
        for name, kind in (("nodes", np.float64), ("elements", np.int64)):
            array = np.array(getattr(self, name), dtype=kind)
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @cached_property
    def surface(self) -> IndexArray:
        """Boundary triangles, shape (k, 3), counter-clockwise seen from outside."""
        faces = self.elements[:, HEXAHEDRON_FACES].reshape(-1, 4)
        _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        quads = faces[np.sort(first[count == 1])]
        return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])

    @cached_property
    def topology_id(self) -> int:
        """CRC-32 of node count and connectivity."""
        return zlib.crc32(np.concatenate([[len(self.nodes)], self.elements.ravel()]).astype("<i8").tobytes())


def names_of(indices: IndexArray, most: int = 8) -> str:
    """Return element or node numbers for a message, the first few of them."""
    shown = ", ".join(str(i) for i in indices[:most])
    return f"{shown} and {len(indices) - most} more" if len(indices) > most else shown


def check_mesh(mesh: SolidMesh, source: str) -> None:
    """Refuse a mesh that no solver can use, and name the offenders.

    Args:
        mesh: The mesh.
        source: Where it comes from, for the message.

    Raises:
        SceneError: no elements; positions not finite; node numbers out of range; unreferenced nodes; coincident nodes;
            elements inverted or without volume at a corner (scaled Jacobian not above 1e-6), or given twice.
    """
    if not len(mesh.elements):
        raise SceneError(f"{source}: the mesh has no hexahedra")
    if (bad := np.flatnonzero(~np.isfinite(mesh.nodes).all(axis=1))).size:
        raise SceneError(f"{source}: positions of nodes {names_of(bad)} are not finite")
    outside = ((mesh.elements < 0) | (mesh.elements >= len(mesh.nodes))).any(axis=1)
    if (bad := np.flatnonzero(outside)).size:
        raise SceneError(f"{source}: elements {names_of(bad)} name nodes outside 0..{len(mesh.nodes) - 1}")
    if (bad := np.setdiff1d(np.arange(len(mesh.nodes)), mesh.elements)).size:
        raise SceneError(f"{source}: nodes {names_of(bad)} belong to no element")
    scale = np.ptp(mesh.nodes, axis=0).max()
    rounded = (
        np.round((mesh.nodes - mesh.nodes.min(axis=0)) / (1e-9 * scale)).astype(np.int64)
        if scale > 0
        else np.zeros((len(mesh.nodes), 3))
    )
    _, inverse, count = np.unique(rounded, axis=0, return_inverse=True, return_counts=True)
    if (bad := np.flatnonzero(count[inverse.ravel()] > 1)).size:
        raise SceneError(f"{source}: nodes {names_of(bad)} share their position with another node")
    quality = corner_quality(mesh)
    if (bad := np.flatnonzero(~(quality > 1e-6))).size:
        inverted = np.flatnonzero(quality < -1e-6)
        if inverted.size:
            raise SceneError(f"{source}: elements {names_of(inverted)} are inverted (node order or geometry)")
        raise SceneError(f"{source}: elements {names_of(bad)} have no volume at a corner")
    _, inverse, count = np.unique(
        np.sort(mesh.elements, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    if (bad := np.flatnonzero(count[inverse.ravel()] > 1)).size:
        raise SceneError(f"{source}: elements {names_of(bad)} have the nodes of another element")


CORNER_NEIGHBOURS = np.array(
    [[1, 3, 4], [2, 0, 5], [3, 1, 6], [0, 2, 7], [7, 5, 0], [4, 6, 1], [5, 7, 2], [6, 4, 3]]
)
"""Neighbours of each corner of a hexahedron, such that their edges are right-handed in a valid element."""


def corner_quality(mesh: SolidMesh) -> FloatArray:
    """Return the smallest scaled Jacobian of the corners of each element, shape (m,); 1 is a brick, 0 is flat."""
    corners = mesh.nodes[mesh.elements]
    edges = corners[:, CORNER_NEIGHBOURS] - corners[:, :, None]
    volume = np.einsum("eci,eci->ec", edges[:, :, 0], np.cross(edges[:, :, 1], edges[:, :, 2]))
    length = np.linalg.norm(edges, axis=3).prod(axis=2)
    ratio = np.divide(volume, length, out=np.zeros_like(volume), where=length > 0)
    return np.asarray(ratio.min(axis=1))
