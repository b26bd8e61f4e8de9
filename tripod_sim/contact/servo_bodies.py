"""The bodies of servos among what touches: boxes below the axes, which slide as they are told, whatever presses them.

Rigid bodies alone meet them: the silicone is clamped to their arms, and what the robot is made of has its place there.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.contact.bodies import Body
from tripod_sim.contact.solid_nodes import HELD
from tripod_sim.integrators.scheme import Stage
from tripod_sim.mesh.surfaces import Part
from tripod_sim.shapes.box import box
from tripod_sim.state import State
from tripod_sim.tables.joints import Joints

SIZE = (0.0118, 0.0225, 0.0227)
"""Width, length along the axis, and height of the body of an SG90 [m]; its axis lies in the middle of its top."""


class ServoBodies(Body):
    """Boxes with three unknowns each, all of which are given (see `bodies.Body`).

    Attributes:
        parts: Their surfaces where the slide is 0, in world.
        unknowns, given, pattern, reach, base, width, held: See `Body`.
    """

    def __init__(self, parts: list[Part], inward: FloatArray, slide: float) -> None:
        """`inward`: where a positive slide moves each, unit vectors, shape (s, 3); `slide`: at the start [m]."""
        self.parts, self._inward = parts, inward
        self.unknowns = inward.size
        self.given: IndexArray = np.arange(self.unknowns)
        self.base = np.repeat(self.given[::3], 8)
        self.width, self.held = np.full(len(self.base), 3), np.ones((len(self.base), 3), dtype=bool)
        self._shape = np.concatenate([part.vertices for part in parts])
        upper = sparse.csc_matrix(np.triu(np.ones((3, 3))))
        self.pattern: Any = sparse.block_diag([upper] * len(parts), format="csc")
        self.pattern.data[:] = HELD * (
            self.pattern.indices == np.repeat(self.given, np.diff(self.pattern.indptr))
        )
        self.reach = np.ones(self.unknowns)
        self._slide, self._left, self._goal, self._rate, self._length = slide, 0.0, slide, 0.0, 0.0
        self._next, self._way = (slide, 0.0), np.zeros(self.unknowns)

    def load(self, state: State, joints: FloatArray, dt: float) -> None:
        """Begin a step of `dt` [s] from `state`, in which servos go to `joints`, shape (s + 1,) or longer."""
        s = len(self.parts)
        self._slide, self._goal, self._left = float(state.joints[s]), float(joints[s]), dt
        self._rate = (self._goal - self._slide) / dt

    def placed(self) -> list[tuple[str, Part]]:
        """Return the surfaces where they are, by name."""
        moves = self._slide * self._inward
        return [
            (f"the body of servo_{i}", replace(part, vertices=part.vertices + move))
            for i, (part, move) in enumerate(zip(self.parts, moves, strict=True))
        ]

    def place(self, positions: FloatArray, arm: FloatArray) -> None:
        """Write where the vertices are [m], shape (8 s, 3)."""
        positions[:] = self._shape + np.repeat(self._slide * self._inward, 8, axis=0)

    def ends(self, u: FloatArray, out: FloatArray) -> None:
        """Write where the vertices are after the moves `u` [m], shape (8 s, 3)."""
        self.place(out, out)
        out += np.repeat(u.reshape(-1, 3), 8, axis=0)

    def begin(self, stage: Stage) -> None:
        """Prepare a stage."""
        left = self._left - stage.length
        self._length, last = stage.length, left < 1e-9 * stage.length
        way = self._goal - self._slide if last else stage.length * self._rate
        self._way[:] = (way * self._inward).ravel()
        self._next = self._slide + way, left

    def guess(self, u: FloatArray) -> None:
        """Write the moves of the stage."""
        u[:] = self._way

    def rate_at_start(self, out: FloatArray) -> None:
        """Write the velocities over the stage."""
        out[:] = self._way / self._length if self._length else 0.0

    def rate_at_end(self, u: FloatArray, out: FloatArray) -> None:
        """Write the same."""
        self.rate_at_start(out)

    def finish(self, u: FloatArray) -> None:
        """Let the moves be made."""
        self._slide, self._left = self._next


def servo_bodies(joints: Joints) -> ServoBodies:
    """Return the bodies of servos."""
    body, parts = box(SIZE).part, list[Part]()
    for arm in joints.arms:
        hung = body.vertices - [0.0, 0.0, 0.5 * SIZE[2]]
        parts.append(
            Part(arm.hub + hung @ arm.frame.T, body.triangles, rigid=True, kinematic=True, name="servo body")
        )
    return ServoBodies(parts, np.array([arm.inward for arm in joints.arms]), joints.slide)
