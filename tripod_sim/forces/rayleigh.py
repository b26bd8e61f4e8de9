"""Stiffness-proportional damping, lagged: within one step it is the quadratic potential of a fixed matrix."""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.forces.solid_kernels import add_element_products

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


class StiffnessDamping:
    """Dissipation D(x) = c/2 (x - x_n)^T K_n (x - x_n), c = b / dt, whose gradient is the force b K_n v.

    K_n is the tangent last assembled at the start of a step: of this one, or of the earlier step whose factorisation
    still serves.

    Attributes:
        factor: c [dimensionless].
        matrices: Element matrices of K_n [N/m], as `Solid.matrices`.
        start: x_n [m], shape (n, 3).
    """

    def __init__(self, coefficient: float, elements: IndexArray, matrices: FloatArray, size: int) -> None:
        """`coefficient`: b [s]; `matrices`: those of the solid, for their shape."""
        self.coefficient, self.factor = coefficient, 0.0
        self._elements, self._all = elements, np.arange(len(elements))
        self.matrices = np.zeros_like(matrices)
        self.start = np.zeros((size, 3))
        self._move = np.zeros((size, 3))

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dD/dx [N] to `g` and return D [J]."""
        np.subtract(x, self.start, out=self._move)
        if not self._move.any():  # a step begins so
            return 0.0
        return float(
            add_element_products(self.matrices, self._elements, self._all, self._move, self.factor, g)
        )
