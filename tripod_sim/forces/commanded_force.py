"""A force on nodes whose size is commanded."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.forces.actuator import ActuatorTerm


class CommandedForce(ActuatorTerm):
    """A force of q newtons on nodes along a fixed direction: V = -q sum of share_a · (x_a - X_a)."""

    name = "force"

    def __init__(self, shares: FloatArray, rest: FloatArray) -> None:
        """`shares`: unit direction times the share of each node, shape (n, 3); `rest`: X [m], shape (n, 3)."""
        self._shares, self._before = shares, float(np.vdot(shares, rest))
        self.elements = np.zeros((0, 1), dtype=np.int64)
        self.matrices = np.zeros((0, 3, 3))

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Write nothing: the force does not change with `x`."""

    def add_products(self, dx: FloatArray, g: FloatArray) -> None:
        """Add nothing."""

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add -q shares to `g` [N], shape (n, 3); return V [J]."""
        self.effort = self._before - float(np.vdot(self._shares, x))
        g -= self.value * self._shares
        return self.value * self.effort

    def add_coupling(self, x: FloatArray, out: FloatArray) -> None:
        """Add -shares."""
        out -= self._shares
