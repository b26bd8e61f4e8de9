"""Stiffness-proportional damping: the rate of the elastic forces, or the projected tangent times the velocity."""

import numpy as np
from numba import njit

from tripod_host.arrays import FloatArray
from tripod_sim.forces.elastic import Elastic


class StiffnessDamping:
    """Force -b dg/dt, g = dE/dx: where the tangent K is constant Rayleigh's -b K v, elsewhere that of each moment.

    An implicit stage x' = z + s v' has the rate (g' - q) / s, with q made of earlier g as z is of earlier x, and is the
    gradient of

        D(x') = c (E(x') - q . (x' - z)),   c = b / s.

    Where K is so far from positive that a step has to project it (to K+), that force would drive the body on, from one
    buckled shape to the next. There the projected tangent is held, and serves until a step renews its factorisation:

        D(x') = c/2 (x' - z)^T K+ (x' - z).

    Attributes:
        factor: c [dimensionless].
        start: z [m], shape (n, 3).
        elastic: q [N], shape (n, 3).
        held: Whether K+ serves.
        matrices: Element matrices of K+ [N/m], as `Elastic.matrices`.
    """

    def __init__(self, coefficient: float, elastic: Elastic, size: int) -> None:
        """`coefficient`: b [s]; `elastic`: what is damped; `size`: number of nodes n."""
        self.coefficient, self.factor = coefficient, 0.0
        self.start, self.elastic = np.zeros((size, 3)), np.zeros((size, 3))
        self.held, self.matrices = False, [np.zeros_like(m) for m in elastic.matrices]
        self._damped = elastic

    def hold(self) -> None:
        """Let the element matrices at hand be those of K+ and serve from now on."""
        self.held = True
        for kept, now in zip(self.matrices, self._damped.matrices, strict=True):
            kept[:] = now

    def add_gradient(self, x: FloatArray, energy: float, elastic: FloatArray, g: FloatArray) -> float:
        """Add dD/dx [N] to `g` and return D [J], given E [J] and its gradient [N] at `x`."""
        if self.held:
            move = x - self.start
            return self._damped.add_products(self.matrices, move, self.factor, g)
        return self.factor * (energy - _add(x, self.start, elastic, self.elastic, self.factor, g))


@njit(cache=True, error_model="numpy")
def _add(
    x: FloatArray, start: FloatArray, elastic: FloatArray, before: FloatArray, factor: float, g: FloatArray
) -> float:
    """Add factor (elastic - before) to `g` and return before . (x - start)."""
    work = 0.0
    for n in range(x.shape[0]):
        for i in range(3):
            g[n, i] += factor * (elastic[n, i] - before[n, i])
            work += before[n, i] * (x[n, i] - start[n, i])
    return work
