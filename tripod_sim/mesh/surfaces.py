"""The surfaces of all bodies that can touch, in one numbering of vertices."""

from dataclasses import dataclass, field

import numpy as np

from tripod_host.arrays import BoolArray, FloatArray, IndexArray
from tripod_sim.mesh.topology import directed_edges

FLAT = 1e-6
"""Sine of the angle between two triangles up to which their common edge is flat."""


@dataclass(frozen=True, eq=False)
class Part:
    """The surface of one body.

    Attributes:
        vertices: Positions at the start [m], shape (n, 3).
        triangles: Of vertices, shape (t, 3); none for a ball, a capsule or a chain.
        filled: Whether each triangle has a solid on its inner side, shape (t,); empty: none has.
        segments: Edges that belong to no triangle, of vertices, shape (s, 2): those of a chain or a capsule.
        fixed: Whether it never moves.
        rigid: Whether it moves as a whole: then it is touched where it is sharp, as if it were fixed.
        radius: Of the sphere about each point of it [m]; positive for a ball, a vertex, and for a capsule, a segment.
        self_contact: Whether it may touch itself.
        kinematic: Whether its motion is prescribed: rigid bodies alone meet it.
        name: For people.
    """

    vertices: FloatArray
    triangles: IndexArray = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    filled: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=np.bool_), kw_only=True)
    segments: IndexArray = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    fixed: bool = False
    rigid: bool = False
    radius: float = 0.0
    self_contact: bool = False
    kinematic: bool = False
    name: str = "body"

    @property
    def reach(self) -> float:
        """Largest distance of a point of it from the origin of its vertices [m]."""
        return float(np.linalg.norm(self.vertices, axis=1).max(initial=0.0)) + self.radius


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Vertices, edges and triangles of all parts, and how they neighbour.

    Attributes:
        body: Part of each vertex, shape (n,).
        touches_itself: Whether each part may touch itself, shape (parts,).
        radius: Of each vertex [m], shape (n,).
        triangles: Of vertices, shape (t, 3).
        filled: Whether each of them has a solid on its inner side, shape (t,).
        edges: Of vertices, shape (e, 2), the smaller number first.
        sides: Edges (a b), (b c), (c a) of each triangle, shape (t, 3).
        faces: Triangles at each edge, shape (e, 2); -1 for none.
        first_edge, edge_list: The edges at vertex v are edge_list[first_edge[v] : first_edge[v + 1]].
        fixed_triangles, fixed_edges, fixed_points: Of parts that never move; of edges and vertices only the sharp ones:
            a flat one, and a hollow one of a closed surface, cannot be touched but where something else is.
        moving_triangles, moving_edges, moving_points: Of others that are not kinematic; of rigid ones only the sharp
            edges.
        lone_edges: Edges of no triangle, those of chains and capsules, shape (r,).
        rigid: Whether each part moves as a whole, freely, shape (parts,).
        kinematic_triangles, kinematic_edges, kinematic_points: Of kinematic parts; of edges only the sharp ones.
    """

    body: IndexArray
    touches_itself: BoolArray
    radius: FloatArray
    triangles: IndexArray
    filled: BoolArray
    edges: IndexArray
    sides: IndexArray
    faces: IndexArray
    first_edge: IndexArray
    edge_list: IndexArray
    fixed_triangles: IndexArray
    fixed_edges: IndexArray
    fixed_points: IndexArray
    moving_triangles: IndexArray
    moving_edges: IndexArray
    moving_points: IndexArray
    lone_edges: IndexArray
    rigid: BoolArray
    kinematic_triangles: IndexArray
    kinematic_edges: IndexArray
    kinematic_points: IndexArray


def join(parts: list[Part]) -> tuple[Surfaces, FloatArray]:
    """Return the surfaces of `parts` in one numbering, and the positions of all vertices [m], shape (n, 3)."""
    counts = [len(p.vertices) for p in parts]
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    vertices = np.concatenate([p.vertices for p in parts]).astype(float)
    triangles = np.concatenate([p.triangles + k for p, k in zip(parts, first, strict=False)]).astype(
        np.int64, order="C"
    )
    filled = np.concatenate(
        [p.filled if len(p.filled) else np.zeros(len(p.triangles), np.bool_) for p in parts]
    )
    body = np.repeat(np.arange(len(parts)), counts)
    n, fixed = len(vertices), np.array([p.fixed for p in parts])
    segments = np.concatenate([p.segments + k for p, k in zip(parts, first, strict=False)]).astype(np.int64)
    # directed edge 3 t + k runs from corner k of triangle t to the next
    ends = np.sort(np.concatenate([directed_edges(triangles), segments]), axis=1)
    keys, which = np.unique(ends[:, 0] * n + ends[:, 1], return_inverse=True)
    edges = np.stack([keys // n, keys % n], axis=1)
    sides = which.ravel()[: 3 * len(triangles)].reshape(-1, 3)
    faces = np.full((len(edges), 2), -1, dtype=np.int64)
    for t, row in enumerate(sides.tolist()):
        for e in row:
            faces[e, 0 if faces[e, 0] < 0 else 1] = t
    ends = np.concatenate([edges[:, 0], edges[:, 1]])
    edge_list = np.argsort(ends, kind="stable") % max(len(edges), 1)
    first_edge = np.searchsorted(np.sort(ends), np.arange(n + 1))
    closed = np.bincount(body[edges[faces[:, 1] < 0, 0]], minlength=len(parts)) == 0
    sharp = _sharp(vertices, triangles, edges, faces, closed[body[edges[:, 0]]])
    stiff, kinematic = np.array([[p.rigid, p.kinematic] for p in parts]).T
    still, free = fixed[body], ~(fixed | kinematic)[body]
    pointed = np.bincount(edges[sharp].ravel(), minlength=n) > 0
    radius = np.repeat([p.radius for p in parts], counts).astype(float)
    surfaces = Surfaces(
        body, np.array([p.self_contact for p in parts]), radius, triangles, filled, edges, sides, faces, first_edge,
        edge_list, np.flatnonzero(still[triangles[:, 0]]), np.flatnonzero(still[edges[:, 0]] & sharp),
        np.flatnonzero(still & (pointed | (radius > 0))),
        np.flatnonzero(free[triangles[:, 0]]),
        np.flatnonzero(free[edges[:, 0]] & (sharp | ~stiff[body[edges[:, 0]]])), np.flatnonzero(free),
        np.flatnonzero(faces[:, 0] < 0), stiff & ~kinematic, np.flatnonzero(kinematic[body[triangles[:, 0]]]),
        np.flatnonzero(kinematic[body[edges[:, 0]]] & sharp), np.flatnonzero(kinematic[body]),
    )  # fmt: skip
    return surfaces, vertices


def _sharp(
    x: FloatArray, triangles: IndexArray, edges: IndexArray, faces: IndexArray, closed: BoolArray
) -> BoolArray:
    """Return which edges stick out: of a closed surface those whose triangles fall away from each other, else all bent.

    Edges that do not have two triangles stick out.
    """
    paired = faces[:, 1] >= 0
    if not len(triangles):
        return ~paired
    a, b, c = (x[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    one, two = np.where(paired[:, None], faces, 0).T
    # the corner of the second triangle that is not of the edge, seen from the edge at right angles
    opposite = np.where(paired, triangles[two].sum(axis=1) - edges.sum(axis=1), 0)
    away, along = x[opposite] - x[edges[:, 0]], x[edges[:, 1]] - x[edges[:, 0]]
    square = (along**2).sum(axis=1, keepdims=True)
    share = (away * along).sum(axis=1, keepdims=True)
    away -= np.divide(share, square, out=np.zeros_like(square), where=square > 0) * along
    rise = (normals[one] * away).sum(axis=1)
    least = FLAT * np.linalg.norm(away, axis=1)
    folded = (normals[one] * normals[two]).sum(axis=1) < 0  # back to back: in one plane, and yet an edge
    bent = (rise < -least) | (~closed & (rise > least)) | (folded & (np.abs(rise) <= least))
    return np.asarray(~paired | bent)
