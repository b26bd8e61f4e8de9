"""Path and solver in the graph: they ask for tilts by `target_pose`, which inverse kinematics follows in mode IK.

Start inverse kinematics with `goal:=orientation` (for a path of positions with `goal:=position`).
"""

import time
from collections import deque
from dataclasses import replace

import numpy as np
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from tripod_msgs.msg import ControlMode

from tripod_graph import names
from tripod_graph.mode import Mode, ModeTracker
from tripod_graph.qos import LATCHED, LATCHED_OF_ALL, RELIABLE
from tripod_play.errors import PlayError
from tripod_play.follow import ServoPath
from tripod_play.path_file import KeyPoints, Kind, tilt_quaternion
from tripod_play.player import Player, PlayerSettings
from tripod_sim.maze.board import Board

FloatArray = NDArray[np.float64]

PERIOD = 0.02
"""Time between two targets [s]."""

SILENCE = 0.5
"""Time without a ball after which the plate is held level [s]."""


class PlayNode(Node):
    """What both have in common: the mode, the effector's pose at rest, targets."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.done = ""
        self._mode, self._first = ModeTracker(), None
        self._position: FloatArray | None = None
        self._rotation = np.eye(3)
        self._targets = self.create_publisher(PoseStamped, names.TARGET_POSE, RELIABLE)
        self._modes = self.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
        self.create_subscription(ControlMode, names.CONTROL_MODE, self._on_mode, LATCHED_OF_ALL)
        self.create_subscription(PoseStamped, names.EFFECTOR_POSE, self._on_effector, RELIABLE)
        self._rest: FloatArray | None = None
        self._asked = False
        self.create_timer(PERIOD, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def close(self) -> None:
        """Ask for the level plate, then leave the graph; the mode stays with the operator."""
        if self._rest is not None and self._mode.mode is Mode.IK:
            self._send(self._rest, np.zeros(2))
        self.destroy_node()

    def _on_mode(self, message: ControlMode) -> None:
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        try:
            self._mode.update(message.mode, stamp)
        except ValueError as error:
            self.get_logger().warning(str(error))
            return
        if self._asked and self._mode.mode is not Mode.IK and not self.done:
            self.done = f"mode is {self._mode.mode.name}: another operator has taken over"

    def _on_effector(self, message: PoseStamped) -> None:
        p, q = message.pose.position, message.pose.orientation
        numbers = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
        if not np.isfinite(numbers).all():
            return
        self._position = numbers[:3]
        self._rotation = _matrix(numbers[3:])
        if self._rest is None:
            self._rest = numbers[:3]
            message = ControlMode(mode=int(Mode.IK), source=self.get_name())
            message.header.stamp = self.get_clock().now().to_msg()
            self._modes.publish(message)
            self._asked = True

    def _send(self, position: FloatArray, tilt: FloatArray) -> None:
        message = PoseStamped()
        message.header.frame_id = names.WORLD
        message.header.stamp = self.get_clock().now().to_msg()
        p, q = message.pose.position, message.pose.orientation
        p.x, p.y, p.z = position.tolist()
        q.x, q.y, q.z, q.w = tilt_quaternion(tilt).tolist()
        self._targets.publish(message)

    def _on_timer(self) -> None:
        if self._rest is not None and not self.done and self._mode.mode is Mode.IK:
            self._play(self._rest)

    def _play(self, rest: FloatArray) -> None:
        """Send what is due; `rest`: position of the effector when this node began [m]."""
        raise NotImplementedError


class PathNode(PlayNode):
    """Plays key points, at the pace of a servo path."""

    def __init__(self, points: KeyPoints, path: ServoPath) -> None:
        self._points, self._path, self._begun = points, path, -1.0
        super().__init__("path")

    def _play(self, rest: FloatArray) -> None:
        now = time.monotonic()
        if self._begun < 0:
            self._begun = now
        passed = now - self._begun
        value = self._points.at(float(np.interp(passed, self._path.times, self._path.file_times)))
        if self._points.kind is Kind.TILT:
            self._send(rest, value)
        else:
            self._send(value, np.zeros(2))
        if passed > self._path.times[-1]:
            self.done = f"path played in {passed:.2f} s"


class SolveNode(PlayNode):
    """Rolls the ball to the goal by what `ball_pose` says, or, where no camera does, `sim/ball_pose`."""

    def __init__(self, board: Board, offset: float, settings: PlayerSettings, delay: float) -> None:
        """`offset`: height of the floor above the effector [m]; `delay`: age of a ball pose when it comes [s]."""
        if board.grid is None:
            raise PlayError("a maze that is a surface has no cells to plan a way in")
        late = max(1, round(delay / PERIOD))
        observer = replace(settings.observer, period=PERIOD, delay=late * PERIOD)
        self._player = Player(board.grid, board.pitch, replace(settings, observer=observer))
        self._board, self._offset = board, np.array([0.0, 0.0, offset])
        self._seen: deque[tuple[float, FloatArray]] = deque(maxlen=50)
        self._camera = self._last = float("-inf")
        super().__init__("solve")
        self.create_subscription(PoseStamped, names.BALL_POSE, self._on_camera, RELIABLE)
        self.create_subscription(PoseStamped, names.SIM_BALL_POSE, self._on_simulated, RELIABLE)

    def _on_camera(self, message: PoseStamped) -> None:
        self._camera = time.monotonic()
        self._see(message)

    def _on_simulated(self, message: PoseStamped) -> None:
        if time.monotonic() - self._camera > SILENCE:
            self._see(message)

    def _see(self, message: PoseStamped) -> None:
        p = message.pose.position
        place = np.array([p.x, p.y, p.z])
        if self._position is None or not np.isfinite(place).all():
            return
        local = self._rotation.T @ (place - self._position) - self._offset
        self._seen.append((time.monotonic(), local))

    def _play(self, rest: FloatArray) -> None:
        if not self._seen:
            self._send(rest, np.zeros(2))
            return
        received, local = self._seen[-1]
        if time.monotonic() - received > SILENCE:
            self._send(rest, np.zeros(2))
            self.get_logger().warning("no ball is seen; the plate is held level", throttle_duration_sec=2.0)
            return
        fresh, self._last = received != self._last, received
        x, y, radius = self._board.goal
        half = self._board.obstacles.extent
        if np.hypot(local[0] - x, local[1] - y) < radius:
            self.done = "goal reached"
        elif local[2] < 0 or not (half[:2] < local[:2]).all() or not (local[:2] < half[2:4]).all():
            self.done = "ball lost"
        else:
            try:
                self._send(rest, self._player.update(local[:2] if fresh else None))
                return
            except PlayError as error:
                self.done = str(error)
        self._send(rest, np.zeros(2))


def _matrix(quaternion: FloatArray) -> FloatArray:
    """Return the rotation matrix of a quaternion (x, y, z, w) of any length but 0."""
    x, y, z, w = quaternion / max(float(np.linalg.norm(quaternion)), 1e-12)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
