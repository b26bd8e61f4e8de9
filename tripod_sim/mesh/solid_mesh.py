"""A volume mesh, and the checks that name what is wrong with one."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray, freeze
from tripod_sim.elements.element import Element
from tripod_sim.elements.hexahedron import H8_MODES
from tripod_sim.errors import SceneError
from tripod_sim.mesh.topology import coincident, edge_uses, equal_rows, parts

FACE_TRIANGLES = {
    3: ((0, 1, 2),),
    6: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    4: ((0, 1, 2), (0, 2, 3)),
    8: ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 7), (5, 6, 7)),
    9: ((0, 4, 8), (4, 1, 8), (1, 5, 8), (5, 2, 8), (2, 6, 8), (6, 3, 8), (3, 7, 8), (7, 0, 8)),
}
"""Triangles of a face by its number of nodes: corners in a loop, mid-edge nodes in the same order, centre."""


SAME = 1e-9
"""Nodes closer than this fraction of the size of the mesh share their position."""


CHUNK = 4096
"""Elements whose Jacobians are kept at a time."""


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """Elements of one kind.

    Attributes:
        nodes: Undeformed positions [m], shape (n, 3).
        elements: Node indices, shape (m, nodes of an element), in VTK order.
        kind: The element.
        groups: Nodes of each group of its file, by the group's name; a node made between nodes of a group is one of it.
        cell_groups: Elements of each group of its file that names such cells, by the group's name.
        notes: What users should know of how it was read, one sentence each.
    """

    nodes: FloatArray
    elements: IndexArray
    kind: Element = H8_MODES
    groups: Mapping[str, IndexArray] = field(default_factory=dict)
    cell_groups: Mapping[str, IndexArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, nodes=np.float64, elements=np.int64)

    @cached_property
    def boundary(self) -> IndexArray:
        """Faces that only one element has, nodes as in `kind.faces`, shape (k, nodes of a face)."""
        faces, first, count = self._faces
        return faces[np.sort(first[count == 1])]

    @cached_property
    def surface(self) -> IndexArray:
        """Boundary triangles, shape (k, 3), counter-clockwise seen from outside."""
        boundary = self.boundary
        return np.concatenate([boundary[:, list(t)] for t in FACE_TRIANGLES[boundary.shape[1]]])

    @cached_property
    def overfull_faces(self) -> IndexArray:
        """Faces that more than two elements have, as `boundary`."""
        faces, first, count = self._faces
        return faces[np.sort(first[count > 2])]

    @cached_property
    def _faces(self) -> tuple[IndexArray, IndexArray, IndexArray]:
        """Return the faces of all elements, the first of each set of equal ones, and how many are equal."""
        faces = self.elements[:, np.array(self.kind.faces)].reshape(-1, len(self.kind.faces[0]))
        corners = np.sort(faces[:, : self.kind.face_corners], axis=1)
        first, count = equal_rows(corners)
        return faces, first, count

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
            elements inverted or without volume somewhere (scaled Jacobian not above 1e-6), or given twice; faces of
            more than two elements.
    """
    _check(mesh.kind, mesh.nodes.tobytes(), mesh.elements.tobytes(), source)


@lru_cache(maxsize=8)
def _check(kind: Element, of_nodes: bytes, of_elements: bytes, source: str) -> None:
    """Check nodes (n, 3) [m] and elements (m, k): whoever builds one mesh often, checks it once."""
    nodes = np.frombuffer(of_nodes).reshape(-1, 3)
    mesh = SolidMesh(nodes, np.frombuffer(of_elements, dtype=np.int64).reshape(-1, kind.size), kind)
    if not len(mesh.elements):
        raise SceneError(f"{source}: the mesh has no elements")
    if (bad := np.flatnonzero(~np.isfinite(mesh.nodes).all(axis=1))).size:
        raise SceneError(f"{source}: positions of nodes {names_of(bad)} are not finite")
    outside = ((mesh.elements < 0) | (mesh.elements >= len(mesh.nodes))).any(axis=1)
    if (bad := np.flatnonzero(outside)).size:
        raise SceneError(f"{source}: elements {names_of(bad)} name nodes outside 0..{len(mesh.nodes) - 1}")
    if (bad := np.setdiff1d(np.arange(len(mesh.nodes)), mesh.elements)).size:
        raise SceneError(f"{source}: nodes {names_of(bad)} belong to no element; remove them")
    with np.errstate(over="ignore"):
        shared = coincident(mesh.nodes, SAME * np.ptp(mesh.nodes, axis=0).max())
    if shared.size:
        raise SceneError(
            f"{source}: nodes {names_of(shared)} have the same position as another node; merge them"
        )
    quality = element_quality(mesh)
    if (bad := np.flatnonzero(~(quality > 1e-6))).size:
        inverted = np.flatnonzero(quality < -1e-6)
        if inverted.size:
            raise SceneError(
                f"{source}: elements {names_of(inverted)} are inverted; correct their node order or geometry"
            )
        raise SceneError(
            f"{source}: elements {names_of(bad)} have no volume at some point; correct the geometry"
        )
    _, inverse, count = np.unique(
        np.sort(mesh.elements, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    if (bad := np.flatnonzero(count[inverse.ravel()] > 1)).size:
        raise SceneError(
            f"{source}: elements {names_of(bad)} have the same nodes as another element; remove one of them"
        )
    if len(mesh.overfull_faces):
        bad = np.unique(mesh.overfull_faces[:, : mesh.kind.face_corners])
        raise SceneError(
            f"{source}: faces at nodes {names_of(bad)} belong to more than two elements; elements overlap "
            "there: correct the mesh"
        )


def check_boundary(mesh: SolidMesh, source: str) -> None:
    """Refuse a mesh whose boundary cannot touch anything: where elements share an edge only, it is no surface.

    Args:
        mesh: A mesh that `check_mesh` accepts.
        source: Where it comes from, for the message.

    Raises:
        SceneError: elements touch along an edge only; the message names the nodes and what to do.
    """
    edges, uses = edge_uses(mesh.boundary[:, : mesh.kind.face_corners])
    if (bad := edges[uses > 2]).size:
        raise SceneError(
            f"{source}: contact needs a closed surface, but elements touch along an edge only at nodes "
            f"{names_of(np.unique(bad))}: fill the gap there with elements, give each side nodes of its own, or leave "
            "out [contact]"
        )


def check_held(mesh: SolidMesh, bodies: Sequence[IndexArray], held: IndexArray, source: str) -> None:
    """Refuse a mesh for a static simulation if a part of it is not held.

    Parts are connected by shared nodes and by rigid bodies.

    Args:
        mesh: A mesh that `check_mesh` accepts.
        bodies: Nodes of each rigid body.
        held: Nodes that are fixed or driven.
        source: Where the mesh comes from, for the message.

    Raises:
        SceneError: a part without held nodes, named by some of its nodes, and how many parts there are.
    """
    label = parts([mesh.elements, *(np.asarray(body)[None] for body in bodies)], len(mesh.nodes))
    loose = np.setdiff1d(label, label[held])
    if loose.size:
        count = len(np.unique(label))
        raise SceneError(
            f"{source}: the mesh has {count} part{('s' if count > 1 else '')}, and nothing holds the one "
            f"with nodes {names_of(np.flatnonzero(label == loose[0]))}. Without inertia every part must "
            "be held: add [[fixed]] there, or [inertia]"
        )


def element_quality(mesh: SolidMesh) -> FloatArray:
    """Return the smallest scaled Jacobian of each element, shape (m,): 1 is a brick, 0 is flat, negative is inside out.

    At nodes and quadrature points, det J over the product of the lengths of J's columns.
    """
    kind = mesh.kind
    points = np.concatenate([kind.reference, kind.points])
    quality = np.empty(len(mesh.elements))
    for start in range(0, len(quality), CHUNK):
        part = slice(start, start + CHUNK)
        jacobian = kind.jacobians(mesh.nodes[mesh.elements[part]], points)
        length = np.linalg.norm(jacobian, axis=2).prod(axis=2)
        volume = np.linalg.det(jacobian)
        ratio = np.divide(volume, length, out=np.zeros_like(volume), where=length > 0)
        quality[part] = ratio.min(axis=1)
    return quality
