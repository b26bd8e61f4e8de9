"""Dead loads on nodes: what a body of its own, such as a ball, presses with during one step."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.forces.term import ForceTerm


class NodalLoads(ForceTerm):
    """Potential V(x) = -sum_i f_i . (x_i - X_i), zero in the undeformed shape X; dV/dx_i = -f_i.

    Attributes:
        force: f [N], shape (n, 3); whoever loads the body writes it before a step.
    """

    name = "ball"
    force: FloatArray

    def __init__(self, rest: FloatArray) -> None:
        """`rest`: X [m], shape (n, 3)."""
        self._rest = rest
        self.force = np.zeros_like(rest)

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dV/dx [N] to `g` and return V [J]."""
        g -= self.force
        return float(np.vdot(self.force, self._rest) - np.vdot(self.force, x))
