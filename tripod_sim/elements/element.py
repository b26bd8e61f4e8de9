"""What a finite element is: shape functions on a reference cell, and the points at which it integrates."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.elements.faces import Face

Rule = tuple[FloatArray, FloatArray]
"""Quadrature points (q, 3) and weights (q,)."""

Lumping = Callable[[FloatArray, FloatArray], FloatArray]
"""Takes N_a at the points (q, n) and volumes of the points (m, q) [m³]; returns the volumes of nodes (m, n) [m³]."""


def row_sums(values: FloatArray, volume: FloatArray) -> FloatArray:
    """Return int N_a dV: the lumping of linear elements."""
    return np.einsum("qa,eq->ea", values, volume)


def diagonal_scaling(values: FloatArray, volume: FloatArray) -> FloatArray:
    """Return volumes in proportion to int N_a² dV: the lumping of quadratic elements, whose row sums are negative at
    corners [HintonRockZienkiewicz1976].
    """
    square = np.einsum("qa,eq->ea", values**2, volume)
    return square * (volume.sum(axis=1) / square.sum(axis=1))[:, None]


@dataclass(frozen=True, eq=False)
class Element:
    """One kind of element. Its module registers it by the name it has there (`catalogue`).

    The reference cell is its own mirror image where the first two coordinates are exchanged.

    Attributes:
        name: As scenes name it.
        cell: As mesh files name its cell (meshio); node order is VTK's, with the determinants of Jacobians positive.
        reference: Reference coordinates of the nodes, corners first, shape (n, 3).
        functions: N_a at points (p, 3), shape (p, n).
        gradients: dN_a/dxi at points (p, 3), shape (p, n, 3).
        points: Quadrature points, shape (q, 3).
        weights: Quadrature weights, shape (q,); they sum to the volume of the reference cell.
        faces: Of any shapes.
        products: Quadrature of N_a N_b: of mass matrices and foundations.
        beyond: How far points (p, 3) lie out of the reference cell; larger where farther, in no unit.
        lumping: How nodes carry inertia.
        linear: The element with the corners alone, None if it is one.
        centres: Corners in the middle of which each node beyond the corners lies.
        divisions: Nodes of each of the parts into which cells of other kinds are divided to become such elements, by
            the names of these cells; of a linear element.
        quadratic: Name of the element on the same cells by which a linear one is judged; empty: it is not judged.
        full: Name of the element to take where this one's points leave motions of a mesh without energy, if it has any.
        chosen_for: Cells for which it is taken where a scene names no element.
        neighbours: Among how many elements, those with the nearest centres, one that holds a point is sought.
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
    faces: tuple[Face, ...]
    products: Rule
    beyond: Callable[[FloatArray], FloatArray]
    lumping: Lumping = row_sums
    linear: "Element | None" = None
    centres: tuple[tuple[int, ...], ...] = ()
    divisions: Mapping[str, tuple[tuple[int, ...], ...]] = field(default_factory=dict)
    quadratic: str = ""
    full: str = ""
    chosen_for: tuple[str, ...] = ()
    neighbours: int = 8
    modes: bool = False
    mean_dilatation: bool = False

    @property
    def size(self) -> int:
        """Number of nodes."""
        return len(self.reference)

    @property
    def plain(self) -> "Element":
        """The element with its corners alone: `linear`, or itself."""
        return self.linear or self

    @property
    def corners(self) -> int:
        """Number of corner nodes of the cell."""
        return self.plain.size

    @property
    def centre(self) -> FloatArray:
        """Mean of the corners in reference coordinates, shape (1, 3)."""
        return self.plain.reference.mean(axis=0, keepdims=True)

    @property
    def mirrored(self) -> list[int]:
        """The nodes in the order that turns an element over: seen in a mirror, its cell is the same."""
        seen = self.reference[:, [1, 0, 2]]
        return [int(np.argmin(np.linalg.norm(self.reference - place, axis=1))) for place in seen]

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
        centre = element.jacobians(nodes, element.centre)[:, 0]
        dm = np.zeros((len(element.points), 3, 3))
        dm[:, range(3), range(3)] = -2 * element.points
        enhanced = np.einsum("qkj,eji->eqki", dm, np.linalg.inv(centre))
        enhanced *= (np.linalg.det(centre)[:, None] / determinant)[:, :, None, None]
        gradients = np.concatenate([gradients, enhanced], axis=2)
    return gradients, determinant * element.weights


def shape_products(element: Element, nodes: FloatArray) -> FloatArray:
    """Return int N_a N_b dV [m³], shape (m, n, n), of elements with `nodes` (m, n, 3)."""
    points, weights = element.products
    volume = np.abs(np.linalg.det(element.jacobians(nodes, points))) * weights
    values = element.functions(points)
    return np.asarray(np.einsum("eq,qa,qb->eab", volume, values, values))


def node_volumes(element: Element, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the volumes with which nodes carry loads and inertia [m³], both of shape (m, n).

    Loads are consistent, int N_a dV. Inertia is lumped as the element has it (`Element.lumping`). Either sums to the
    element's volume. What lumping by `diagonal_scaling` lacks, implicit schemes add (`forces.element_inertia`).
    """
    volume = np.linalg.det(element.jacobians(nodes, element.points)) * element.weights
    values = element.functions(element.points)
    load = row_sums(values, volume)
    return load, load if element.lumping is row_sums else element.lumping(values, volume)
