"""Rigid bodies that lie on a solid: which contacts they have, and whether these keep them where they are."""

from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import BoolArray, FloatArray, IndexArray
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.rest_rows import Carried
from tripod_sim.response import Holding

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.contact.rigid_set import RigidSet

HELD = 1e-6
"""Stiffness against a move, as a share of the largest, from which on a body is kept from it."""

NOTHING = 1e-9
"""Size of what a turn does, as a share, below which it does nothing."""

TINY = 1e-9
"""Size of a body that nothing touches any more [m]."""

TAKES_PART = 0.1
"""Share of a move that is not kept from, over the largest, from which on it is that body's."""


class Touching:
    """The contacts of a world that press, as far as they are between the solid and what it carries.

    Attributes:
        contacts: Their numbers, shape (c,).
        soft: Which of their vertices are the solid's, shape (c, 4).
        bodies: Rigid body of each vertex, -1 for none, shape (c, 4).
        arms: From its centre [m], zero for others, shape (c, 4, 3).
        radius: Of the ball about a vertex of a rigid body [m], zero for others, shape (c, 4).
    """

    def __init__(self, world: ContactSolver, count: int, rigid: "RigidSet | None") -> None:
        """`count`: vertices of the solid, the first ones of `world`; `rigid`: its rigid bodies."""
        c, of = world.contacts.arrays, slice(0, world.contacts.count)
        self.contacts = np.flatnonzero(c.pressure[of] > 0.0)
        vertex, counts = c.vertex[self.contacts], c.weight[self.contacts] != 0.0
        self.soft = (vertex < count) & counts
        self._weights = rigid.mass[:, None] * rigid.gravity if rigid else np.zeros((0, 3))
        part = world.surfaces.body[vertex] - world.soft
        self.bodies = np.where(counts & (part >= 0) & (part < len(self._weights)), part, -1)
        self.arms, self.radius = np.zeros((*vertex.shape, 3)), np.zeros(vertex.shape)
        if world.rigid:
            on = self.bodies >= 0
            self.arms[on] = world.positions[vertex[on]] - world.rigid.centre[self.bodies[on]]
            self.radius[on] = world.surfaces.radius[vertex[on]]

    def linked(self) -> BoolArray:
        """Return which rigid bodies touch the solid, or others that do, shape (b,)."""
        found, before = np.zeros(len(self._weights) + 1, dtype=bool), -1
        while found.sum() > before:
            before = int(found.sum())
            near = self.soft.any(axis=1) | found[self.bodies].any(axis=1)
            found[self.bodies[near]] = True
            found[-1] = False
        return found[:-1]

    def among(self, carried: BoolArray) -> BoolArray:
        """Return which contacts are among the solid, the bodies `carried` and what is fixed, shape (c,)."""
        on = self.bodies >= 0
        others = on & ~np.append(carried, True)[self.bodies]
        return np.asarray((self.soft | on).any(axis=1) & ~others.any(axis=1))

    def carried(
        self,
        bodies: IndexArray,
        carried: BoolArray,
        arms: FloatArray,
        levers: FloatArray,
        forces: FloatArray,
    ) -> Carried:
        """Return what contacts with `forces` make of the bodies `carried`, b of them.

        With F at r from the centre, the potential -F . (c + R r) has the second derivative
        (F . r) I - (F rᵀ + r Fᵀ) / 2 in a turn.

        Args:
            bodies: Of each vertex among the carried ones, -1 for none, shape (k, 4).
            carried: Which of all bodies, shape (all,).
            arms: From the centre to the vertex [m], shape (k, 4, 3).
            levers: From the centre to where the force acts [m], shape (k, 4, 3).
            forces: On the vertices [N], shape (k, 4, 3).
        """
        which = np.flatnonzero(carried)
        turning, unbalanced, spans = (
            np.zeros((len(which), 3, 3)),
            np.zeros((len(which), 6)),
            np.zeros(len(which)),
        )
        for b, body in enumerate(which):
            own = bodies == b
            f, r = forces[own], levers[own]
            product = f.T @ arms[own]
            turning[b] = np.trace(product) * np.eye(3) - 0.5 * (product + product.T)
            unbalanced[b, :3] = -f.sum(axis=0) - self._weights[body]
            unbalanced[b, 3:] = -np.cross(r, f).sum(axis=0)
            spans[b] = np.linalg.norm(r, axis=1).max(initial=TINY)
        return Carried(turning, unbalanced, spans)


def loose(held: Holding) -> BoolArray:
    """Return which rigid bodies could move where the solid stands still, shape (b,).

    Their energy must rise with every move that no multiplier forbids; but a ball that nothing keeps from turning about
    its centre may do that.
    """
    size = len(held.scale)
    scaled, first = 1.0 / held.scale, len(held.stiffness) - size
    K = held.stiffness[first:, first:] * np.outer(scaled, scaled)
    C = held.rows[:, first:] * scaled
    stiffest, widest = np.abs(K).max(initial=0.0), np.abs(C).max(initial=0.0)
    does = (np.abs(K) > NOTHING * stiffest).any(axis=0) | (np.abs(C) > NOTHING * widest).any(axis=0)
    moved = np.ones((size // 6, 6), dtype=bool)
    moved[:, 3:] = does.reshape(-1, 6)[:, 3:].any(axis=1)[:, None]
    felt = moved.ravel()
    _, sizes, moves = np.linalg.svd(C[:, felt])
    free = moves[int((sizes > HELD * widest).sum()) :].T
    values, shapes = np.linalg.eigh(free.T @ K[np.ix_(felt, felt)] @ free)
    lost = np.zeros((size, int((values <= HELD * stiffest).sum())))
    lost[felt] = free @ shapes[:, : lost.shape[1]]
    part = np.abs(lost).reshape(size // 6, -1).max(axis=1, initial=0.0)
    return np.asarray(part > TAKES_PART * part.max(initial=0.0))
