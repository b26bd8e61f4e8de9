"""Weight of the nodes."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class GravityForce:
    """Potential V(x) = -sum_i m_i a . (x_i - X_i), zero in the undeformed shape X; dV/dx_i = -m_i a."""

    def __init__(self, mass: FloatArray, acceleration: tuple[float, float, float], rest: FloatArray) -> None:
        """`mass` [kg], shape (n,); `acceleration` [m/s²]; `rest` [m], shape (n, 3)."""
        self._gradient = -mass[:, None] * np.array(acceleration)
        self._offset = float(np.vdot(self._gradient, rest))

    @property
    def force(self) -> FloatArray:
        """The weight of each node [N], shape (n, 3)."""
        return -self._gradient

    def energy(self, x: FloatArray) -> float:
        """Return V [J]."""
        return float(np.vdot(self._gradient, x)) - self._offset

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dV/dx [N] to `g` and return V [J]."""
        g += self._gradient
        return self.energy(x)
