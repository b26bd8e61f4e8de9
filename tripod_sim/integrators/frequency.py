"""The largest frequency of a solid in the unknowns that its constraints leave."""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.integrators.stability import largest_eigenvalue
from tripod_sim.state import State
from tripod_sim.system import System

FloatArray = NDArray[np.float64]

FIRST, LATER = 500, 10
"""Products of the power iteration at the first call and at those after, which begin where the last one ended."""


class LargestFrequency:
    """Estimates the largest w² of K u = w² M u, driven nodes at rest, by power iteration.

    With M = L L^T the iteration is on L^-1 K L^-T. M is diagonal but for a block of six rows for each rigid body,

        sum_i m_i [I, -[r_i]x; [r_i]x, -[r_i]x²].
    """

    def __init__(self, system: System, mass: FloatArray) -> None:
        """`mass`: of nodes [kg], shape (n,)."""
        self._system, self._mass = system, mass
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
        """Begin anew at the next call."""
        self._vector = None

    def squared(self, state: State) -> float:
        """Return w² [1/s²], an estimate from below, with the matrices that the system assembled last, at `state`."""
        system = self._system
        system.update_levers(state)
        for b, nodes in enumerate(system.groups.rigid):
            self._blocks[b] = np.linalg.inv(
                np.linalg.cholesky(_inertia(self._mass[nodes], system.lever[nodes]))
            )
        first = self._vector is None
        start = (
            np.random.default_rng(0).standard_normal(len(self._unknowns))
            if self._vector is None
            else self._vector
        )
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
        system.elastic.add_products(system.elastic.matrices, self._move, 1.0, self._force)
        if system.foundation:
            system.foundation.add_gradient(self._move, self._force)
        out = np.empty_like(u)
        system.reduction.gradient(self._force, system.lever, system.axes, out, self._torques)
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
