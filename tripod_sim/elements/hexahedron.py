"""Eight-node hexahedra (H8): plain, and with incompatible modes.

Trilinear shape functions N_a = (1 + xi xi_a)(1 + eta eta_a)(1 + zeta zeta_a) / 8 on [-1, 1]^3. Plain, the element is
far too stiff in bending. With modes, each element has three quadratic modes M_k = 1 - xi_k^2 with vector amplitudes of
its own, condensed element by element: one layer then bends without locking. The deformation gradient is

    F = I + sum_a u_a (x) dN_a/dX + sum_k alpha_k (x) G_k   (G_k: see `reference_gradients`).
"""

from dataclasses import replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.elements.element import Element
from tripod_sim.elements.faces import QUADRILATERAL4, Face

CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]],
    float,
)
"""Reference coordinates of the corners, VTK order, shape (8, 3)."""

FACES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
"""Corners of the faces, counter-clockwise seen from outside."""


def functions(xi: FloatArray) -> FloatArray:
    """Return N_a at the points `xi` (p, 3), shape (p, 8)."""
    return np.prod(1 + xi[:, None, :] * CORNERS[None], axis=2) / 8


def gradients(xi: FloatArray) -> FloatArray:
    """Return dN_a/dxi at the points `xi` (p, 3), shape (p, 8, 3)."""
    f = 1 + xi[:, None, :] * CORNERS[None]
    others = np.stack([f[..., 1] * f[..., 2], f[..., 0] * f[..., 2], f[..., 0] * f[..., 1]], -1)
    return CORNERS[None] * others / 8


def gauss(count: int) -> tuple[FloatArray, FloatArray]:
    """Return the points (count³, 3) and weights (count³,) of the Gauss rule on [-1, 1]^3."""
    x, w = np.polynomial.legendre.leggauss(count)
    points = np.stack(np.meshgrid(x, x, x, indexing="ij"), -1).reshape(-1, 3)
    return points, np.einsum("i,j,k->ijk", w, w, w).ravel()


def beyond(xi: FloatArray) -> FloatArray:
    """Return the largest coordinate of the points `xi` (p, 3), which is 1 on the boundary, shape (p,)."""
    return np.asarray(np.abs(xi).max(axis=1))


H8 = Element(
    "h8", "hexahedron", CORNERS, functions, gradients, *gauss(2), tuple(Face(QUADRILATERAL4, f) for f in FACES),
    gauss(3), beyond, quadratic="h20",
)  # fmt: skip
H8_MODES = replace(H8, name="h8_modes", linear=H8, modes=True, chosen_for=("hexahedron",))
