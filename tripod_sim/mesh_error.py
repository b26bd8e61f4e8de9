"""The error that the mesh makes of the effector's position, estimated while a scene runs.

A richer mesh of the same piece, with the same clamps, material and weight, is kept at rest beside the body in motion:
its driven frames stand where those of the body stand, and it carries the body's inertia as a dead load,

    dE+/dx (x+) = m+ (G - T a),      error = H x+ - H x,

G gravity, a the accelerations that the body's elastic forces balance, T the interpolation in its elements, H the mean
of the disc's nodes. Where both are linear that is the dual-weighted residual [BeckerRannacher2001] with the dual
solution of the richer mesh, error = -z+ . R+(x), A+ z+ = H^T: a step with the kept tangent A+ costs the one
back-substitution that the dual would, gives all three components, and what the linearisation misses is seen and
corrected by the next. Accelerations are taken as known, so the error follows at once: that the errors themselves have
inertia, and vibrate, is left out.

Stiffness damping b makes elastic forces g lag behind: g + b dg/dt = f, so a is the measured one passed through the same
first-order lag.
"""

import math
import time
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tripod_sim.build import build, reach_of
from tripod_sim.constraints.groups import rotation_vector
from tripod_sim.errors import StepError
from tripod_sim.forces.loads import NodalLoads
from tripod_sim.integrators.newton import Newton, NewtonError
from tripod_sim.integrators.quasi_static import QuasiStatic
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.scene import Scene, at_rest
from tripod_sim.state import State
from tripod_sim.system import System

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

NEAR = 5e-6
"""How far from its solution a coordinate of the richer mesh may be [m]: far below errors that matter."""

GRADED = 8
"""The coarsest mesh level of the Y whose cells are graded for quadratic elements; see `mesh.y_piece.LEVELS`."""


@dataclass(frozen=True)
class MeshErrorReport:
    """How far the effector is from where the richer mesh has it.

    Attributes:
        effector: Exact minus computed position of its centre [m]; NaN where the richer mesh has no equilibrium.
        time: Simulated time of the estimate [s].
    """

    effector: tuple[float, float, float]
    time: float

    @property
    def distance(self) -> float:
        """Length of the error [m]."""
        return math.hypot(*self.effector)


def richer(scene: Scene) -> Scene:
    """Return the static scene on the mesh that tells the error of the scene's own.

    Quadratic hexahedra on the same cells tell the error of linear ones, half the edges that of quadratic ones. The Y's
    levels below `GRADED` are too coarse at disc and clamp for that: they are held against quadratic elements on it.
    """
    mesh = scene.mesh
    assert mesh and mesh.element in ("h8_modes", "h20")
    if mesh.source == "y_piece" and mesh.level < GRADED:
        finer = replace(mesh, element="h20", level=GRADED)
    elif mesh.element == "h8_modes":
        finer = replace(mesh, element="h20")
    else:
        finer = replace(mesh, refine=mesh.refine + 1)
    return replace(at_rest(scene), mesh=finer)


class MeshError:
    """Keeps the richer mesh beside a simulation."""

    def __init__(self, scene: Scene, mesh: SolidMesh) -> None:
        """Build the richer mesh; `mesh`: the scene's own, whose nodes come first in its states. Raises SceneError."""
        parts, solver = build(richer(scene)), scene.solver
        assert isinstance(parts.system, System) and isinstance(parts.mesh, SolidMesh)
        system = self._system = parts.system
        self._newton = Newton(system, solver.tolerance, solver.max_iterations)
        self._newton.near = NEAR
        self._careful = QuasiStatic(self._newton, solver.max_halvings, solver.max_turn, reach_of(scene))
        self._share = scene.mesh_error.share if scene.mesh_error else np.inf
        self._nodes, self._weights = interpolation(mesh, parts.mesh.nodes)
        self._own: State | None = None
        self._dx, self._move = np.zeros_like(system.rest), np.zeros(system.unknowns)
        self._moving = scene.inertia is not None
        if self._moving:
            count = len(mesh.nodes)
            self._before, self._acceleration = np.zeros((count, 3)), np.zeros((count, 3))
            system.loads = NodalLoads(system.rest)
            self._mass = parts.mass[: len(parts.mesh.nodes), None]
            self._drag = scene.damping.mass if scene.damping else 0.0
            lag = scene.damping.stiffness if scene.damping else 0.0
            self._rate, self._lets = 1 / scene.dt, scene.dt / (scene.dt + lag)

    def start(self, state: State) -> MeshErrorReport:
        """Begin anew with `state`, at rest: bring the richer mesh there; return the error there."""
        if self._own is None:
            self._own = self._system.start_state(np.zeros_like(state.joints))
            self._trial, self._seen = self._own.copy(), state.copy()
            self._careful.step(self._own, state.joints, 0.0)
            self._start = self._own.copy()
            self.estimate(state)  # what compiles here is not to count
        self._start.copy_to(self._own)
        state.copy_to(self._seen)
        self._newton.forget()
        self._credit = 0.0
        if self._moving:
            self._before[:], self._acceleration[:] = state.velocities[: len(self._before)], 0.0
        begin = time.thread_time()
        self._last = self.estimate(state)
        self._cost = time.thread_time() - begin
        return self._last

    def follow(self, state: State, begin: float) -> MeshErrorReport:
        """Take notice of a step to `state` that began at `begin` of the thread's clock [s].

        Returns:
            The error at its end where an estimate is due, else the last one.
        """
        end = time.thread_time()
        self._credit += self._share * (end - begin)
        if self._moving:
            track(state.velocities, self._rate, self._drag, self._lets, self._before, self._acceleration)
        due = self._credit >= self._cost
        if due:
            self._last = self.estimate(state)
        taken = time.thread_time() - end
        self._credit -= taken
        if due:
            self._cost = taken
        return self._last

    def estimate(self, state: State) -> MeshErrorReport:
        """Return the error at `state`."""
        own, system = self._own, self._system
        assert own
        if self._moving and system.loads:
            force = system.loads.force[: len(self._nodes)]
            interpolate(self._nodes, self._weights, self._acceleration, self._acceleration, 0.0, force)
            force *= -self._mass
        try:
            self._settle(own, state)
        except StepError:
            return MeshErrorReport((np.nan, np.nan, np.nan), state.time)
        state.copy_to(self._seen)
        x, y, z = (own.centres[0] - state.centres[0]).tolist()
        return MeshErrorReport((x, y, z), state.time)

    def _settle(self, own: State, state: State) -> None:
        """Bring the richer mesh to rest where `state` has moved since it was last seen.

        It goes along with that at first; where no rest is near there, it goes its own way, by increments.

        Raises:
            StepError: there is no rest; it stays where it was.
        """
        trial, joints = self._trial, state.joints
        own.copy_to(trial)
        self._carry(own, state, trial)
        try:
            self._newton.solve(trial, joints, keep=1.0)
            trial.copy_to(own)
        except NewtonError:
            self._careful.step(own, joints, 0.0)

    def _carry(self, own: State, state: State, out: State) -> None:
        """Write to `out` where `own` is moved by what `state` has moved since it was last seen."""
        system, seen, dx, move = self._system, self._seen, self._dx, self._move
        first = 3 * system.reduction.free_count
        interpolate(self._nodes, self._weights, state.positions, seen.positions, 1.0, dx)
        move[first : first + 3] = state.centres[0] - seen.centres[0]
        move[first + 3 : first + 6] = rotation_vector(state.rotations[0] @ seen.rotations[0].T)
        system.drive(out, state.joints)
        system.move(own, move, dx, 1.0, out)


@njit(cache=True, error_model="numpy")
def track(
    velocities: FloatArray, rate: float, drag: float, share: float, before: FloatArray, acceleration: FloatArray
) -> None:  # fmt: skip
    """Let `acceleration` [m/s²], shape (n, 3), follow the change of `velocities` [m/s] since `before`, (n, 3).

    Args:
        velocities: At the end of a step; `before` becomes a copy of its first n.
        rate: 1 / dt [1/s].
        drag: a of the damping force -a M v [1/s], which counts as acceleration.
        share: dt / (dt + b), what a lag of b lets through in a step.
    """
    for n in range(before.shape[0]):
        for i in range(3):
            v = velocities[n, i]
            now = (v - before[n, i]) * rate + drag * v
            acceleration[n, i] += share * (now - acceleration[n, i])
            before[n, i] = v


@njit(cache=True, error_model="numpy")
def interpolate(
    nodes: IndexArray, weights: FloatArray, values: FloatArray, less: FloatArray, part: float, out: FloatArray
) -> None:
    """Write sum_a w_a (values - part less) of `nodes` with `weights`, both (p, k), to the first p rows of `out`."""
    for p in range(nodes.shape[0]):
        for i in range(3):
            total = 0.0
            for a in range(nodes.shape[1]):
                n = nodes[p, a]
                total += weights[p, a] * (values[n, i] - part * less[n, i])
            out[p, i] = total


def interpolation(mesh: SolidMesh, points: FloatArray) -> tuple[IndexArray, FloatArray]:
    """Return nodes and weights, both (p, k), that give values at `points` [m], (p, 3), of those at a mesh's nodes.

    Points a little outside of the mesh take the values of the nearest element, continued.
    """
    kind, elements = mesh.kind, np.asarray(mesh.elements)
    corners = mesh.nodes[elements]
    near = min(8, len(elements))
    candidates = cKDTree(corners.mean(axis=1)).query(points, near)[1].reshape(len(points), near)
    best, least = np.zeros((len(points), 3)), np.full(len(points), np.inf)
    chosen = candidates[:, 0].copy()
    for k in range(near):
        nodes, xi = corners[candidates[:, k]], np.zeros((len(points), 3))
        for _ in range(10):
            miss = points - np.einsum("pa,pai->pi", kind.functions(xi), nodes)
            jacobian = np.einsum("paj,pai->pij", kind.gradients(xi), nodes)
            xi = np.clip(xi + np.linalg.solve(jacobian, miss[:, :, None])[:, :, 0], -2.0, 2.0)
        beyond = np.abs(xi).max(axis=1)
        nearer = beyond < least - 1e-9
        best[nearer], least[nearer], chosen[nearer] = xi[nearer], beyond[nearer], candidates[nearer, k]
    return elements[chosen], kind.functions(best)
