"""Weight and bedding of a reduced model, as terms of its rows."""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.reduced.rows import Rows

FloatArray = NDArray[np.float64]


class Weight:
    """The weight of all nodes, carried by the inert rows: V = -f . x, the same for every z as -F . B z."""

    def __init__(self, forces: FloatArray, columns: FloatArray, rows: Rows) -> None:
        """`forces`: F [N], shape (n, 3), zero on nodes of no mass; `columns`: B of all nodes, shape (3 n, size)."""
        self._inert = rows.inert
        self._gradient = -(forces.reshape(-1) @ columns @ rows.back).reshape(-1, 3)

    def energy(self, x: FloatArray) -> float:
        """Return V [J]."""
        return float(np.vdot(self._gradient, x[self._inert]))

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dV/dx [N] to `g` and return V [J]."""
        g[self._inert] += self._gradient
        return self.energy(x)


class Bedding:
    """The foundation of the clamps: E = 1/2 |x|² of the bedded rows, whose positions are in N^1/2 m^1/2.

    Attributes:
        matrices: None: `Projection` has them.
    """

    matrices = np.zeros((0, 0, 0))

    def __init__(self, rows: Rows) -> None:
        self._rows = rows.bedded

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dE/dx to `g` and return E [J]."""
        g[self._rows] += x[self._rows]
        return 0.5 * float(np.vdot(x[self._rows], x[self._rows]))
