"""A kept factorisation that turns with the body.

It is worth as much as the matrix is still that of the body. What changes the matrix most is that parts of the body turn
[MullerGross2004], so the kept one turns along: with R the rotation of each node since the factorisation,

    x = R A^-1 R^T b.
"""

from collections.abc import Sequence

import numpy as np
from numba import njit

from tripod_host.arrays import Array, FloatArray, IndexArray
from tripod_sim.elements.element import Element
from tripod_sim.linear.solver import LinearSolver
from tripod_sim.materials.laws.corotational import polar_rotation
from tripod_sim.state import State
from tripod_sim.system import System


class TurningSolver(LinearSolver):
    """Solves with the matrix last factored, turned as the body has turned since then."""

    def __init__(self, inner: LinearSolver, unknowns: int) -> None:
        """`inner`: solves with the matrix itself, of as many `unknowns`."""
        self._inner, self.iterates, self.places = inner, inner.iterates, inner.places
        self.solves_a_factor = inner.solves_a_factor
        self._now = self._factored = np.tile(np.eye(3), (unknowns // 3, 1, 1))
        self._since: FloatArray | None = None

    def turn(self, rotations: FloatArray) -> None:
        """Take notice of the rotation of each three unknowns, shape (unknowns / 3, 3, 3)."""
        self._now, self._since = rotations, rotations @ self._factored.transpose(0, 2, 1)

    def factor(self) -> bool:
        """As `LinearSolver`."""
        self._factored, self._since = self._now, None
        return self._inner.factor()

    def is_positive(self) -> bool:
        """As `LinearSolver`."""
        return self._inner.is_positive()

    def solve(self, b: FloatArray) -> FloatArray:
        """As `LinearSolver`."""
        if self._since is None:
            found = self._inner.solve(b)
        else:
            turned = np.empty_like(b)
            turn_back(self._since, b, turned)
            found = np.empty_like(b)
            turn(self._since, self._inner.solve(turned), found)
        self.iterations = self._inner.iterations
        return found


class Rotations:
    """Finds how the surroundings of points of bodies have turned: their elements, by the mean gradient of the motion.

    Elements alone turn to and fro in bending; their mean is smooth.
    """

    def __init__(
        self,
        rest: FloatArray,
        solids: Sequence[tuple[IndexArray, Element]],
        around: IndexArray,
        system: System,
    ) -> None:
        """Take the elements of a mesh, and points in it.

        Args:
            rest: Its undeformed nodes [m], shape (n, 3).
            solids: Its elements of each kind.
            around: Its nodes around each free node of `system`, shape (k, c).
            system: Whose unknowns turn.
        """
        self._solids = [(np.ascontiguousarray(e), _weighted_slopes(rest, e, kind)) for e, kind in solids]
        self._around, self._bodies = around, system.reduction.bodies
        self._sums = np.zeros((len(rest), 3, 3))

    @classmethod
    def of_own_mesh(cls, system: System) -> "Rotations":
        """Return those of the nodes of `system` itself; nodes of no element do not turn."""
        solids = [(term.elements, term.kind) for term in system.elastic.terms if term.solid]
        return cls(system.rest, solids, system.reduction.free[:, None], system)

    def at(self, state: State) -> FloatArray:
        """Return the rotation of each three unknowns for the body in `state`, shape (unknowns / 3, 3, 3).

        What is pressed flat or inside out does not turn.
        """
        count = len(self._around)
        self._sums[:] = 0.0
        for elements, slopes in self._solids:
            add_gradients(state.positions, elements, slopes, self._sums)
        out = np.empty((count + 2 * self._bodies, 3, 3))
        write_rotations(self._sums, self._around, out)
        out[count:] = np.repeat(state.rotations[: self._bodies], 2, axis=0)
        return out

    def of_elements(self, state: State) -> list[FloatArray]:
        """Return the rotation of each element for the body in `state`, shape (m, 3, 3), of each kind."""
        found = []
        for elements, slopes in self._solids:
            out = np.empty((len(elements), 3, 3))
            write_element_rotations(state.positions, elements, slopes, out)
            found.append(out)
        return found


def _weighted_slopes(rest: FloatArray, elements: IndexArray, kind: Element) -> FloatArray:
    """Return the slopes of the shape functions amid each element times its volume there [m²], shape (m, k, 3)."""
    jacobians = kind.jacobians(rest[elements], kind.centre)[:, 0]
    slopes = np.einsum("aj,ejk->eak", kind.gradients(kind.centre)[0], np.linalg.inv(jacobians))
    return np.ascontiguousarray(slopes * np.linalg.det(jacobians)[:, None, None])


@njit(cache=True, error_model="numpy", inline="always")
def _write_gradient(x: Array, nodes: Array, slopes: Array, F: Array) -> None:
    """Write the gradient of the motion to x amid one element, times its volume."""
    F[:] = 0.0
    for a in range(nodes.shape[0]):
        for i in range(3):
            for j in range(3):
                F[i, j] += x[nodes[a], i] * slopes[a, j]


@njit(cache=True, error_model="numpy")
def add_gradients(x: Array, elements: Array, slopes: Array, sums: Array) -> None:
    """Add the gradient of the motion to x amid each element, times its volume, to each of its nodes, (n, 3, 3)."""
    F = np.empty((3, 3))
    for e in range(elements.shape[0]):
        _write_gradient(x, elements[e], slopes[e], F)
        for a in range(elements.shape[1]):
            for i in range(3):
                for j in range(3):
                    sums[elements[e, a], i, j] += F[i, j]


@njit(cache=True, error_model="numpy")
def _write_rotation(F: Array, out: Array) -> None:
    """Write the rotation in F, which is destroyed; the identity where F has none."""
    size = 0.0
    for i in range(3):
        for j in range(3):
            size += F[i, j] * F[i, j]
    F *= np.sqrt(3.0 / size)  # as large as a rotation is; NaN, which turns nothing, without elements
    if not polar_rotation(F, out):
        for i in range(3):
            for j in range(3):
                out[i, j] = 1.0 if i == j else 0.0


@njit(cache=True, error_model="numpy")
def write_element_rotations(x: Array, elements: Array, slopes: Array, out: Array) -> None:
    """Write the rotation amid each element at x, shape (m, 3, 3)."""
    F = np.empty((3, 3))
    for e in range(elements.shape[0]):
        _write_gradient(x, elements[e], slopes[e], F)
        _write_rotation(F, out[e])


@njit(cache=True, error_model="numpy")
def write_rotations(sums: Array, around: Array, out: Array) -> None:
    """Write the rotation in the sum over the nodes around each point, (k, c), to `out` (k, 3, 3)."""
    F = np.empty((3, 3))
    for p in range(around.shape[0]):
        F[:] = 0.0
        for c in range(around.shape[1]):
            for i in range(3):
                for j in range(3):
                    F[i, j] += sums[around[p, c], i, j]
        _write_rotation(F, out[p])


@njit(cache=True, error_model="numpy")
def turn(rotations: Array, b: Array, out: Array) -> None:
    """Write R b, three by three; `out` is not `b`."""
    for n in range(rotations.shape[0]):
        R = rotations[n]
        for i in range(3):
            out[3 * n + i] = R[i, 0] * b[3 * n] + R[i, 1] * b[3 * n + 1] + R[i, 2] * b[3 * n + 2]


@njit(cache=True, error_model="numpy")
def turn_back(rotations: Array, b: Array, out: Array) -> None:
    """Write R^T b, three by three; `out` is not `b`."""
    for n in range(rotations.shape[0]):
        R = rotations[n]
        for i in range(3):
            out[3 * n + i] = R[0, i] * b[3 * n] + R[1, i] * b[3 * n + 1] + R[2, i] * b[3 * n + 2]
