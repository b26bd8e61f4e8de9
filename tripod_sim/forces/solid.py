"""Elastic solid: elements of one kind and one material."""

from functools import partial

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_host.threads import together
from tripod_sim.elements.element import Element, reference_gradients
from tripod_sim.forces import solid_kernels as kernels
from tripod_sim.forces.elastic import ElasticTerm
from tripod_sim.forces.mode_kernels import settle_modes, turn_blocks
from tripod_sim.forces.rate_kernels import add_solid_rates
from tripod_sim.forces.solid_arrays import SolidArrays, SolidPart, parts_of
from tripod_sim.materials.calls import addresses, tangent_of
from tripod_sim.materials.law import law_named
from tripod_sim.materials.laws import KAPPA

CRUSHED, BLOWN_UP = 0.3, 3.0
"""Volume ratios beyond which an element is named as what a solve may have failed by."""


SAFE = "stable_neo_hooke"
"""The law that brings elements back from inside out in every cell of `benchmarks/stability.py`."""


def undeformed_tangent(functions: IndexArray, parameters: FloatArray) -> tuple[float, float]:
    """Return lambda and mu [Pa] of the tangent of a law, by its functions, where nothing is deformed."""
    C = np.zeros((9, 9))
    tangent_of(functions, np.eye(3), parameters, C)
    return float(C[0, 4]), float(C[1, 1])


class Solid(ElasticTerm):
    """Strain energy E = sum over elements and points of weight psi(F), its gradient and its condensed stiffness.

    Its damper, if it has one, has the stress of `damper_kernels` at each point.

    Incompatible modes, where the element has them, are condensed with the stiffness of the last call of `stiffness`;
    a Newton step of the nodes by dx moves them by -y - X dx (see `solid_kernels`).

    Attributes:
        elements: Node indices, shape (m, nodes of an element).
        matrices: Condensed element matrices of the last `stiffness` [N/m], shape (m, d, d), d = 3 nodes of an element.
        mode_residual_squared: |dE/d modes|² of the last `add_gradient` [N²].
        numbers: Of the elements in their mesh, for messages, shape (m,).
    """

    solid: SolidArrays

    def __init__(
        self,
        nodes: FloatArray,
        elements: IndexArray,
        kind: Element,
        law: str,
        parameters: FloatArray,
        owner: str = "",
        damping: float = 0.0,
    ) -> None:
        """Take the elements of a mesh.

        Args:
            nodes: Undeformed positions [m], shape (n, 3).
            elements: Node indices, shape (m, nodes of an element).
            kind, law, parameters: Of the elements and their material (`materials.laws`).
            owner: Name of the body, for messages.
            damping: b, the viscosity over the stiffness undeformed [s].
        """
        self.elements, self._owner, self._law = np.ascontiguousarray(elements), owner, law
        self.kind, self.numbers = kind, np.arange(len(elements))
        functions = addresses(law_named(law))
        gradients, weight = reference_gradients(kind, nodes[elements])
        G = np.ascontiguousarray(gradients.transpose(0, 1, 3, 2))
        count, dofs = len(elements), 3 * elements.shape[1]
        self._modes = G.shape[3] - kind.size
        self.has_modes = self._modes > 0
        extra = 3 * self._modes
        self.matrices = np.zeros((count, dofs, dofs))
        lam, mu = undeformed_tangent(functions, parameters)
        kappa = parameters[KAPPA] if kind.mean_dilatation else 0.0
        points = weight.shape[1] if damping else 0
        self.remembers = count * points * 6
        y, pull, push = np.zeros((3, count, extra))
        before, strain = np.zeros((2, count, points, 6))
        self.solid = SolidArrays(
            elements, np.arange(count), G, weight, functions, parameters, kind.mean_dilatation, self.matrices,
            np.zeros((count, extra, dofs)), np.zeros((count, extra, extra)), y, pull, push,
            damping * np.array([lam - kappa, mu, kappa]), np.zeros(1), before, strain,
        )  # fmt: skip
        self.mode_offsets = self.solid.y
        self._parts = parts_of(self.solid)

    def forget(self) -> None:
        """Drop the condensation of the last `stiffness`: gradients are then dE/dx as it is."""
        self.solid.X[:] = 0.0
        self.solid.inverse[:] = 0.0

    def rest_modes(self) -> FloatArray:
        """Return the mode amplitudes of the undeformed solid [m], shape (m, modes of an element, 3)."""
        return np.zeros((len(self.elements), self._modes, 3))

    def energy(self, x: FloatArray, modes: FloatArray) -> float:
        """Return E [J] at positions `x` [m], shape (n, 3); infinite where the material has none."""
        y, pull = np.empty((2, *self.solid.y.shape))  # those at hand stay those of the last gradient
        apart, g = self.solid._replace(y=y, pull=pull), np.zeros_like(x)
        return float(kernels.solid_gradient(x, modes, apart, kernels.ELASTIC, g, g)[0])

    def add_gradient(self, x: FloatArray, modes: FloatArray, g: FloatArray) -> float:
        """Add the condensed dE/dx [N] to `g`, shape (n, 3), and return E [J]; where E is infinite `g` is spoilt."""
        return self._add(x, modes, kernels.ELASTIC, g, g)[0]

    def add_gradients(
        self, x: FloatArray, modes: FloatArray, g: FloatArray, d: FloatArray
    ) -> tuple[float, float]:
        """As `add_gradient`; add the condensed dD/dx of the damper to `d`, too, and return E and D [J]."""
        return self._add(x, modes, kernels.BOTH, g, d)

    def add_damper_gradient(self, x: FloatArray, modes: FloatArray, d: FloatArray) -> float:
        """Add the condensed dD/dx [N] to `d`, shape (n, 3), and return D [J]."""
        return self._add(x, modes, kernels.DAMPER, d, d)[1]

    def _add(
        self, x: FloatArray, modes: FloatArray, of: int, g: FloatArray, d: FloatArray
    ) -> tuple[float, float]:
        if not self._parts:
            energy, damped, self.mode_residual_squared = kernels.solid_gradient(
                x, modes, self.solid, of, g, d
            )
            return float(energy), float(damped)
        found = np.array(together([partial(_part_gradient, part, x, modes, of) for part in self._parts]))
        for part in self._parts:
            if of & kernels.ELASTIC:
                g[part.nodes] += part.g
            if of & kernels.DAMPER:
                d[part.nodes] += part.d
        energy, damped, self.mode_residual_squared = found.sum(axis=0).tolist()
        return energy, damped

    def remember(self, x: FloatArray, modes: FloatArray, out: FloatArray, *, known: bool) -> None:
        """Write Green's strain at each point to `out`; `known`: it is that of the last gradient with the damper."""
        if not known:
            kernels.write_strains(x, modes, self.solid)
        out[:] = self.solid.strain.reshape(-1)

    def aim(self, s: float, known: FloatArray) -> None:
        """Let the damper be that of a stage of `s` [s], whose strains before are `known`, shape (remembers,)."""
        self.solid.rate[0] = 1.0 / s
        self.solid.before.reshape(-1)[:] = known

    def add_rates(
        self, x: FloatArray, modes: FloatArray, y: FloatArray, factor: float, out: FloatArray
    ) -> None:
        """Add `factor` C y to `out`, both of shape (n, 3), C the damper's matrix at `x`."""
        add_solid_rates(x, y, modes, self.solid, factor, out)

    def stiffness(self, x: FloatArray, modes: FloatArray, *, damper: bool = False, project: bool) -> int:
        """Write `matrices`; return -1, or the first element whose modes are unstable (only without `project`)."""
        of = kernels.BOTH if damper else kernels.ELASTIC
        if not self._parts:
            return int(kernels.solid_stiffness(x, modes, self.solid, of, project))
        found = together([partial(_part_stiffness, part, x, modes, of, project) for part in self._parts])
        return next((element for element in found if element >= 0), -1)

    def advance_modes(self, modes: FloatArray, dx: FloatArray, scale: float, out: FloatArray) -> None:
        """Write the modes after `scale` times a Newton step in which the nodes move by `dx` [m], shape (n, 3)."""
        kernels.update_modes(modes, self.elements, self.solid.X, self.solid.y, dx, scale, out)

    def settle_modes(
        self, x: FloatArray, modes: FloatArray, tolerance: float, *, damper: bool = False
    ) -> float:
        """As `ElasticTerm.settle_modes`."""
        return float(
            settle_modes(x, modes, self.solid, kernels.BOTH if damper else kernels.ELASTIC, tolerance)
        )

    def balance_modes(self) -> None:
        """Take the modes to be in balance, f_a = -h_a: the next step moves them by -X dx alone."""
        np.negative(self.solid.push, out=self.solid.pull)
        self.solid.y[:] = 0.0
        self.mode_residual_squared = 0.0

    @property
    def mode_gradient(self) -> FloatArray:
        """As `ElasticTerm.mode_gradient`."""
        return self.solid.pull + self.solid.push

    def solve_modes(self, q: FloatArray) -> FloatArray:
        """As `ElasticTerm.solve_modes`."""
        found: FloatArray = np.matmul(self.solid.inverse, q[:, :, None])[:, :, 0]
        return found

    def turn_modes(self, rotations: FloatArray) -> None:
        """As `ElasticTerm.turn_modes`."""
        turn_blocks(rotations, self.solid.X)
        turn_blocks(rotations, self.solid.inverse)

    def worst_element(self, x: FloatArray, modes: FloatArray) -> tuple[int, float]:
        """Return the element with the smallest volume ratio det F, and that ratio."""
        element, ratio = kernels.smallest_volume_ratio(x, modes, self.solid)
        return int(element), float(ratio)

    def culprit(self, x: FloatArray, modes: FloatArray) -> tuple[float, str]:
        """Return the smallest volume ratio, and what to say of its element."""
        element, ratio = self.worst_element(x, modes)
        name = f"element {self.numbers[element]}{self._owner and f' of {self._owner}'}"
        if ratio < 0:
            what = "turned inside out"
        elif not CRUSHED <= ratio <= BLOWN_UP:  # NaN, too
            what = "blown up" if ratio > BLOWN_UP else "crushed"
        else:
            what = "not inverted, as no element is; it is compressed most"
        advice = (
            "" if ratio > 0 or self._law == SAFE else f'; material.law = "{SAFE}" turns such elements back'
        )
        return ratio, f"{name} is {what} (volume ratio {ratio:.3g}){advice}"


def _part_gradient(part: SolidPart, x: FloatArray, modes: FloatArray, of: int) -> tuple[float, float, float]:
    """As `kernels.solid_gradient`, of a part, into its own fields."""
    part.g[:] = part.d[:] = 0.0
    found: tuple[float, float, float] = kernels.solid_gradient(
        x[part.nodes], modes[part.elements], part.arrays, of, part.g, part.d
    )
    return found


def _part_stiffness(part: SolidPart, x: FloatArray, modes: FloatArray, of: int, project: bool) -> int:
    """As `kernels.solid_stiffness`, of a part."""
    found = kernels.solid_stiffness(x[part.nodes], modes[part.elements], part.arrays, of, project)
    return int(part.elements.start + found) if found >= 0 else -1
