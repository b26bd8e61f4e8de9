"""How the error of the mesh swings: what that of `mesh_error`, at rest beside a motion, lacks in the motion itself.

In motion the error has inertia, too. Let phi_i be the lowest modes of the body on its own mesh, K phi_i = w_i² M phi_i
with phi_i . M phi_i = 1. Their inertia f_i = -phi_i . M v' makes a part of the error at rest,

    e = sum of E_i f_i,   E_i = (A+^-1 P^T - P K^-1) M phi_i,   e_i = (P phi_i) . M+ e,

and while f changes, the error goes beyond that at rest by the sum of phi_i z_i:

    z_i'' + (a + d_i) z_i' + w_i² z_i = -e_i''.

A+, M+ and P are as in `mesh_error`, a the damping by mass, d_i = phi_i . C phi_i with C the matrix of the body's
dampers. A mesh is too stiff, so it vibrates too fast and gets ahead from period to period; time steps make a body
slower, and so the two errors may cancel. Of e itself what f has changed since the last estimate is added, too. Modes
and E are those of the start.
"""

from contextlib import suppress

import numpy as np
from numba import njit
from scipy.sparse import csr_matrix

from tripod_host.arrays import Array, FloatArray
from tripod_sim.array_kernels import put
from tripod_sim.forces.elastic import Elastic
from tripod_sim.linear.solver import LinearError
from tripod_sim.mesh_error.external_loads import ExternalLoads
from tripod_sim.mesh_error.modes import modes, none, project
from tripod_sim.state import State
from tripod_sim.system import System
from tripod_sim.system_kernels import same


class ModalError:
    """Follows the error of the mesh in the lowest modes of a body that is alone in its scene.

    Attributes:
        modes: Those of the start.
        damping: d_i [1/s], shape (modes,).
    """

    def __init__(
        self, loads: ExternalLoads, richer: System, prolong: csr_matrix, mass: FloatArray, drag: float, dampers: Elastic
    ) -> None:  # fmt: skip
        """Prepare.

        Args:
            loads: Has the body on its own mesh.
            richer: The body on the richer mesh.
            prolong: P, shape (nodes of the richer mesh, nodes of the own one).
            mass: Of nodes of the richer mesh [kg], shape (nodes,).
            drag: a of the force -a M v [1/s].
            dampers: Have those of the body.
        """
        self._loads, self._richer, self._prolong, self._mass = loads, richer, prolong, mass
        self._inertia = prolong.T @ prolong.multiply(mass[:, None]).tocsr()
        self._drag, self._dampers, self.damping = drag, dampers, np.zeros(0)

    def start(self, state: State, fine: State) -> None:
        """Begin again at `state`, where the richer mesh rests as `fine` and is factored; nothing swings yet."""
        self._find_modes(state, fine)
        self._time, self._length, self._velocities = state.time, 0.0, state.velocities.copy()
        self._moving = bool(state.velocities.any())
        count = len(self.modes.squares)
        self._beyond, self._rate, self._force = np.zeros(count), np.zeros(count), np.zeros(count)
        self._seen, self._still = np.zeros(count), False

    def see(self) -> None:
        """Take notice of a new estimate of the error at rest."""
        self._seen[:] = self._force

    def follow(self, state: State) -> bool:
        """Go on to `state`, a step further; return whether that changed anything."""
        h = state.time - self._time
        if h <= 0.0:
            return False
        self._time = state.time
        if self._still and same(state.velocities, self._velocities):
            return False
        if h != self._length:
            self._length, self._propagator = h, propagator(self.modes.squares, self._drag + self.damping, h)
        self._still = carry(
            *self.modes.weighed, state.velocities, self._velocities, h, self._change, self._propagator, self._force,
            self._beyond, self._rate, self.modes.negligible,
        )  # fmt: skip
        if self._moving:  # what acted before the start is not known: that it begins here makes nothing swing
            self._beyond[:] = self._rate[:] = 0.0
            self._moving = False
            self.see()
        return True

    def beyond(self) -> tuple[float, float, float]:
        """Return what the effector errs by beyond the last estimate of its error at rest [m]."""
        x, y, z = beyond(self._effector_change, self._force, self._seen, self._effector, self._beyond)
        return x, y, z

    def _find_modes(self, state: State, fine: State) -> None:
        """Find the modes and E; there are none where an equilibrium is not stable, or they are not found."""
        own, system, richer = self._loads.placed(state), self._loads.system, self._richer
        system.assemble(own, project=False)
        stable = system.factor() and richer.factored
        found, answers = none(system), np.zeros((0, *richer.rest.shape))
        if stable:
            with suppress(LinearError):
                several = modes(system, self._inertia)
                answers = np.array([self._answer(force.copy(), own, fine) for force in several.inert])
                found = several
        system.forget()  # what was assembled is not to count in the forces of later states
        self.modes, count = found, len(found.squares)
        self.damping = np.array([self._damped(state, shape) for shape in found.shapes])
        finer = np.array([self._prolong @ shape for shape in found.shapes]).reshape(answers.shape)
        errors = answers - np.array([self._prolong @ move for move in found.yields]).reshape(answers.shape)
        weighed = (self._mass[:, None] * finer).reshape(count, richer.rest.size)
        self._change = weighed @ errors.reshape(count, richer.rest.size).T
        self._effector = found.shapes[:, system.groups.rigid[0]].mean(axis=1).T
        self._effector_change = errors[:, richer.groups.rigid[0]].mean(axis=1).T

    def _damped(self, state: State, shape: FloatArray) -> float:
        """Return shape . C shape at `state` [1/s], shape (nodes, 3) [kg^-1/2]."""
        force = np.zeros_like(shape)
        self._dampers.add_damping_bound(state.positions, state.modes, shape, force)
        return float(np.vdot(shape, force))

    def _answer(self, force: FloatArray, own: State, fine: State) -> FloatArray:
        """Return the moves of the richer mesh [m] under a force on the own one [N], overwritten, shapes (nodes, 3)."""
        richer = self._richer
        found, reduced = np.zeros_like(richer.rest), np.zeros(richer.unknowns)
        self._loads.spread(force, own, fine, found)
        richer.reduction.gradient(found, reduced, np.zeros_like(richer.torques))
        found[:] = 0.0
        richer.reduction.moves(richer.linear.solve(reduced), richer.lever, found)
        return found


def propagator(squares: FloatArray, damping: FloatArray, h: float) -> FloatArray:
    """Return what carries z and z' of z'' + d z' + w² z = 0 over a time, shape (2, 2, modes).

    Args:
        squares: w² of each mode [1/s²], above 0, shape (modes,).
        damping: d of each [1/s], shape (modes,).
        h: The time [s].
    """
    half = 0.5 * damping
    root = np.sqrt((half**2 - squares).astype(complex))
    small = np.abs(root * h) < 1e-6
    odd = np.where(small, h, np.sinh(root * h) / np.where(small, 1.0, root)).real
    decay, even = np.exp(-half * h), np.cosh(root * h).real
    return np.asarray(decay * [[even + half * odd, odd], [-squares * odd, even - half * odd]])


@njit(cache=True, error_model="numpy")
def carry(
    nodes: Array, inert: Array, velocities: FloatArray, before: FloatArray, h: float, change: FloatArray,
    by: FloatArray, force: FloatArray, z: FloatArray, rate: FloatArray, negligible: float,
) -> bool:  # fmt: skip
    """Carry z and z' of all modes over a step; return whether all is still, and stays so without a force.

    Args:
        nodes, inert: As `Modes.weighed`.
        velocities: At the end [m/s], shape (n, 3).
        before: Those at the start; those at the end afterwards.
        h: [s].
        change: e_i for each unit of f_j, shape (modes, modes).
        by: The `propagator`.
        force: f, as before; shape (modes,), as z and z'; updated.
        z, rate: Updated.
        negligible: What is below it is none where no force acts [m kg^1/2].
    """
    more = project(nodes, inert, before, velocities)
    for i in range(len(z)):
        more[i] = more[i] / h - force[i]
        force[i] += more[i]
    for i in range(len(z)):
        x, v = z[i], rate[i]
        for j in range(len(z)):
            x -= change[i, j] * more[j]
        z[i], rate[i] = by[0, 0, i] * x + by[0, 1, i] * v, by[1, 0, i] * x + by[1, 1, i] * v
    put(before, velocities)
    for i in range(len(z)):
        if force[i] != 0.0 or not abs(z[i]) + h * abs(rate[i]) < negligible:
            return False
    z[:] = rate[:] = 0.0
    return True


@njit(cache=True, error_model="numpy")
def beyond(change: Array, force: Array, seen: Array, effector: Array, z: Array) -> tuple[float, float, float]:
    """Return `change` (force - seen) + `effector` z, both matrices of shape (3, modes)."""
    found = np.zeros(3)
    for i in range(3):
        for m in range(len(z)):
            found[i] += change[i, m] * (force[m] - seen[m]) + effector[i, m] * z[m]
    return found[0], found[1], found[2]
