"""Platforms: rigid bodies that join sets of several bodies, which may have to be bent to fit.

Where the platform begins, a node X of a set that it holds stands at

    x = c + to + R(turn) (X - point),

c its centre. These places are what the reduction knows of the platform (`Groups.places`); the bodies keep their
undeformed shape. To find a state in which both hold, the platform is held at c, and its sets go there,

    x(s) = point + s (c + to - point) + R(s turn) (X - point),   s from 0 to 1,

in increments that each end in equilibrium: so a leg bends the way that its set turns. Then the platform is let go.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NoReturn

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.bodies.assembly import Assembly, SoftBody
from tripod_sim.constraints.groups import Groups
from tripod_sim.constraints.prescribed import Motion, Prescribed
from tripod_sim.errors import SceneError, StepError
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.quasi_static import quasi_static_steps
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.mesh.node_sets import NodeSets
from tripod_sim.state import State
from tripod_sim.system import System
from tripod_sim.tables.method import Solver
from tripod_sim.tables.robot import Hold, Platform
from tripod_sim.tables.timeline import Timeline

Progress = Callable[[float], None]

TURN, REACH = 0.1, 0.05
"""Largest turn [rad] and move, in parts of the largest extent of the bodies, of a set in an increment."""

ARM = 0.03
"""Length by which a slide counts as a turn [m]; nothing slides here."""

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / math.sqrt(12)
"""Where eight equal masses have the moments of inertia of a box with edges of 1, shape (8, 3)."""


class Platforms:
    """All of a scene.

    Attributes:
        nodes: Of the sets that each holds.
    """

    def __init__(self, tables: Sequence[Platform], sets: NodeSets) -> None:
        """Raises SceneError: there is no such set, or none of its nodes, or a node is in two of them."""
        self._tables = tables
        self._holds = list[tuple[int, str, Hold, IndexArray]]()
        for i, table in enumerate(tables):
            for k, hold in enumerate(table.hold):
                field = f"platform.{i}.hold.{k}"
                nodes = sets.nodes(hold.set, f"{field}.set")
                for _, before, _, other in self._holds:
                    if (both := np.intersect1d(nodes, other)).size:
                        raise SceneError(
                            f"{field} and {before} both hold node {both[0]}; leave it out of one of them"
                        )
                self._holds.append((i, field, hold, nodes))
        self.nodes = [
            np.concatenate([nodes for j, _, _, nodes in self._holds if j == i]) for i in range(len(tables))
        ]

    def joined(self, assembly: Assembly) -> Assembly:
        """Return the bodies, those that a platform joins counted as tied."""
        tied = np.array([body.tied for body in assembly.bodies])
        for nodes in self.nodes:
            meets = [k for k, body in enumerate(assembly.bodies) if np.isin(body.nodes, nodes).any()]
            together = np.isin(tied, tied[meets])
            tied[together] = tied[together].min()
        bodies = zip(assembly.bodies, tied.tolist(), strict=True)
        return Assembly([replace(body, tied=k) for body, k in bodies])

    def fasten(self, rest: FloatArray, groups: Groups) -> tuple[FloatArray, Groups, FloatArray]:
        """Return nodes and groups with the platforms' own nodes, and the masses of these.

        Eight nodes have the mass of a platform; each of a set has an image without mass on the other side of the
        platform's centre, so that the mean of all, the centre of the rigid body, is that of the platform.

        Args:
            rest: Undeformed positions [m], shape (n, 3).
            groups: With the nodes of the sets as the last rigid bodies.

        Returns:
            Nodes [m], shape (n + k, 3), where the platforms begin; groups; masses of the new nodes [kg], shape (k,).
        """
        first = len(groups.rigid) - len(self._tables)
        rigid, places, mass = list(groups.rigid), dict[int, FloatArray](), list[FloatArray]()
        for i, table in enumerate(self._tables):
            there = np.concatenate([m.places(1.0) for j, _, m in self.motions(rest) if j == i])
            centre = np.array(table.position)
            own = np.concatenate([centre + CORNERS * table.size, 2 * centre - there])
            mass.append(np.repeat([table.mass / len(CORNERS), 0.0], [len(CORNERS), len(there)]))
            new = len(rest) + np.arange(len(own))
            rest = np.concatenate([rest, own])
            rigid[first + i] = np.concatenate([self.nodes[i], new])
            places[first + i] = np.concatenate([there, own])
        groups = replace(groups, size=len(rest), rigid=tuple(rigid), places=places)
        return rest, groups, np.concatenate(mass)

    def hold(self, field: str) -> Hold:
        """Return what `platform.0.hold.1` describes."""
        return next(hold for _, name, hold, _ in self._holds if name == field)

    def stretch(self, field: str) -> float:
        """Return by which share the body that it holds may be longer than undeformed."""
        return next(self._tables[i].stretch for i, name, _, _ in self._holds if name == field)

    def bending(
        self, assembly: Assembly, make: Callable[[Groups], System], solver: Solver, progress: Progress | None
    ) -> "Bending":
        """Return what bends the bodies to fit, see there."""
        return Bending(self, assembly, make, solver, progress)

    def motions(self, rest: FloatArray) -> list[tuple[int, str, Motion]]:
        """Return how each set goes to its place over times from 0 to 1, with its platform and field."""
        found = []
        for i, field, hold, nodes in self._holds:
            point = np.array(hold.point)
            move = np.array(self._tables[i].position) + hold.to - point
            lines = [
                Timeline(np.array([0.0, 1.0]), np.stack([np.zeros(3), v]))
                for v in (move, np.array(hold.turn))
            ]
            found.append((i, field, Motion(nodes, (0, 1, 2), rest[nodes], point, *lines)))
        return found


def increments(motions: Sequence[tuple[int, str, Motion]], rest: FloatArray) -> int:
    """Return in how many increments sets go to their places, bodies being undeformed at `rest` [m]."""
    size = float(np.ptp(rest, axis=0).max())
    moves = [np.linalg.norm(m.places(1.0) - m.rest, axis=1).max() / (REACH * size) for _, _, m in motions]
    turns = [np.linalg.norm(m.turn.at(1.0)) / TURN for _, _, m in motions]
    return max(1, math.ceil(max(*moves, *turns)))


class Bending:
    """Brings bodies that platforms join from their undeformed shape to rest: what `System.assembly` is."""

    def __init__(
        self, platforms: Platforms, assembly: Assembly, make: Callable[[Groups], System], solver: Solver,
        progress: Progress | None,
    ) -> None:  # fmt: skip
        """`make`: returns the system of other groups; `progress`: told the share of the way that is done."""
        self._platforms, self._assembly, self._make, self._solver = platforms, assembly, make, solver
        self._progress = progress
        self._found: State | None = None

    def __call__(self, system: System) -> State:
        """Return the state of rest of `system` with its joints at 0. Raises SceneError."""
        if self._found is None:
            self._found = self._bent(system)
        return self._found.copy()

    def _bent(self, system: System) -> State:
        groups, rest = system.groups, system.rest
        own = np.concatenate([groups.rigid[b] for b in groups.places])
        motions = self._platforms.motions(rest)
        others = tuple(nodes for b, nodes in enumerate(groups.rigid) if b not in groups.places)
        held = replace(
            groups, rigid=others, fixed=np.union1d(groups.fixed, own), places={},
            prescribed=Prescribed([m for _, _, m in motions]),
        )  # fmt: skip
        ramp = self._make(held)
        count = groups.commanded
        state, joints = ramp.undeformed(np.zeros(count + 2)), np.zeros(count + 2)
        stepper, parts = self._stepper(ramp), increments(motions, rest)
        for k in range(1, parts + 1):
            joints[-1] = k / parts
            try:
                stepper.step(state, joints, 0.0)
            except StepError as error:
                self._refuse(motions, (k - 1) / parts, error)
            if self._progress:
                self._progress(k / (parts + 1))
        found = self._let_go(system, state)
        for _, field, motion in motions:
            self._check_length(field, motion, system, found)
        return found

    def _stepper(self, system: System) -> Substeps:
        s = self._solver
        return quasi_static_steps(
            Newton(system, s.tolerance, s.max_iterations), s.max_halvings, s.max_turn, ARM
        )

    def _let_go(self, system: System, held: State) -> State:
        """Return the state of rest of `system` near `held`, in which its platforms are held. Raises SceneError."""
        groups = system.groups
        state = system.undeformed(np.zeros(groups.joints))
        state.positions[:] = held.positions
        tolerance = self._solver.tolerance**2
        system.elastic.settle_modes(state.positions, state.modes, tolerance)  # `held` may have fewer
        others = [b for b in range(len(groups.rigid)) if b not in groups.places]
        state.centres[others], state.rotations[others] = held.centres, held.rotations
        try:
            self._stepper(system).step(state, state.joints.copy(), 0.0)
        except StepError as error:
            raise SceneError(
                "platform: no equilibrium was found once the platform is free, with all its sets in place: "
                f"{error}; check hold, point, to and turn, or start from another platform position"
            ) from error
        state.time, state.step = 0.0, 0
        return state

    def _refuse(self, motions: Sequence[tuple[int, str, Motion]], share: float, error: StepError) -> NoReturn:
        """Raise SceneError: the sets cannot go further than `share` of their way."""
        left = [np.linalg.norm(m.places(1.0) - m.places(share), axis=1).max() for _, _, m in motions]
        worst = int(np.argmax(left))
        field = motions[worst][1]
        raise SceneError(
            f"{field}: set {self._name(field)!r} misses its place by {1000.0 * left[worst]:.3g} mm: after "
            f"{100 * share:.0f} % of the way the bodies bend no further; check point, to and turn, or "
            f"start from another platform position ({error})"
        ) from error

    def _check_length(self, field: str, motion: Motion, system: System, state: State) -> None:
        """Raise SceneError where a body has to be stretched to reach a set's place."""
        allowed = self._platforms.stretch(field)
        for body in self._assembly.bodies:
            if not np.isin(motion.nodes, body.nodes).all():
                continue
            before, after = lengths(body, motion.nodes, system, state)
            if after > (1 + allowed) * before:
                raise SceneError(
                    f"{field}: set {self._name(field)!r} misses its place by {1000.0 * (after - before):.3g} mm. "
                    f"Body {body.table.name!r} is {1000.0 * before:.4g} mm long from where it is held to that set "
                    f"and would be stretched to {1000.0 * after:.4g} mm, by {100 * (after / before - 1):.0f} %; "
                    f"{field.partition('.hold')[0]}.stretch allows {100 * allowed:g} %. Move the platform or what "
                    "holds the body, or set a larger stretch"
                )

    def _name(self, field: str) -> str:
        return self._platforms.hold(field).set


def lengths(body: SoftBody, nodes: IndexArray, system: System, state: State) -> tuple[float, float]:
    """Return the mean length of the shortest ways along edges from what else holds a body to `nodes`, undeformed and
    in `state` [m]; zeros where nothing else holds it.
    """
    rest, blocks = system.rest, body.blocks
    held = np.concatenate([np.flatnonzero(system.groups.held().any(axis=1)), *system.groups.rigid])
    start = np.setdiff1d(np.intersect1d(body.nodes, held), nodes)
    if not start.size:
        return 0.0, 0.0
    pairs = np.concatenate(
        [rows[:, [i, j]] for rows in blocks for i, j in combinations(range(rows.shape[1]), 2)]
    )
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    length = np.linalg.norm(rest[pairs[:, 0]] - rest[pairs[:, 1]], axis=1)
    graph = sparse.csr_matrix((length, pairs.T), shape=(len(rest), len(rest)))
    reached, before, _ = dijkstra(
        graph, directed=False, indices=start, return_predecessors=True, min_only=True
    )
    total = 0.0
    for end in nodes.tolist():
        here = end
        while before[here] >= 0:
            total += float(np.linalg.norm(state.positions[here] - state.positions[before[here]]))
            here = before[here]
    return float(reached[nodes].mean()), total / len(nodes)
