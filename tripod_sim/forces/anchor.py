"""Quadratic pull of each node to a point: what inertia and mass damping are within one implicit step."""

import numpy as np
from numba import njit

from tripod_host.arrays import FloatArray
from tripod_sim.forces.term import Term


class Anchor(Term):
    """Potential Q(x) = 1/2 sum_i w_i |x_i - y_i|²; dQ/dx_i = w_i (x_i - y_i).

    Implicit Euler's inertia is w = m / dt², y = x_n + dt v_n; mass damping adds w = a m / dt, y = x_n.

    Attributes:
        weight: w [N/m], shape (n,).
        point: y [m], shape (n, 3).
        per_mass: w / m, the same for all nodes with mass [1/s²].
    """

    name = "inertia"
    weight: FloatArray

    def __init__(self, size: int) -> None:
        self.weight, self.point, self.per_mass = np.zeros(size), np.zeros((size, 3)), 0.0

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dQ/dx [N] to `g` and return Q [J]."""
        return float(_add(x, self.weight, self.point, g))


@njit(cache=True, error_model="numpy")
def _add(x: FloatArray, weight: FloatArray, point: FloatArray, g: FloatArray) -> float:
    total = 0.0
    for n in range(x.shape[0]):
        for i in range(3):
            d = x[n, i] - point[n, i]
            g[n, i] += weight[n] * d
            total += 0.5 * weight[n] * d * d
    return total
