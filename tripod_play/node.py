"""Path and solver in the graph: they ask for tilts by `target_pose`, which inverse kinematics follows in mode IK.

Start inverse kinematics with `--set goal=orientation` (for a path of positions with `--set goal=position`).
"""

import time
from collections import deque
from dataclasses import replace

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import String
from tripod_msgs.msg import IkStatus

from tripod_graph import names
from tripod_graph.authority import OperatorAuthority
from tripod_graph.control_mode import Speaker, clocks, listen
from tripod_graph.mode import Decision, Mode
from tripod_graph.motion_clock import MotionClock
from tripod_graph.parameters import declare
from tripod_graph.qos import LATCHED, RELIABLE
from tripod_graph.source import name_of, new_source
from tripod_host.arrays import FloatArray
from tripod_host.rotations import quaternion_matrix, vector_quaternion
from tripod_play.errors import PlayError
from tripod_play.follow import ServoPath
from tripod_play.path_file import KeyPoints, Kind
from tripod_play.player import Player, PlayerSettings
from tripod_sim.maze.board import Board

PERIOD = 0.02
"""Time between two targets [s]."""

SILENCE = 0.5
"""Time without a ball after which the plate is held level [s]."""

PATIENCE = 3.0
"""Time without what is waited for after which that is said [s]: nodes find each other within it."""

SLANT = 0.01
"""Tilt that is missing [rad] from which on it is said: less is missed where tilts are large."""

TILTS, POSITIONS = ("orientation", "pose"), ("position", "pose")
"""Goals of inverse kinematics that follow tilts, and positions; the first is proposed."""

LEVELLING = 0.8
"""Time in which the plate can get level at the end [s]: less than the lease of a decision, which is repeated before."""


class PlayNode(Node):
    """What both have in common: the mode, the effector's pose at rest, targets.

    Attributes:
        done: How it ended; empty while it goes on.
        succeeded: Whether it ended as wanted.
    """

    def __init__(self, name: str, goals: tuple[str, ...]) -> None:
        """`goals`: those of inverse kinematics, one of which it must have, or nothing would move."""
        super().__init__(name)
        declare(self, ())
        self.done, self.succeeded = "", False
        self._authority = OperatorAuthority(new_source(name, self.get_namespace()))
        self._motion = MotionClock(self)
        self._position: FloatArray | None = None
        self._rotation = np.eye(3)
        self._targets = self.create_publisher(PoseStamped, names.TARGET_POSE, RELIABLE)
        self._speaker = Speaker(self, self._authority)
        listen(self, self._on_decision)
        self.create_subscription(PoseStamped, names.EFFECTOR_POSE, self._on_effector, RELIABLE)
        self.create_subscription(String, names.IK_GOAL, self._on_goal, LATCHED)
        self._goals, self._followed = goals, False
        self._tilts = goals == TILTS
        self._rest: FloatArray | None = None
        self._asked = False
        self._begun: float | None = None
        self._off = 0.0  # by which the closest pose missed a target that is out of reach, at most [rad or m]
        self.create_subscription(IkStatus, names.IK_STATUS, self._on_status, RELIABLE)
        self._made_at = time.monotonic()
        self.create_timer(PERIOD, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def close(self) -> None:
        """Ask for the level plate, then leave the graph and say so: everything holds, then parks."""
        if self._rest is not None and self._authority.held:
            self._speaker.repeat()
            self._send(self._rest, np.zeros(2))
            time.sleep(LEVELLING)
        self._speaker.leave(self._authority)
        self.destroy_node()

    def _on_decision(self, decision: Decision) -> None:
        try:
            self._authority.hear(decision, *clocks(self))
        except ValueError as error:
            self.get_logger().warning(str(error))
        self._look()

    def _look(self) -> None:
        """End when somebody else decides."""
        tracker = self._authority.tracker
        if self._asked and not tracker.is_held_by(self._authority.source) and not self.done:
            by = name_of(tracker.source) or "nobody"
            self.done = f"mode is {self._authority.mode.name}, by {by}: another operator has taken over"

    def _on_effector(self, message: PoseStamped) -> None:
        p, q = message.pose.position, message.pose.orientation
        numbers = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
        if not (np.isfinite(numbers).all() and numbers[3:].any()):
            return
        self._position = numbers[:3]
        self._rotation = quaternion_matrix(numbers[3:])
        self._begin()

    def _on_goal(self, message: String) -> None:
        self._followed = message.data in self._goals
        if not self._followed and not self.done:
            self.done = (
                f"inverse kinematics has the goal {message.data[:20]!r}, which cannot follow this path: start "
                f"it with --set goal={self._goals[0]} (`tripod up --set ik.goal={self._goals[0]}`)"
            )
        self._begin()

    def _on_status(self, message: IkStatus) -> None:
        if self._begun is not None and message.state == IkStatus.CLOSEST:
            self._off = max(self._off, message.tilt_residual if self._tilts else message.residual)

    def _begin(self) -> None:
        """Take the mode once the effector is seen and inverse kinematics follows what will be asked for."""
        if self._rest is None and self._position is not None and self._followed:
            self._rest = self._position
            self._speaker.decide(Mode.IK)
            self._asked = True

    def _send(self, position: FloatArray, tilt: FloatArray) -> None:
        message = PoseStamped()
        message.header.frame_id = names.WORLD
        message.header.stamp = self.get_clock().now().to_msg()
        p, q = message.pose.position, message.pose.orientation
        p.x, p.y, p.z = position.tolist()
        q.x, q.y, q.z, q.w = vector_quaternion([*tilt, 0.0]).tolist()
        self._targets.publish(message)

    def _on_timer(self) -> None:
        self._look()
        if self._rest is None and time.monotonic() - self._made_at > PATIENCE:
            topic, who = (
                (names.EFFECTOR_POSE, "the simulator")
                if self._position is None
                else (names.IK_GOAL, "inverse kinematics")
            )
            self.get_logger().warning(f"waiting for {topic}: is {who} running?", throttle_duration_sec=10.0)
        if self._rest is not None and not self.done and self._authority.held:
            if self._begun is None:
                self._begun = self._motion.at(time.monotonic())
            self._play(self._rest, self._begun)

    def _play(self, rest: FloatArray, begun: float) -> None:
        """Send what is due; `rest`: position of the effector when this node began [m]; `begun`: to play [s]."""
        raise NotImplementedError


class PathNode(PlayNode):
    """Plays key points, at the pace of a servo path."""

    def __init__(self, points: KeyPoints, path: ServoPath) -> None:
        self._points, self._path = points, path
        super().__init__("path", TILTS if points.kind is Kind.TILT else POSITIONS)

    def _play(self, rest: FloatArray, begun: float) -> None:
        passed = self._motion.at(time.monotonic()) - begun
        value = self._points.at(float(np.interp(passed, self._path.times, self._path.file_times)))
        if self._tilts:
            self._send(rest, value)
        else:
            self._send(value, np.zeros(2))
        if passed > self._path.times[-1]:
            off, unit = (np.degrees(self._off), "degrees") if self._tilts else (1e3 * self._off, "mm")
            self.done, self.succeeded = f"path played in {passed:.2f} s", True
            if off >= 0.05:  # one digit is shown
                self.done += f"; some targets were out of reach, by up to {off:.1f} {unit}"


class SolveNode(PlayNode):
    """Rolls the ball to the goal by what `ball_pose` says, or, where no camera does, `sim/ball_pose`."""

    def __init__(self, board: Board, offset: float, settings: PlayerSettings, delay: float) -> None:
        """`offset`: height of the floor above the effector [m]; `delay`: age of a ball pose when it comes [s]."""
        if board.grid is None:
            raise PlayError("a maze given as a surface has no cells in which to plan; take one drawn as text")
        late = max(1, round(delay / PERIOD))
        observer = replace(settings.observer, period=PERIOD, delay=late * PERIOD)
        self._player = Player(board.grid, board.pitch, replace(settings, observer=observer))
        self._board, self._offset = board, np.array([0.0, 0.0, offset])
        self._seen: deque[tuple[float, FloatArray]] = deque(maxlen=50)
        self._camera = self._last = float("-inf")
        super().__init__("solve", TILTS)
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

    def _play(self, rest: FloatArray, begun: float) -> None:
        if self._off > SLANT:
            self.get_logger().warning(
                f"the plate is {np.degrees(self._off):.1f} degrees from the requested tilt, the closest that "
                "the robot can reach: is it in its working pose (`tripod teleop`, key a)?",
                throttle_duration_sec=10.0,
            )
            self._off = 0.0
        received = self._seen[-1][0] if self._seen else self._made_at + PATIENCE
        late = time.monotonic() - received > SILENCE
        if late or not self._seen:
            self._send(rest, np.zeros(2))
            if late:
                self.get_logger().warning(
                    "no ball is seen, so the plate is held level; check the camera or simulator that sends its "
                    "position",
                    throttle_duration_sec=2.0,
                )
            return
        local = self._seen[-1][1]
        fresh, self._last = received != self._last, received
        x, y, radius = self._board.goal
        half = self._board.obstacles.extent
        if np.hypot(local[0] - x, local[1] - y) < radius:
            self.done, self.succeeded = "goal reached", True
        elif local[2] < 0 or not (half[:2] < local[:2]).all() or not (local[:2] < half[2:4]).all():
            self.done = "ball lost"
        else:
            try:
                self._send(rest, self._player.update(local[:2] if fresh else None))
                return
            except PlayError as error:
                self.done = str(error)
        self._send(rest, np.zeros(2))
