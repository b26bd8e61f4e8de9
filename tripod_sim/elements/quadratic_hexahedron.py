"""Quadratic hexahedra: serendipity with 20 nodes (H20) and Lagrange with 27 (H27).

H20: corners N_a = (1 + xi xi_a)(1 + eta eta_a)(1 + zeta zeta_a)(xi xi_a + eta eta_a + zeta zeta_a - 2) / 8, mid-edge
nodes (1 - xi^2)(1 + eta eta_a)(1 + zeta zeta_a) / 4 and likewise along the other axes. H27: products of the quadratic
Lagrange polynomials of each axis. H20 integrates with 2x2x2 points (`h20`, which keeps bending from locking where the
material is nearly incompressible) or in full with 3x3x3 (`h20_full`) [Hughes1987]. Where a mesh is one element
thick and wide 2x2x2 points leave motions without energy: there `h20` integrates in full, too
(`tripod_sim.mesh.hourglass`).
"""

from dataclasses import replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.elements.element import Element, diagonal_scaling
from tripod_sim.elements.faces import QUADRILATERAL8, QUADRILATERAL9, Face
from tripod_sim.elements.hexahedron import CORNERS, FACES, H8, beyond, gauss

EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
"""Corners between which the nodes 8 to 19 lie, VTK order."""

FACE_CENTRES = ((0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7))
"""Corners of the faces whose centres are the nodes 20 to 25, VTK order; node 26 is the centre of the cell."""

_EDGE_NODES = np.array([CORNERS[list(e)].mean(axis=0) for e in EDGES])
_H20_NODES = np.concatenate([CORNERS, _EDGE_NODES])
_H27_NODES = np.concatenate(
    [_H20_NODES, [CORNERS[list(f)].mean(axis=0) for f in FACE_CENTRES], np.zeros((1, 3))]
)


def _face(loop: tuple[int, ...], *, centre: bool) -> Face:
    """Return corners, mid-edge nodes and, if asked, the centre of a face."""
    sides = [{loop[i], loop[(i + 1) % 4]} for i in range(4)]
    mids = [8 + next(i for i, e in enumerate(EDGES) if set(e) == side) for side in sides]
    middle = [20 + next(i for i, f in enumerate(FACE_CENTRES) if set(f) == set(loop))] if centre else []
    return Face(QUADRILATERAL9 if centre else QUADRILATERAL8, (*loop, *mids, *middle))


def h20_functions(xi: FloatArray) -> FloatArray:
    """Return N_a at the points `xi` (p, 3), shape (p, 20)."""
    t = xi[:, None, :] * _H20_NODES[None]
    values = np.prod(1 + t, axis=2)
    corner = values[:, :8] * (t[:, :8].sum(axis=2) - 2) / 8
    along = np.argmin(np.abs(_H20_NODES[8:]), axis=1)
    middle = values[:, 8:] * (1 - xi[:, along] ** 2) / 4
    return np.concatenate([corner, middle], axis=1)


def h20_gradients(xi: FloatArray) -> FloatArray:
    """Return dN_a/dxi at the points `xi` (p, 3), shape (p, 20, 3)."""
    a = _H20_NODES
    f = 1 + xi[:, None, :] * a[None]
    s = (xi[:, None, :] * a[None]).sum(axis=2)
    out = np.empty((len(xi), 20, 3))
    for j in range(3):
        k, m = (j + 1) % 3, (j + 2) % 3
        others = f[..., k] * f[..., m]
        out[:, :8, j] = a[:8, j] * others[:, :8] * (s[:, :8] - 2 + f[:, :8, j]) / 8
        for n in range(8, 20):
            along = int(np.argmin(np.abs(a[n])))
            bubble = 1 - xi[:, along] ** 2
            if along == j:
                out[:, n, j] = -2 * xi[:, j] * others[:, n] / 4
            else:
                rest = 3 - along - j
                out[:, n, j] = bubble * a[n, j] * f[:, n, rest] / 4
    return out


def _lagrange(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the quadratic Lagrange polynomials of the nodes -1, 0, 1 and their derivatives, each (..., 3)."""
    return (
        np.stack([x * (x - 1) / 2, 1 - x * x, x * (x + 1) / 2], -1),
        np.stack([x - 0.5, -2 * x, x + 0.5], -1),
    )


_AXIS = np.round(_H27_NODES).astype(int) + 1


def h27_functions(xi: FloatArray) -> FloatArray:
    """Return N_a at the points `xi` (p, 3), shape (p, 27)."""
    values, _ = _lagrange(xi)
    return np.prod([values[:, j, _AXIS[:, j]] for j in range(3)], axis=0)


def h27_gradients(xi: FloatArray) -> FloatArray:
    """Return dN_a/dxi at the points `xi` (p, 3), shape (p, 27, 3)."""
    values, slopes = _lagrange(xi)
    out = np.empty((len(xi), 27, 3))
    for j in range(3):
        parts = [(slopes if i == j else values)[:, i, _AXIS[:, i]] for i in range(3)]
        out[:, :, j] = np.prod(parts, axis=0)
    return out


H20 = Element(
    "h20", "hexahedron20", _H20_NODES, h20_functions, h20_gradients, *gauss(2),
    tuple(_face(f, centre=False) for f in FACES), gauss(3), beyond, lumping=diagonal_scaling, linear=H8, centres=EDGES,
    full="h20_full", chosen_for=("hexahedron20",),
)  # fmt: skip
_POINTS, _WEIGHTS = gauss(3)
H20_FULL = replace(H20, name="h20_full", points=_POINTS, weights=_WEIGHTS, full="", chosen_for=())
H27 = Element(
    "h27", "hexahedron27", _H27_NODES, h27_functions, h27_gradients, _POINTS, _WEIGHTS,
    tuple(_face(f, centre=True) for f in FACES), gauss(3), beyond, lumping=diagonal_scaling, linear=H8,
    centres=(*EDGES, *FACE_CENTRES, tuple(range(8))), chosen_for=("hexahedron27",),
)  # fmt: skip
