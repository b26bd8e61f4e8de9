"""Tetrahedra: linear (T4) and quadratic (T10).

With barycentric coordinates l_a, T4 has N_a = l_a and one point; T10 has l_a (2 l_a - 1) at corners, 4 l_a l_b at
mid-edge nodes and the four-point rule of degree 2 [Hughes1987]. T4 is far too stiff in bending and for nearly
incompressible materials: it is here because others use it.
"""

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.elements.element import Element, diagonal_scaling
from tripod_sim.elements.faces import TRIANGLE3, TRIANGLE6, Face
from tripod_sim.elements.hexahedron import CORNERS as CUBE
from tripod_sim.elements.hexahedron import gauss

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
"""Corners between which the nodes 4 to 9 lie, VTK order."""

FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))

_SLOPES = np.array([[-1, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)  # dl_a/dxi


def _barycentric(xi: FloatArray) -> FloatArray:
    return np.column_stack([1 - xi.sum(axis=1), xi])


def t4_gradients(xi: FloatArray) -> FloatArray:
    """Return dN_a/dxi at the points `xi` (p, 3), shape (p, 4, 3)."""
    return np.tile(_SLOPES, (len(xi), 1, 1))


def t10_functions(xi: FloatArray) -> FloatArray:
    """Return N_a at the points `xi` (p, 3), shape (p, 10)."""
    b = _barycentric(xi)
    return np.concatenate([b * (2 * b - 1), np.stack([4 * b[:, i] * b[:, j] for i, j in EDGES], 1)], axis=1)


def t10_gradients(xi: FloatArray) -> FloatArray:
    """Return dN_a/dxi at the points `xi` (p, 3), shape (p, 10, 3)."""
    b = _barycentric(xi)
    corner = (4 * b - 1)[:, :, None] * _SLOPES
    edge = [4 * (b[:, i, None] * _SLOPES[j] + b[:, j, None] * _SLOPES[i]) for i, j in EDGES]
    return np.concatenate([corner, np.stack(edge, 1)], axis=1)


def _face(loop: tuple[int, ...]) -> Face:
    sides = [{loop[i], loop[(i + 1) % 3]} for i in range(3)]
    mids = (4 + next(i for i, e in enumerate(EDGES) if set(e) == side) for side in sides)
    return Face(TRIANGLE6, (*loop, *mids))


def collapsed(count: int) -> tuple[FloatArray, FloatArray]:
    """Return a rule on the tetrahedron with corners 0, x, y and z, of `gauss`, of degree 2 count - 3, shapes alike.

    The cube [0, 1]^3 is collapsed to it: x = a, y = b (1 - a), z = c (1 - a) (1 - b) [Hughes1987].
    """
    points, weights = gauss(count)
    a, b, c = (0.5 * (1 + points)).T
    xi = np.column_stack([a, b * (1 - a), c * (1 - a) * (1 - b)])
    return xi, weights / 8 * (1 - a) ** 2 * (1 - b)


def beyond(xi: FloatArray) -> FloatArray:
    """Return how far the points `xi` (p, 3) are beyond the face they are farthest from, shape (p,)."""
    return np.asarray(np.maximum(-xi.min(axis=1), xi.sum(axis=1) - 1))


_A, _B = (5 + 3 * np.sqrt(5)) / 20, (5 - np.sqrt(5)) / 20
_FOUR = np.array([[_B, _B, _B], [_A, _B, _B], [_B, _A, _B], [_B, _B, _A]])


def _kuhn() -> tuple[tuple[int, ...], ...]:
    """Return six tetrahedra of a hexahedron, along its diagonal from node 0 to node 6, each right-handed."""
    number = {tuple(corner): i for i, corner in enumerate(((CUBE + 1) // 2).astype(int).tolist())}
    found = []
    for order in permutations(range(3)):
        corner, path = [0, 0, 0], [0]
        for axis in order:
            corner[axis] = 1
            path.append(number[tuple(corner)])
        found.append(tuple(right_handed(path, CUBE)))
    return tuple(found)


def right_handed(nodes: Sequence[int], places: FloatArray) -> list[int]:
    """Return the four nodes of a tetrahedron in an order that makes its volume positive; `places`: by node, (n, 3)."""
    a, b, c, d = nodes
    legs = places[[b, c, d]] - places[a]
    return [a, b, c, d] if np.linalg.det(legs) > 0 else [a, c, b, d]


_RULE = (_FOUR, np.full(4, 1 / 24))

T4 = Element(
    "t4", "tetra", CORNERS, _barycentric, t4_gradients, np.full((1, 3), 0.25), np.array([1 / 6]),
    tuple(Face(TRIANGLE3, f) for f in FACES), _RULE, beyond, quadratic="t10", divisions={"hexahedron": _kuhn()},
    neighbours=64,
)  # fmt: skip
T10 = Element(
    "t10", "tetra10", np.concatenate([CORNERS, [CORNERS[list(e)].mean(axis=0) for e in EDGES]]), t10_functions,
    t10_gradients, *_RULE, tuple(_face(f) for f in FACES), collapsed(4), beyond, lumping=diagonal_scaling, linear=T4,
    centres=EDGES, chosen_for=("tetra", "tetra10"), neighbours=64,
)  # fmt: skip
