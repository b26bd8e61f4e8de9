"""Springs as an elastic term of a system, and their dampers."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tripod_sim.forces.solid_kernels import add_element_products
from tripod_sim.springs.spring_kernels import Links, add_gradient, elastic_energy, lengths, tangents

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


class SpringForce:
    """Strain energy E = sum of k (l - L)² / 2 over springs of length l (see `springs.body`).

    Attributes:
        elements: The ends of each spring, shape (m, 2).
        matrices: [B, -B; -B, B] of each [N/m], shape (m, 6, 6), of the last `stiffness`.
        mode_residual_squared: 0: springs have no modes.
    """

    has_modes = False

    def __init__(
        self, ends: IndexArray, rest_length: FloatArray, stiffness: FloatArray, *, slack: bool, owner: str
    ) -> None:
        """Join nodes.

        Args:
            ends: Node indices of each spring, shape (m, 2).
            rest_length: L [m], shape (m,).
            stiffness: k [N/m], shape (m,).
            slack: Whether springs that are compressed carry no force.
            owner: Name of the body, for messages.
        """
        m, self._owner = len(ends), owner
        self.elements = np.ascontiguousarray(ends)
        self.matrices, self.mode_residual_squared = np.zeros((m, 6, 6)), 0.0
        self._links = Links(self.elements, rest_length, stiffness, np.zeros(m), slack)
        self._none, self._blocks = np.zeros(m), np.zeros((m, 6))

    def rest_modes(self) -> FloatArray:
        """Return no modes, shape (m, 0, 3)."""
        return np.zeros((len(self.elements), 0, 3))

    def energy(self, x: FloatArray, modes: FloatArray) -> float:
        """Return E [J] at positions `x` [m], shape (n, 3)."""
        return float(elastic_energy(x, self._links))

    def add_gradient(self, x: FloatArray, modes: FloatArray, g: FloatArray) -> float:
        """Add dE/dx [N] to `g`, shape (n, 3), and return E [J]."""
        return float(add_gradient(x, self._links, 0.0, self._none, g))

    def stiffness(self, x: FloatArray, modes: FloatArray, *, project: bool) -> int:
        """Write `matrices`, with `project` positive semi-definite; return -1."""
        tangents(x, self._links, 0.0, self._none, project, self._blocks)
        _expand(self._blocks, self.matrices)
        return -1

    def advance_modes(self, modes: FloatArray, dx: FloatArray, scale: float, out: FloatArray) -> None:
        """There are none."""

    def balance_modes(self) -> None:
        """There are none."""

    def forget(self) -> None:
        """There is nothing to forget."""

    def culprit(self, x: FloatArray, modes: FloatArray) -> tuple[float, str]:
        """Return that the springs are to blame last of all: they carry any length."""
        return np.inf, f"springs of {self._owner} move too far"


class SpringDampers:
    """Dampers along springs, whose force c dl/dt an implicit stage takes from how the lengths change in it.

    What a scheme does to positions it does to lengths: dl/dt = (l - l_0) / s. So the force is the gradient of

        D(x') = sum of c/(2 s) (l(x') - l_0)².

    Attributes:
        elements: The ends of each damper, shape (m, 2).
        matrices: Of the last `stiffness` [N/m], shape (m, 6, 6).
        reference: l_0 [m], shape (m,).
        rate: 1 / s [1/s].
    """

    def __init__(self, ends: IndexArray, damping: FloatArray) -> None:
        """`ends`: node indices, shape (m, 2); `damping`: c [N s/m], shape (m,)."""
        m = len(ends)
        self.elements = np.ascontiguousarray(ends)
        self._links = Links(self.elements, np.zeros(m), np.zeros(m), damping, False)
        self.matrices, self._blocks = np.zeros((m, 6, 6)), np.zeros((m, 6))
        self.reference, self.rate = np.zeros(m), 0.0
        self._all = np.arange(m)

    def lengths(self, x: FloatArray, out: FloatArray) -> None:
        """Write l of each at positions `x` [m], shape (n, 3), to `out`, shape (m,)."""
        lengths(x, self._links, out)

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dD/dx [N] to `g`, shape (n, 3), and return D [J]."""
        return float(add_gradient(x, self._links, self.rate, self.reference, g))

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Write `matrices`, with `project` positive semi-definite."""
        tangents(x, self._links, self.rate, self.reference, project, self._blocks)
        _expand(self._blocks, self.matrices)

    def add_products(self, dx: FloatArray, g: FloatArray) -> None:
        """Add the matrices times `dx` [m] to `g` [N], both of shape (n, 3)."""
        add_element_products(self.matrices, self.elements, self._all, dx, 1.0, g)


@njit(cache=True, error_model="numpy")
def _expand(blocks: FloatArray, out: FloatArray) -> None:
    """Write [B, -B; -B, B] for each B given as xx, xy, xz, yy, yz, zz."""
    for m in range(blocks.shape[0]):
        k = 0
        for i in range(3):
            for j in range(i, 3):
                b = blocks[m, k]
                k += 1
                out[m, i, j] = out[m, j, i] = out[m, 3 + i, 3 + j] = out[m, 3 + j, 3 + i] = b
                out[m, i, 3 + j] = out[m, 3 + j, i] = out[m, j, 3 + i] = out[m, 3 + i, j] = -b
