"""A chamber: a gas or a liquid of one pressure in a volume that a closed surface encloses.

The potential is -p V(x), p the pressure above that outside and V the volume [BonetWood2008, section 8.5]. It is exact
for any motion and any time step: the pressure follows the surface. V is the volume of the interpolated faces, curved
ones included (`mesh.closed_surface`), without quadrature error.

The Hessian -p d²V/dx² is symmetric and indefinite: its blocks have zero trace. Made positive semi-definite block by
block it would depend on the origin, so the projected tangent leaves it out.
"""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.forces.actuator import ActuatorTerm
from tripod_sim.forces.chamber_kernels import add_volume_gradient, write_volume_blocks
from tripod_sim.forces.solid_kernels import add_element_products
from tripod_sim.mesh.closed_surface import ClosedSurface, volume_polynomial

RUNAWAY = 2.0
"""Times the undeformed volume from which a chamber is named as what a solve may have failed by."""


class Chamber(ActuatorTerm):
    """The potential -p V(x) [J] of a pressure p = `value` [Pa] in a closed surface.

    Attributes:
        surface: What encloses the chamber.
        elements: Pairs of nodes, shape (k, 2).
        matrices: Blocks of the last `stiffness` [N/m], shape (k, 6, 6); zero with `project`.
    """

    name = "chamber"

    def __init__(self, surface: ClosedSurface, rest: FloatArray, owner: str = "chamber") -> None:
        """Take a closed surface; `mesh.cavity` finds and checks it.

        Args:
            surface: What encloses the chamber.
            rest: Undeformed positions [m], shape (n, 3).
            owner: Name of the chamber, for messages.
        """
        self.surface, self._owner, self._undeformed = surface, owner, surface.volume(rest)
        self._triples, self._weights = volume_polynomial(surface)
        pairs = self._triples[:, [0, 1, 1, 2, 0, 2]].reshape(-1, 2)
        size = int(pairs.max()) + 1
        keys, which = np.unique(pairs[:, 0] * size + pairs[:, 1], return_inverse=True)
        self.elements = np.stack([keys // size, keys % size], axis=1)
        self.matrices = np.zeros((len(keys), 6, 6))
        self._pairs, self._every = which.reshape(-1, 3), np.arange(len(keys))

    @property
    def volume(self) -> float:
        """The enclosed volume at the last `add_gradient` [m³]; negative if the surface encloses the body."""
        return -self.effort

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add -p dV/dx to `g` [N], shape (n, 3), and return -p V [J]."""
        self.effort = -float(add_volume_gradient(self._triples, self._weights, x, -self.value, g))
        return self.value * self.effort

    def add_coupling(self, x: FloatArray, out: FloatArray) -> None:
        """Add -dV/dx [m²] to `out`, shape (n, 3)."""
        add_volume_gradient(self._triples, self._weights, x, -1.0, out)

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Write `matrices` at `x` [m], shape (n, 3)."""
        factor = 0.0 if project else -self.value
        write_volume_blocks(self._triples, self._weights, self._pairs, x, factor, self.matrices)

    def add_products(self, dx: FloatArray, g: FloatArray) -> None:
        """Add the blocks of the last `stiffness` times `dx` [m] to `g` [N], both of shape (n, 3)."""
        add_element_products(self.matrices, self.elements, self._every, dx, 1.0, g)

    def runaway(self) -> str:
        """Return in words how far the chamber is blown up, if that is a likely cause of a failed solve; else empty."""
        ratio = self.volume / self._undeformed
        if ratio <= RUNAWAY:
            return ""
        return (
            f"likely cause: {self._owner} at {self.value:.3g} Pa is blown up to {ratio:.3g} times its volume, and "
            "above the largest pressure that a body bears there is no equilibrium; lower the pressure, or raise it in "
            "smaller steps"
        )
