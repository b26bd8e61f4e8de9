"""What a spring body is to whoever steps it, looks at it or adds to it: energies, weight, pattern of the Hessian."""

from typing import Any

import numpy as np
from scipy import sparse

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.constraints.groups import Groups
from tripod_sim.springs.body import SpringBody
from tripod_sim.springs.spring_kernels import elastic_energy, has_dampers, lengths, links_of
from tripod_sim.state import State


class SpringSystem:
    """Springs, weight and fixed nodes.

    The potential is E(x) - F . (x - X), gradient dE/dx - F; unknowns are the positions of free nodes, three each, in
    the order of `body.free`.

    Attributes:
        body: Nodes, springs, masses.
        links: The springs as kernels take them, damped by what the body says and by b times their stiffness.
        force: F, constant force on each node [N], shape (n, 3).
        mass: Of nodes [kg], zero of fixed ones, shape (n,).
        number: Place of a node in `body.free`, -1 if fixed, shape (n,).
        unknowns: Three for each free node.
        groups: The fixed nodes as node groups.
        torques: Of servos: there are none, shape (0,).
        rest: As `body.nodes`.
        remembers: How many numbers a stage remembers of dampers; 0 where no spring has one.
        terms: None, as of a `System`.
    """

    def __init__(
        self, body: SpringBody, acceleration: tuple[float, float, float] | None, damping: float = 0.0
    ) -> None:
        """`acceleration`: of gravity [m/s²], None for none; `damping`: b of stiffness damping [s]."""
        self.body = body
        self.links = links_of(body.ends, body.rest_length, body.stiffness, body.damping, body.slack, damping)
        self.remembers, self.terms = len(body.ends) if has_dampers(self.links) else 0, ()
        self.rest, self.force = body.nodes, np.zeros_like(body.nodes)
        if acceleration is not None:
            self.force += body.mass[:, None] * np.array(acceleration)
        self.mass = np.zeros(len(body.nodes))
        self.mass[body.free] = body.mass[body.free]
        self.number = np.full(len(body.nodes), -1, dtype=np.int64)
        self.number[body.free] = np.arange(len(body.free))
        self.unknowns = 3 * len(body.free)
        self.groups = Groups(len(body.nodes), fixed=np.unique(body.fixed))
        self.torques = np.zeros(0)

    def start_state(self, joints: FloatArray) -> State:
        """Return the undeformed state, at rest."""
        return State.of_nodes(self.body.nodes, joints)

    def potentials(self, state: State) -> tuple[float, float]:
        """Return the energy of the springs and the potential of the weight [J]."""
        weight = -float(np.vdot(self.force, state.positions - self.body.nodes))
        return float(elastic_energy(state.positions, self.links)), weight

    def remember(self, state: State, out: FloatArray) -> None:
        """Write the lengths of dampers at `state` [m] to `out`, shape (remembers,)."""
        if self.remembers:
            lengths(state.positions, self.links, out)

    def aim(self, s: float, known: FloatArray) -> None:
        """Nothing is to be prepared: kernels take what is `known` themselves."""

    def pattern(self, pairs: IndexArray | None = None) -> tuple[Any, IndexArray, IndexArray]:
        """Return where the Hessian of free nodes has entries: the upper triangle, CSC, and places in its data.

        `pairs`, shape (k, 2), are nodes that have entries with each other besides those that springs join.
        The second and third are where column c of a free node's diagonal block begins, shape (free, 3), and of each
        spring's off-diagonal block, shape (m, 3), -1 where an end is fixed.
        """
        count, n = len(self.body.free), self.unknowns
        joined = self.body.ends if pairs is None else np.concatenate([self.body.ends, pairs])
        a, b = np.sort(self.number[joined], axis=1).T
        there = a >= 0
        own = np.arange(count)
        block = np.unique(np.concatenate([own * (count + 1), b[there] * count + a[there]]))
        a, b, there = (values[: len(self.body.ends)] for values in (a, b, there))
        column, row = block // count, block % count
        c, r = np.arange(3)[None, :, None], np.arange(3)[None, None, :]
        rows = np.broadcast_to(3 * row[:, None, None] + r, (len(block), 3, 3))
        columns = np.broadcast_to(3 * column[:, None, None] + c, (len(block), 3, 3))
        keys = np.sort((columns * n + rows)[rows <= columns])
        indptr = np.searchsorted(keys, np.arange(n + 1) * n)
        matrix = sparse.csc_matrix((np.ones(len(keys)), keys % n, indptr), shape=(n, n))

        def begin(i: IndexArray, j: IndexArray) -> IndexArray:
            return np.searchsorted(keys, (3 * j[:, None] + np.arange(3)) * n + 3 * i[:, None])

        off = np.full((len(self.body.ends), 3), -1, dtype=np.int64)
        off[there] = begin(a[there], b[there])
        return matrix, begin(own, own), off
