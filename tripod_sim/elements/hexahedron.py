"""Eight-node hexahedron with incompatible modes (H8).

Besides the trilinear shape functions N_a, each element has three quadratic modes M_k = 1 - xi_k^2 with vector
amplitudes of its own, condensed element by element: bending of a single layer then costs no locking. The deformation
gradient is

    F = I + sum_a u_a (x) dN_a/dX + sum_k alpha_k (x) G_k,   G_k = (j_0 / j) J_0^-T dM_k/dxi,

with the Jacobian J_0 (determinant j_0) at the element's centre, so that constant strain is represented exactly in any
shape (patch test) [Taylor1976], [SimoArmero1992].
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]],
    float,
)
"""Reference coordinates of the nodes, VTK order, shape (8, 3)."""

GAUSS = CORNERS / np.sqrt(3.0)
"""2x2x2 Gauss points, each of weight 1, shape (8, 3)."""


def shape_functions(xi: FloatArray) -> FloatArray:
    """Return N_a at the points `xi`, shape (p, 3), as shape (p, 8)."""
    return np.prod(1 + xi[:, None, :] * CORNERS[None], axis=2) / 8


def shape_gradients(xi: FloatArray) -> FloatArray:
    """Return dN_a/dxi at the points `xi`, shape (p, 3), as shape (p, 8, 3)."""
    factors = 1 + xi[:, None, :] * CORNERS[None]
    others = np.stack(
        [
            factors[..., 1] * factors[..., 2],
            factors[..., 0] * factors[..., 2],
            factors[..., 0] * factors[..., 1],
        ],
        -1,
    )
    return CORNERS[None] * others / 8


def h8_gradients(corners: FloatArray, *, modes: bool = True) -> tuple[FloatArray, FloatArray]:
    """Return reference gradients and integration weights of every element.

    Args:
        corners: Undeformed node positions of each element [m], shape (m, 8, 3).
        modes: Whether to add the three incompatible modes.

    Returns:
        Gradients dN_a/dX and then G_k [1/m], shape (m, 8, 8 or 11, 3), and weights (volumes) [m³], shape (m, 8).
    """
    dn = shape_gradients(GAUSS)
    jacobian = np.einsum("qaj,eai->eqij", dn, corners)  # dX_i/dxi_j
    volume = np.linalg.det(jacobian)
    inverse = np.linalg.inv(jacobian)
    gradients = np.einsum("qaj,eqji->eqai", dn, inverse)
    if not modes:
        return gradients, volume
    centre = np.einsum("aj,eai->eij", shape_gradients(np.zeros((1, 3)))[0], corners)
    dm = np.zeros((8, 3, 3))
    dm[:, range(3), range(3)] = -2 * GAUSS
    enhanced = np.einsum("qkj,eji->eqki", dm, np.linalg.inv(centre))
    enhanced *= (np.linalg.det(centre)[:, None] / volume)[:, :, None, None]
    return np.concatenate([gradients, enhanced], axis=2), volume


def h8_node_volumes(corners: FloatArray) -> FloatArray:
    """Return the volume lumped at each node, int N_a dV [m³], shape (m, 8); they sum to the element's."""
    jacobian = np.einsum("qaj,eai->eqij", shape_gradients(GAUSS), corners)
    return np.einsum("qa,eq->ea", shape_functions(GAUSS), np.linalg.det(jacobian))
