"""Elastic foundation: the compliant clamp.

The clamped part of the body is not tied to the arm but bedded on it. With p the place that the arm gives to each point,

    E = kappa/2 int |x - p|² dV

over the clamped elements: the edge of the clamp is no longer a singular line, and meshes converge. The place p is
interpolated from ghosts: a second, driven node for each clamped one, so that torque and compliance need no rule of
their own.
"""

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.elements.element import Element
from tripod_sim.elements.hexahedron import gauss
from tripod_sim.elements.tetrahedron import T10
from tripod_sim.forces.solid_kernels import add_element_products
from tripod_sim.forces.term import LinearTerm


class Foundation(LinearTerm):
    """The bedding of some elements on ghosts.

    Attributes:
        elements: Nodes of each clamped element and then their ghosts, shape (m, 2 n).
        matrices: kappa int [N_a N_b, -N_a N_b; -N_a N_b, N_a N_b] dV I [N/m], shape (m, 6 n, 6 n).
    """

    name = "clamp"

    def __init__(
        self, kind: Element, rest: FloatArray, elements: IndexArray, ghosts: IndexArray, stiffness: float
    ) -> None:
        """Bed elements.

        Args:
            kind: Of the elements.
            rest: Undeformed positions [m], shape (nodes, 3).
            elements: Node indices of the clamped elements, shape (m, n).
            ghosts: Their ghosts, shape (m, n).
            stiffness: kappa [N/m⁴]: force per volume and displacement.
        """
        self.elements = np.ascontiguousarray(np.hstack([elements, ghosts]))
        points, weights = gauss(3) if kind.corners == 8 else (T10.points, T10.weights)
        volume = np.abs(np.linalg.det(kind.jacobians(rest[elements], points))) * weights
        values = kind.functions(points)
        mass = stiffness * np.einsum("eq,qa,qb->eab", volume, values, values)
        block = np.concatenate(
            [np.concatenate([mass, -mass], axis=2), np.concatenate([-mass, mass], axis=2)], axis=1
        )
        self._all = np.arange(len(elements))
        size = 3 * self.elements.shape[1]
        self.matrices = np.einsum("eab,ij->eaibj", block, np.eye(3)).reshape(len(elements), size, size)

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dE/dx [N] to `g` and return E [J]; both arrays of shape (nodes and ghosts, 3)."""
        return float(add_element_products(self.matrices, self.elements, self._all, x, 1.0, g))

    def energies(self, x: FloatArray) -> tuple[float, float]:
        """Return E, which is strain energy, and 0 [J]."""
        return self.add_gradient(x, np.zeros_like(x)), 0.0
