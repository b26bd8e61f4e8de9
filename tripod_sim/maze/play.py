"""The ball in the maze and the robot under it: each step the plate moves the ball, and the ball loads the next step.

The ball is light against the plate, so that the delay of a step between its impulses and the plate's answer is stable;
the ledger has what the delay makes of the energy.
"""

from collections.abc import Callable

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.rotations import axial, skew
from tripod_sim.ball.ball import BallOnPlate, BallState, Place, PlateMotion
from tripod_sim.ball.motion_kernels import move_ahead
from tripod_sim.ball.obstacle_kernels import MISSES, sweep
from tripod_sim.ball.plate_kernels import SKIN
from tripod_sim.ball.rest import carried
from tripod_sim.errors import SceneError
from tripod_sim.forces.loads import NodalLoads
from tripod_sim.maze.plate import Plate
from tripod_sim.state import State
from tripod_sim.tables.maze import Ball

HEAVIEST = 1 / 16
"""Mass of the ball over that of the plate up to which the delayed load is stable, at the rim of the plate too."""

AVERAGE = 0.05
"""Without inertia the robot cannot take an impact; it then feels the ball's force averaged over this time [s]."""


class MazeBall:
    """Moves the ball of a scene with a maze.

    Attributes:
        plate: What it plays on.
        ball: Its motion on the plate.
        loads: What it presses with, a term of the system.
        weight: Of the ball [N], shape (3,).
    """

    def __init__(
        self, description: Ball, plate: Plate, gravity: FloatArray, loads: NodalLoads, *, quasi_static: bool
    ) -> None:
        """`loads`: of the system; `quasi_static`: whether the robot has no inertia. Raises SceneError."""
        heaviest = float(plate.mass.sum()) * HEAVIEST
        if description.mass > heaviest:
            raise SceneError(
                f"ball.mass is {description.mass} kg; in a maze it must be at most 1/16 of maze.mass, {heaviest:.4g} kg"
            )
        self.plate = plate
        self.ball = BallOnPlate(description, plate.board.obstacles, gravity)
        self._gravity, self.weight = gravity, description.mass * gravity
        self.loads, self._quasi_static = loads, quasi_static
        self._motion = PlateMotion(np.zeros((2, 3)), np.zeros((2, 3, 3)), np.zeros((2, 3)))
        self._up = np.array([0.0, 0.0, plate.offset])
        self._before = np.zeros((len(plate.nodes), 3))
        self._pressed = np.zeros((2, 3))

    def start(self, state: State) -> BallState:
        """Return the ball at rest on its start, the plate being at rest as in `state`. Raises SceneError."""
        o, board = self.plate.board.obstacles, self.plate.board
        radius = self.ball.description.radius
        top = max((o.boxes[:, 2] + o.boxes[:, 5]).max(initial=0.0), o.triangles[:, 2::3].max(initial=-np.inf))
        point, down = np.array([*board.start, top + 2 * radius]), np.zeros(3)
        down[2] = o.extent[4] - radius - point[2]
        first = min(
            sweep(k, o, point, down, radius + SKIN, np.zeros((3, 3)))
            for k in range(len(o.boxes) + len(o.triangles))
        )
        if first >= MISSES:
            raise SceneError(
                f"maze.start {list(board.start)} m: there is no floor under the ball; move maze.start"
            )
        height = point[2] + first * down[2]
        if board.grid and height > radius + 2 * SKIN:
            raise SceneError(
                f"maze: the ball of radius {radius} m does not fit between the walls at the start; set a "
                "smaller ball.radius or move maze.start"
            )
        rotation = state.rotations[0]
        numbers = np.zeros(13)
        numbers[:3] = state.centres[0] + rotation @ (self._up + np.array([*board.start, height]))
        numbers[12] = 1.0
        return BallState(numbers)

    def load(self, state: State, ball: BallState) -> None:
        """Write the loads of a step that begins at `state`, and remember where the plate is."""
        motion, nodes = self._motion, self.plate.nodes
        motion.rotation[0] = state.rotations[0]
        motion.centre[0] = state.centres[0] + motion.rotation[0] @ self._up
        x = self._before
        x[:] = state.positions[nodes]
        arms = x - state.centres[0]
        force, moment = ball.wrench
        turn = np.linalg.solve(_inertia(arms), moment)
        self.loads.force[nodes] = force / len(nodes) + arms @ skew(turn).T

    def follow(self, state: State, ball: BallState, dt: float) -> None:
        """Move `ball` over the step that ended at `state`, in place."""
        motion, nodes = self._motion, self.plate.nodes
        ball.load_work += float(np.vdot(self.loads.force[nodes], state.positions[nodes] - self._before))
        motion.rotation[1] = state.rotations[0]
        motion.centre[1] = state.centres[0] + motion.rotation[1] @ self._up
        motion.twist[:] = self._twist(state, dt)
        self.ball.advance(ball, motion, state.time - dt, dt)
        force, moment, along = self.ball.reaction / dt
        self._pressed[:] = -along, along - force
        arm = motion.centre[0] - state.centres[0]
        wrench = np.array([force, moment + skew(arm) @ force])
        share = min(1.0, dt / AVERAGE) if self._quasi_static else 1.0
        ball.wrench += share * (wrench - ball.wrench)
        self._note_goal(ball, motion, state.time)

    def contact_forces(self, ball: BallState) -> tuple[FloatArray, FloatArray]:
        """Return the sums of the normal forces and of the friction of floor and walls on the ball, shape (2, 3) [N].

        They are means over the last step. Both begin where the normal forces press: second what that is, a point on the
        ball [m], shape (3,).
        """
        size = float(np.linalg.norm(self._pressed[0]))
        inward = self._pressed[0] / size if size else np.zeros(3)
        return self._pressed.copy(), ball.position - self.ball.description.radius * inward

    @property
    def twist(self) -> FloatArray:
        """Velocity [m/s] and angular velocity [rad/s] of the plate at the end of the last step, shape (2, 3)."""
        return self._motion.twist

    def shifted(self) -> Callable[[BallState, float, FloatArray, float, float], None]:
        """Return what moves another ball, in place, over the step of `dt` up to `time` [s] that the first followed.

        Its plate is `ahead` of the first one's by a time [s], to first order: x + ahead v, from the `twist` at its
        start to that at the end. It is not loaded.
        """
        mover, own = BallOnPlate(self.ball.description, self.ball.obstacles, self._gravity), self._motion
        motion = PlateMotion(np.zeros((2, 3)), np.zeros((2, 3, 3)), np.zeros((2, 3)))

        def follow(ball: BallState, ahead: float, twist: FloatArray, time: float, dt: float) -> None:
            move_ahead(
                own.centre, own.rotation, twist, own.twist, ahead, dt,
                motion.centre, motion.rotation, motion.twist,
            )  # fmt: skip
            mover.advance(ball, motion, time - dt, dt)

        return follow

    def rest_load(self, state: State, ball: BallState, out: FloatArray) -> None:
        """Write the static load of the ball on the nodes [N], shape (n, 3): while in play its weight, where it lies.

        It goes along with the plate, as a ball does that friction and rolling resistance hold. Of a ball that rolls or
        bounces it is the mean: impacts are no state of rest. It has no stiffness but that of the load.
        """
        out[:] = 0.0
        if ball.place is Place.PLAYING:
            nodes, centre = self.plate.nodes, state.centres[0]
            out[nodes] = carried(state.positions[nodes] - centre, ball.position - centre, self.weight)

    def _twist(self, state: State, dt: float) -> FloatArray:
        """Return velocity and angular velocity of the plate at the end of the step, shape (2, 3)."""
        nodes = self.plate.nodes
        x = state.positions[nodes]
        v = (x - self._before) / dt if self._quasi_static else state.velocities[nodes]
        arms, centre = x - state.centres[0], v.mean(axis=0)
        moments = arms.T @ (v - centre)  # their antisymmetric part is the sum of arm x velocity
        spin = np.asarray(np.linalg.solve(_inertia(arms), axial(moments)), dtype=np.float64)
        return np.array([centre + skew(spin) @ self._motion.rotation[1] @ self._up, spin])

    def _note_goal(self, ball: BallState, motion: PlateMotion, time: float) -> None:
        x, y, radius = self.plate.board.goal
        if radius <= 0 or ball.place is not Place.PLAYING or np.isfinite(ball.goal_time):
            return
        q = motion.rotation[1].T @ (ball.position - motion.centre[1])
        if np.hypot(q[0] - x, q[1] - y) < radius and q[2] < 2 * self.ball.description.radius:
            ball.goal_time = time

    def local(self, state: State, ball: BallState) -> FloatArray:
        """Return the ball's centre in the plate's frame [m], shape (3,)."""
        rotation = state.rotations[0]
        return np.asarray(rotation.T @ (ball.position - state.centres[0]) - self._up)


def _inertia(arms: FloatArray) -> FloatArray:
    """Return the inertia of points of unit mass about the origin of their `arms`, shape (n, 3)."""
    return np.asarray(np.eye(3) * np.vdot(arms, arms) - arms.T @ arms)
