"""The elastic terms of a system as one: several solids, each with its elements, law and material, and springs."""

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.elements.element import Element
from tripod_sim.forces.solid_arrays import SolidArrays
from tripod_sim.forces.solid_kernels import add_element_products

if TYPE_CHECKING:  # only with springs
    from tripod_sim.forces.spring_kernels import Links

Matrices = Sequence[FloatArray]


class ElasticTerm:
    """A part of the strain energy E(x, modes), in element matrices.

    Modes are amplitudes that belong to single elements and are condensed (see `solid_kernels`); a term has none unless
    it says so.

    It may have a damper, whose potential D(x, modes) in an implicit stage knows the rate of its own measure of strain.

    Attributes:
        elements: Node indices of its blocks, shape (m, k), the same while it lives.
        matrices: Condensed element matrices of the last `stiffness` [N/m], shape (m, 3 k, 3 k).
        mode_residual_squared: |d(E + D)/d modes|² of the last gradient [N²].
        has_modes: Whether the elements have modes.
        mode_offsets: How far the modes were from their balance at the last gradient [m], shape as of the modes; of a
            term that has modes.
        remembers: How many numbers its damper takes the rate of, which schemes combine as they do positions; 0 without
            one.
        lasting: Whether the Hessian of one step is near that of the next, so that a factorisation may serve both.
        solid: What compiled loops need of elements; the arrays are the term's own.
        kind: Of these elements; of a term that has `solid`.
        links: The same of springs; explicit schemes refuse a term that has neither.
    """

    elements: IndexArray
    matrices: FloatArray
    mode_residual_squared = 0.0
    has_modes = False
    mode_offsets: FloatArray
    remembers = 0
    lasting = True
    solid: "SolidArrays | None" = None
    kind: Element
    links: "Links | None" = None

    def rest_modes(self) -> FloatArray:
        """Return the modes of the undeformed body [m], shape (m, modes of an element, 3)."""
        return np.zeros((len(self.elements), 0, 3))

    def energy(self, x: FloatArray, modes: FloatArray) -> float:
        """Return E [J] at positions `x` [m], shape (n, 3); infinite where there is none."""
        raise NotImplementedError

    def add_gradient(self, x: FloatArray, modes: FloatArray, g: FloatArray) -> float:
        """Add the condensed dE/dx [N] to `g`, shape (n, 3), and return E [J]; where E is infinite `g` is spoilt."""
        raise NotImplementedError

    def add_gradients(
        self, x: FloatArray, modes: FloatArray, g: FloatArray, d: FloatArray
    ) -> tuple[float, float]:
        """As `add_gradient`; add the condensed dD/dx of the damper to `d`, too, and return E and D [J]."""
        return self.add_gradient(x, modes, g), 0.0

    def add_damper_gradient(self, x: FloatArray, modes: FloatArray, d: FloatArray) -> float:
        """Add the condensed dD/dx of the damper [N] to `d`, shape (n, 3), and return D [J]."""
        return 0.0

    def remember(self, x: FloatArray, modes: FloatArray, out: FloatArray, *, known: bool) -> None:
        """Write what its damper takes the rate of to `out`, shape (remembers,).

        `known`: whether `add_gradients` or `add_damper_gradient` was called last at this `x` and these modes.
        """

    def aim(self, s: float, known: FloatArray) -> None:
        """Let the damper be that of a stage of `s` [s]; `known`: what the scheme makes of what `remember` writes."""

    def add_rates(
        self, x: FloatArray, modes: FloatArray, y: FloatArray, factor: float, out: FloatArray
    ) -> None:
        """Add `factor` C y to `out`, both of shape (n, 3), C the damper's matrix at `x`."""

    def add_damping_bound(self, x: FloatArray, modes: FloatArray, v: FloatArray, out: FloatArray) -> None:
        """Add C v to `out` [N], both of shape (n, 3), C the damper's matrix at `x`, or one that it never exceeds."""
        self.add_rates(x, modes, v, 1.0, out)

    def rounding(self, x: FloatArray) -> float:
        """Return what rounding of positions makes of the forces at `x` [N]: too little to count."""
        return 0.0

    def add_present_products(
        self, x: FloatArray, modes: FloatArray, dx: FloatArray, out: FloatArray, *, damper: bool
    ) -> None:
        """Add the Hessian at `x`, with that of the damper in a stage or without, times `dx` [m] to `out` [N].

        What lasts has `matrices` for it.
        """
        every = np.arange(len(self.elements))
        add_element_products(self.matrices, self.elements, every, dx, 1.0, out)

    def stiffness(self, x: FloatArray, modes: FloatArray, *, damper: bool = False, project: bool) -> int:
        """Write `matrices`, with those of the damper in a stage or without.

        Returns -1, or the first element whose modes are unstable (only without `project`).
        """
        raise NotImplementedError

    def advance_modes(self, modes: FloatArray, dx: FloatArray, scale: float, out: FloatArray) -> None:
        """Write the modes after `scale` times a Newton step in which the nodes move by `dx` [m], shape (n, 3)."""

    def settle_modes(
        self, x: FloatArray, modes: FloatArray, tolerance: float, *, damper: bool = False
    ) -> float:
        """Bring `modes` to the least E, or E + D, at `x`, in place, until the square of its slope is <= `tolerance`
        [N²].

        Returns that square; infinite where E is; larger than `tolerance` where no rest is found.
        """
        return 0.0

    def balance_modes(self) -> None:
        """Take the modes to be in balance: the next step moves them by -X dx alone."""

    @property
    def mode_gradient(self) -> FloatArray:
        """f_a + h_a of the last gradient [N], shape (m, modes of an element times 3), of a term that has modes."""
        raise NotImplementedError

    def solve_modes(self, q: FloatArray) -> FloatArray:
        """Return K_aa^-1 q of the last `stiffness`, both as `mode_gradient`, of a term that has modes."""
        raise NotImplementedError

    def turn_modes(self, rotations: FloatArray) -> None:
        """Turn the condensation of the last `stiffness` with its elements, by `rotations`, shape (m, 3, 3)."""

    def forget(self) -> None:
        """Drop the condensation of the last `stiffness`: gradients are then dE/dx as it is."""

    def limit(self) -> None:
        """Where that is known, write matrices to `matrices` that no tangent of the term exceeds; else leave them."""

    def culprit(self, x: FloatArray, modes: FloatArray) -> tuple[float, str]:
        """Return how bad its worst element is, the smaller the worse, and what to say of it."""
        raise NotImplementedError


class Elastic:
    """Sum of elastic terms; the modes of a state are those of its terms, one after the other.

    Attributes:
        terms: In the order of the modes.
        matrices: The element matrices of each term.
        mode_residual_squared: Sum of the terms' [N²], of the last gradient.
        has_modes: Whether a term has any.
        remembers: Sum of the terms'; 0 where dampers do not count.
        lasting: Whether the Hessians of all terms last.
    """

    def __init__(self, terms: Sequence[ElasticTerm], moved: IndexArray, *, damped: bool = False) -> None:
        """`moved`: nodes whose move `add_response` is asked for; `damped`: whether dampers of the terms count."""
        self.mode_residual_squared = 0.0
        ends = np.cumsum([0, *(t.remembers if damped else 0 for t in terms)]).tolist()
        self._memories, self.remembers = [slice(a, b) for a, b in pairwise(ends)], ends[-1]
        self.has_modes, self.lasting = any(t.has_modes for t in terms), all(t.lasting for t in terms)
        self.matrices = [t.matrices for t in terms]
        self._every = [(t.elements, np.arange(len(t.elements))) for t in terms]
        self._beside = [(t.elements, np.flatnonzero(np.isin(t.elements, moved).any(axis=1))) for t in terms]
        counts = [len(t.elements) if t.has_modes else 0 for t in terms]
        ends = np.cumsum([0, *counts]).tolist()
        self._parts = [slice(a, b) for a, b in pairwise(ends)]
        self._none = [None if t.has_modes else t.rest_modes() for t in terms]
        self.terms = tuple(terms)  # last, where `explain.objects.walk` begins: the arrays above are theirs

    def of(self, modes: FloatArray, k: int) -> FloatArray:
        """Return the modes of term `k` out of those of all: a view."""
        none = self._none[k]
        return modes[self._parts[k]] if none is None else none

    def rest_modes(self) -> FloatArray:
        """Return the modes of the undeformed bodies [m], shape (m, modes of an element, 3)."""
        having = [t.rest_modes() for t in self.terms if t.has_modes]
        return np.concatenate(having) if having else np.zeros((0, 3, 3))

    def energy(self, x: FloatArray, modes: FloatArray) -> float:
        """Return E [J] at positions `x` [m], shape (n, 3)."""
        return sum((t.energy(x, self.of(modes, k)) for k, t in enumerate(self.terms)), 0.0)

    def add_gradient(self, x: FloatArray, modes: FloatArray, g: FloatArray) -> float:
        """Add the condensed dE/dx [N] to `g`, shape (n, 3), and return E [J]; where E is infinite `g` is spoilt."""
        energy = residual = 0.0
        for k, term in enumerate(self.terms):
            energy += term.add_gradient(x, self.of(modes, k), g)
            residual += term.mode_residual_squared
        self.mode_residual_squared = residual
        return energy

    def add_gradients(
        self, x: FloatArray, modes: FloatArray, g: FloatArray, d: FloatArray
    ) -> tuple[float, float]:
        """As `add_gradient`; add the condensed dD/dx of dampers to `d`, too, and return E and D [J]."""
        energy = damped = residual = 0.0
        for k, term in enumerate(self.terms):
            own = self.of(modes, k)
            if self._damps(k):
                stored, lost = term.add_gradients(x, own, g, d)
                energy, damped = energy + stored, damped + lost
            else:
                energy += term.add_gradient(x, own, g)
            residual += term.mode_residual_squared
        self.mode_residual_squared = residual
        return energy, damped

    def add_damper_gradient(self, x: FloatArray, modes: FloatArray, d: FloatArray) -> float:
        """Add the condensed dD/dx of dampers [N] to `d`, shape (n, 3), and return D [J]."""
        damped = residual = 0.0
        for k, term in enumerate(self.terms):
            if self._damps(k):
                damped += term.add_damper_gradient(x, self.of(modes, k), d)
            residual += term.mode_residual_squared
        self.mode_residual_squared = residual
        return damped

    def _damps(self, k: int) -> bool:
        part = self._memories[k]
        return bool(part.stop > part.start)

    def remember(self, x: FloatArray, modes: FloatArray, out: FloatArray, *, known: bool) -> None:
        """Write what dampers take the rates of to `out`, shape (remembers,)."""
        for k, term in enumerate(self.terms):
            if self._damps(k):
                term.remember(x, self.of(modes, k), out[self._memories[k]], known=known)

    def aim(self, s: float, known: FloatArray) -> None:
        """Let the dampers be those of a stage of `s` [s]."""
        for k, term in enumerate(self.terms):
            if self._damps(k):
                term.aim(s, known[self._memories[k]])

    def add_rates(
        self, x: FloatArray, modes: FloatArray, y: FloatArray, factor: float, out: FloatArray
    ) -> None:
        """Add `factor` C y to `out`, both of shape (n, 3), C the dampers' matrix at `x`."""
        for k, term in enumerate(self.terms):
            if self._damps(k):
                term.add_rates(x, self.of(modes, k), y, factor, out)

    def add_damping_bound(self, x: FloatArray, modes: FloatArray, v: FloatArray, out: FloatArray) -> None:
        """Add C v to `out` [N], both of shape (n, 3), C a bound of the matrix of all dampers."""
        for k, term in enumerate(self.terms):
            term.add_damping_bound(x, self.of(modes, k), v, out)

    def stiffness(self, x: FloatArray, modes: FloatArray, *, project: bool) -> int:
        """Write the terms' matrices; return -1, or the first element whose modes are unstable."""
        for k, term in enumerate(self.terms):
            if (found := term.stiffness(x, self.of(modes, k), damper=self._damps(k), project=project)) >= 0:
                return found
        return -1

    def advance_modes(self, modes: FloatArray, dx: FloatArray, scale: float, out: FloatArray) -> None:
        """Write the modes after `scale` times a Newton step in which the nodes move by `dx` [m], shape (n, 3)."""
        for k, term in enumerate(self.terms):
            if term.has_modes:
                term.advance_modes(self.of(modes, k), dx, scale, self.of(out, k))

    def settle_modes(self, x: FloatArray, modes: FloatArray, tolerance: float) -> float:
        """As `ElasticTerm.settle_modes`, of all terms together."""
        having = [(term, k) for k, term in enumerate(self.terms) if term.has_modes]
        each = tolerance / max(1, len(having))
        return sum(term.settle_modes(x, self.of(modes, k), each, damper=self._damps(k)) for term, k in having)

    @property
    def mode_gradient(self) -> FloatArray:
        """The terms' f_a + h_a of the last gradient [N], shape (s,)."""
        having = [t.mode_gradient.ravel() for t in self.terms if t.has_modes]
        return np.concatenate(having) if having else np.zeros(0)

    def solve_modes(self, q: FloatArray) -> FloatArray:
        """Return K_aa^-1 q of the last `stiffness`, both of shape (s,)."""
        having, out, end = [t for t in self.terms if t.has_modes], np.empty_like(q), 0
        for term in having:
            part = slice(end, end := end + term.mode_offsets.size)
            out[part] = term.solve_modes(q[part].reshape(term.mode_offsets.shape)).ravel()
        return out

    def offset_modes(self, y: FloatArray) -> None:
        """Let the next step move the modes by -y - X dx, y of shape (s,)."""
        end = 0
        for term in self.terms:
            if term.has_modes:
                part = slice(end, end := end + term.mode_offsets.size)
                term.mode_offsets[:] = y[part].reshape(term.mode_offsets.shape)

    def balance_modes(self) -> None:
        """Take the modes to be in balance."""
        self.mode_residual_squared = 0.0
        for term in self.terms:
            term.balance_modes()

    def limit(self) -> None:
        """Write matrices that no tangent of a term exceeds, where the term knows such."""
        for term in self.terms:
            term.limit()

    def forget(self) -> None:
        """Drop the condensations of the last `stiffness`."""
        for term in self.terms:
            term.forget()

    def add_products(self, matrices: Matrices, dx: FloatArray, factor: float, g: FloatArray) -> float:
        """Add factor K dx to `g`, K the sum of element matrices of each term; return factor/2 dx^T K dx."""
        total = 0.0
        for k, (elements, every) in enumerate(self._every):
            total += add_element_products(matrices[k], elements, every, dx, factor, g)
        return total

    def rounding(self, x: FloatArray) -> float:
        """Return what rounding of positions makes of the forces at `x` [N]."""
        return sum(term.rounding(x) for term in self.terms)

    def add_present_products(self, x: FloatArray, modes: FloatArray, dx: FloatArray, out: FloatArray) -> None:
        """Add the Hessian at `x` times `dx` [m] to `out` [N], both of shape (n, 3)."""
        for k, term in enumerate(self.terms):
            term.add_present_products(x, self.of(modes, k), dx, out, damper=self._damps(k))

    def add_response(self, matrices: Matrices, dx: FloatArray, factor: float, g: FloatArray) -> None:
        """As `add_products`, of the elements alone that have one of the nodes which are moved."""
        for k, (elements, beside) in enumerate(self._beside):
            add_element_products(matrices[k], elements, beside, dx, factor, g)

    def largest_stiffness(self) -> float:
        """Return the largest entry of the matrices [N/m]."""
        return max((float(np.abs(t.matrices).max(initial=0.0)) for t in self.terms), default=0.0)

    def culprit(self, x: FloatArray, modes: FloatArray) -> str:
        """Return in words what is worst of all elements."""
        found = [t.culprit(x, self.of(modes, k)) for k, t in enumerate(self.terms)]
        return min(found, default=(0.0, "nodes that belong to no element move too far"))[1]
