"""Dead loads on nodes: what a body of its own, such as a ball, presses with during one step."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.forces.term import ForceTerm


class NodalLoads(ForceTerm):
    """Potential V(x) = -sum_i f_i . (x_i - X_i), zero in the undeformed shape X; dV/dx_i = -f_i.

    Whoever loads the body writes `force` before a step.
    """

    name, exerts = "ball", ""

    def __init__(self, rest: FloatArray) -> None:
        """`rest`: X [m], shape (n, 3)."""
        self._rest = rest
        self._force = np.zeros_like(rest)

    @property
    def force(self) -> FloatArray:
        """f [N], shape (n, 3), the array itself."""
        return self._force

    def share(self, other: "NodalLoads") -> None:
        """Take the loads of another, of the same nodes, from now on."""
        self._force = other.force

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dV/dx [N] to `g` and return V [J]."""
        g -= self.force
        return float(np.vdot(self.force, self._rest) - np.vdot(self.force, x))
