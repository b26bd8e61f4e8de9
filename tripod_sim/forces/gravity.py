"""Weight of the nodes, and dead loads beside it."""

import numpy as np
from numba import njit

from tripod_host.arrays import FloatArray
from tripod_sim.forces.term import ForceTerm, at_nodes


class GravityForce(ForceTerm):
    """Potential V(x) = -sum_i (m_i a + f_i) . (x_i - X_i), zero in the undeformed shape X; dV/dx_i = -(m_i a + f_i)."""

    name, works = "gravity", False

    def __init__(
        self,
        mass: FloatArray,
        acceleration: tuple[float, float, float],
        rest: FloatArray,
        load: FloatArray | None = None,
    ) -> None:
        """`mass` [kg], shape (n,); `acceleration` [m/s²]; `rest` [m] and `load` f [N], shape (n, 3)."""
        self._gradient = -mass[:, None] * np.array(acceleration)
        if load is not None:
            self._gradient -= load
        self._offset = float(np.vdot(self._gradient, rest))
        self._load, self.exerts = load, "" if load is None else "load"

    @property
    def force(self) -> FloatArray:
        """Weight and dead load of each node [N], shape (n, 3)."""
        return -self._gradient

    @property
    def node_weights(self) -> FloatArray:
        """Weight of each node [N], shape (n, 3)."""
        return self.force if self._load is None else self.force - self._load

    def exerted(self, x: FloatArray, command: float, effort: float) -> tuple[FloatArray, FloatArray]:
        """Return the dead loads."""
        return at_nodes(x, np.zeros_like(x) if self._load is None else self._load)

    def energies(self, x: FloatArray) -> tuple[float, float]:
        """Return 0 and V [J]."""
        return 0.0, float(np.vdot(self._gradient, x)) - self._offset

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dV/dx [N] to `g` and return V [J]."""
        return float(_add(self._gradient, x, g)) - self._offset


@njit(cache=True, error_model="numpy")
def _add(gradient: FloatArray, x: FloatArray, g: FloatArray) -> float:
    """Add `gradient` to `g` and return gradient . x."""
    work = 0.0
    for n in range(x.shape[0]):
        for i in range(3):
            g[n, i] += gradient[n, i]
            work += gradient[n, i] * x[n, i]
    return work
