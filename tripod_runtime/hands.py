"""Hands on the bodies: springs from a mouse to points of a body, and loads that stay. Pure but for a lock.

A hand of stiffness k at a pulls the mean x_p = sum_i w_i x_i of nodes near a vertex; its force is spread by w. It is
constant in a step and found from the state before. In motion, with C = h² sum_i w_i² / m_i, by how much a force of 1 N
moves x_p within a step of h without what else holds it,

    f = k (a - x_p - d) / (1 + k C),    d: the way of x_p in the last step,    a = x_p at first,

which is the spring at the end of a step of free nodes: neither k nor h makes it unstable. In statics f goes to
k (a - x_p) by steps that are as long as the last one was answered softly (a secant).
"""

import threading
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.errors import SceneError, shown
from tripod_sim.simulation import Simulation

PATIENCE = 1.0
"""A hand that says nothing for so long has let go [s]."""

REACH = 0.04
"""Radius about a vertex in which nodes are pulled, as a share of the size of all bodies."""

PULL = 20.0
"""Stiffness of a hand that is told none: it pulls with as many times the weight of all bodies over their size."""

GRAVITY = 9.81
STIFFEST = 1e6
"""Of a hand [N/m]."""

FURTHEST = 3.0
"""How far a hand pulls, as a multiple of the size of all bodies."""

MOST = 16
"""Of hands, and of loads."""

LARGEST = 1e6
"""Component of a place [m], or of a load [N]."""

SOFT_START = 50.0
"""Softness that a hand expects in statics at first, times its stiffness."""


@dataclass(eq=False)
class _Grip:
    """Nodes of `Simulation.mesh` with the weights of their mean, and how far 1 N moves that within a step [m/N]."""

    nodes: IndexArray
    weights: FloatArray
    softness: float


@dataclass(eq=False)
class _Hand:
    grip: _Grip
    vertex: int
    stiffness: float
    hold: FloatArray
    target: FloatArray
    until: float
    force: FloatArray = field(default_factory=lambda: np.zeros(3))
    before: FloatArray = field(default_factory=lambda: np.zeros(3))
    seen: FloatArray | None = None
    off: FloatArray | None = None


class Hands:
    """The hands on one simulation. `forces` is called by the thread of the physics, all else by others."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation, self._lock = simulation, threading.Lock()
        self._hands: dict[int, _Hand] = {}
        self._loads: dict[int, tuple[_Grip, FloatArray]] = {}

    @cached_property
    def stiffness(self) -> float:
        """How stiff a hand is that is told nothing [N/m], with two digits."""
        mass = self._simulation.total_mass
        return float(f"{PULL * GRAVITY * mass / self._size:.2g}") if mass > 0.0 else 50.0

    @cached_property
    def _size(self) -> float:
        return float(np.linalg.norm(np.ptp(self._simulation.mesh.nodes, axis=0))) or 1.0

    @property
    def _moves(self) -> bool:
        return self._simulation.scene.inertia is not None

    @property
    def _dt(self) -> float:
        return self._simulation.scene.dt

    def pull(
        self,
        who: int,
        vertex: int,
        hold: FloatArray,
        target: FloatArray,
        now: float,
        stiffness: float | None = None,
    ) -> None:
        """Pull at a vertex of the skin: `who` does, at `now` [s], and has to repeat it.

        A hand takes hold at `hold` [m], in world at that moment, and wants that place at `target` [m].

        Raises SceneError: what is no vertex, place or stiffness, or more than `MOST` hands.
        """
        k = self.stiffness if stiffness is None else stiffness
        if not 0.0 < k <= STIFFEST:
            raise SceneError(f"a pull has a stiffness of {k:g} N/m; it must be above 0, at most {STIFFEST:g}")
        start, place = _three("where a pull takes hold", hold), _three("the target of a pull", target)
        with self._lock:
            hand = self._hands.get(who)
            if hand is None or hand.vertex != vertex or (hand.hold != start).any():
                if hand is None and len(self._hands) >= MOST:
                    raise SceneError(f"{MOST} hands pull already; let one go")
                hand = self._hands[who] = _Hand(self._grip(vertex), vertex, k, start, place, now)
            hand.target, hand.until, hand.stiffness = place, now + PATIENCE, k

    def let_go(self, who: int) -> None:
        """Let go what `who` pulls, if anything."""
        with self._lock:
            self._hands.pop(who, None)

    def load(self, vertex: int, force: FloatArray) -> None:
        """Let a force [N] act at a vertex of the skin from now on; zero ends it.

        Raises SceneError: what is no vertex or force, or more than `MOST` loads.
        """
        value = _three("a load", force)
        with self._lock:
            if not value.any():
                self._loads.pop(vertex, None)
                return
            if vertex not in self._loads and len(self._loads) >= MOST:
                raise SceneError(f"{MOST} loads act already; remove one")
            self._loads[vertex] = (self._grip(vertex), value)

    def unload(self) -> None:
        """End all loads."""
        with self._lock:
            self._loads.clear()

    def clear(self) -> None:
        """End all pulls and loads."""
        with self._lock:
            self._hands.clear()
            self._loads.clear()

    def forces(self, now: float) -> dict[int, FloatArray]:
        """Return what acts in the next step by node [N]; hands that have said nothing for long let go."""
        if not (self._hands or self._loads):  # the rule
            return {}
        found: dict[int, FloatArray] = {}
        with self._lock:
            for who in [who for who, hand in self._hands.items() if hand.until < now]:
                del self._hands[who]
            for hand in self._hands.values():
                _spread(hand.grip, self._pulled(hand), found)
            for grip, force in self._loads.values():
                _spread(grip, force, found)
        return found

    def words(self) -> str:
        """Return what hands do, for people; empty: nothing."""
        with self._lock:
            pulls = [(hand.stiffness, float(np.linalg.norm(hand.force))) for hand in self._hands.values()]
            loads = [float(np.linalg.norm(force)) for _, force in self._loads.values()]
        told = [f"pull of {force:.3g} N by a spring of {k:.3g} N/m" for k, force in pulls]
        if loads:
            told.append("load of " + ", ".join(f"{load:.3g} N" for load in loads))
        return "; ".join(told)

    def _grip(self, vertex: int) -> _Grip:
        """Return the nodes near a vertex of the skin. Raises SceneError: there is none of that number."""
        simulation = self._simulation
        owners = simulation.owners
        if not 0 <= vertex < len(owners):
            raise SceneError(f"there is no vertex {vertex}; allowed: 0 to {len(owners) - 1}")
        node, rigid = int(owners[vertex]), simulation.rigid_softness(int(owners[vertex]))
        if rigid is not None:
            return _Grip(np.array([node]), np.ones(1), self._dt**2 * rigid)
        ends = np.cumsum(simulation.bodies)
        body = int(np.searchsorted(ends, vertex, side="right"))
        own = np.unique(owners[ends[body] - simulation.bodies[body] : ends[body]])
        far = np.linalg.norm(simulation.mesh.nodes[own] - simulation.mesh.nodes[node], axis=1)
        weights = np.clip(1.0 - (far / (REACH * self._size)) ** 2, 0.0, None)
        mass = simulation.masses[own]
        if self._moves and mass[own == node] > 0.0:
            weights[mass <= 0.0] = 0.0
        near = weights > 0.0
        nodes, weights, mass = own[near], weights[near] / weights[near].sum(), mass[near]
        with np.errstate(divide="ignore"):
            softness = self._dt**2 * float((weights**2 / mass).sum())
        return _Grip(nodes, weights, softness)

    def _pulled(self, hand: _Hand) -> FloatArray:
        """Return the force of a hand in the next step [N]."""
        grip, k = hand.grip, hand.stiffness
        x = grip.weights @ self._simulation.positions[grip.nodes]
        if hand.off is None:
            hand.off = hand.hold - x
        way = hand.target - hand.off - x
        far = float(np.linalg.norm(way)) / (FURTHEST * self._size)
        way /= max(1.0, far)
        if self._moves:
            step = x - hand.seen if hand.seen is not None else 0.0 * x
            hand.seen = x
            hand.force = k * (way - step) / (1.0 + k * grip.softness)
            return hand.force
        changed = float(np.linalg.norm(hand.force - hand.before))
        if hand.seen is None:
            grip.softness = SOFT_START / k
        elif changed > 0.0:
            grip.softness = max(float(np.linalg.norm(x - hand.seen)) / changed, 0.5 * grip.softness)
        hand.seen, hand.before = x, hand.force
        hand.force = hand.force + (k * way - hand.force) / (1.0 + k * grip.softness)
        return hand.force


def _spread(grip: _Grip, force: FloatArray, out: dict[int, FloatArray]) -> None:
    """Add a force to those of the nodes of a grip."""
    for node, weight in zip(grip.nodes.tolist(), grip.weights, strict=True):
        out[node] = out.get(node, 0.0) + weight * force


def _three(name: str, values: FloatArray) -> FloatArray:
    """Return three finite numbers as an array. Raises SceneError."""
    try:
        found = np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        found = np.zeros(0)
    if found.shape != (3,) or not (np.abs(found) < LARGEST).all():
        raise SceneError(f"{name} is {shown(values)}; it must be three finite numbers")
    return found
