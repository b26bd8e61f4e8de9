"""What acts on the bodies of a simulation at the end of a step, as groups of points and vectors, for people to see.

| group | unit | vectors |
|---|---|---|
| normal force, friction | N | on a body that touches another, where it does: `friction on ball by plate` (1) |
| reaction | N | of what holds or moves nodes: the sum over each patch of neighbours, at its middle |
| reaction moment | N m | of that patch, about its middle |
| cable tension | N | of a cable on the points of bodies through which it runs |
| servo torque | N m | along the axis of each servo, at its hub |
| load | N | dead loads, node by node, and commanded forces |
| weight | N | of each soft and rigid body, at its centre of mass |

(1) A group for each pair of bodies, unless more than `MOST_PAIRS` may touch.

All act on the bodies. They are the multipliers, barrier forces and gradients of the step itself; none is estimated from
the motion. Not shown: the pressure in chambers, which acts on the whole surface (see `Simulation.efforts`); impulses of
impacts; forces within bodies, of springs between them and of a strain limit; drag.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.constraints.groups import Groups
from tripod_sim.forces.actuator import ActuatorTerm
from tripod_sim.integrators.stepper import integrator_of
from tripod_sim.mesh.topology import parts as connected_parts
from tripod_sim.state import State
from tripod_sim.steps.parts import Parts
from tripod_sim.system import System

UNITS: Mapping[str, str] = {
    "normal force": "N",
    "friction": "N",
    "reaction": "N",
    "reaction moment": "N m",
    "cable tension": "N",
    "servo torque": "N m",
    "load": "N",
    "weight": "N",
}
"""Of the groups, in their order; see `kind_of`."""

MOST_PAIRS = 30
"""Pairs of bodies that may touch, above which contact forces have one group for all pairs."""

LONGEST_NAME = 30
"""Longest name of a body in the name of a group [characters]."""

ON = " on "
"""In the name of a group, between its kind and the bodies."""


def kind_of(group: str) -> str:
    """Return the key of `UNITS` of a group: `normal force` of `normal force on ball by plate`."""
    return group.partition(ON)[0]


CONTACT = ("normal force", "friction")
"""Kinds of groups that name two bodies."""

Vectors = tuple[FloatArray, FloatArray]
"""Points [m] and vectors, both of shape (k, 3)."""


class Forces(NamedTuple):
    """A group of forces or moments on the bodies.

    Attributes:
        name: A key of `UNITS`, of contact forces with the bodies: `normal force on ball by plate`.
        points: Where they act [m], shape (k, 3).
        vectors: In the group's unit, shape (k, 3).
    """

    name: str
    points: FloatArray
    vectors: FloatArray


class ActingForces:
    """Finds the forces of a simulation.

    Attributes:
        groups: Names of those that it has, in the order of `UNITS`.
    """

    def __init__(self, parts: Parts, *, contact: bool) -> None:
        """`contact`: whether its bodies touch something."""
        self._parts, self._system, self._contact = parts, parts.system, contact
        system, groups = parts.system, parts.system.groups
        self._held, self._terms = groups.held(), [t for t in system.terms if t.exerts]
        blocks = [block for body in parts.assembly.bodies for block in body.blocks] if parts.assembly else []
        self._patches, self._weights = _patches(groups, blocks), _weights(system, blocks)
        there = {term.exerts for term in self._terms}
        self._pairs = self._named_pairs()
        if contact or parts.ball:
            there |= {"normal force", "friction"}
        if self._patches:
            there |= {"reaction", "reaction moment"}
        if groups.driven:
            there.add("servo torque")
        if self._weights or (parts.rigid and parts.rigid.gravity.any()):
            there.add("weight")
        self.groups = tuple(
            f"{kind}{pair}"
            for kind in UNITS
            if kind in there
            for pair in (dict.fromkeys(self._pairs.values()) if self._pairs and kind in CONTACT else ("",))
        )

    def at(self, state: State, gradient: FloatArray, efforts: FloatArray) -> tuple[Forces, ...]:
        """Return the forces of `groups`, in that order.

        Args:
            state: At the end of a step.
            gradient: What holds the nodes then [N], see `Simulation.reactions`, shape (n, 3).
            efforts: Of the actuators then.
        """
        found: dict[str, list[Vectors]] = {name: [] for name in self.groups}
        for kind, pair, one in self._contacts(state):
            found[f"{kind}{pair}"].append(one)
        if self._patches:
            found["reaction"], found["reaction moment"] = self._reactions(state.positions, gradient)
        actuator = len(self._system.groups.driven)
        for term in self._terms:
            command = effort = 0.0
            if isinstance(term, ActuatorTerm):
                command, effort = float(state.joints[actuator]), float(efforts[actuator])
                actuator += 1
            found[term.exerts].append(term.exerted(state.positions, command, effort))
        if "servo torque" in found:
            found["servo torque"].append(self._torques(state, efforts))
        if "weight" in found:
            found["weight"] += self._weight(state)
        none = np.zeros((0, 3))
        return tuple(
            Forces(name, *(np.concatenate([none, *(one[k] for one in vectors)]) for k in (0, 1)))
            for name, vectors in found.items()
        )

    def _named_pairs(self) -> dict[tuple[int, int], str]:
        """Return how a group names two surfaces that may touch: on which it acts, by which; empty: not at all."""
        if not self._contact:
            return {(0, 1): f"{ON}ball by plate", (1, 0): f"{ON}plate by ball"} if self._parts.ball else {}
        world = integrator_of(self._parts.stepper).world
        moving, parts = world.soft + self._system.groups.free, world.parts
        names = [part.name.replace("/", " ")[:LONGEST_NAME] for part in parts]
        found = {
            (i, j): f"{ON}{names[i]} by {names[j] if i != j else 'itself'}"
            for i in range(moving)
            for j in range(len(parts))
            if (parts[i].self_contact if i == j else parts[i].rigid or not parts[j].kinematic)
        }
        return found if len(set(found.values())) <= MOST_PAIRS else {}

    def _contacts(self, state: State) -> Iterator[tuple[str, str, Vectors]]:
        """Generate normal forces and friction: kind, how the group names the pair of bodies, vectors."""
        if self._contact:
            from tripod_sim.contact.shown_forces import contact_forces  # noqa: PLC0415 - only with contact

            world = integrator_of(self._parts.stepper).world
            points, normals, friction, sides = contact_forces(world, world.soft + self._system.groups.free)
            pairs = np.array([self._pairs.get((i, j), "") for i, j in sides.tolist()], dtype=object)
            for pair in dict.fromkeys(pairs.tolist()):
                own = pairs == pair
                yield "normal force", pair, (points[own], normals[own])
                yield "friction", pair, _acting(points[own], friction[own])
        elif (ball := self._parts.ball) and state.ball:
            forces, point = ball.contact_forces(state.ball)
            for kind, force in zip(CONTACT, forces, strict=True):
                for pair, sign in zip(self._pairs.values(), (1.0, -1.0), strict=True):
                    yield kind, pair, _acting(point[None], sign * force[None])

    def _reactions(self, x: FloatArray, gradient: FloatArray) -> tuple[list[Vectors], list[Vectors]]:
        """Return of each patch the force of what holds it, at its middle, and the moment about that."""
        forces, moments = [], []
        for nodes in self._patches:
            force, middle = gradient[nodes] * self._held[nodes], x[nodes].mean(axis=0)
            forces.append((middle[None], force.sum(axis=0)[None]))
            if len(nodes) > 1:
                moments.append((middle[None], np.cross(x[nodes] - middle, force).sum(axis=0)[None]))
        return forces, moments

    def _torques(self, state: State, efforts: FloatArray) -> Vectors:
        """Return hubs and torques of servos."""
        frames, slide = self._system.groups.driven, state.joints[self._system.actuators]
        hubs = np.array([frame.point + slide * frame.inward for frame in frames])
        return hubs, efforts[: len(frames), None] * np.array([frame.axis for frame in frames])

    def _weight(self, state: State) -> list[Vectors]:
        """Return the weight of each body at the centre of mass."""
        found = [
            ((shares @ state.positions[nodes])[None], weight[None]) for nodes, shares, weight in self._weights
        ]
        if rigid := self._parts.rigid:
            found.append((state.rigid.centres.copy(), rigid.mass[:, None] * rigid.gravity))
        if (ball := self._parts.ball) and state.ball:
            found.append((state.ball.position[None].copy(), ball.weight[None]))
        return found


def _acting(points: FloatArray, vectors: FloatArray) -> Vectors:
    """Return those that are not zero."""
    acts = vectors.any(axis=1)
    return points[acts], vectors[acts]


def _patches(groups: Groups, blocks: Sequence[IndexArray]) -> tuple[IndexArray, ...]:
    """Return the nodes that something holds, those together that neighbour each other and are held alike.

    The nodes of each servo arm are one patch. `blocks`: nodes of elements and springs, each of shape (m, k).
    """
    size = groups.size
    alike = groups.still() @ np.array([1, 2, 4])
    if groups.prescribed:
        alike[groups.prescribed.nodes] += 8
    first, second = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for block in blocks:
        rows = block[(alike[block] > 0).sum(axis=1) > 1]
        for a in range(rows.shape[1]):
            for b in range(a):
                near = (alike[rows[:, a]] == alike[rows[:, b]]) & (alike[rows[:, a]] > 0)
                first.append(rows[near, a])
                second.append(rows[near, b])
    one, other = np.concatenate(first), np.concatenate(second)
    graph = sparse.coo_matrix((np.ones(len(one)), (one, other)), (size, size))
    _, label = connected_components(graph, directed=False)
    held = np.flatnonzero(alike)
    patches = [held[label[held] == own] for own in np.unique(label[held])]
    return (*patches, *(frame.nodes for frame in groups.driven))


def _weights(system: System, blocks: Sequence[IndexArray]) -> list[tuple[IndexArray, FloatArray, FloatArray]]:
    """Return of each soft body, with what is rigid on it, its nodes, their shares of its mass, and its weight [N]."""
    known = [term.node_weights for term in system.terms]
    total = sum((weights for weights in known if weights is not None), np.zeros_like(system.rest))
    sizes = np.linalg.norm(total, axis=1)
    if not sizes.any():
        return []
    rows = [*blocks, *(nodes[None] for nodes in system.groups.rigid)]
    label = connected_parts(rows, len(sizes))
    bodies = [np.flatnonzero(label == own) for own in np.unique(label[sizes > 0.0])]
    return [(nodes, sizes[nodes] / sizes[nodes].sum(), total[nodes].sum(axis=0)) for nodes in bodies]
