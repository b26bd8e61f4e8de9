"""Six-node wedge (W6): a prism of two triangles and three quadrilaterals.

With barycentric coordinates l_a of the triangle and t along the prism in [-1, 1], N_a = l_a (1 - t) / 2 on the first
triangle and l_a (1 + t) / 2 on the second [Hughes1987]. det J has degree 1 across and 2 along, so that three points of
degree 2 across times two Gauss points along give volumes and int N_a dV exactly, and constant stresses do their work
exactly on distorted wedges (patch test). Fewer points would leave motions without energy. The element locks as plain H8
does, in bending and where the material is nearly incompressible: it is to fill up meshes of hexahedra, and to join
these to tetrahedra.
"""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.elements.element import Element, Rule
from tripod_sim.elements.faces import QUADRILATERAL4, TRIANGLE3, Face, triangle_rule

CORNERS = np.array(
    [[0, 0, -1], [1, 0, -1], [0, 1, -1], [0, 0, 1], [1, 0, 1], [0, 1, 1]],
    float,
)
"""Reference coordinates: two coordinates of the triangle, and t, shape (6, 3)."""

_SLOPES = np.array([[-1.0, -1], [1, 0], [0, 1]])  # of l_a
_ENDS = ((-1.0, slice(3)), (1.0, slice(3, 6)))


def functions(xi: FloatArray) -> FloatArray:
    """Return N_a at the points `xi` (p, 3), shape (p, 6)."""
    shares, t = _barycentric(xi), xi[:, 2:]
    return np.concatenate([shares * (1 - t), shares * (1 + t)], axis=1) / 2


def gradients(xi: FloatArray) -> FloatArray:
    """Return dN_a/dxi at the points `xi` (p, 3), shape (p, 6, 3)."""
    shares, t, out = _barycentric(xi), xi[:, 2, None, None], np.empty((len(xi), 6, 3))
    for sign, own in _ENDS:
        out[:, own, :2] = _SLOPES * (1 + sign * t) / 2
        out[:, own, 2] = sign * shares / 2
    return out


def beyond(xi: FloatArray) -> FloatArray:
    """Return how far the points `xi` (p, 3) are beyond the face they are farthest from, shape (p,)."""
    return np.asarray(np.maximum(-_barycentric(xi).min(axis=1), np.abs(xi[:, 2]) - 1))


def _barycentric(xi: FloatArray) -> FloatArray:
    return np.column_stack([1 - xi[:, 0] - xi[:, 1], xi[:, :2]])


def _prism(shares: FloatArray, weights: FloatArray, count: int) -> Rule:
    """Return a rule of the triangle, with barycentric coordinates (q, 3), times `count` Gauss points along."""
    t, w = np.polynomial.legendre.leggauss(count)
    across = np.tile(shares[:, 1:], (count, 1))
    return np.column_stack([across, np.repeat(t, len(weights))]), np.outer(w, weights).ravel()


_MIDDLE = np.array([[4.0, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6  # degree 2

W6 = Element(
    "w6", "wedge", CORNERS, functions, gradients, *_prism(_MIDDLE, np.full(3, 1 / 6), 2),
    (
        Face(TRIANGLE3, (0, 2, 1)), Face(TRIANGLE3, (3, 4, 5)), Face(QUADRILATERAL4, (0, 1, 4, 3)),
        Face(QUADRILATERAL4, (1, 2, 5, 4)), Face(QUADRILATERAL4, (2, 0, 3, 5)),
    ),
    _prism(*triangle_rule(), 3), beyond, divisions={"hexahedron": ((0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7))},
    chosen_for=("wedge",), neighbours=16,
)  # fmt: skip
