"""Springs as an elastic term of a system, and their dampers."""

import numpy as np
from numba import njit

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.forces.elastic import ElasticTerm
from tripod_sim.forces.solid_kernels import add_element_products
from tripod_sim.forces.term import DamperTerm, StageTerm
from tripod_sim.springs.spring_kernels import (
    Links,
    add_gradient,
    elastic_energy,
    lengths,
    links_of,
    tangents,
)


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
    """Strain energy E = sum of k (l - L)² / 2 over springs of length l (see `springs.body`).

    Attributes:
        elements: The ends of each spring, shape (m, 2).
        matrices: [B, -B; -B, B] of each [N/m], shape (m, 6, 6), of the last `stiffness`.
    """

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
        super().__init__(links_of(ends, rest_length, stiffness, np.zeros(len(ends)), slack))
        self._owner = owner

    def energy(self, x: FloatArray, modes: FloatArray) -> float:
        """Return E [J] at positions `x` [m], shape (n, 3)."""
        return float(elastic_energy(x, self.links))

    def add_gradient(self, x: FloatArray, modes: FloatArray, g: FloatArray) -> float:
        """Add dE/dx [N] to `g`, shape (n, 3), and return E [J]."""
        return float(add_gradient(x, self.links, 0.0, self._none, g))

    def stiffness(self, x: FloatArray, modes: FloatArray, *, project: bool) -> int:
        """Write `matrices`, with `project` positive semi-definite; return -1."""
        self.write(x, 0.0, self._none, project=project)
        return -1

    def arrays(self) -> Links:
        """Return what compiled loops need; the arrays are the springs' own."""
        return self.links

    def limit(self) -> None:
        """Write k times [I, -I; -I, I]: stretched, a spring's tangent is below that, k (1 - L / l) across it."""
        write_networks(self.links.stiffness, self.matrices)

    def culprit(self, x: FloatArray, modes: FloatArray) -> tuple[float, str]:
        """Return that the springs are to blame last of all: they carry any length."""
        return np.inf, f"springs of {self._owner} move too far"


class Lengths(StageTerm):
    """What dampers remember: the lengths that a stage takes their rates from, dl/dt = (l - l_0) / s.

    Attributes:
        reference: l_0 [m], shape (m,).
        rate: 1 / s [1/s].
    """

    name = "springs"

    def __init__(self, links: Links) -> None:
        """`links`: the dampers, as kernels take them."""
        self.links, self.rate = links, 0.0
        self.reference, self.remembers = np.zeros(len(links.ends)), len(links.ends)

    def remember(self, x: FloatArray, out: FloatArray) -> None:
        """Write l of each at positions `x` [m], shape (n, 3), to `out`, shape (m,)."""
        lengths(x, self.links, out)

    def aim(self, s: float, known: FloatArray) -> None:
        """Let the lengths before be `known` [m], shape (m,), in a stage of `s` [s]."""
        self.rate, self.reference[:] = 1.0 / s, known


class SpringDampers(SpringTangents, Lengths, DamperTerm):
    """Dampers along springs, whose force c dl/dt an implicit stage takes from how the lengths change in it.

    What a scheme does to positions it does to lengths: dl/dt = (l - l_0) / s. So the force is the gradient of

        D(x') = sum of c/(2 s) (l(x') - l_0)².

    Attributes:
        elements: The ends of each damper, shape (m, 2).
        links: The dampers as springs without stiffness.
        matrices: Of the last `stiffness` [N/m], shape (m, 6, 6).
    """

    def __init__(self, ends: IndexArray, damping: FloatArray) -> None:
        """`ends`: node indices, shape (m, 2); `damping`: c [N s/m], shape (m,)."""
        rest, stiffness = np.zeros((2, len(ends)))
        links = links_of(ends, rest, stiffness, damping, False)
        SpringTangents.__init__(self, links)
        Lengths.__init__(self, links)

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dD/dx [N] to `g`, shape (n, 3), and return D [J]."""
        return float(add_gradient(x, self.links, self.rate, self.reference, g))

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Write `matrices`, with `project` positive semi-definite."""
        self.write(x, self.rate, self.reference, project=project)

    def limit(self) -> None:
        """Write c times [I, -I; -I, I] to `matrices` [N s/m], which the force of no motion exceeds."""
        write_networks(self.links.damping, self.matrices)


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
