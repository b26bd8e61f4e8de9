"""Nearest places of a surface of triangles, and how far two surfaces are apart."""

from itertools import chain

import numpy as np
from scipy.spatial import cKDTree

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.distance_kernels import nearest_places

FINENESS = 64
"""Longest side of the triangles that are searched, as a part of the diagonal of the surface."""

CHUNK = 4096
"""Points that are searched for at a time."""


class NearestSurface:
    """A surface in which nearest places are looked up: exact, by the centroids of triangles of bounded size."""

    def __init__(self, vertices: FloatArray, triangles: IndexArray) -> None:
        """Take vertices [m], shape (n, 3), and triangles, shape (m, 3) with m > 0."""
        corners = vertices[triangles]
        longest = float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0))) / FINENESS
        self._corners = np.ascontiguousarray(divided(corners, longest))
        self.samples: FloatArray = self._corners.mean(axis=1)
        """Points of the surface, one in each triangle no longer than a part of it [m], shape (k, 3)."""
        reach = np.linalg.norm(self._corners - self.samples[:, None], axis=2)
        self._reach = float(reach.max())
        self._tree = cKDTree(self.samples)

    def places(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the places of the surface nearest to points (k, 3) [m], shape (k, 3), and their distances [m]."""
        places, squares = np.array(points, dtype=float), np.zeros(len(points))
        for start in range(0, len(points), CHUNK):
            own = slice(start, start + CHUNK)
            part = np.ascontiguousarray(points[own], dtype=float)
            bound, _ = self._tree.query(part)  # the centroid is a place of the surface
            found = self._tree.query_ball_point(part, bound * (1 + 1e-9) + self._reach)
            first = np.cumsum([0, *map(len, found)])
            candidates = np.fromiter(chain.from_iterable(found), dtype=np.int64, count=int(first[-1]))
            nearest_places(part, self._corners, first, candidates, places[own], squares[own])
        return places, np.sqrt(squares)

    def farthest(self, other: "NearestSurface") -> float:
        """Return the largest distance of samples of another surface from this one [m]."""
        return float(self.places(other.samples)[1].max())


def divided(corners: FloatArray, longest: float) -> FloatArray:
    """Return triangles (m, 3, 3) divided until no side is longer than `longest`, which is positive."""
    done = []
    while len(corners):
        sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        long = sides.max(axis=1) > longest
        done.append(corners[~long])
        split, at = corners[long], sides[long].argmax(axis=1)
        a, b, c = (split[np.arange(len(split)), (at + k) % 3] for k in range(3))
        middle = 0.5 * (a + b)
        corners = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done)
