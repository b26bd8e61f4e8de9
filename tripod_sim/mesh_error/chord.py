"""Steps with a kept factorisation that turns with the body, for a mesh whose new one takes the time of 20 of them."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.newton import Newton
from tripod_sim.system import System

SLOWLY = 0.8
"""What a step may leave of the unbalanced force; another factorisation follows where it leaves more."""

NEAR, PART = 5e-7, 0.1
"""How far a coordinate may be from its solution [m]; how far the last step may move the effector, beyond that, in parts
of the error that is told."""


class ChordNewton(Newton):
    """Keeps a factorisation as long as it converges, and ends once it knows the effector as well as is worth it.

    Attributes:
        amiss: Place of the body's effector [m], shape (3,), if its distance is all that is asked for; None: solves end
            within `NEAR`.
    """

    FEW = 20

    def __init__(self, system: System, tolerance: float, max_iterations: int) -> None:
        """As `Newton`."""
        super().__init__(system, tolerance, max_iterations)
        self.near = NEAR
        self.amiss: FloatArray | None = None
        self._centre = np.zeros(3)

    def _converges(self, size: float, before: float) -> bool:
        return size < SLOWLY * before

    def _ends(self) -> bool:
        last, self._centre = self._centre, self._state.centres[0].copy()
        if self.amiss is None:
            return super()._ends()
        told, change = np.linalg.norm(self._centre - self.amiss), np.linalg.norm(self._centre - last)
        return bool(self._size < SLOWLY * self._before and change <= NEAR + PART * told)
