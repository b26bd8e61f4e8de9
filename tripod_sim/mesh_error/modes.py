"""Modes of a body for what moves it and what is looked at: few do what many of its lowest ones would.

With K and M of the body, k its servos and H the mean of the effector's nodes, the blocks

    [K^-1 M K^-1 dK_k, K^-1 H],   K^-1 M times these,   and so on,

hold how the body answers the inertia of what its servos turn and forces at the effector, by dK_k the forces per turn of
servo k: Ritz vectors [WilsonYuanDickens1982], from both ends as in Krylov model reduction. The modes are those of the
body within their span, K^-1 M phi = phi / w².
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from tripod_host.arrays import Array, FloatArray, IndexArray
from tripod_sim.system import System

LEAST = 12
"""Vectors at least, in at least two blocks: of the Tripod so many tell the errors of its steps to a fifth."""

NEGLIGIBLE = 1e-7
"""Errors of nodes below this are none [m]: at rest, where solvers leave a body about as far off, nothing is carried."""

DEPENDENT = 1e-6
"""Share of a vector that those before it leave, up to which it adds nothing."""


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes phi_i with phi_i . M phi_i = 1.

    Attributes:
        squares: w_i² [1/s²], shape (modes,).
        shapes: phi_i [kg^-1/2], shape (modes, n, 3).
        inert: M phi_i [kg^1/2], shape (modes, n, 3).
        yields: K^-1 M phi_i, of which phi_i / w_i² is the part within the span [kg^-1/2 s²], shape (modes, n, 3).
    """

    squares: FloatArray
    shapes: FloatArray
    inert: FloatArray
    yields: FloatArray

    def momenta(self, change: FloatArray, before: FloatArray) -> FloatArray:
        """Return phi_i . M (change - before) of what moves by itself, shape (modes,); both of shape (n, 3)."""
        return np.asarray(project(*self._momenta, change, before))

    def furthest(self, parts: FloatArray) -> tuple[float, int]:
        """Return the largest of the moves of nodes that `parts` of the modes make, shape (modes,), and of which."""
        largest, node = furthest(self._momenta[0], self._compact, parts)
        return float(largest), int(node)

    @cached_property
    def weighed(self) -> tuple[IndexArray, NDArray[np.float32]]:
        """Nodes that move by themselves, then those beside them, shape (k,), and M phi_i there, (modes, 3 k)."""
        moving, heavy = (a.any(axis=(0, 2)) for a in (self.shapes, self.inert))
        nodes = np.append(np.flatnonzero(moving), np.flatnonzero(heavy & ~moving))
        forces = self.inert[:, nodes].reshape(len(self.inert), 3 * len(nodes))
        return nodes, np.ascontiguousarray(forces, dtype=np.float32)

    @cached_property
    def _momenta(self) -> tuple[IndexArray, NDArray[np.float32]]:
        """Return what is `weighed` of nodes that move by themselves."""
        (nodes, inert), moving = self.weighed, int(self.shapes.any(axis=(0, 2)).sum())
        return nodes[:moving], np.ascontiguousarray(inert[:, : 3 * moving])

    @cached_property
    def _compact(self) -> NDArray[np.float32]:
        """Return phi_i of the nodes that move by themselves, shape (3, modes, k)."""
        return np.ascontiguousarray(self.shapes[:, self._momenta[0]].transpose(2, 0, 1), dtype=np.float32)

    @cached_property
    def negligible(self) -> float:
        """How much of a mode is negligible [m kg^1/2]."""
        return NEGLIGIBLE / float(np.abs(self.shapes).max(initial=NEGLIGIBLE))


def none(system: System) -> Modes:
    """Return the modes of what has none."""
    shapes = np.zeros((0, *system.rest.shape))
    return Modes(np.zeros(0), shapes, shapes, shapes)


def modes(system: System, inertia: csr_matrix) -> Modes:
    """Return the modes of a body.

    Args:
        system: Assembled and factored where they are asked for, positive definite.
        inertia: M [kg], shape (n, n).

    Raises:
        LinearError: a system is not solved for.
    """
    reduction, moved = system.reduction, np.zeros_like(system.rest)
    torques = np.zeros_like(system.torques)

    def answer(forces: FloatArray) -> FloatArray:
        reduced = np.zeros(system.unknowns)
        reduction.gradient(forces, reduced, torques)
        return yielded(reduced)

    def yielded(reduced: FloatArray) -> FloatArray:
        reduction.moves(system.linear.solve(reduced), system.lever, moved)
        return moved.copy()

    block = [answer(inertia @ yielded(column.copy())) for column in reduction.drive.T if column.any()]
    effector, unit = np.zeros((3, *system.rest.shape)), np.eye(3)
    effector[:, system.groups.rigid[0]] = unit[:, None] / len(system.groups.rigid[0])
    block += [answer(forces) for forces in effector]
    basis: list[FloatArray] = []
    inert: list[FloatArray] = []
    answers: list[FloatArray] = []
    for _ in range(max(2, -(-LEAST // len(block)))):
        first = len(basis)
        for vector in block:
            _add(vector, inertia, basis, inert)
        block = [answer(force.copy()) for force in inert[first:]]
        answers += block
    flexibility = np.tensordot(inert, answers, ((1, 2), (1, 2)))
    inverse, turn = np.linalg.eigh(0.5 * (flexibility + flexibility.T))
    inverse, turn = inverse[::-1], turn[:, ::-1]
    shapes, forces, yields = (np.tensordot(turn.T, several, 1) for several in (basis, inert, answers))
    return Modes(1.0 / inverse, shapes, forces, yields)


def _add(vector: FloatArray, inertia: csr_matrix, basis: list[FloatArray], inert: list[FloatArray]) -> None:
    """Add what of a vector is new to a basis that is orthonormal by the masses, and M times that to `inert`."""
    whole = np.sqrt(np.vdot(vector, inertia @ vector))
    for _ in range(2):  # once loses orthogonality by rounding
        for shape, force in zip(basis, inert, strict=True):
            vector = vector - np.vdot(force, vector) * shape
    force = inertia @ vector
    size = np.sqrt(np.vdot(vector, force))
    if size > DEPENDENT * whole:
        basis.append(vector / size)
        inert.append(force / size)


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def project(nodes: Array, weights: Array, a: Array, b: Array) -> Array:
    """Return weights . (a - b), shape (modes,), of `nodes` (k,) with weights (modes, 3 k), a and b of shape (n, 3)."""
    found, changes, some = np.zeros(weights.shape[0]), np.empty(weights.shape[1]), False
    for k in range(nodes.shape[0]):
        for i in range(3):
            changes[3 * k + i] = change = a[nodes[k], i] - b[nodes[k], i]
            some |= change != 0.0
    if some:
        for m in range(found.shape[0]):
            total = 0.0
            for j in range(changes.shape[0]):
                total += weights[m, j] * changes[j]
            found[m] = total
    return found


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def furthest(nodes: Array, shapes: Array, parts: Array) -> tuple[float, int]:
    """Return the largest length of a move, and of which node; `nodes` (k,), shapes (3, modes, k), parts (modes,)."""
    count = nodes.shape[0]
    squares, moves = np.zeros(count, np.float32), np.empty(count, np.float32)
    for i in range(3):
        for k in range(count):
            moves[k] = 0.0
        for m in range(parts.shape[0]):
            part = np.float32(parts[m])
            for k in range(count):
                moves[k] += shapes[i, m, k] * part
        for k in range(count):
            squares[k] += moves[k] ** 2
    which = 0
    for k in range(count):
        if squares[k] > squares[which]:
            which = k
    return np.sqrt(np.float64(squares[which])), nodes[which]
