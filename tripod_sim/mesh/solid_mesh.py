"""A volume mesh, and the checks that name what is wrong with one."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np

from tripod_host.arrays import Array, FloatArray, IndexArray, freeze
from tripod_sim.elements.element import Element, node_volumes
from tripod_sim.elements.faces import FaceShape
from tripod_sim.elements.hexahedron import H8_MODES
from tripod_sim.errors import SceneError
from tripod_sim.mesh.topology import coincident, edge_uses, equal_rows, parts

SAME = 1e-9
"""Nodes closer than this fraction of the size of the mesh share their position."""


CHUNK = 4096
"""Elements whose Jacobians are kept at a time."""


class Block(NamedTuple):
    """The elements of one kind of a mesh: their nodes, shape (m, nodes of an element), in VTK order."""

    kind: Element
    elements: IndexArray


class Faces(NamedTuple):
    """Faces of one shape of the elements of one kind.

    Attributes:
        kind: The element.
        own: Which of its nodes those of a face are, in the first of its faces with that shape.
        shape: Of the faces.
        nodes: Of each face, in the order of `Element.faces`, shape (k, nodes of a face).
    """

    kind: Element
    own: tuple[int, ...]
    shape: FaceShape
    nodes: IndexArray

    @property
    def corners(self) -> IndexArray:
        """Corners of each face in a loop, shape (k, corners)."""
        return self.nodes[:, : self.shape.corners]

    def functions(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return N_a, dN_a/ds and dN_a/dt at the quadrature points of the shape, each of shape (q, nodes of a face).

        s and t are the coordinates of the face; the normal x_s × x_t points out of the element.
        """
        own, shape = list(self.own), self.shape
        corners = self.kind.reference[own[: shape.corners]]
        points, (along, across) = shape.shares @ corners, shape.slopes @ corners
        slopes = self.kind.gradients(points)[:, own]
        first, second = (np.einsum("qaj,qj->qa", slopes, way) for way in (along, across))
        return self.kind.functions(points)[:, own], first, second


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """Elements of one kind or of several; they are numbered through, block after block.

    Attributes:
        nodes: Undeformed positions [m], shape (n, 3).
        blocks: The elements, by their kind.
        groups: Nodes of each group of its file, by the group's name; a node made between nodes of a group is one of it.
        cell_groups: Elements of each group of its file that names such cells, by the group's name.
        notes: What users should know of how it was read, one sentence each.
    """

    nodes: FloatArray
    blocks: tuple[Block, ...]
    groups: Mapping[str, IndexArray] = field(default_factory=dict)
    cell_groups: Mapping[str, IndexArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, nodes=np.float64)
        blocks = tuple(Block(kind, _read_only(elements)) for kind, elements in self.blocks)
        object.__setattr__(self, "blocks", blocks)

    @classmethod
    def of(
        cls,
        nodes: FloatArray,
        elements: IndexArray,
        kind: Element = H8_MODES,
        groups: Mapping[str, IndexArray] | None = None,
        cell_groups: Mapping[str, IndexArray] | None = None,
    ) -> "SolidMesh":
        """Return a mesh of elements (m, nodes of an element) of one kind."""
        return cls(nodes, (Block(kind, elements),), groups or {}, cell_groups or {})

    @property
    def kind(self) -> Element:
        """The element of a mesh that has one kind. Raises SceneError where it has several."""
        return self._only.kind

    @property
    def elements(self) -> IndexArray:
        """The elements of a mesh that has one kind. Raises SceneError where it has several."""
        return self._only.elements

    @property
    def _only(self) -> Block:
        if len(self.blocks) > 1:
            raise SceneError(
                f"the mesh has elements of several kinds ({self.kinds}); this needs a mesh with elements of one kind"
            )
        return self.blocks[0]

    @property
    def kinds(self) -> str:
        """Names of its kinds of elements, for messages."""
        return ", ".join(block.kind.name for block in self.blocks)

    @property
    def count(self) -> int:
        """Number of elements."""
        return sum(len(block.elements) for block in self.blocks)

    @cached_property
    def boundary(self) -> tuple[Faces, ...]:
        """Faces that only one element has."""
        first, count = self._equal_faces
        return self._chosen(np.sort(first[count == 1]))

    @cached_property
    def surface(self) -> IndexArray:
        """Boundary triangles, shape (k, 3), counter-clockwise seen from outside."""
        found = [f.nodes[:, list(t)] for f in self.boundary for t in f.shape.triangles]
        return np.concatenate(found)

    def faces_within(self, nodes: IndexArray) -> list[Faces]:
        """Return the faces of the boundary whose nodes are all among `nodes`; there may be none."""
        found = [
            faces._replace(nodes=faces.nodes[np.isin(faces.nodes, nodes).all(axis=1)])
            for faces in self.boundary
        ]
        return [faces for faces in found if len(faces.nodes)]

    @cached_property
    def overfull_nodes(self) -> IndexArray:
        """Corners of faces that more than two elements have, ascending."""
        first, count = self._equal_faces
        found = self._chosen(first[count > 2])
        return np.unique(np.concatenate([f.corners.ravel() for f in found]))

    @cached_property
    def unmatched_nodes(self) -> IndexArray:
        """Corners of faces at which elements of two kinds do not fit together, ascending.

        Faces with the same corners have other nodes beyond these, or triangles lie on a quadrilateral.
        """
        if len(self._faces) < 2:
            return np.zeros(0, dtype=np.int64)
        found = [np.zeros(0, dtype=np.int64)]
        every, corners = self._rows(whole=True), self._rows()
        order = np.lexsort(corners.T)  # faces with the same corners follow each other
        same = (corners[order[1:]] == corners[order[:-1]]).all(axis=1)
        other = (every[order[1:]] != every[order[:-1]]).any(axis=1)
        found.append(corners[order[1:][same & other]].ravel())
        triangles = [f.corners for f in self.boundary if f.shape.corners == 3]
        larger = [f.corners for f in self.boundary if f.shape.corners > 3]
        parts_of = [f[:, three] for f in larger for three in combinations(range(f.shape[1]), 3)]
        if triangles and parts_of:
            rows = np.sort(np.concatenate([*triangles, *parts_of]), axis=1)
            first, count = equal_rows(rows)
            found.append(rows[first[count > 1]].ravel())
        nodes = np.unique(np.concatenate(found))
        return nodes[nodes >= 0]

    @cached_property
    def _faces(self) -> tuple[Faces, ...]:
        """The faces of all elements, by kind and shape."""
        found = []
        for kind, elements in self.blocks:
            for shape in dict.fromkeys(face.shape for face in kind.faces):
                own = [face.nodes for face in kind.faces if face.shape is shape]
                found.append(Faces(kind, own[0], shape, elements[:, np.array(own)].reshape(-1, shape.size)))
        return tuple(found)

    @cached_property
    def _equal_faces(self) -> tuple[IndexArray, IndexArray]:
        """Return of all faces, numbered through, the first of each set of equal ones, and how many are equal."""
        return equal_rows(self._rows())

    def _rows(self, *, whole: bool = False) -> IndexArray:
        """Return the sorted corners of all faces, or all their nodes, -1 before those of the smaller."""
        rows = [np.sort(f.nodes if whole else f.corners, axis=1) for f in self._faces]
        widest = max(r.shape[1] for r in rows)
        padded = [np.pad(r, ((0, 0), (widest - r.shape[1], 0)), constant_values=-1) for r in rows]
        return np.concatenate(padded)

    def _chosen(self, numbers: IndexArray) -> tuple[Faces, ...]:
        """Return some of all faces, which are numbered through."""
        found, start = [], 0
        for faces in self._faces:
            end = start + len(faces.nodes)
            own = numbers[(start <= numbers) & (numbers < end)] - start
            found.append(faces._replace(nodes=faces.nodes[own]))
            start = end
        return tuple(found)

    @cached_property
    def topology_id(self) -> int:
        """CRC-32 of node count and connectivity."""
        words = [np.array([len(self.nodes)]), *(block.elements.ravel() for block in self.blocks)]
        return zlib.crc32(np.concatenate(words).astype("<i8").tobytes())


def _read_only(elements: IndexArray) -> IndexArray:
    """Return a read-only copy of node indices."""
    copied = np.array(elements, dtype=np.int64)
    copied.flags.writeable = False
    return copied


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
            more than two elements, or at which elements of two kinds do not fit together.
    """
    _check(mesh.nodes.tobytes(), tuple((kind, e.tobytes()) for kind, e in mesh.blocks), source)


@lru_cache(maxsize=8)
def _check(of_nodes: bytes, blocks: tuple[tuple[Element, bytes], ...], source: str) -> None:
    """Check nodes (n, 3) [m] and elements (m, k): whoever builds one mesh often, checks it once."""
    elements = [np.frombuffer(e, dtype=np.int64).reshape(-1, kind.size) for kind, e in blocks]
    kinds = [kind for kind, _ in blocks]
    mesh = SolidMesh(np.frombuffer(of_nodes).reshape(-1, 3), tuple(map(Block, kinds, elements)))
    if not mesh.count:
        raise SceneError(f"{source}: the mesh has no elements")
    if (bad := np.flatnonzero(~np.isfinite(mesh.nodes).all(axis=1))).size:
        raise SceneError(f"{source}: positions of nodes {names_of(bad)} are not finite")
    outside = np.concatenate([((e < 0) | (e >= len(mesh.nodes))).any(axis=1) for e in elements])
    if (bad := np.flatnonzero(outside)).size:
        raise SceneError(f"{source}: elements {names_of(bad)} name nodes outside 0..{len(mesh.nodes) - 1}")
    if (bad := np.setdiff1d(np.arange(len(mesh.nodes)), np.concatenate([e.ravel() for e in elements]))).size:
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
    if (
        bad := np.concatenate([_twice(e) + first for e, first in zip(elements, _starts(mesh), strict=True)])
    ).size:
        raise SceneError(
            f"{source}: elements {names_of(bad)} have the same nodes as another element; remove one of them"
        )
    if (bad := mesh.overfull_nodes).size:
        raise SceneError(
            f"{source}: faces at nodes {names_of(bad)} belong to more than two elements; elements overlap "
            "there: correct the mesh"
        )
    if (bad := mesh.unmatched_nodes).size:
        raise SceneError(
            f"{source}: elements of different kinds ({mesh.kinds}) do not share whole faces at nodes {names_of(bad)}, "
            "where they would come apart: join quadrilaterals to quadrilaterals and triangles to triangles, for "
            "instance with wedges between hexahedra and tetrahedra, and linear elements to linear ones"
        )


def _starts(mesh: SolidMesh) -> IndexArray:
    """Return the number of the first element of each block."""
    return np.cumsum([0, *(len(block.elements) for block in mesh.blocks[:-1])])


def _twice(elements: IndexArray) -> IndexArray:
    """Return the elements that have the same nodes as another."""
    _, inverse, count = np.unique(np.sort(elements, axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.flatnonzero(count[inverse.ravel()] > 1)


def check_boundary(mesh: SolidMesh, source: str) -> None:
    """Refuse a mesh whose boundary cannot touch anything: where elements share an edge only, it is no surface.

    Args:
        mesh: A mesh that `check_mesh` accepts.
        source: Where it comes from, for the message.

    Raises:
        SceneError: elements touch along an edge only; the message names the nodes and what to do.
    """
    edges, uses = edge_uses([faces.corners for faces in mesh.boundary])
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
    label = parts(
        [*(b.elements for b in mesh.blocks), *(np.asarray(body)[None] for body in bodies)], len(mesh.nodes)
    )
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
    return np.concatenate([_quality(kind, mesh.nodes, elements) for kind, elements in mesh.blocks])


def _quality(kind: Element, nodes: FloatArray, elements: IndexArray) -> FloatArray:
    """Return it for elements (m, k) of one kind."""
    points = np.concatenate([kind.reference, kind.points])
    quality = np.empty(len(elements))
    for start in range(0, len(quality), CHUNK):
        part = slice(start, start + CHUNK)
        jacobian = kind.jacobians(nodes[elements[part]], points)
        length = np.linalg.norm(jacobian, axis=2).prod(axis=2)
        volume = np.linalg.det(jacobian)
        ratio = np.divide(volume, length, out=np.zeros_like(volume), where=length > 0)
        quality[part] = ratio.min(axis=1)
    return quality


def solid_volumes(mesh: SolidMesh) -> FloatArray:
    """Return the volume of each element [m³], shape (m,)."""
    return np.concatenate([load.sum(axis=1) for load, _ in block_volumes(mesh)])


def by_block(mesh: SolidMesh, values: Array) -> list[Array]:
    """Return values of the elements, shape (m,), apart by the blocks of a mesh."""
    return np.split(values, np.cumsum([len(block.elements) for block in mesh.blocks])[:-1])


def block_volumes(mesh: SolidMesh) -> list[tuple[FloatArray, FloatArray]]:
    """Return `node_volumes` of each block."""
    return [node_volumes(kind, mesh.nodes[elements]) for kind, elements in mesh.blocks]
