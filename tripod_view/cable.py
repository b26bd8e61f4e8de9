"""Cables as tubes through points that move with nodes: thick where taut, thin where slack. Metres. Pure."""

from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray

Rgb = tuple[int, int, int]

TAUT_COLOUR: Rgb = (38, 38, 46)
SLACK_COLOUR: Rgb = (150, 150, 160)

SLACK = 1e-6
"""Largest tension at which a cable counts as slack [N]."""

TAUT_RADIUS, SLACK_RADIUS = 0.004, 0.0015
"""Of the tube, in parts of the largest extent of what it is drawn with."""

SIDES = 6
"""Of a tube."""


@dataclass(frozen=True, eq=False)
class Route:
    """Points of a cable: x_p = X_p + sum_a N_a x_a.

    Attributes:
        name: Of the cable.
        nodes: Of each point, shape (k, m).
        weights: N_a of each node, shape (k, m); zero for what only fills a row.
        fixed: X_p [m], shape (k, 3).
    """

    name: str
    nodes: IndexArray
    weights: FloatArray
    fixed: FloatArray

    def __post_init__(self) -> None:
        """Raise ValueError unless the shapes fit each other."""
        count = len(self.fixed)
        fits = self.nodes.ndim == 2 and self.nodes.shape == self.weights.shape and len(self.nodes) == count
        if not fits or count < 2 or self.fixed.shape != (count, 3) or self.nodes.min(initial=0) < 0:
            raise ValueError(f"the points of cable {self.name!r:.40} do not fit each other")

    def fits(self, count: int) -> bool:
        """Return whether `count` nodes are enough."""
        return bool(self.nodes.max(initial=-1) < count)

    def points(self, nodes: FloatArray) -> FloatArray:
        """Return its points with `nodes` at positions [m], shape (..., n, 3), as (..., k, 3)."""
        return np.asarray(self.fixed + np.einsum("pa,...pai->...pi", self.weights, nodes[..., self.nodes, :]))


def radius(extent: float, tension: FloatArray) -> FloatArray:
    """Return the radius of the tube [m] for tensions [N] of any shape, beside bodies of an extent [m]."""
    return np.where(tension > SLACK, TAUT_RADIUS, SLACK_RADIUS) * extent


def tube(points: FloatArray, radii: FloatArray) -> FloatArray:
    """Return the nodes of tubes through points [m], shape (s, k, 3), of radii [m], shape (s,), as (s, k SIDES, 3)."""
    ahead = np.diff(points, axis=1)
    along = np.concatenate([ahead[:, :1], ahead[:, 1:] + ahead[:, :-1], ahead[:, -1:]], axis=1)
    length = np.linalg.norm(along, axis=2, keepdims=True)
    along = np.where(length > 0, along / np.where(length > 0, length, 1.0), [1.0, 0.0, 0.0])
    side = np.eye(3)[np.argmin(np.abs(along[:, 0]), axis=1)]
    turn = 2 * np.pi * np.arange(SIDES) / SIDES
    rings = []
    for k in range(points.shape[1]):
        t = along[:, k]
        side = side - (side * t).sum(axis=1, keepdims=True) * t
        size = np.linalg.norm(side, axis=1, keepdims=True)
        other = np.cross(t, np.eye(3)[np.argmin(np.abs(t), axis=1)])
        other /= np.linalg.norm(other, axis=1, keepdims=True)
        side = np.where(size > 1e-6, side / np.where(size > 1e-6, size, 1.0), other)
        up = np.cross(t, side)
        ring = np.cos(turn)[:, None] * side[:, None] + np.sin(turn)[:, None] * up[:, None]
        rings.append(points[:, k, None] + radii[:, None, None] * ring)
    return np.concatenate(rings, axis=1)


def tube_triangles(count: int) -> IndexArray:
    """Return the triangles of a tube through so many points, facing outward, shape (t, 3)."""
    ring, side = np.meshgrid(np.arange(count - 1), np.arange(SIDES), indexing="ij")
    a = (ring * SIDES + side).ravel()
    b = (ring * SIDES + (side + 1) % SIDES).ravel()
    return np.concatenate([np.stack([a, b, b + SIDES], axis=1), np.stack([a, b + SIDES, a + SIDES], axis=1)])
