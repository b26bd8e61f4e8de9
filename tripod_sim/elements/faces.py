"""Faces of elements: polygons with their triangles and their quadrature."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from tripod_host.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class FaceShape:
    """A kind of face.

    Attributes:
        corners: Number of corner nodes.
        size: Number of nodes: the corners in a loop, then mid-edge nodes in the same order, then a centre.
        triangles: Its division, as numbers of its nodes; each runs round as the corners do.
        shares: Of the corners in the place of each quadrature point, shape (q, corners).
        slopes: Derivatives of these along the two coordinates of the face, shape (2, q, corners).
        weights: Quadrature weights, shape (q,).
    """

    corners: int
    size: int
    triangles: tuple[tuple[int, int, int], ...]
    shares: FloatArray = field(repr=False)
    slopes: FloatArray = field(repr=False)
    weights: FloatArray = field(repr=False)


class Face(NamedTuple):
    """A face of an element: its kind, and its nodes, counter-clockwise seen from outside."""

    shape: FaceShape
    nodes: tuple[int, ...]

    @property
    def loop(self) -> tuple[int, ...]:
        """The corners among `nodes`."""
        return self.nodes[: self.shape.corners]


def triangle_rule() -> tuple[FloatArray, FloatArray]:
    """Return the barycentric coordinates (6, 3) and weights (6,) of degree 4; they sum to 1/2 [Dunavant1985]."""
    a, b = 0.445948490915965, 0.091576213509771
    shares = np.array([[1 - 2 * c if i == j else c for j in range(3)] for c in (a, b) for i in range(3)])
    return shares, np.repeat([0.223381589678011, 0.109951743655322], 3) / 2


def _on_triangle() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return shares, slopes and weights of the six points of degree 4."""
    shares, weights = triangle_rule()
    slopes = np.array([[-1.0, 1, 0], [-1, 0, 1]])
    return shares, np.repeat(slopes[:, None], len(weights), axis=1), weights


def _on_quadrilateral() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return shares, slopes and weights of 3x3 Gauss points."""
    x, w = np.polynomial.legendre.leggauss(3)
    s, t = (c.ravel() for c in np.meshgrid(x, x, indexing="ij"))
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    along, across = 1 + np.outer(s, signs[:, 0]), 1 + np.outer(t, signs[:, 1])
    slopes = np.stack([across * signs[:, 0] / 4, along * signs[:, 1] / 4])
    return along * across / 4, slopes, np.outer(w, w).ravel()


_THREE, _FOUR = _on_triangle(), _on_quadrilateral()

TRIANGLE3 = FaceShape(3, 3, ((0, 1, 2),), *_THREE)
TRIANGLE6 = FaceShape(3, 6, ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)), *_THREE)
QUADRILATERAL4 = FaceShape(4, 4, ((0, 1, 2), (0, 2, 3)), *_FOUR)
QUADRILATERAL8 = FaceShape(
    4, 8, ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 7), (5, 6, 7)), *_FOUR
)  # fmt: skip
QUADRILATERAL9 = FaceShape(
    4, 9, ((0, 4, 8), (4, 1, 8), (1, 5, 8), (5, 2, 8), (2, 6, 8), (6, 3, 8), (3, 7, 8), (7, 0, 8)), *_FOUR
)  # fmt: skip
