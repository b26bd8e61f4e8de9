"""The ball on the soft body itself and on the tops of its servos.

Each step the surface moves the ball, and the ball's impulses, shared among the corners of the triangles it touched,
load the next step. The ball must be light against the body, so that this delay is stable.
"""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.ball.ball import ABYSS, BallState, Place
from tripod_sim.ball.plate_kernels import fall
from tripod_sim.ball.surface_kernels import advance_on_surface, workspace
from tripod_sim.constraints.groups import DrivenFrame
from tripod_sim.errors import SceneError
from tripod_sim.forces.loads import NodalLoads
from tripod_sim.scene import Ball
from tripod_sim.state import State

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

HEAVIEST = 1 / 32
"""Mass of the ball over that of the body up to which the delayed load is stable."""

AVERAGE = 0.05
"""Without inertia the body cannot take an impact; it then feels the ball's force averaged over this time [s]."""

LOST = 0.1
"""Depth below the mid-plane at which the ball counts as lost [m]."""

SERVO = np.array([0.0225, 0.0118, 0.0227])
"""Length (along the axis), width and height of the body of an SG90 [m]; its axis lies in the middle of its top."""

_FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


class BodyBall:
    """Moves the ball of a scene without a maze."""

    def __init__(
        self,
        description: Ball,
        surface: IndexArray,
        frames: tuple[DrivenFrame, ...],
        mass: float,
        gravity: FloatArray,
        loads: NodalLoads,
        *,
        quasi_static: bool,
    ) -> None:
        """Prepare the surfaces.

        Args:
            description: The ball.
            surface: Triangles of the body, shape (m, 3).
            frames: The servo arms; a servo stands under each.
            mass: Of the body [kg].
            gravity: [m/s²], shape (3,).
            loads: Of the system.
            quasi_static: Whether the body has no inertia.

        Raises:
            SceneError: the ball is too heavy.
        """
        if description.mass > mass * HEAVIEST:
            raise SceneError(
                f"ball.mass is {description.mass} kg; on the soft body it must be at most 1/32 of material.mass, "
                f"{mass * HEAVIEST:.4g} kg"
            )
        d = self.description = description
        self._numbers = np.array(
            [d.mass, d.radius, d.friction, d.restitution, d.rest_speed, d.rolling, d.substep, *gravity]
        )
        self._gravity, self._loads, self._quasi_static = gravity, loads, quasi_static
        n = len(loads.force)
        boxes = [_box(frame) for frame in frames]
        self._servos = np.concatenate([*boxes, np.zeros((0, 3))])
        self._inward = np.concatenate([*(np.tile(f.inward, (8, 1)) for f in frames), np.zeros((0, 3))])
        tops = [
            [8 * i + n + a, 8 * i + n + b, 8 * i + n + c]
            for i in range(len(frames))
            for p, q, r, s in _FACES
            for a, b, c in ((p, q, r), (p, r, s))
        ]
        self._triangles = np.concatenate([surface, np.array(tops, dtype=np.int64).reshape(-1, 3)])
        self._before, self._after = np.zeros((2, n + len(self._servos), 3))
        self._reaction = np.zeros_like(self._before)
        self._scratch = workspace(len(self._triangles))

    def _corners(self, state: State, out: FloatArray) -> None:
        n = len(state.positions)
        out[:n] = state.positions
        out[n:] = self._servos + state.joints[-1] * self._inward

    def start(self, state: State) -> BallState:
        """Return the ball at rest where the scene puts it. Raises SceneError if it overlaps something."""
        numbers = np.zeros(13)
        numbers[:3], numbers[12] = self.description.position, 1.0
        ball = BallState(numbers)
        self._corners(state, self._before)
        gap = self.gap(ball)
        if gap < 0:
            raise SceneError(
                f"ball.position {list(self.description.position)} m: the ball of radius {self.description.radius} m "
                f"overlaps the body or a servo by {-gap:.3g} m; lift it"
            )
        ball.nodal = np.zeros_like(self._loads.force)
        return ball

    def gap(self, ball: BallState) -> float:
        """Return the distance between the ball and the surfaces as they were at the start of the last step [m]."""
        from tripod_sim.ball.obstacle_kernels import triangle_distance  # noqa: PLC0415

        normal, weights = np.zeros(3), np.zeros(3)
        corners = self._before[self._triangles].reshape(-1, 9)
        nearest = min(triangle_distance(t, ball.position, normal, weights) for t in corners)
        return float(nearest - self.description.radius)

    def load(self, state: State, ball: BallState) -> None:
        """Write the loads of a step that begins at `state`, and remember where the surfaces are."""
        self._corners(state, self._before)
        if ball.nodal is not None:
            self._loads.force[:] = ball.nodal

    def follow(self, state: State, ball: BallState, dt: float) -> None:
        """Move `ball` over the step that ended at `state`, in place."""
        force, n = self._loads.force, len(state.positions)
        ball.load_work += float(np.vdot(force, state.positions) - np.vdot(force, self._before[:n]))
        self._corners(state, self._after)
        self._reaction[:] = 0.0
        if ball.place is Place.PLAYING:
            rows, candidates, owners = self._scratch
            advance_on_surface(
                ball.numbers, self._before, self._after, self._triangles, dt, self._numbers, ball.ledger,
                self._reaction, rows, candidates, owners,
            )  # fmt: skip
            if ball.position[2] < -LOST:
                ball.place, ball.lost_time = Place.LEFT, state.time
        elif ball.position[2] > -ABYSS:
            fall(ball.numbers, dt, self._gravity)
        if ball.nodal is not None:
            share = min(1.0, dt / AVERAGE) if self._quasi_static else 1.0
            ball.nodal *= 1 - share
            ball.nodal += (share / dt) * self._reaction[:n]

    def energy(self, ball: BallState) -> float:
        """Return kinetic and potential energy of the ball [J], the latter zero at the origin."""
        d, v, w = self.description, ball.velocity, ball.spin
        kinetic = 0.5 * d.mass * float(v @ v) + 0.2 * d.mass * d.radius**2 * float(w @ w)
        return kinetic - d.mass * float(self._gravity @ ball.position)


def _box(frame: DrivenFrame) -> FloatArray:
    """Return the corners of the servo under an arm, its slide being 0 [m], shape (8, 3)."""
    length, width, height = SERVO
    corners = [
        frame.point + a * frame.axis + b * frame.inward + c * np.array([0.0, 0.0, 1.0])
        for a in (-length / 2, length / 2)
        for b in (-width / 2, width / 2)
        for c in (-height, 0.0)
    ]
    return np.array(corners)
