"""The largest frequency of bodies in the unknowns that their constraints leave."""

from collections.abc import Callable

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.stability import largest_eigenvalue
from tripod_sim.state import State
from tripod_sim.system import System

FIRST, LATER = 500, 10
"""Products of the power iteration at the first call and at those after, which begin where the last one ended."""

STIRRED = 0.1
"""Of the start of a later call, by what it is off where the last one ended: of several terms another may have become
the stiffest, of which that knows nothing."""


class LargestFrequency:
    """Estimates the largest w² of K u = w² M u, driven nodes at rest, by power iteration; of dampers w² is a rate.

    With M = L L^T the iteration is on L^-1 K L^-T. M is diagonal but for a block of six rows for each rigid body,

        sum_i m_i [I, -[r_i]x; [r_i]x, -[r_i]x²].
    """

    def __init__(
        self, system: System, mass: FloatArray, add: Callable[[FloatArray, FloatArray], object]
    ) -> None:
        """`mass`: of nodes [kg], shape (n,); `add`: adds K times the first to the second, both of shape (n, 3)."""
        self._system, self._mass, self._add = system, mass, add
        self._stirs = len(system.elastic.terms) > 1
        reduction, n = system.reduction, len(mass)
        self._first = 3 * reduction.free_count
        self._root = np.repeat(1.0 / np.sqrt(mass[reduction.free]), 3)
        self._blocks = np.zeros((reduction.bodies, 6, 6))
        self._unknowns, self._move, self._force = (
            np.zeros(reduction.unknowns),
            np.zeros((n, 3)),
            np.zeros((n, 3)),
        )
        self._torques = np.zeros(reduction.driven)
        self._vector: FloatArray | None = None

    def forget(self) -> None:
        """Begin again at the next call."""
        self._vector = None

    def largest(self, state: State) -> float:
        """Return w² [1/s²], or a rate [1/s], an estimate from below, with the K at hand and the levers of `state`."""
        system = self._system
        system.update_levers(state)
        for b, nodes in enumerate(system.groups.rigid):
            self._blocks[b] = np.linalg.inv(
                np.linalg.cholesky(_inertia(self._mass[nodes], system.lever[nodes]))
            )
        first = self._vector is None
        start = self._vector
        if start is None or self._stirs:
            noise = np.random.default_rng(0).standard_normal(len(self._unknowns))
            start = noise if start is None else start + STIRRED / np.linalg.norm(noise) * noise
        value, self._vector = largest_eigenvalue(self._product, start, FIRST if first else LATER)
        return max(0.0, value)

    def _product(self, p: FloatArray) -> FloatArray:
        system, u, first = self._system, self._unknowns, self._first
        np.multiply(self._root, p[:first], out=u[:first])
        for b, block in enumerate(self._blocks):
            part = slice(first + 6 * b, first + 6 * b + 6)
            u[part] = p[part] @ block
        system.reduction.moves(u, system.lever, self._move)
        self._force[:] = 0.0
        self._add(self._move, self._force)
        out = np.empty_like(u)
        system.reduction.gradient(self._force, out, self._torques)
        out[:first] *= self._root
        for b, block in enumerate(self._blocks):
            part = slice(first + 6 * b, first + 6 * b + 6)
            out[part] = block @ out[part]
        return out


def _inertia(mass: FloatArray, lever: FloatArray) -> FloatArray:
    """Return the 6x6 mass matrix of mass points [kg] at levers [m], shape (k, 3)."""
    J = np.zeros((len(mass), 3, 6))
    J[:, range(3), range(3)] = 1.0
    J[:, 0, 4], J[:, 0, 5] = lever[:, 2], -lever[:, 1]
    J[:, 1, 3], J[:, 1, 5] = -lever[:, 2], lever[:, 0]
    J[:, 2, 3], J[:, 2, 4] = lever[:, 1], -lever[:, 0]
    return np.asarray(np.einsum("n,nij,nik->jk", mass, J, J))
