"""What acts from outside on a body whose error a richer mesh tells: forces, and obstacles that hold it."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.bodies.soft_build import assembled, sets_of
from tripod_sim.build import build_model
from tripod_sim.errors import SceneError
from tripod_sim.integrators.stepper import integrator_of
from tripod_sim.linear.choice import linear_factory
from tripod_sim.mesh.described import described_mesh
from tripod_sim.mesh.embedding import reference_coordinates
from tripod_sim.mesh.solid_mesh import SolidMesh, solid_volumes
from tripod_sim.mesh_error.support import Support
from tripod_sim.model import Model
from tripod_sim.state import State
from tripod_sim.steps.parts import Parts
from tripod_sim.system import System
from tripod_sim.tables.bodies import Mesh
from tripod_sim.tables.materials import initial_young
from tripod_sim.tables.sets import NodeSet

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.contact.contact_solver import ContactSolver


STIFF = 100.0
"""Stiffness of what holds a point against an obstacle, over Young's modulus times the body's size."""

PRESSES, STICKS = 1e-3, 0.999
"""As in `contact.rest`, which only scenes with contact import."""


def alone(model: Model, mesh: Mesh) -> Model:
    """Return the model at rest of the first body on `mesh`, without other bodies and what is said of these alone."""
    model, (field, body) = model.at_rest(), model.bodies[0]
    found = replace(model, bodies=((field, replace(body, mesh=mesh)),))
    if len(model.bodies) == 1:
        return found
    found = replace(found, ties=(), markers=())
    assembly, _ = assembled(found, described_mesh)

    def has(tables: tuple[NodeSet, ...], name: str) -> bool:
        """Return whether a set of `tables` has nodes of the body."""
        try:
            return bool(len(sets_of(replace(found, sets=tables), assembly).nodes(name, "")))
        except SceneError:
            return False

    sets = tuple(table for table in model.sets if has((table,), table.name))

    def concerns(table: Any) -> bool:
        """Return whether what an effect holds, moves or loads, a set or a box, has nodes of the body."""
        low, high = getattr(table, "low", None), getattr(table, "high", None)
        return has((*sets, NodeSet("box", low=low, high=high)), table.set or "box")

    effects = list[tuple[Any, Any]]()
    for effect, table in model.effects:
        own = tuple(filter(concerns, table)) if effect.several else table
        if own or not effect.several:
            effects.append((effect, own))
    joints = model.joints.of_body(body.name) if model.joints else None
    discs = tuple(disc for disc in model.discs if disc[2].name == body.name)
    return replace(found, sets=sets, effects=tuple(effects), joints=joints, effectors=discs)


class ExternalLoads:
    """What acts on the first body from outside: forces on the nodes of the richer mesh, and obstacles that hold it.

    Attributes:
        system: The body alone, on its own mesh.
        plates: Nodes of a maze's plate there and on the richer mesh.
        changes: How often other points have been held.
    """

    def __init__(self, model: Model, mesh: SolidMesh, richer: Parts, simulated: Parts) -> None:
        """`mesh`, `simulated`: as for `MeshError`; `richer`: what it made of the richer mesh."""
        _, body = model.bodies[0]
        assert body.mesh and body.material and isinstance(richer.mesh, SolidMesh)
        parts = build_model(alone(model, body.mesh))
        system = self.system = parts.system
        joints = system.groups.joints
        self._count, self._state = len(mesh.nodes), system.start_state(np.zeros(joints))
        self._nodes, self._weights = interpolation(richer.mesh, mesh.nodes)
        self._rest, self._fine_rest = mesh.nodes, richer.system.rest
        self._held = system.groups.held()
        self._disc, self._fine_disc = system.groups.rigid[0], richer.system.groups.rigid[0]
        none = np.zeros(0, dtype=np.int64)
        self._plate = simulated.plate.nodes if simulated.plate else none
        self.plates = (
            parts.plate.nodes if parts.plate else none,
            richer.plate.nodes if richer.plate else none,
        )
        self._support: Support | None = None
        self._world: ContactSolver | None = None
        self.changes = 0
        if model.obstacles:
            self._world = integrator_of(simulated.stepper).world
            self._surface = np.unique(mesh.surface)
            volume = float(solid_volumes(mesh).sum())
            stiffness = STIFF * initial_young(body.material) * volume ** (1 / 3)
            self._support = Support(self._nodes[self._surface], self._weights[self._surface], stiffness)
            self._stuck = np.zeros(len(self._surface), dtype=bool)
            self._along = np.zeros((len(self._surface), 3, 3))
            self._astray = np.zeros((len(self._surface), 3))

    def supported(self, system: System, model: Model) -> System:
        """Return the system of the richer mesh, with the supports of the body where it may have any."""
        if not self._support:
            return system
        solver = model.solver
        linear = linear_factory(solver.linear, solver.linear_tolerance)
        terms = [*system.terms, self._support]
        return System(system.rest, system.elastic.terms, system.groups, terms, linear=linear)

    def hold(self, state: State, seen: State, fine: State) -> None:
        """Hold the points of the richer mesh that lean on obstacles in `state`.

        Along the normal they stay where the body's own mesh has them; along the surface, while friction holds them, as
        far from there as they were when it began to.

        Args:
            state: Of the simulation.
            seen: The same at the last estimate.
            fine: Of the richer mesh then.
        """
        if not (self._support and self._world):
            return
        along, sticks = self._leaning(self._world)
        begin = sticks & ~self._stuck
        if begin.any():
            miss = self._support.places(fine.positions)[begin] - seen.positions[self._surface[begin]]
            self._astray[begin] = miss
        self._stuck[:] = sticks
        points = np.flatnonzero(along.any(axis=(1, 2)))
        self.changes += not np.allclose(along, self._along, atol=0.05)
        self._along[:] = along
        place = state.positions[self._surface[points]]
        for k, v in enumerate(points.tolist()):
            if sticks[v]:
                normal = self._normal[v]
                place[k] += self._astray[v] - (self._astray[v] @ normal) * normal
        self._support.hold(points, along[points], place)

    def _leaning(self, world: "ContactSolver") -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return along what obstacles hold each point of the surface, D, shape (p, 3, 3), and which of them stick."""
        count = len(self._surface)
        along, sticks, self._normal = (
            np.zeros((count, 3, 3)),
            np.zeros(count, dtype=bool),
            np.zeros((count, 3)),
        )
        c, of, nodes = world.contacts.arrays, slice(0, world.contacts.count), world.nodes
        pressure = c.pressure[of]
        if not (pressure > 0).any():
            return along, sticks
        own = nodes.nodes  # type: ignore[union-attr]
        point_of = np.full(len(world.positions), -1)
        mine = own < self._count
        point_of[: len(own)][mine] = np.searchsorted(self._surface, own[mine])
        rigid = len(world.rigid.centre) if world.rigid else 0
        for k in np.flatnonzero(pressure > PRESSES * pressure.max()).tolist():
            counts = c.weight[k] != 0.0
            vertex, weight, normal = c.vertex[k][counts], np.abs(c.weight[k][counts]), c.normal[k]
            fixed, points = world.surfaces.body[vertex] >= world.soft + rigid, point_of[vertex]
            if not fixed.any() or not (fixed | (points >= 0)).all():
                continue
            held = bool(np.linalg.norm(c.friction[k]) < STICKS * world.law.friction * pressure[k])
            directions = np.eye(3) if held else np.outer(normal, normal)
            for v, w in zip(points[~fixed].tolist(), weight[~fixed].tolist(), strict=True):
                along[v] += w * directions
                sticks[v] |= held
                self._normal[v] = normal
        return along, sticks

    def places(self, x: FloatArray) -> FloatArray:
        """Return where the richer mesh, its nodes at `x` [m], has the nodes of the body's own [m], shape (n, 3)."""
        return self._rest + np.einsum("pa,pai->pi", self._weights, (x - self._fine_rest)[self._nodes])

    def placed(self, state: State) -> State:
        """Return the body alone as it is in `state`, with its system evaluated there; the next call overwrites it."""
        own, system, n = self._state, self.system, self._count
        if own.modes.size:
            own.modes[:] = state.modes[: len(own.modes)]
        own.centres[0], own.rotations[0] = state.centres[0], state.rotations[0]
        system.drive(own, state.joints[: len(own.joints)])
        own.positions[:n] = state.positions[:n]
        own.positions[self.plates[0]] = state.positions[self._plate]
        system.evaluate(own)
        return own

    def load(self, state: State, fine: State, force: FloatArray) -> None:
        """Write the forces at `state` [N] to `force`, shape (nodes of the richer mesh, 3); `fine`: its state."""
        own = self.placed(state)
        self.spread(self.system.gradient.copy(), own, fine, force)

    def spread(self, given: FloatArray, own: State, fine: State, force: FloatArray) -> None:
        """Write to `force` [N] what forces on nodes of the body's own mesh are on those of the richer one.

        Args:
            given: They [N], shape (nodes, 3); overwritten.
            own: The body alone, as `placed`.
            fine: Of the richer mesh.
            force: Output, shape (nodes of the richer mesh, 3).
        """
        given[self._held] = 0.0
        x, disc = own.positions, self._disc
        total = given[disc].sum(axis=0)
        moment = np.cross(x[disc] - own.centres[0], given[disc]).sum(axis=0)
        given[disc] = 0.0
        force[:] = 0.0
        np.add.at(force, self._nodes, self._weights[:, :, None] * given[: self._count, None])
        arms = fine.positions[self._fine_disc] - fine.centres[0]
        inertia = np.eye(3) * np.vdot(arms, arms) - arms.T @ arms
        force[self._fine_disc] += total / len(arms) + np.cross(np.linalg.solve(inertia, moment), arms)


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
    near = min(kind.neighbours, len(elements))
    candidates = cKDTree(corners.mean(axis=1)).query(points, near)[1].reshape(len(points), near)
    best, least = np.zeros((len(points), 3)), np.full(len(points), np.inf)
    chosen = candidates[:, 0].copy()
    for k in range(near):
        xi = reference_coordinates(kind, corners[candidates[:, k]], points, kind.centre, 10)
        beyond = kind.beyond(xi)
        nearer = beyond < least - 1e-9
        best[nearer], least[nearer], chosen[nearer] = xi[nearer], beyond[nearer], candidates[nearer, k]
    return elements[chosen], kind.functions(best)
