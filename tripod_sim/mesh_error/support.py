"""Stiff supports of points within elements: what holds a body that leans on something, for the error of its mesh.

With P_v the interpolation at a point, y_v where it is held and D_v the directions along which it is,

    E = kappa/2 sum_v (P_v x - y_v) . D_v (P_v x - y_v).
"""

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.forces.solid_kernels import add_element_products
from tripod_sim.forces.term import BlockTerm


class Support(BlockTerm):
    """Points of a mesh that may be held.

    Attributes:
        elements: Nodes of the elements that have such points, shape (m, k).
        matrices: Second derivatives [N/m], shape (m, 3 k, 3 k).
    """

    name = "mesh_error"

    def __init__(self, nodes: IndexArray, weights: FloatArray, stiffness: float) -> None:
        """Hold nothing yet.

        Args:
            nodes: Of the element about each point, shape (p, k).
            weights: Of these nodes at the point, shape (p, k).
            stiffness: kappa [N/m].
        """
        self.elements, self._of = np.unique(nodes, axis=0, return_inverse=True)
        self._of = self._of.ravel()
        self._nodes, self._weights, self._stiffness = nodes, weights, stiffness
        size = 3 * nodes.shape[1]
        self.matrices = np.zeros((len(self.elements), size, size))
        self._all = np.arange(len(self.elements))
        self._held = np.zeros(0, dtype=np.int64)
        self._along, self._place = np.zeros((0, 3, 3)), np.zeros((0, 3))

    def places(self, x: FloatArray) -> FloatArray:
        """Return where all points are [m], shape (p, 3), with nodes at `x`."""
        return np.asarray(np.einsum("pa,pai->pi", self._weights, x[self._nodes]))

    def hold(self, points: IndexArray, along: FloatArray, place: FloatArray) -> None:
        """Hold `points`, shape (h,), at `place` y [m], (h, 3), along D, (h, 3, 3); let go of all others."""
        self._held, self._along, self._place = points, self._stiffness * along, place
        self.matrices[:] = 0.0
        w = self._weights[points]
        size = self.matrices.shape[1]
        blocks = np.einsum("ha,hb,hij->haibj", w, w, self._along).reshape(-1, size, size)
        np.add.at(self.matrices, self._of[points], blocks)

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dE/dx [N] to `g` and return E [J]; both arrays of shape (n, 3)."""
        if not len(self._held):
            return 0.0
        nodes, w = self._nodes[self._held], self._weights[self._held]
        miss = np.einsum("ha,hai->hi", w, x[nodes]) - self._place
        pull = np.einsum("hij,hj->hi", self._along, miss)
        np.add.at(g, nodes, w[:, :, None] * pull[:, None])
        return 0.5 * float(np.vdot(pull, miss))

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Nothing changes with `x`."""

    def add_products(self, dx: FloatArray, g: FloatArray) -> None:
        """Add the change of dE/dx when nodes move by `dx` [m], shape (n, 3), to `g`."""
        add_element_products(self.matrices, self.elements, self._all, dx, 1.0, g)
