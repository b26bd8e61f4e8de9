"""A chamber: a gas or a liquid of one pressure in a volume that a closed surface encloses.

The potential is -p V(x), p the pressure above that outside and V the volume [BonetWood2008, section 8.5]. It is exact
for any motion and any time step: the pressure follows the surface. V is the volume of the interpolated faces, curved
ones included (`mesh.closed_surface`), without quadrature error.

The Hessian -p d²V/dx² is symmetric and indefinite: its blocks have zero trace. Made positive semi-definite block by
block it would depend on the origin, so the projected tangent leaves it out.

Commanded by volume, q is what is pumped in [m³] of a liquid of bulk modulus K. With s = K / V_0

    1/2 s (V(x) - V_0 - q)²,    dV/dq = p = -s (V(x) - V_0 - q),

whose Hessian also has s dV/dx dV/dx^T, one dense block of all nodes of the surface. The liquid holds as well as it
pushes: p may be negative.
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
    """The potential of a pressure p = `value` [Pa] in a closed surface, or of a volume q = `value` [m³] pumped in.

    Attributes:
        surface: What encloses the chamber.
        elements: Pairs of nodes, shape (k, 2); by volume all nodes, shape (1, n).
        matrices: Blocks of the last `stiffness` [N/m], shape (k, 6, 6) or (1, 3 n, 3 n).
        undeformed: V_0 [m³].
        volume: The enclosed volume at the last evaluation [m³]; negative if the surface encloses the body.
        pressure: p there [Pa].
    """

    name = "chamber"

    def __init__(
        self, surface: ClosedSurface, rest: FloatArray, owner: str = "chamber", *, bulk: float | None = None
    ) -> None:
        """Take a closed surface; `mesh.cavity` finds and checks it.

        Args:
            surface: What encloses the chamber.
            rest: Undeformed positions [m], shape (n, 3).
            owner: Name of the chamber, for messages.
            bulk: K [Pa], where the volume is commanded; None: the pressure is.
        """
        self.surface, self._owner, self.undeformed = surface, owner, surface.volume(rest)
        self.volume, self.pressure = self.undeformed, 0.0
        self._triples, self._weights = volume_polynomial(surface)
        pairs = self._triples[:, [0, 1, 1, 2, 0, 2]].reshape(-1, 2)
        size = int(pairs.max()) + 1
        keys, which = np.unique(pairs[:, 0] * size + pairs[:, 1], return_inverse=True)
        self._blocks, self._pairs = np.zeros((len(keys), 6, 6)), which.reshape(-1, 3)
        self.elements, self.matrices = np.stack([keys // size, keys % size], axis=1), self._blocks
        self._per_volume = None if bulk is None else bulk / self.undeformed
        if bulk is not None:
            own, local = np.unique(self.elements, return_inverse=True)
            self._ends, self.elements = local.reshape(-1, 2), own[None]
            self.matrices = np.zeros((1, 3 * len(own), 3 * len(own)))
            self._slope, self.effort_slope = np.zeros_like(rest), self._per_volume or 0.0
        self._every = np.arange(len(self.elements))

    def _measure(self, x: FloatArray) -> float:
        """Write volume, pressure and effort at `x` [m], shape (n, 3); return the potential [J]."""
        self.volume = float(add_volume_gradient(self._triples, self._weights, x, 0.0, np.zeros_like(x)))
        if self._per_volume is None:
            self.pressure, self.effort = self.value, -self.volume
            return -self.value * self.volume
        excess = self.volume - self.undeformed - self.value
        self.pressure = self.effort = -self._per_volume * excess
        return 0.5 * self._per_volume * excess * excess

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add -p dV/dx to `g` [N], shape (n, 3), and return the potential [J]."""
        if self._per_volume is None:
            self.volume = float(add_volume_gradient(self._triples, self._weights, x, -self.value, g))
            self.pressure, self.effort = self.value, -self.volume
            return self.value * self.effort
        energy = self._measure(x)
        add_volume_gradient(self._triples, self._weights, x, -self.pressure, g)
        return energy

    def add_coupling(self, x: FloatArray, out: FloatArray) -> None:
        """Add -dV/dx [m²], or by volume -s dV/dx [Pa/m], to `out`, shape (n, 3)."""
        add_volume_gradient(self._triples, self._weights, x, -(self._per_volume or 1.0), out)

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Write `matrices` at `x` [m], shape (n, 3); with `project` without p d²V/dx²."""
        if self._per_volume is not None:
            self._measure(x)
        factor = 0.0 if project else -self.pressure if self._per_volume else -self.value
        write_volume_blocks(self._triples, self._weights, self._pairs, x, factor, self._blocks)
        if self._per_volume is None:
            return
        own, n = self.elements[0], len(self.elements[0])
        self._slope[own] = 0.0
        add_volume_gradient(self._triples, self._weights, x, 1.0, self._slope)
        slope = self._slope[own].ravel()
        np.multiply.outer(self._per_volume * slope, slope, out=self.matrices[0])
        a, b = self._ends.T
        by_node = self.matrices[0].reshape(n, 3, n, 3)
        by_node[a, :, b, :] += self._blocks[:, :3, 3:]
        by_node[b, :, a, :] += self._blocks[:, 3:, :3]

    def add_products(self, dx: FloatArray, g: FloatArray) -> None:
        """Add the blocks of the last `stiffness` times `dx` [m] to `g` [N], both of shape (n, 3)."""
        add_element_products(self.matrices, self.elements, self._every, dx, 1.0, g)

    def energies(self, x: FloatArray) -> tuple[float, float]:
        """Return the energy of a compressed liquid, and none in gravity [J]; a given pressure does work only."""
        return (0.0 if self._per_volume is None else self._measure(x)), 0.0

    def runaway(self) -> str:
        """Return in words how far the chamber is blown up, if that is a likely cause of a failed solve; else empty."""
        ratio = self.volume / self.undeformed
        if ratio <= RUNAWAY or self._per_volume is not None:
            return ""
        return (
            f"likely cause: {self._owner} at {self.value:.3g} Pa is blown up to {ratio:.3g} times its volume, and "
            "above the largest pressure that a body bears there is no equilibrium; lower the pressure, or raise it in "
            "smaller steps"
        )
