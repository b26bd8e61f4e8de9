"""Elastic foundation: the compliant clamp.

The clamped part of the body is not tied to the arm but bedded on it. With p the place that the arm gives to each point,

    E = kappa/2 int |x - p|² dV

over the clamped elements: the edge of the clamp is no longer a singular line, and meshes converge. The place p is
interpolated from ghosts: a second, driven node for each clamped one, so that torque and compliance need no rule of
their own.
"""

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.elements.element import Element, shape_products
from tripod_sim.forces.term import LinearTerm


class Foundation(LinearTerm):
    """The bedding of some elements on ghosts: `couplings` are kappa int N_a N_b dV [N/m]."""

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
        super().__init__(elements, ghosts, stiffness * shape_products(kind, rest[elements]))

    def energies(self, x: FloatArray) -> tuple[float, float]:
        """Return E, which is strain energy, and 0 [J]."""
        return self.add_gradient(x, np.zeros_like(x)), 0.0
