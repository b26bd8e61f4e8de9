"""Steps with a kept factorisation, for a mesh whose new factorisation takes the time of 20 of them.

They are worth as much as the matrix is still that of the body. What changes it most is that parts of the body turn, so
the kept one turns along: with R of each node, that of the element of a coarser mesh around it since the factorisation,

    x = R A^-1 R^T b.
"""

import numpy as np
from scipy.spatial import cKDTree

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.newton import Newton
from tripod_sim.linear.solver import LinearSolver
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.state import State
from tripod_sim.system import System

SLOWLY = 0.8
"""What a step may leave of the unbalanced force; another factorisation follows where it leaves more."""

NEAR, PART = 5e-7, 0.1
"""How far a coordinate may be from its solution [m]; how far the last step may move the effector, beyond that, in parts
of the error that is told."""


class TurningSolver(LinearSolver):
    """Solves with the matrix last factored, turned as the body has turned since then."""

    def __init__(self, inner: LinearSolver, unknowns: int) -> None:
        """`inner`: solves with the matrix itself, of as many `unknowns`."""
        self._inner = inner
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
            return self._inner.solve(b)
        back = b.reshape(-1, 1, 3) @ self._since
        found = self._inner.solve(back.reshape(-1)).reshape(-1, 3, 1)
        return np.asarray((self._since @ found).reshape(-1))


class Rotations:
    """Finds how parts of a body have turned, from the gradient of its motion amid each element."""

    def __init__(self, mesh: SolidMesh, system: System) -> None:
        """`mesh`: the body's own; `system`: of the finer mesh, whose unknowns turn."""
        kind, corners = mesh.kind, mesh.nodes[mesh.elements]
        slopes = kind.gradients(kind.centre)[0]
        inverse = np.linalg.inv(kind.jacobians(corners, kind.centre)[:, 0])
        self._elements, self._slopes = mesh.elements, np.einsum("aj,ejk->eak", slopes, inverse)
        places = system.rest[system.reduction.free]
        self._around = cKDTree(corners.mean(axis=1)).query(places)[1]
        self._bodies = system.reduction.bodies

    def at(self, state: State) -> FloatArray:
        """Return the rotation of each three unknowns for the body in `state`, shape (unknowns / 3, 3, 3)."""
        gradients = np.einsum("eai,eak->eik", state.positions[self._elements], self._slopes)
        u, _, v = np.linalg.svd(gradients)
        return np.concatenate([(u @ v)[self._around], np.repeat(state.rotations[: self._bodies], 2, axis=0)])


class ChordNewton(Newton):
    """Keeps a factorisation as long as it converges, and ends once it knows the effector as well as is worth it.

    Attributes:
        amiss: Place of the body's effector [m], shape (3,), if its distance is all that is asked for; None: solves end
            within `NEAR`.
    """

    FEW = 20

    def __init__(self, system: System, tolerance: float, max_iterations: int) -> None:
        """As `Newton`."""
        super().__init__(system, tolerance, max_iterations)
        self.near = NEAR
        self.amiss: FloatArray | None = None
        self._centre = np.zeros(3)

    def _converges(self, size: float, before: float) -> bool:
        return size < SLOWLY * before

    def _ends(self) -> bool:
        last, self._centre = self._centre, self._state.centres[0].copy()
        if self.amiss is None:
            return super()._ends()
        told, change = np.linalg.norm(self._centre - self.amiss), np.linalg.norm(self._centre - last)
        return bool(self._size < SLOWLY * self._before and change <= NEAR + PART * told)
