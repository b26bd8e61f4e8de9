"""Sets of nodes that move along a timeline, whatever acts on them: a node X stands at c + R(turn) (X - c) + move."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_host.rotations import rotation_matrix
from tripod_sim.tables.timeline import Timeline


@dataclass(frozen=True, eq=False)
class Motion:
    """One set in motion.

    Attributes:
        nodes: Of the set, shape (k,).
        axes: Along which it is moved, of 0, 1, 2.
        rest: Undeformed places [m], shape (k, 3).
        centre: c [m], shape (3,).
        move: Displacement over time [m].
        turn: Rotation vector over time [rad].
    """

    nodes: IndexArray
    axes: tuple[int, ...]
    rest: FloatArray
    centre: FloatArray
    move: Timeline
    turn: Timeline

    def places(self, time: float) -> FloatArray:
        """Return where the nodes stand at `time` [s], shape (k, 3) [m]."""
        return (self.rest - self.centre) @ rotation_matrix(self.turn.at(time)).T + (
            self.centre + self.move.at(time)
        )


class Prescribed:
    """All sets in motion.

    Attributes:
        motions: Of each of them.
        nodes: Of all of them, shape (k,).
        end: Time after which nothing moves any more [s].
    """

    def __init__(self, motions: Sequence[Motion]) -> None:
        self.motions = tuple(motions)
        self._places = [(m, np.ix_(m.nodes, np.array(m.axes))) for m in motions]
        self.nodes = np.unique(np.concatenate([m.nodes for m in motions]))
        self.end = max(float(t.times[-1]) for m in motions for t in (m.move, m.turn))

    def place(self, time: float, x: FloatArray) -> None:
        """Write to `x` [m], shape (n, 3), where the sets are at `time` [s], along their axes."""
        for motion, where in self._places:
            x[where] = motion.places(time)[:, motion.axes]
