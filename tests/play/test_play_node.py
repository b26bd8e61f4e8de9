"""Path and solver in a graph of their own: which targets they ask for, when they stop."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String
from tripod_msgs.msg import ControlMode, IkStatus

from tests.messages import assert_names, lines_naming
from tripod_graph import names
from tripod_graph.qos import LATCHED, LATCHED_OF_ALL, RELIABLE
from tripod_play import node as play_node
from tripod_play.follow import ServoPath
from tripod_play.node import PathNode, PlayNode, SolveNode
from tripod_play.path_file import KeyPoints, Kind
from tripod_play.player import PlayerSettings
from tripod_sim.maze.board import make_board
from tripod_sim.tables.maze import Maze

pytestmark = pytest.mark.ros

DEADLINE = 60.0
OFFSET = 0.008


class Robot(Node):
    """Stands for simulator, camera, inverse kinematics and operator."""

    def __init__(self, goal: str = "orientation") -> None:
        super().__init__("robot")
        self._goal = self.create_publisher(String, names.IK_GOAL, LATCHED)
        self._goal.publish(String(data=goal))
        self.targets: list[PoseStamped] = []
        self.modes: list[int] = []
        self.create_subscription(PoseStamped, names.TARGET_POSE, self.targets.append, RELIABLE)
        self.create_subscription(
            ControlMode, names.CONTROL_MODE, lambda m: self.modes.append(m.mode), LATCHED_OF_ALL
        )
        self._pose = self.create_publisher(PoseStamped, names.EFFECTOR_POSE, RELIABLE)
        self._balls = {
            name: self.create_publisher(PoseStamped, name, RELIABLE)
            for name in (names.SIM_BALL_POSE, names.BALL_POSE)
        }
        self._mode = self.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
        self._status = self.create_publisher(IkStatus, names.IK_STATUS, RELIABLE)

    def say_closest(self, tilt: float) -> None:
        self.say_pose()
        self._status.publish(IkStatus(state=IkStatus.CLOSEST, tilt_residual=tilt))

    def say_pose(self) -> None:
        message = PoseStamped()
        message.header.frame_id = names.WORLD
        message.pose.position.z = -0.0084
        message.pose.orientation.w = 1.0
        self._pose.publish(message)

    def say_ball(self, x: float, y: float, topic: str = names.SIM_BALL_POSE, z: float = 0.002) -> None:
        message = PoseStamped()
        p = message.pose.position
        p.x, p.y, p.z = x, y, -0.0084 + OFFSET + z
        self._balls[topic].publish(message)

    def say_mode(self, mode: int) -> None:
        message = ControlMode(mode=mode, source="robot")
        message.header.stamp = self.get_clock().now().to_msg()
        self._mode.publish(message)


class Graph:
    def __init__(self, make: Callable[[], PlayNode], goal: str = "orientation") -> None:
        self.robot, self.node = Robot(goal), make()
        self._executor = SingleThreadedExecutor()
        for node in (self.robot, self.node):
            self._executor.add_node(node)

    def until(self, wanted: Callable[[], bool], each: Callable[[], None] = lambda: None) -> None:
        end = time.monotonic() + DEADLINE
        while not wanted():
            assert time.monotonic() < end
            each()
            self._executor.spin_once(timeout_sec=0.01)

    def until_told(
        self, capfd: pytest.CaptureFixture[str], *named: str, each: Callable[[], None] = lambda: None
    ) -> None:
        """Spin until a line on stderr names each of `named`."""
        said: list[str] = []

        def told() -> bool:
            said.append(capfd.readouterr().err)
            return bool(lines_naming("".join(said), *named))

        self.until(told, each)

    def close(self) -> None:
        self.node.close()
        self._executor.shutdown()
        for node in (self.node, self.robot):
            node.destroy_node()


@pytest.fixture
def context(domain: int) -> Iterator[None]:
    rclpy.init(args=[], domain_id=domain)
    yield
    rclpy.try_shutdown()


def tilt_of(message: PoseStamped) -> np.ndarray:
    q = message.pose.orientation
    return 2 * np.array([q.x, q.y])


def solver() -> SolveNode:
    return SolveNode(make_board(Maze(source="first"), 0.002), OFFSET, PlayerSettings(), 0.05)


def test_a_path_takes_the_mode_plays_its_tilts_and_ends(context: None) -> None:
    points = KeyPoints(Kind.TILT, np.array([0.0, 0.4]), np.array([[0.0, 0.0], [0.1, -0.05]]))
    times = np.array([0.0, 0.4])
    path = ServoPath(times, np.zeros((2, 3)), times, ())
    graph = Graph(lambda: PathNode(points, path))
    try:
        graph.until(lambda: bool(graph.node.done), graph.robot.say_pose)
        graph.until(lambda: bool(graph.robot.targets) and tilt_of(graph.robot.targets[-1])[0] > 0.0995)
        assert ControlMode.IK in graph.robot.modes
        tilts = np.array([tilt_of(t) for t in graph.robot.targets])
        assert (np.diff(tilts[:, 0]) >= 0).all()
        np.testing.assert_allclose(tilts[-1], [0.1, -0.05], atol=1e-3)
        assert all(t.pose.position.z == -0.0084 for t in graph.robot.targets)
        assert_names(graph.node.done, "path played")
        graph.node.close()
        graph.until(lambda: graph.robot.modes[-1] == ControlMode.NONE)  # it is not missed
        graph.until(lambda: np.allclose(tilt_of(graph.robot.targets[-1]), 0))
    finally:
        graph.close()


def test_a_path_out_of_reach_says_how_far(context: None) -> None:
    points = KeyPoints(Kind.TILT, np.array([0.0, 0.4]), np.array([[0.0, 0.0], [0.1, -0.05]]))
    path = ServoPath(points.times, np.zeros((2, 3)), points.times, ())
    graph = Graph(lambda: PathNode(points, path))
    try:
        graph.until(lambda: bool(graph.node.done), lambda: graph.robot.say_closest(0.05))
        assert_names(graph.node.done, "path played", "out of reach", "2.9 degrees")
    finally:
        graph.close()


def test_a_plate_that_cannot_tilt_is_told(context: None, capfd: pytest.CaptureFixture[str]) -> None:
    graph = Graph(solver)
    try:
        graph.until_told(
            capfd, "plate", "2.9 degrees", "working pose", each=lambda: graph.robot.say_closest(0.05)
        )
    finally:
        graph.close()


def test_where_inverse_kinematics_follows_something_else_nothing_is_commanded_and_that_is_said(
    context: None,
) -> None:
    graph = Graph(solver, "position")
    try:
        graph.until(lambda: bool(graph.node.done), graph.robot.say_pose)
        remedy = ("--set goal=orientation", "tripod up --set ik.goal=orientation")
        assert_names(graph.node.done, "inverse kinematics", "'position'", *remedy)
        assert ControlMode.IK not in graph.robot.modes
        assert not graph.robot.targets
    finally:
        graph.close()


def test_a_ball_that_was_never_seen_is_told(
    context: None, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(play_node, "PATIENCE", 0.0)
    graph = Graph(solver)
    try:
        graph.until_told(capfd, "no ball", "plate", each=graph.robot.say_pose)
    finally:
        graph.close()


def test_the_solver_tilts_along_the_way_and_stops_in_the_goal(context: None) -> None:
    """In `first` the way begins along +x: a turn about +y."""
    graph = Graph(solver)
    start, goal = (-0.0105, 0.0105), (-0.0105, 0.0035)

    def see() -> None:
        graph.robot.say_pose()
        graph.robot.say_ball(*start)

    try:
        graph.until(lambda: len(graph.robot.targets) > 15 and tilt_of(graph.robot.targets[-1])[1] > 0.01, see)
        assert not graph.node.done
        graph.until(lambda: bool(graph.node.done), lambda: graph.robot.say_ball(*goal))
        assert_names(graph.node.done, "goal reached")
        count = len(graph.robot.targets)
        graph.until(
            lambda: len(graph.robot.targets) > count or np.allclose(tilt_of(graph.robot.targets[-1]), 0)
        )
        np.testing.assert_allclose(tilt_of(graph.robot.targets[-1]), 0)
    finally:
        graph.close()


def test_a_camera_comes_before_the_simulator_and_nan_is_not_seen(context: None) -> None:
    graph = Graph(solver)

    def see() -> None:
        graph.robot.say_pose()
        graph.robot.say_ball(-0.0105, 0.0105, names.BALL_POSE)
        graph.robot.say_ball(float("nan"), 0.0, names.BALL_POSE)
        graph.robot.say_ball(-0.0105, 0.0035, names.SIM_BALL_POSE)  # the goal, were it believed

    try:
        graph.until(
            lambda: len(graph.robot.targets) > 20,
            lambda: graph.robot.say_ball(-0.0105, 0.0105, names.BALL_POSE) or graph.robot.say_pose(),
        )
        graph.until(lambda: len(graph.robot.targets) > 40, see)
        assert not graph.node.done
        assert np.isfinite([tilt_of(t) for t in graph.robot.targets]).all()
    finally:
        graph.close()


def test_a_lost_ball_and_another_operator_end_the_game(context: None) -> None:
    for lost in (True, False):
        graph = Graph(solver)

        def see(graph: Graph = graph) -> None:
            graph.robot.say_pose()
            graph.robot.say_ball(-0.0105, 0.0105)

        try:
            graph.until(lambda graph=graph: len(graph.robot.targets) > 3, see)
            if lost:
                graph.until(
                    lambda graph=graph: bool(graph.node.done),
                    lambda graph=graph: graph.robot.say_ball(0.0, 0.0, z=-0.02),
                )
                assert_names(graph.node.done, "ball lost")
            else:
                graph.robot.say_mode(ControlMode.STOP)
                graph.until(lambda graph=graph: bool(graph.node.done), see)
                assert_names(graph.node.done, "STOP", "robot", "another operator")
        finally:
            graph.close()


def test_the_simulator_tells_where_the_ball_is(domain: int) -> None:
    from tripod_runtime.node import SimNode

    received: list[PoseStamped] = []
    rclpy.init(
        args=["--ros-args", "-p", "scene:=maze", "-p", "set:=mesh.level=1"],
        domain_id=domain,
    )
    robot = Robot()
    robot.create_subscription(PoseStamped, names.SIM_BALL_POSE, received.append, RELIABLE)
    sim = SimNode()
    executor = SingleThreadedExecutor()
    executor.add_node(robot)
    executor.add_node(sim)
    try:
        end = time.monotonic() + DEADLINE
        while len(received) < 3:
            assert time.monotonic() < end
            executor.spin_once(timeout_sec=0.02)
        p = received[-1].pose.position
        np.testing.assert_allclose([p.x, p.y], [-0.021, 0.021], atol=1e-3)
        assert received[-1].header.frame_id == names.WORLD
    finally:
        sim.close()
        executor.shutdown()
        for node in (sim, robot):
            node.destroy_node()
        rclpy.try_shutdown()


def test_without_a_simulator_it_says_what_it_waits_for(
    context: None, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(play_node, "PATIENCE", 0.0)
    graph = Graph(solver)
    try:
        graph.until_told(capfd, names.EFFECTOR_POSE, "simulator")
    finally:
        graph.close()


def test_a_game_that_is_stopped_is_not_won(domain: int) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "tripod_bringup", "play", "first", "--live"],
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
    )
    try:
        assert process.stderr
        assert_names(process.stderr.readline(), names.EFFECTOR_POSE)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 1
