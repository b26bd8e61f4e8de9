"""Contacts at rest, in the unknowns of the static body, its driven angles and the moves of rigid bodies on it.

A vertex of a contact moves by dx = J dz with z of its own: a free node is three unknowns, a node of a rigid group or a
vertex of a rigid body turns with six, dx = dc + dtheta x r, a driven node turns about its servo's axis, dx = a x r dq.
"""

from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import BoolArray, FloatArray, IndexArray
from tripod_sim.constraints.groups import Kind
from tripod_sim.response import Holding
from tripod_sim.system import System

CROSS = np.array([[np.cross(np.eye(3)[j], np.eye(3)[k]) for j in range(3)] for k in range(3)])
"""CROSS[k, j] = e_j x e_k: with it a turn about axis j moves what is at r by sum_k r_k CROSS[k, j]."""

CARRIED = -1
"""Kind of a vertex that is no node of the solid, or does not move."""

REPEATED = 1e-12
"""Square of how much of a row may be new, over the largest, for it to be a sum of the others."""


@dataclass(frozen=True, eq=False)
class Points:
    """The vertices of contacts, four of each.

    Attributes:
        nodes: Of the solid, shape (m, 4).
        bodies: Rigid body of each, -1 for a node of the solid, shape (m, 4).
        arms: From the centre of that body [m], shape (m, 4, 3).
        count: Whether it moves at all, shape (m, 4).
    """

    nodes: IndexArray
    bodies: IndexArray
    arms: FloatArray
    count: BoolArray

    def of(self, which: IndexArray | BoolArray) -> "Points":
        """Return those of some contacts."""
        return Points(self.nodes[which], self.bodies[which], self.arms[which], self.count[which])


@dataclass(frozen=True, eq=False)
class Carried:
    """Rigid bodies that lie on the solid, for b of them.

    Attributes:
        turning: Stiffness against turns under forces that do not turn along [N m], shape (b, 3, 3).
        unbalanced: dPhi/dy, what is missing to balance with its sign turned [N, N m], shape (b, 6).
        spans: Size of each [m], shape (b,).
    """

    turning: FloatArray
    unbalanced: FloatArray
    spans: FloatArray


@dataclass(frozen=True, eq=False)
class Rest:
    """Contacts of a solid at one state.

    Attributes:
        force: On the nodes [N], shape (n, 3).
        points: Of each contact, c of them.
        stiffness: Of its pressure, which turns, between the moves of the four points [N/m], shape (c, 12, 12).
        of: Contact of each row, shape (m,).
        vectors: How a row counts the moves of these points, shape (m, 4, 3); zero for those that do not count.
        touched: As the arms of `points`, but to where the row has hold of a body [m], shape (m, 4, 3).
        give: 1 / stiffness of each row [m/N], 0 for multipliers, shape (m,).
        carried: Rigid bodies among them.
    """

    force: FloatArray
    points: Points
    stiffness: FloatArray
    of: IndexArray
    vectors: FloatArray
    touched: FloatArray
    give: FloatArray
    carried: Carried

    def holding(self, system: System) -> Holding:
        """Return what the contacts are to `compliance`, the levers of `system` being those of the state.

        Rows of multipliers are turned into as many orthogonal ones as are independent: a disc on many points is held in
        six directions at most.
        """
        unknowns, spans = self._unknowns(system), self.carried.spans
        first = len(unknowns) + system.reduction.driven
        size = first + 6 * len(spans)
        columns, moves = _moves(self.points, self.points.arms, system, unknowns, size)
        stiffness = self._turned(columns, moves, size)
        of_rows = columns[self.of], moves[self.of]
        rows = self.rows(system, unknowns) if len(spans) else self._rows(*of_rows, size)
        firm, springs = rows[self.give == 0.0], rows[self.give != 0.0]
        stiffness += (springs.T / self.give[self.give != 0.0]) @ springs
        for b, block in enumerate(self.carried.turning):
            own = slice(first + 6 * b + 3, first + 6 * b + 6)
            stiffness[own, own] += block
        scale = np.repeat(np.stack([np.ones_like(spans), spans], axis=1), 3, axis=1).ravel()
        stiffness = 0.5 * (stiffness + stiffness.T)
        return Holding(unknowns, stiffness, _independent(firm), self.carried.unbalanced.ravel(), scale)

    def rows(self, system: System, unknowns: IndexArray) -> FloatArray:
        """Return the gradient of each row, shape (m, u + s + 6 b), in `unknowns`, angles and rigid bodies."""
        size = len(unknowns) + system.reduction.driven + 6 * len(self.carried.spans)
        return self._rows(*_moves(self.points.of(self.of), self.touched, system, unknowns, size), size)

    def _rows(self, columns: IndexArray, moves: FloatArray, size: int) -> FloatArray:
        m = len(self.of)
        parts = (self.vectors[:, :, None] @ moves)[:, :, 0]
        flat = np.arange(0, m * (size + 1), size + 1)[:, None, None] + columns
        found = np.bincount(flat.ravel(), parts.ravel(), minlength=m * (size + 1))
        return np.asarray(found.reshape(m, size + 1)[:, :size], dtype=np.float64)

    def _turned(self, columns: IndexArray, moves: FloatArray, size: int) -> FloatArray:
        """Return the stiffness of pressures that turn, shape (size, size)."""
        c = len(columns)
        # between point k, direction a, and point l, direction b: first b becomes a column, then a
        blocks = self.stiffness.reshape(c, 4, 3, 4, 3).transpose(0, 3, 1, 2, 4).reshape(c, 4, 12, 3) @ moves
        blocks = blocks.reshape(c, 4, 4, 3, 6).transpose(0, 2, 3, 1, 4).reshape(c, 4, 3, 24)
        blocks = moves.transpose(0, 1, 3, 2) @ blocks
        at = columns.reshape(c, 24)
        flat = (at[:, :, None] * (size + 1) + at[:, None]).ravel()
        found = np.bincount(flat, blocks.ravel(), minlength=(size + 1) ** 2)
        return np.asarray(found.reshape(size + 1, size + 1)[:size, :size], dtype=np.float64)

    def _unknowns(self, system: System) -> IndexArray:
        """Return the unknowns of the solid that move any point, ascending, shape (u,)."""
        r, solid = system.reduction, self.points.count & (self.points.bodies < 0)
        first = np.unique(r.base[self.points.nodes[solid]])
        first = first[first >= 0]
        nodes, groups = first[first < 3 * r.free_count], first[first >= 3 * r.free_count]
        return np.concatenate(
            [(nodes[:, None] + np.arange(3)).ravel(), (groups[:, None] + np.arange(6)).ravel()]
        )


def _moves(
    points: Points, arms: FloatArray, system: System, unknowns: IndexArray, nothing: int
) -> tuple[IndexArray, FloatArray]:
    """Return the columns that move each point, shape (c, 4, 6), `nothing` for none, and J, shape (c, 4, 3, 6).

    `arms`: of vertices of rigid bodies from the centre [m], shape (c, 4, 3).
    """
    r, nodes = system.reduction, points.nodes
    solid, carried = points.count & (points.bodies < 0), points.count & (points.bodies >= 0)
    kind = np.where(solid, r.kind[nodes], CARRIED)
    free, grouped, driven = kind == Kind.FREE, kind == Kind.RIGID, kind == Kind.DRIVEN
    columns, moves = np.full((*nodes.shape, 6), nothing), np.zeros((*nodes.shape, 3, 6))
    place = np.searchsorted(unknowns, r.base[nodes[free]])
    yields = ~system.groups.held()[nodes[free]]
    columns[free, :3], moves[free, :, :3] = place[:, None] + np.arange(3), np.eye(3) * yields[:, None]
    for turning, first, levers in (
        (grouped, np.searchsorted(unknowns, r.base[nodes[grouped]]), system.lever[nodes[grouped]]),
        (carried, len(unknowns) + r.driven + 6 * points.bodies[carried], arms[carried]),
    ):
        if len(first):
            columns[turning], moves[turning, :, :3] = first[:, None] + np.arange(6), np.eye(3)
            moves[turning, :, 3:] = (levers @ CROSS.reshape(3, 9)).reshape(-1, 3, 3).transpose(0, 2, 1)
    if driven.any():
        number = r.number[nodes[driven]]
        columns[driven, 0] = len(unknowns) + number
        moves[driven, :, 0] = np.cross(system.axes[number], system.lever[nodes[driven]])
    return columns, moves


def _independent(rows: FloatArray) -> FloatArray:
    """Return as many orthogonal rows of length 1 as `rows` has independent ones, with the same span."""
    m, n = rows.shape
    shares, turned = np.linalg.eigh(rows @ rows.T if m <= n else rows.T @ rows)
    new = shares > REPEATED * shares.max(initial=0.0)
    if m <= n:
        return np.asarray((turned[:, new] / np.sqrt(shares[new])).T @ rows)
    return np.asarray(turned[:, new].T)
