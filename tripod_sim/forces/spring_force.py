"""Springs with their dampers as an elastic term of a system."""

import math

import numpy as np
from numba import njit

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.forces.elastic import ElasticTerm
from tripod_sim.forces.solid_kernels import add_element_products
from tripod_sim.forces.spring_kernels import (
    Links,
    add_damper_gradient,
    add_gradient,
    add_gradients,
    add_products,
    add_rates,
    elastic_energy,
    has_dampers,
    lengths,
    links_of,
    rates_of,
    tangents,
)
from tripod_sim.system_kernels import largest


class SpringTangents:
    """What terms along springs share: their Hessian.

    Attributes:
        elements: The ends of each, shape (m, 2).
        links: As kernels take them.
        matrices: [B, -B; -B, B] of each [N/m], shape (m, 6, 6), of the last `write`.
    """

    def __init__(self, links: Links) -> None:
        m = len(links.ends)
        self.elements, self.links = links.ends, links
        self.matrices, self._blocks = np.zeros((m, 6, 6)), np.zeros((m, 6))
        self._none, self._all = np.zeros(m), np.arange(m)

    def write(self, x: FloatArray, rate: float, reference: FloatArray, *, project: bool) -> None:
        """Write `matrices` at positions `x` [m]; `rate`, `reference`: see `spring_kernels.tangents`."""
        tangents(x, self.links, rate, reference, project, self._blocks)
        _expand(self._blocks, self.matrices)

    def add_products(self, dx: FloatArray, g: FloatArray) -> None:
        """Add the matrices times `dx` [m] to `g` [N], both of shape (n, 3)."""
        add_element_products(self.matrices, self.elements, self._all, dx, 1.0, g)


class SpringForce(SpringTangents, ElasticTerm):
    """Strain energy E = sum of k (l - L)² / 2 over springs of length l, and their dampers (see `springs.body`).

    What a scheme does to positions it does to lengths, dl/dt = (l - l_0) / s. So the dampers' force in an implicit
    stage is the gradient of

        D(x') = sum of c/(2 s) (l(x') - l_0)²,

    and where slack springs go slack that of what `spring_kernels.stage_tension` has.

    Attributes:
        elements: The ends of each spring, shape (m, 2).
        matrices: [B, -B; -B, B] of each [N/m], shape (m, 6, 6), of the last `stiffness`.
        lasting: No: springs turn and go slack.
    """

    lasting = False
    links: Links

    def __init__(
        self, ends: IndexArray, rest_length: FloatArray, stiffness: FloatArray, damping: FloatArray, *, slack: bool,
        owner: str, viscosity: float = 0.0,
    ) -> None:  # fmt: skip
        """Join nodes.

        Args:
            ends: Node indices of each spring, shape (m, 2).
            rest_length: L [m], shape (m,).
            stiffness: k [N/m], shape (m,).
            damping: c [N s/m], shape (m,).
            slack: Whether springs only pull.
            owner: Name of the body, for messages.
            viscosity: b of further dampers b k [s], which of slack springs act while they are taut.
        """
        super().__init__(links_of(ends, rest_length, stiffness, damping, slack, viscosity))
        self._rounding = 1e-15 * float(stiffness.max(initial=0.0)) * math.sqrt(len(ends))
        self._owner, self._reference, self._rate = owner, np.zeros(len(ends)), 0.0
        self.remembers = len(ends) if has_dampers(self.links) else 0

    def energy(self, x: FloatArray, modes: FloatArray) -> float:
        """Return E [J] at positions `x` [m], shape (n, 3)."""
        return float(elastic_energy(x, self.links))

    def add_gradient(self, x: FloatArray, modes: FloatArray, g: FloatArray) -> float:
        """Add dE/dx [N] to `g`, shape (n, 3), and return E [J]."""
        return float(add_gradient(x, self.links, 0.0, self._none, g))

    def add_gradients(
        self, x: FloatArray, modes: FloatArray, g: FloatArray, d: FloatArray
    ) -> tuple[float, float]:
        """As `add_gradient`; add dD/dx to `d`, too, and return E and D [J]."""
        stored, lost = add_gradients(x, self.links, self._rate, self._reference, g, d)
        return float(stored), float(lost)

    def add_damper_gradient(self, x: FloatArray, modes: FloatArray, d: FloatArray) -> float:
        """Add dD/dx [N] to `d`, shape (n, 3), and return D [J]."""
        return float(add_damper_gradient(x, self.links, self._rate, self._reference, d))

    def remember(self, x: FloatArray, modes: FloatArray, out: FloatArray, *, known: bool) -> None:
        """Write the lengths at positions `x` [m] to `out`, shape (m,)."""
        lengths(x, self.links, out)

    def aim(self, s: float, known: FloatArray) -> None:
        """Let the lengths before be `known` [m], shape (m,), in a stage of `s` [s]."""
        self._rate, self._reference[:] = 1.0 / s, known

    def add_rates(
        self, x: FloatArray, modes: FloatArray, y: FloatArray, factor: float, out: FloatArray
    ) -> None:
        """Add `factor` C y to `out`, both of shape (n, 3), C the dampers' matrix at `x`."""
        add_rates(x, self.links, factor, self._reference, y, out)

    def add_damping_bound(self, x: FloatArray, modes: FloatArray, v: FloatArray, out: FloatArray) -> None:
        """Add to `out` what dampers have that pull in all directions, c [I, -I; -I, I], shape (n, 3)."""
        (i, j), c = self.elements.T, rates_of(self.links)[:, None]
        np.add.at(out, i, c * (v[i] - v[j]))
        np.add.at(out, j, c * (v[j] - v[i]))

    def rounding(self, x: FloatArray) -> float:
        """Return what rounding of positions makes of the forces at `x` [N]."""
        return self._rounding * largest(x)

    def add_present_products(
        self, x: FloatArray, modes: FloatArray, dx: FloatArray, out: FloatArray, *, damper: bool
    ) -> None:
        """Add the Hessian at `x` times `dx` [m] to `out` [N], of slack springs positive semi-definite."""
        rate = self._rate if damper else 0.0
        tangents(x, self.links, rate, self._reference, self.links.slack, self._blocks)
        add_products(self.elements, self._blocks, dx, 1.0, out)

    def stiffness(self, x: FloatArray, modes: FloatArray, *, damper: bool = False, project: bool) -> int:
        """Write `matrices`, with `project` positive semi-definite; return -1."""
        self.write(x, self._rate if damper else 0.0, self._reference, project=project)
        return -1

    def limit(self) -> None:
        """Write k times [I, -I; -I, I]: stretched, a spring's tangent is below that, k (1 - L / l) across it."""
        write_networks(self.links.stiffness, self.matrices)

    def culprit(self, x: FloatArray, modes: FloatArray) -> tuple[float, str]:
        """Return that the springs are to blame last of all: they carry any length."""
        return np.inf, f"springs of {self._owner} move too far"


def write_networks(weights: FloatArray, out: FloatArray) -> None:
    """Write w [I, -I; -I, I] for each of the `weights`, shape (m,), to `out`, shape (m, 6, 6)."""
    network = np.kron(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.eye(3))
    np.multiply(weights[:, None, None], network, out=out)


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
