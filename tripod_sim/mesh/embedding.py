"""Points fixed to a body: each moves with nodes of the body, x_p = X_p + sum_a N_a x_a.

In a solid N_a are the shape functions of the element that contains the point, at the point, and X_p = 0. A point of a
net of springs is one of its nodes. A point that is fixed in the world has X_p alone.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tripod_host.arrays import BoolArray, FloatArray, IndexArray
from tripod_sim.distance_kernels import point_triangle_distance
from tripod_sim.elements.element import Element
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import SolidMesh

INSIDE = 1e-9
"""How far beyond a face a point counts as inside, in reference coordinates."""

NOTHING = 1e-13
"""Weights below this are rounding and count as zero: a point on a face moves with the nodes of the face alone."""

BULGE = 0.25
"""How far a curved element may reach beyond the box of its nodes, over the size of the box: a parabola through three
nodes reaches 1/8 beyond them."""

ITERATIONS = 50
"""Of Newton's method on the map of an element; it converges in five where the element is not nearly inverted."""


class Embedding(NamedTuple):
    """Points that move with nodes.

    Attributes:
        nodes: Of each point, shape (k, m); rows of fewer are filled up with any node.
        weights: N_a of each node, shape (k, m), zero where filled up.
        fixed: X_p [m], zero of points that nodes move, shape (k, 3).
    """

    nodes: IndexArray
    weights: FloatArray
    fixed: FloatArray

    def places(self, x: FloatArray) -> FloatArray:
        """Return where the points are [m], shape (k, 3), with nodes at `x` [m], shape (n, 3)."""
        return np.asarray(self.fixed + np.einsum("pa,pai->pi", self.weights, x[self.nodes]))


def in_world(points: FloatArray) -> Embedding:
    """Return points that never move, at `points` [m], shape (k, 3)."""
    none = np.zeros((len(points), 0))
    return Embedding(none.astype(np.int64), none, np.array(points, dtype=float))


def at_nodes(nodes: IndexArray) -> Embedding:
    """Return points that are nodes, given by their numbers, shape (k,)."""
    return Embedding(nodes[:, None], np.ones((len(nodes), 1)), np.zeros((len(nodes), 3)))


def joined(parts: Sequence[Embedding]) -> Embedding:
    """Return the points of all `parts`, one after another."""
    most = max(part.nodes.shape[1] for part in parts)
    wide = [((0, 0), (0, most - part.nodes.shape[1])) for part in parts]
    return Embedding(
        np.concatenate([np.pad(part.nodes, pad) for part, pad in zip(parts, wide, strict=True)]),
        np.concatenate([np.pad(part.weights, pad) for part, pad in zip(parts, wide, strict=True)]),
        np.concatenate([part.fixed for part in parts]),
    )


def in_net(
    points: FloatArray,
    nodes: FloatArray,
    own: IndexArray,
    *,
    tolerance: float | None = None,
    name: str = "point",
) -> Embedding:
    """Return points of a net of springs, each of which is the net's nearest node.

    Args:
        points: Undeformed places [m], shape (k, 3).
        nodes: Undeformed positions of all nodes [m], shape (n, 3).
        own: The nodes of the net, shape (m,).
        tolerance: How far a point may be from its node [m]; None: see `default_tolerance`.
        name: Of the points, for messages.

    Raises:
        SceneError: a point is farther from each node.
    """
    distances = np.linalg.norm(points[:, None] - nodes[own], axis=2)
    nearest = np.argmin(distances, axis=1)
    allowed = default_tolerance(nodes[own]) if tolerance is None else tolerance
    for p, (k, distance) in enumerate(zip(nearest, distances.min(axis=1), strict=True)):
        if not distance <= allowed:
            raise SceneError(
                f"{name} {p} at {_place(points[p])} is {distance:.3g} m from the nearest node of the springs, which "
                f"have no inside; move it to that node, at {_place(nodes[own[k]])}"
            )
    return at_nodes(own[nearest])


def in_solid(
    points: FloatArray, mesh: SolidMesh, *, tolerance: float | None = None, name: str = "point"
) -> Embedding:
    """Return points of a solid, each of the element that contains it, of several that with the lowest number.

    Args:
        points: Undeformed places [m], shape (k, 3).
        mesh: Of the solid; its blocks may hold a part of the nodes only.
        tolerance: How far outside a point may be [m]; it is taken to the nearest place of the surface. None: see
            `default_tolerance`.
        name: Of the points, for messages.

    Raises:
        SceneError: a point is farther outside.
    """
    cells = [_Cells(kind, mesh.nodes, elements) for kind, elements in mesh.blocks]
    used = np.unique(np.concatenate([elements.ravel() for _, elements in mesh.blocks]))
    allowed = default_tolerance(mesh.nodes[used]) if tolerance is None else tolerance
    found = []
    for p, point in enumerate(points):
        inside = next((own for c in cells if (own := c.containing(point))), None)
        if inside is None:
            distance, inside = min((c.nearest(point) for c in cells), key=lambda pair: pair[0])
            if not distance <= allowed:
                place = in_elements(*inside).places(mesh.nodes)[0]
                raise SceneError(
                    f"{name} {p} at {_place(point)} is {distance:.3g} m outside the body; move it inside: the nearest "
                    f"place of the body is {_place(place)}"
                )
        found.append(in_elements(*inside))
    return joined(found)


def in_elements(kind: Element, elements: IndexArray, xi: FloatArray) -> Embedding:
    """Return points at reference coordinates `xi` (k, 3) of `elements` (k, n) of a kind, one in each."""
    weights = kind.functions(xi)
    weights[np.abs(weights) < NOTHING] = 0.0
    return Embedding(elements, weights, np.zeros((len(xi), 3)))


def default_tolerance(nodes: FloatArray) -> float:
    """Return 1 nm and a millionth of the body's largest extent [m]; `nodes`: its own [m], shape (n, 3)."""
    return 1e-9 + 1e-6 * float(np.ptp(nodes, axis=0).max())


def _place(point: FloatArray) -> str:
    return "({}) m".format(", ".join(f"{c:.6g}" for c in point + 0.0))


def reference_coordinates(
    kind: Element, nodes: FloatArray, points: FloatArray, start: FloatArray, iterations: int
) -> FloatArray:
    """Return where Newton's method on the maps of elements takes their reference coordinates.

    Args:
        kind: Of the elements.
        nodes: Undeformed nodes of each [m], shape (p, n, 3).
        points: One place for each [m], shape (p, 3).
        start: Reference coordinates to start from, shape (p, 3) or (1, 3).
        iterations: How many; coordinates stay within [-2, 2].
    """
    xi = np.array(np.broadcast_to(start, points.shape))
    for _ in range(iterations):
        miss = points - np.einsum("pa,pai->pi", kind.functions(xi), nodes)
        jacobian = np.einsum("paj,pai->pij", kind.gradients(xi), nodes)
        jacobian[np.linalg.det(jacobian) == 0.0] = np.eye(3)
        step = np.linalg.solve(jacobian, miss[:, :, None])[:, :, 0]
        xi = np.clip(xi + step, -2.0, 2.0)
        if np.abs(step).max(initial=0.0) < 1e-14:
            break
    return xi


class _Cells:
    """Elements of one kind, in which places are looked up."""

    def __init__(self, kind: Element, nodes: FloatArray, elements: IndexArray) -> None:
        self._kind, self._nodes, self._elements = kind, nodes[elements], elements
        low, high = self._nodes.min(axis=1), self._nodes.max(axis=1)
        room = (BULGE if kind.linear else 0.0) * (high - low) + 1e-6 * (high - low).max(axis=1, keepdims=True)
        self._low, self._high = low - room, high + room
        self._boundary = float(kind.beyond(kind.reference).max())
        self._triangles = np.array(
            [
                kind.reference[[face.nodes[i] for i in three]]
                for face in kind.faces
                for three in face.shape.triangles
            ]
        )

    def containing(self, point: FloatArray) -> tuple[Element, IndexArray, FloatArray] | None:
        """Return the first element that contains `point` [m], shape (3,), and its reference coordinates there."""
        around = np.flatnonzero(((self._low <= point) & (point <= self._high)).all(axis=1))
        for start in self._starts(point, around):
            nodes = self._nodes[around] - point  # so that a body far from the origin loses no digits
            xi = reference_coordinates(self._kind, nodes, np.zeros((len(around), 3)), start, ITERATIONS)
            miss = np.einsum("pa,pai->pi", self._kind.functions(xi), nodes)
            size = (self._high - self._low)[around].max(axis=1)
            hit = (np.linalg.norm(miss, axis=1) <= 1e-12 * size) & self._holds(xi)
            if hit.any():
                first = int(np.argmax(hit))
                return self._kind, self._elements[around[first]][None], xi[first][None]
        return None

    def _starts(self, point: FloatArray, around: IndexArray) -> list[FloatArray]:
        """Return where Newton's method starts, shapes (1, 3) and (elements, 3): the centre, then the nearest node."""
        distance = np.linalg.norm(self._nodes[around] - point, axis=2)
        nearest = self._kind.reference[np.argmin(distance, axis=1)] if len(around) else np.zeros((0, 3))
        return [self._kind.centre, 0.9 * nearest + 0.1 * self._kind.centre]

    def _holds(self, xi: FloatArray) -> BoolArray:
        """Return whether reference coordinates (p, 3) are those of the cell."""
        return np.asarray(self._kind.beyond(xi) <= self._boundary + INSIDE)

    def nearest(self, point: FloatArray) -> tuple[float, tuple[Element, IndexArray, FloatArray]]:
        """Return the distance of `point` [m], shape (3,), from the elements, and the nearest place, on their faces."""
        to_nodes = np.linalg.norm(self._nodes - point, axis=2).min(axis=1)
        to_box = np.linalg.norm(np.maximum(np.maximum(self._low - point, point - self._high), 0.0), axis=1)
        around = np.flatnonzero(to_box <= to_nodes.min())
        count = len(self._triangles)
        of = np.repeat(around, count)
        corners = np.tile(self._triangles, (len(around), 1, 1))
        xi, best = corners.mean(axis=1), np.full(len(of), np.inf)
        nearest = xi.copy()
        for _ in range(ITERATIONS):
            values, slopes = self._kind.functions(xi), self._kind.gradients(xi)
            miss = np.einsum("pa,pai->pi", values, self._nodes[of]) - point
            distance = np.linalg.norm(miss, axis=1)
            nearer = distance < best
            best[nearer], nearest[nearer] = distance[nearer], xi[nearer]
            jacobian = np.einsum("paj,pai->pij", slopes, self._nodes[of])
            flat = miss[:, None] + np.einsum("pij,pcj->pci", jacobian, corners - xi[:, None])
            before, xi = xi, np.einsum("pc,pcj->pj", _nearest_in_triangles(flat), corners)
            if np.abs(xi - before).max() < 1e-14:
                break
        k = int(np.argmin(best))
        return float(best[k]), (self._kind, self._elements[of[k]][None], nearest[k][None])


def _nearest_in_triangles(corners: FloatArray) -> FloatArray:
    """Return barycentric coordinates, shape (p, 3), of the place nearest to 0 in triangles (p, 3, 3)."""
    return np.array([point_triangle_distance(np.zeros(3), *own)[:3] for own in corners])
