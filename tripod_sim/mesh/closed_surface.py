"""Closed surfaces of element faces, and the volume that they enclose as a polynomial of the positions.

The volume that a surface encloses is the integral of x . n / 3 over it. On a face with x = sum of N_a(s, t) x_a it is

    1/3 ∫ x . (x_s × x_t) ds dt = sum over a < b < c of w_abc det(x_a, x_b, x_c)

with constants w_abc that belong to the shape of the face alone. The quadrature of `FaceShape` integrates them exactly
(to degree 4 on triangles, 5 along each side of quadrilaterals), so curved faces have their exact volume.

An opening can be closed by a cap: a fan from the centre of its rim, the mean of the rim's nodes, to its edges, curved
ones included. The centre is no node of its own. A pressure on the cap acts on the nodes of the rim.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.mesh.solid_mesh import Faces
from tripod_sim.mesh.topology import directed_edges, parts

NEGLIGIBLE = 1e-12
"""Share of the largest w below which a w is rounding."""


class ClosedSurface(NamedTuple):
    """Faces of solids around a volume.

    Attributes:
        faces: Their normals point out of the solids, so into a cavity.
        rims: For each cap the edges of the opening, in the direction in which the faces beside them run: start, end
            and middle, which is -1 of linear elements, shape (k, 3).
    """

    faces: tuple[Faces, ...]
    rims: tuple[IndexArray, ...] = ()

    @property
    def nodes(self) -> IndexArray:
        """All its nodes, ascending."""
        return np.unique(np.concatenate([faces.nodes.ravel() for faces in self.faces]))

    def volume(self, x: FloatArray) -> float:
        """Return the enclosed volume at positions `x`, shape (n, 3) [m³]: positive for a cavity, else negative."""
        triples, weights = volume_polynomial(self)
        return float(np.linalg.det((x - x[triples[0, 0]])[triples]) @ weights)


def volume_polynomial(surface: ClosedSurface) -> tuple[IndexArray, FloatArray]:
    """Return triples of nodes, ascending, shape (m, 3), and w (m,): V(x) = sum of w det(x_a, x_b, x_c) [m³].

    V is the volume enclosed by a closed surface with normals into it. It does not depend on the origin.
    """
    found = [*map(_of_faces, surface.faces), *map(_of_cap, surface.rims)]
    triples, weights = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.argsort(triples, axis=1)
    odd = (order[:, 0] > order[:, 1]) ^ (order[:, 0] > order[:, 2]) ^ (order[:, 1] > order[:, 2])
    return np.take_along_axis(triples, order, axis=1), np.where(odd, weights, -weights)


def _of_faces(faces: Faces) -> tuple[IndexArray, FloatArray]:
    """Return triples and w of faces, for the volume on the side that their normals point away from."""
    values, first, second = faces.functions()
    c = np.einsum("q,qa,qb,qc->abc", faces.shape.weights / 3, values, first, second)
    w = c + c.transpose(1, 2, 0) + c.transpose(2, 0, 1)
    w = w - w.transpose(0, 2, 1)
    local = np.argwhere(np.abs(w) > NEGLIGIBLE * np.abs(w).max())
    local = local[(local[:, 0] < local[:, 1]) & (local[:, 1] < local[:, 2])]
    return faces.nodes[:, local].reshape(-1, 3), np.tile(w[tuple(local.T)], len(faces.nodes))


def _of_cap(rim: IndexArray) -> tuple[IndexArray, FloatArray]:
    """Return triples and w of a cap, as `_of_faces`.

    A fan from c to the edge x(s) has the volume c . ∫ x × x' ds / 6; a parabola through a, m, b has
    ∫ x × x' ds = 4/3 (a × m + m × b) - 1/3 a × b.
    """
    start, end, middle = rim.T
    curved = middle >= 0
    ways = ((start, middle), (middle, end), (start, end))
    pairs = np.concatenate([np.stack(way, axis=1)[curved] for way in ways] + [rim[~curved, :2]])
    shares = np.repeat([4 / 3, 4 / 3, -1 / 3, 1.0], [*[curved.sum()] * 3, (~curved).sum()])
    nodes = np.unique(rim[rim >= 0])
    triples = np.column_stack([np.repeat(nodes, len(pairs)), np.tile(pairs, (len(nodes), 1))])
    weights = np.tile(-shares / (6 * len(nodes)), len(nodes))
    apart = (triples[:, 0] != triples[:, 1]) & (triples[:, 0] != triples[:, 2])
    return triples[apart], weights[apart]


def open_edges(faces: Sequence[Faces]) -> IndexArray:
    """Return the edges at which faces are not closed, as `ClosedSurface.rims` has them.

    A surface is closed where its faces run along each edge as often in one direction as in the other.
    """
    edges = np.concatenate([_edges(some) for some in faces])
    size = int(edges.max(initial=0)) + 1
    keys, back = edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
    _, own = np.unique(np.concatenate([keys, back]), return_inverse=True)
    surplus = np.bincount(own[: len(keys)], minlength=own.max(initial=0) + 1)
    surplus -= np.bincount(own[len(keys) :], minlength=len(surplus))
    return edges[surplus[own[: len(keys)]] > 0]


def encloses(faces: Sequence[Faces]) -> bool:
    """Return whether some of the faces, connected with each other by nodes, form a closed surface."""
    nodes = np.concatenate([some.corners.ravel() for some in faces])
    label = parts([some.corners for some in faces], int(nodes.max()) + 1)
    return bool(np.setdiff1d(label[nodes], label[open_edges(faces)[:, 0]]).size)


def _edges(faces: Faces) -> IndexArray:
    """Return start, end and middle of the edges of faces, in the direction in which each runs; middle -1: none."""
    ends, corners = directed_edges(faces.corners), faces.shape.corners
    if faces.shape.size == corners:
        return np.column_stack([ends, np.full(len(ends), -1)])
    return np.column_stack([ends, faces.nodes[:, corners : 2 * corners].ravel()])
