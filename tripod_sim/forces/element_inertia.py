"""Inertia of quadratic elements: by what their consistent mass differs from the masses of their nodes.

The mass matrix of an element, M_ab = int rho N_a N_b dV, moves it as the continuum does, rigidly and bent [Archer1963].
Lumped masses of quadratic elements do not: they turn an element that is as thick as the strip more than twice as hard
about the strip's axis, and a body that falls freely is deformed by them, since its weight int rho N_a dV is not in
proportion to them. Of linear elements, which are small where a motion is to be exact, they serve well.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array, FloatArray, IndexArray
from tripod_sim.elements.element import Element, node_volumes, shape_products
from tripod_sim.forces.anchor import Anchor
from tripod_sim.forces.term import BlockTerm
from tripod_sim.forces.term_kernels import couple


class ElementMasses(NamedTuple):
    """By what the mass matrix of elements of one kind differs from the masses of their nodes.

    Attributes:
        elements: Node indices, shape (m, k).
        couplings: M_ab - delta_ab m_a, m_a the element's part of the mass of its node [kg], shape (m, k, k).
    """

    elements: IndexArray
    couplings: FloatArray

    def add(self, a: FloatArray, out: FloatArray) -> float:
        """Add the product with `a` to `out`, both of shape (n, 3); return half of a . that."""
        return float(_add(self.couplings, self.elements, 1.0, a, np.zeros_like(a), out))


def lacking(kind: Element, nodes: FloatArray, elements: IndexArray, density: FloatArray) -> ElementMasses:
    """Return what the masses of nodes lack of the inertia of elements.

    Args:
        kind: Of the elements, quadratic.
        nodes: Their undeformed nodes [m], shape (m, k, 3).
        elements: The indices of these, shape (m, k).
        density: Of each [kg/m³], shape (m,).
    """
    _, lumped = node_volumes(kind, nodes)
    couplings = shape_products(kind, nodes)
    couplings *= (lumped.sum(axis=1) / couplings.sum(axis=(1, 2)))[
        :, None, None
    ]  # other points, a little apart
    own = np.arange(kind.size)
    couplings[:, own, own] -= lumped
    return ElementMasses(np.ascontiguousarray(elements), density[:, None, None] * couplings)


class ElementInertia(BlockTerm):
    """Potential Q(x) = c/2 sum_ab couplings_ab (x_a - y_a) . (x_b - y_b), with y and c = w / m of an `Anchor`.

    HacCovariance with that it is the inertia and mass damping of one implicit step (see `anchor`, `integrators.stage`).
    """

    name, has_inertia = "inertia", True

    def __init__(self, masses: ElementMasses, anchor: Anchor) -> None:
        """`masses`: of the elements; `anchor`: of the masses of all nodes."""
        self.elements, self._masses, self._anchor = masses.elements, masses, anchor
        m, k = masses.elements.shape
        self.matrices, self._written = np.zeros((m, 3 * k, 3 * k)), 0.0
        self._origin = np.zeros_like(anchor.point)

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Write `matrices`, which change with the step alone."""
        if self._written != self._anchor.per_mass:
            self._written = self._anchor.per_mass
            for i in range(3):
                np.multiply(self._masses.couplings, self._written, out=self.matrices[:, i::3, i::3])

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dQ/dx [N] to `g` and return Q [J]."""
        masses, anchor = self._masses, self._anchor
        return float(_add(masses.couplings, masses.elements, anchor.per_mass, x, anchor.point, g))

    def add_products(self, dx: FloatArray, g: FloatArray) -> None:
        """Add the blocks times `dx` [m] to `g` [N]."""
        masses = self._masses
        _add(masses.couplings, masses.elements, self._anchor.per_mass, dx, self._origin, g)

    def add_inertia(self, a: FloatArray, out: FloatArray) -> float:
        """Add the product of what nodes lack in mass with `a` to `out`; return half of a . that."""
        return self._masses.add(a, out)


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _add(couplings: Array, elements: Array, factor: float, x: Array, y: Array, g: Array) -> float:
    """Add `factor` couplings (x - y) to `g`, all of shape (n, 3); return half of (x - y) . that."""
    size, total = couplings.shape[1], 0.0
    d, f = np.empty((3, size)), np.empty((3, size))
    for e in range(elements.shape[0]):
        for a in range(size):
            n = elements[e, a]
            for i in range(3):
                d[i, a] = x[n, i] - y[n, i]
        total += couple(couplings[e], d, f)
        for a in range(size):
            for i in range(3):
                g[elements[e, a], i] += factor * f[i, a]
    return 0.5 * factor * total
