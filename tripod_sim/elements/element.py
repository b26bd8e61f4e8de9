"""What a finite element is: shape functions on a reference cell, and the points at which it integrates."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Element:
    """One kind of element.

    Attributes:
        name: As scenes name it.
        cell: As mesh files name its cell (meshio); node order is VTK's.
        reference: Reference coordinates of the nodes, corners first, shape (n, 3).
        functions: N_a at points (p, 3), shape (p, n).
        gradients: dN_a/dxi at points (p, 3), shape (p, n, 3).
        points: Quadrature points, shape (q, 3).
        weights: Quadrature weights, shape (q,); they sum to the volume of the reference cell.
        faces: Node numbers of each face, corners first in a loop that is counter-clockwise seen from outside.
        corners: Number of corner nodes of the cell.
        modes: Whether incompatible modes are added (see `hexahedron`).
        mean_dilatation: Whether the points share one volume change (see `mean_dilatation`).
    """

    name: str
    cell: str
    reference: FloatArray
    functions: Callable[[FloatArray], FloatArray]
    gradients: Callable[[FloatArray], FloatArray]
    points: FloatArray
    weights: FloatArray
    faces: tuple[tuple[int, ...], ...]
    corners: int
    modes: bool = False
    mean_dilatation: bool = False

    @property
    def size(self) -> int:
        """Number of nodes."""
        return len(self.reference)

    @property
    def face_corners(self) -> int:
        """Corners of a face: 3 or 4."""
        return 3 if self.corners == 4 else 4

    def jacobians(self, nodes: FloatArray, xi: FloatArray) -> FloatArray:
        """Return dX_i/dxi_j at the points `xi` (p, 3) of elements with `nodes` (m, n, 3), shape (m, p, 3, 3)."""
        return np.einsum("paj,eai->epij", self.gradients(xi), nodes)


def reference_gradients(element: Element, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return reference gradients and integration weights.

    With incompatible modes M_k = 1 - xi_k^2 the gradients of the modes follow those of the nodes,
    G_k = (j_0 / j) J_0^-T dM_k/dxi, J_0 the Jacobian at the centre: constant strain is then represented exactly in any
    shape (patch test) [Taylor1976], [SimoArmero1992].

    Args:
        element: Its kind.
        nodes: Undeformed node positions of each element [m], shape (m, n, 3).

    Returns:
        dN_a/dX and then G_k [1/m], shape (m, q, n or n + 3, 3), and volumes [m³], shape (m, q).
    """
    jacobian = element.jacobians(nodes, element.points)
    determinant = np.linalg.det(jacobian)
    gradients = np.einsum("qaj,eqji->eqai", element.gradients(element.points), np.linalg.inv(jacobian))
    if element.modes:
        centre = element.jacobians(nodes, np.zeros((1, 3)))[:, 0]
        dm = np.zeros((len(element.points), 3, 3))
        dm[:, range(3), range(3)] = -2 * element.points
        enhanced = np.einsum("qkj,eji->eqki", dm, np.linalg.inv(centre))
        enhanced *= (np.linalg.det(centre)[:, None] / determinant)[:, :, None, None]
        gradients = np.concatenate([gradients, enhanced], axis=2)
    return gradients, determinant * element.weights


def shape_products(element: Element, nodes: FloatArray, rule: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return int N_a N_b dV [m³], shape (m, n, n), of elements with `nodes` (m, n, 3), by points and weights."""
    points, weights = rule
    volume = np.abs(np.linalg.det(element.jacobians(nodes, points))) * weights
    values = element.functions(points)
    return np.asarray(np.einsum("eq,qa,qb->eab", volume, values, values))


def node_volumes(element: Element, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the volumes with which nodes carry loads and inertia [m³], both of shape (m, n).

    Loads are consistent, int N_a dV. Inertia is lumped: the same for linear elements; for quadratic ones, where that is
    negative at corners, in proportion to int N_a^2 dV [HintonRockZienkiewicz1976]. Either sums to the element's volume.
    What is lacking of the inertia of quadratic elements, implicit schemes add (`forces.element_inertia`).
    """
    volume = np.linalg.det(element.jacobians(nodes, element.points)) * element.weights
    values = element.functions(element.points)
    load = np.einsum("qa,eq->ea", values, volume)
    if element.size in (4, 8):
        return load, load
    square = np.einsum("qa,eq->ea", values**2, volume)
    return load, square * (volume.sum(axis=1) / square.sum(axis=1))[:, None]
