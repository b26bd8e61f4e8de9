"""A recorded motion to the robot: all is checked, then slowly to the first pose, then as recorded."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import ControlMode, RobotStatus, SimStatus

from tests.messages import assert_names
from tripod_bringup.script_player import ScriptPlayer
from tripod_graph import names
from tripod_graph.qos import LATCHED, LATCHED_OF_ALL, RELIABLE
from tripod_graph.trajectory import seconds
from tripod_play import replay_node
from tripod_play.joint_path import SAFE_SPEED, JointPath
from tripod_play.replay_node import ReplayNode

pytestmark = pytest.mark.ros

DEADLINE = 60.0


class Clock:
    """In place of `time` in the node: each of its looks takes `step` [s], however long it takes the machine."""

    def __init__(self) -> None:
        self.now, self.step, self.looks = 100.0, replay_node.PERIOD, 0

    def monotonic(self) -> float:
        self.looks += 1
        self.now += self.step
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(replay_node, "time", clock)
    return clock


class Driver(Node):
    """Stands for the driver: goes at once where the last trajectory begins."""

    def __init__(self) -> None:
        super().__init__("driver")
        self.here = np.zeros(3)
        self.modes: list[ControlMode] = []
        self.asked: list[JointTrajectory] = []
        self._status = self.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)
        self._joints = self.create_publisher(JointState, names.ROBOT_JOINT_STATES, RELIABLE)
        self.operator = self.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
        self.create_subscription(ControlMode, names.CONTROL_MODE, self.modes.append, LATCHED_OF_ALL)
        self.create_subscription(JointTrajectory, names.JOINT_TRAJECTORY, self._on_trajectory, RELIABLE)

    def say(self, **status: Any) -> None:
        values = {
            "state": RobotStatus.ACTIVE if self.asked else RobotStatus.PARKED,
            "lower": [-1.0] * 3,
            "upper": [0.5] * 3,
            "speed": [4.0] * 3,
            **status,
        }
        self._status.publish(RobotStatus(**values))
        self._joints.publish(JointState(name=list(names.SERVOS), position=self.here.tolist()))

    def _on_trajectory(self, message: JointTrajectory) -> None:
        self.asked.append(message)
        self.here = np.array(message.points[0].positions[:3])


class Simulator(Driver):
    """Stands for the simulator."""

    def __init__(self) -> None:
        super().__init__()
        self._told = self.create_publisher(SimStatus, names.SIM_STATUS, RELIABLE)
        self._seen = self.create_publisher(JointState, names.SIM_JOINT_STATES, RELIABLE)

    def say(self, **status: Any) -> None:
        state = SimStatus.RUNNING if self.asked else SimStatus.PARKED
        values = {"state": state, "lower": [-1.0] * 3, "upper": [0.5] * 3, **status}
        self._told.publish(SimStatus(**values))
        self._seen.publish(JointState(name=list(names.SERVOS), position=self.here.tolist()))


class Graph:
    def __init__(self, path: JointPath, *, alone: bool = False, **options: Any) -> None:
        """`alone`: the simulator without a driver."""
        self.driver = Simulator() if alone or "simulated" in options else Driver()
        self.node = ReplayNode(path, **{"start": 0.0, "rate": 1.0, **options})
        self.executor = SingleThreadedExecutor()
        for node in (self.driver, self.node):
            self.executor.add_node(node)

    def until(self, condition: Callable[[], Any], **status: Any) -> None:
        end = time.monotonic() + DEADLINE
        while not condition():
            assert time.monotonic() < end, self.node.done
            self.driver.say(**status)
            self.executor.spin_once(timeout_sec=0.01)

    def close(self) -> None:
        self.executor.shutdown()
        self.node.close()
        self.driver.destroy_node()


@pytest.fixture
def make(domain: int) -> Iterator[Callable[..., Graph]]:
    rclpy.init(args=[], domain_id=domain)
    made: list[Graph] = []

    def graph(path: JointPath, **options: Any) -> Graph:
        made.append(Graph(path, **options))
        return made[-1]

    yield graph
    for graph_ in made:
        graph_.close()
    rclpy.try_shutdown()


def motion(first: float = -0.3, size: float = 0.2) -> JointPath:
    """A second of motion that begins at `first` [rad]."""
    times = np.linspace(2.0, 3.0, 101)
    joints = np.zeros((101, 4))
    joints[:, :3] = first + size * np.sin(np.pi * (times[:, None] - 2.0))
    joints[:, 3] = 0.02
    return JointPath(times, joints, 3)


def test_it_takes_the_mode_goes_slowly_to_the_first_pose_and_plays_to_the_end(make, clock: Clock) -> None:
    path = motion()
    graph = make(path, start=2.0)
    assert_names(graph.node.waiting, "looking", "driver")
    graph.until(lambda: graph.driver.asked)
    assert_names(graph.node.waiting, "first pose")
    graph.until(lambda: graph.node.done)
    assert graph.node.waiting == ""
    assert not graph.node.failed
    assert_names(graph.node.done, "1.00 s")
    decided = [m for m in graph.driver.modes if m.mode == ControlMode.REPLAY]
    source = decided[0].source
    assert {m.header.frame_id for m in graph.driver.asked} == {source}
    assert "bag_play#" in source
    there = next(i for i, m in enumerate(graph.driver.asked) if len(m.points) == 1)
    assert there >= 5  # 0.3 rad at the safe speed
    for i, message in enumerate(graph.driver.asked):
        assert list(message.joint_names) == [*names.SERVOS, names.SLIDE]
        angles = np.array([p.positions[:3] for p in message.points])
        times = np.array([seconds(p.time_from_start) for p in message.points])
        assert times[-1] <= replay_node.AHEAD
        if i < there:
            assert (
                np.abs(np.diff(angles, axis=0)).max(axis=1) <= 1.01 * SAFE_SPEED * np.diff(times) + 1e-9
            ).all()
        assert (angles >= -0.3 - 1e-9).all()
    graph.until(lambda: np.allclose(graph.driver.here, path.at(3.0)[:3], rtol=0, atol=1e-9))


@pytest.mark.parametrize(
    ("path", "status", "named"),
    [
        (motion(first=-0.95, size=-0.2), {}, ("servo_0", "-1.006 rad", "2.09 s", "-1.000 to 0.500 rad")),
        (motion(), {"speed": [0.3] * 3}, ("servo_0", "0.63 rad/s", "0.30 rad/s")),
        (motion(), {"state": RobotStatus.FAULT, "message": "no answer"}, ("driver", "no answer")),
    ],
)
def test_what_the_driver_cannot_do_is_refused_and_nothing_moves(make, path, status, named) -> None:
    graph = make(path, start=2.0)
    graph.until(lambda: graph.node.done, **status)
    assert graph.node.refused
    assert_names(graph.node.done, *named)
    graph.until(lambda: graph.driver.count_publishers(names.CONTROL_MODE))
    assert not graph.driver.asked
    assert not [m for m in graph.driver.modes if m.mode == ControlMode.REPLAY]


def test_it_goes_by_the_simulator_where_that_is_asked(make) -> None:
    path = motion()
    graph = make(path, start=2.0, simulated=[4.0] * 3)
    graph.until(lambda: graph.node.done)
    assert not graph.node.failed
    assert_names(graph.node.done, "1.00 s")
    graph.until(lambda: np.allclose(graph.driver.here, path.at(3.0)[:3], rtol=0, atol=1e-9))


@pytest.mark.parametrize(
    ("simulated", "status", "named"),
    [
        ([0.3] * 3, {}, ("servo_0", "0.63 rad/s", "0.30 rad/s")),
        ([4.0] * 3, {"state": SimStatus.PAUSED}, ("simulator", "paused")),
        ([4.0] * 3, {"state": SimStatus.FAILED, "message": "no"}, ("simulator", "no")),
    ],
)
def test_what_the_simulator_cannot_do_is_refused(make, simulated, status, named) -> None:
    graph = make(motion(), start=2.0, simulated=simulated)
    graph.until(lambda: graph.node.done, **status)
    assert graph.node.refused
    assert_names(graph.node.done, *named)
    assert not graph.driver.asked


def test_where_no_driver_is_heard_it_goes_by_the_simulator(make, clock: Clock) -> None:
    path = motion()
    graph = make(path, alone=True, start=2.0)
    graph.until(lambda: graph.node.done)
    assert not graph.node.failed
    assert_names(graph.node.done, "1.00 s")
    graph.until(lambda: np.allclose(graph.driver.here, path.at(3.0)[:3], rtol=0, atol=1e-9))


def test_a_motion_for_the_simulator_ends_where_a_driver_joins(make, clock: Clock) -> None:
    """Its range and speed were not checked for that driver."""
    graph = make(JointPath(np.array([0.0, 60.0]), np.full((2, 3), -0.1), 3), alone=True)
    graph.until(lambda: graph.node.place > 0.2)
    Driver.say(graph.driver)
    graph.until(lambda: graph.node.done)
    assert graph.node.failed
    assert_names(graph.node.done, "driver", "joined", "again")


def test_without_a_driver_it_says_so_and_nothing_moves(make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_node, "PATIENCE", 0.3)
    graph = make(motion(), start=2.0)
    end = time.monotonic() + DEADLINE
    while not graph.node.done and time.monotonic() < end:
        graph.executor.spin_once(timeout_sec=0.01)
    assert_names(graph.node.done, "no driver", "no simulator", "tripod up", "tripod driver")
    monkeypatch.setattr(replay_node, "SOON", 0.0)
    assert_names(graph.node.waiting, "waiting", "driver", "tripod up", "tripod driver")
    assert not graph.driver.asked


def test_a_second_replay_is_refused_and_the_first_goes_on(make, clock: Clock) -> None:
    graph = make(motion(), start=2.0)
    graph.until(lambda: graph.driver.asked)
    clock.step = 0.0  # the first does not end meanwhile
    second = ReplayNode(motion(), start=2.0, rate=1.0)
    graph.executor.add_node(second)
    try:
        graph.until(lambda: second.done)
        assert second.failed
        assert_names(second.done, "bag_play", "already", "stop")
        clock.step = replay_node.PERIOD
        graph.until(lambda: graph.node.done)
        assert not graph.node.failed
        assert len({m.header.frame_id for m in graph.driver.asked}) == 1
    finally:
        graph.executor.remove_node(second)
        second.close()


def test_another_operator_ends_it(make, clock: Clock) -> None:
    graph = make(motion(), start=2.0)
    graph.until(lambda: graph.driver.asked)
    message = ControlMode(mode=ControlMode.TELEOP, source="/teleop#1")
    message.header.stamp = graph.driver.get_clock().now().to_msg()
    graph.driver.operator.publish(message)
    graph.until(lambda: graph.node.done)
    assert graph.node.failed
    assert_names(graph.node.done, "mode is TELEOP", "by teleop", "another operator")
    count, looks = len(graph.driver.asked), clock.looks
    graph.until(lambda: clock.looks > looks + 3)
    assert len(graph.driver.asked) <= count + 1  # one may have been under way


@pytest.mark.parametrize(
    ("status", "why"),
    [
        ({"state": RobotStatus.HOLDING, "message": "stopped by a service"}, "stopped by a service"),
        ({"state": RobotStatus.DISCONNECTED, "message": "mock was lost"}, "mock was lost"),
        ({"state": RobotStatus.HOLDING}, "it holds"),
    ],
)
def test_a_motion_that_the_robot_does_not_follow_ends_and_says_why(
    make, clock: Clock, status: dict, why: str
) -> None:
    times = np.array([0.0, 60.0])
    graph = make(JointPath(times, np.full((2, 3), -0.1), 3))
    graph.until(lambda: graph.node.place > 0.2)
    clock.step = 0.0

    def after(seconds: float, **status: Any) -> None:
        """Say so, and look at what the node does when so much time has passed."""
        graph.until(lambda: (graph.node._deaf_since is not None) == bool(status), **status)
        clock.now += seconds
        looks = clock.looks
        graph.until(lambda: clock.looks > looks + 2, **status)

    after(0.9 * replay_node.DEAF, **status)
    after(0.9 * replay_node.DEAF)  # it was short, and is forgotten
    after(0.9 * replay_node.DEAF, **status)
    assert not graph.node.done
    after(0.2 * replay_node.DEAF, **status)
    assert graph.node.failed
    assert_names(graph.node.done, "driver", why)
    assert not graph.node.refused


def test_paused_it_holds_the_pose_and_steps_by_a_tenth(make) -> None:
    graph = make(motion(), start=2.0)
    graph.until(lambda: graph.node.place > 2.2)
    graph.node.toggle()
    place = graph.node.place
    graph.until(lambda: len(graph.driver.asked[-1].points) == 1)
    pose = graph.driver.asked[-1].points[0].positions
    count = len(graph.driver.asked)
    graph.until(lambda: len(graph.driver.asked) > count + 3)  # it is not silent, so that nothing parks
    assert graph.driver.asked[-1].points[0].positions == pose
    graph.node.step()
    assert graph.node.place == pytest.approx(place + replay_node.PERIOD)
    graph.node.toggle()
    graph.until(lambda: graph.node.done)
    assert not graph.node.failed


def test_a_script_waits_until_it_is_wanted_tells_its_end_and_leaves(make) -> None:
    told: list[str] = []
    graph = make(motion())
    graph.executor.remove_node(graph.node)
    player = ScriptPlayer(
        JointPath(np.array([0.0, 0.2]), np.full((2, 3), -0.1), 3), graph.executor, told.append
    )

    def spun(condition: Callable[[], Any]) -> None:
        def tended() -> Any:
            player.tend()
            return condition()

        graph.until(tended)

    turns = iter(range(20))
    spun(lambda: next(turns, None) is None)
    assert not graph.driver.asked
    player.wanted = True
    spun(lambda: told)
    (line,) = told
    assert_names(line, "script: ", "0.20 s")
    assert graph.driver.here == pytest.approx([-0.1] * 3)
    spun(lambda: graph.driver.get_node_names().count("script") == 0)
    spun(lambda: graph.driver.modes[-1].mode == ControlMode.NONE)  # it is not missed
    assert graph.driver.modes[-1].source.startswith("/script#")
    assert len(told) == 1
