"""The simulator in a graph: what it publishes, which commands it follows, its services, how it starts and ends."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState, PointCloud2
from shape_msgs.msg import Mesh, SolidPrimitive
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from tripod_msgs.msg import BodyState, Compliance, ControlMode, SimStatus
from visualization_msgs.msg import MarkerArray

from tripod_graph import names
from tripod_graph.command import CommandError, CommandLimits
from tripod_graph.parameters import ParameterError
from tripod_graph.qos import LATCHED, RELIABLE, SENSOR
from tripod_graph.run import ros_arguments
from tripod_sim import SceneError, StepError, load_scene, messages
from tripod_sim.mesh.y_piece import LEVELS, y_piece
from tripod_sim.node import SimNode, _within_scene

pytestmark = pytest.mark.ros

DEADLINE = 20.0
"""For a loaded machine [s]; nothing here waits so long unless it fails."""

NAN, INF = float("nan"), float("inf")
ROOT = Path(__file__).parents[2]
MESH = y_piece(LEVELS[1])

PUBLISHED = {
    names.BODY_STATE: (BodyState, SENSOR),
    names.MESH: (Mesh, LATCHED),
    names.MAZE_MESH: (Mesh, LATCHED),
    names.BALL_SHAPE: (SolidPrimitive, LATCHED),
    names.MARKERS: (MarkerArray, SENSOR),
    names.POINT_CLOUD: (PointCloud2, SENSOR),
    names.SIM_JOINT_STATES: (JointState, RELIABLE),
    names.EFFECTOR_POSE: (PoseStamped, RELIABLE),
    names.COMPLIANCE: (Compliance, RELIABLE),
    names.SIM_STATUS: (SimStatus, RELIABLE),
    names.DIAGNOSTICS: (DiagnosticArray, RELIABLE),
}
QUIET = (names.MARKERS, names.POINT_CLOUD, names.COMPLIANCE)
"""Computed only while someone listens."""


def assert_finite(message: Any) -> None:
    """Fail on any number in a message, at any depth, that is not finite."""
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        if isinstance(value, float) or type(value).__module__ in ("array", "numpy"):
            assert np.isfinite(np.asarray(value)).all(), f"{type(message).__name__}.{name} is {value}"
        elif hasattr(value, "get_fields_and_field_types"):
            assert_finite(value)
        elif isinstance(value, list) and value and hasattr(value[0], "get_fields_and_field_types"):
            for part in value:
                assert_finite(part)


class Graph:
    """The node under test in a namespace of its own, and one that listens, commands and calls services."""

    def __init__(self, **parameters: object) -> None:
        """`parameters`: of the node under test, as on its command line."""
        # a domain may be shared by chance with other tests on the machine, a namespace not
        words = [f"__ns:=/robot_{random.getrandbits(48):x}", *(f"{k}:={v}" for k, v in parameters.items())]
        rclpy.init(args=ros_arguments(words), domain_id=random.SystemRandom().randint(1, 100))
        self.executor = SingleThreadedExecutor()
        self.ear = Node("ear")
        self.executor.add_node(self.ear)
        self.heard: dict[str, list[Any]] = {topic: [] for topic in PUBLISHED}
        self.node: Any = None
        self.mode = self.ear.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
        self.trajectory = self.ear.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)

    def start(self, before_it_listens: Callable[[], None] = lambda: None) -> "Graph":
        self.node = SimNode()
        before_it_listens()
        self.executor.add_node(self.node)
        for topic in PUBLISHED:
            if topic not in QUIET:
                self.listen(topic)
        self.wait(self.trajectory.get_subscription_count, "the simulator's subscription")
        self.wait(self.mode.get_subscription_count, "the simulator's subscription")
        return self

    def listen(self, topic: str) -> Any:
        def keep(message: Any) -> None:
            assert_finite(message)
            self.heard[topic].append(message)

        kind, qos = PUBLISHED[topic]
        return self.ear.create_subscription(kind, topic, keep, qos)

    def wait(self, condition: Callable[[], Any], what: str) -> Any:
        deadline = time.monotonic() + DEADLINE
        while not (value := condition()):
            assert time.monotonic() < deadline, f"waited in vain for {what}; status: {self.last_status()}"
            self.executor.spin_once(timeout_sec=0.02)
        return value

    def spin(self, seconds: float) -> None:
        """Let time pass, to see that something does not happen."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=0.02)

    def last_status(self) -> Any:
        statuses = self.heard[names.SIM_STATUS]
        return statuses[-1] if statuses else None

    def next(self, topic: str, condition: Callable[[Any], bool] = lambda message: True) -> Any:
        """Wait for a message that comes from now on and meets the condition."""
        heard = self.heard[topic]
        heard.clear()
        return self.wait(lambda: next((m for m in heard if condition(m)), None), f"a message on {topic}")

    def status(self, **fields: object) -> Any:
        """Wait for a status with these values."""
        return self.next(names.SIM_STATUS, lambda s: all(getattr(s, k) == v for k, v in fields.items()))

    def joints(self) -> list[float]:
        return list(self.next(names.SIM_JOINT_STATES).position)

    def call(self, name: str, request: object) -> Any:
        kind = SetBool if isinstance(request, SetBool.Request) else Trigger
        client = self.ear.create_client(kind, name)
        self.wait(client.service_is_ready, f"service {name}")
        future = client.call_async(request)
        self.wait(future.done, f"the answer of {name}")
        self.ear.destroy_client(client)
        return future.result()

    def pause(self, paused: bool) -> Any:
        return self.call(names.SIM_PAUSE, SetBool.Request(data=paused))

    def reset(self) -> Any:
        return self.call(names.SIM_RESET, Trigger.Request())

    def step(self) -> Any:
        return self.call(names.SIM_STEP, Trigger.Request())

    def choose(self, mode: int) -> None:
        self.mode.publish(ControlMode(mode=mode, source="test"))
        if mode in (ControlMode.STOP, ControlMode.TELEOP, ControlMode.IK, ControlMode.REPLAY):
            self.wait(lambda: self.node._mode.mode == mode, f"mode {mode}")

    def command(
        self, positions: Sequence[float], joints: Sequence[str] = names.SERVOS, seconds: float = 0.0
    ) -> None:
        point = JointTrajectoryPoint(positions=list(positions))
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(seconds * 1e9), 10**9)
        self.trajectory.publish(JointTrajectory(joint_names=list(joints), points=[point]))

    def close(self) -> None:
        if self.node:
            self.executor.remove_node(self.node)
            self.node.close()
            assert not self.node._physics.is_alive()
            self.node.destroy_node()
        self.ear.destroy_node()
        self.executor.shutdown()
        rclpy.try_shutdown()


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Graph]]:
    """Make graphs, on the coarse mesh unless told; none outlives the test."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    made: list[Graph] = []

    def graph(**parameters: object) -> Graph:
        made.append(Graph(**{"set": "mesh.level=1", **parameters}))
        return made[-1]

    before = sys.getswitchinterval()
    yield graph
    sys.setswitchinterval(before)
    for graph in made:
        graph.close()


def test_it_publishes_every_topic_of_its_table_with_the_right_sizes(make) -> None:
    graph = make().start()
    for topic in QUIET:
        graph.listen(topic)
    for topic, messages_heard in graph.heard.items():
        graph.wait(lambda heard=messages_heard: heard, topic)
    own = graph.node.get_namespace()
    found = dict(graph.ear.get_publisher_names_and_types_by_node("sim", own))
    expected = {t if t.startswith("/") else f"{own}/{t}" for t in PUBLISHED}
    assert set(found) == expected | {"/rosout", "/parameter_events"}

    count = len(MESH.nodes)
    body, status = graph.next(names.BODY_STATE), graph.next(names.SIM_STATUS)
    assert len(body.positions) == 3 * count
    assert body.topology_id == MESH.topology_id
    assert np.abs(np.reshape(body.positions, (-1, 3)) - MESH.nodes).max() < 0.01
    mesh = graph.heard[names.MESH][0]
    assert len(mesh.vertices) == count
    assert len(mesh.triangles) == len(MESH.surface)
    joints = graph.next(names.SIM_JOINT_STATES)
    assert list(joints.name) == [*names.SERVOS, names.SLIDE]
    assert len(joints.position) == len(joints.effort) == 4
    assert abs(graph.next(names.EFFECTOR_POSE).pose.position.z) < 0.01
    compliance = graph.next(names.COMPLIANCE)
    w = np.reshape(compliance.w, (9, 9))
    np.testing.assert_allclose(w, w.T, rtol=0, atol=1e-12 * np.abs(w).max())
    assert np.linalg.eigvalsh(w).min() > 0
    cloud, (marker,) = graph.next(names.POINT_CLOUD), graph.next(names.MARKERS).markers
    assert cloud.width == count
    assert len(marker.points) == 3 * len(MESH.surface)
    for header in (m.header for m in (body, status, joints, compliance, cloud, marker)):
        assert header.frame_id == "world"
        assert abs(header.stamp.sec - time.time()) < DEADLINE

    assert status.scene == "tripod"
    assert status.dt == 0.005
    assert status.state == SimStatus.PARKED
    assert status.message == status.last_rejection == ""
    assert status.time == pytest.approx(status.step * 0.005)
    later = graph.next(names.SIM_STATUS, lambda s: s.step > status.step + 20)
    assert later.step_time_p99 >= later.step_time_median > 0
    assert later.capacity == pytest.approx(0.005 / later.step_time_median)
    assert later.real_time_factor > 0
    assert later.strain_energy > 0
    diagnostics = graph.next(names.DIAGNOSTICS, lambda m: m.status[0].name == f"{own}/sim").status[0]
    values = {pair.key: float(pair.value) for pair in diagnostics.values}
    assert set(values) == {"real-time factor", "median step [s]", "missed"}
    assert diagnostics.level in (b"\x00", b"\x01")  # a busy machine may be slower than time


def test_markers_cloud_and_compliance_are_made_only_while_someone_listens(make, monkeypatch) -> None:
    graph = make(body_rate=100.0).start()
    made = {names.MARKERS: 0, names.POINT_CLOUD: 0, names.COMPLIANCE: 0}

    def counted(topic: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def count(*arguments: Any) -> Any:
            made[topic] += 1
            return function(*arguments)

        return count

    physics = graph.node._physics
    monkeypatch.setattr(
        graph.node._scene_markers,
        "serialised",
        counted(names.MARKERS, graph.node._scene_markers.serialised),
    )
    monkeypatch.setattr(messages, "cloud_message", counted(names.POINT_CLOUD, messages.cloud_message))
    compliance = counted(names.COMPLIANCE, physics._simulation.compliance)
    monkeypatch.setattr(physics._simulation, "compliance", compliance)

    def unheard() -> dict[str, int]:
        """Return what is made while ten bodies and three statuses are published."""
        before = dict(made)
        for topic, count in ((names.BODY_STATE, 10), (names.SIM_STATUS, 3)):
            heard = graph.heard[topic]
            heard.clear()
            graph.wait(lambda heard=heard, count=count: len(heard) >= count, topic)
        return {topic: made[topic] - before[topic] for topic in made}

    assert unheard() == dict.fromkeys(QUIET, 0)
    ears = [graph.listen(topic) for topic in QUIET]
    for topic in QUIET:
        graph.next(topic)
    assert min(unheard().values()) > 0
    for ear in ears:
        graph.ear.destroy_subscription(ear)
    node = graph.node
    for publisher in (node._markers, node._cloud, node._compliance):
        graph.wait(lambda p=publisher: p.get_subscription_count() == 0, "the end of the subscription")
    graph.wait(lambda: not physics.want_compliance, "the end of compliances")
    assert unheard() == dict.fromkeys(QUIET, 0)


def test_it_begins_in_stop_and_refuses_commands(make) -> None:
    graph = make().start()
    graph.command([-0.5, -0.5, -0.5])
    status = graph.status(rejected_commands=1)
    assert status.last_rejection == "control_mode is STOP; choose another mode first"
    assert status.state == SimStatus.PARKED
    assert graph.joints() == [0, 0, 0, 0]


def test_it_follows_a_command_within_its_limits(make) -> None:
    """At 2 rad/s, 0.8 rad take 0.4 s and more; one step moves no more than 0.1 s of it, however late it comes."""
    graph = make(angle_speed=2.0, slide_speed=0.05, pose_rate=1000.0, timeout=5.0).start()
    graph.choose(ControlMode.TELEOP)
    heard = graph.heard[names.SIM_JOINT_STATES]
    graph.joints()
    began = time.monotonic()
    target = [-0.8, -0.4, 0.2, 0.01]
    graph.command(target[::-1], [*names.SERVOS, names.SLIDE][::-1])
    graph.wait(lambda: list(heard[-1].position) == pytest.approx(target, abs=1e-9), "the target")
    assert time.monotonic() - began >= 0.4
    status = graph.status(state=SimStatus.RUNNING)
    assert status.rejected_commands == 0
    path = np.array([m.position for m in heard])
    moves = np.diff(path, axis=0) * np.sign(target)
    assert (moves >= 0).all()
    assert (moves[:, :3].max(axis=0) <= 0.2 + 1e-9).all()
    assert len(np.unique(path[:, 0])) > 5
    assert (
        graph.next(names.EFFECTOR_POSE).pose.position.x > 0.005
    )  # and the body follows the servo that bends most


def test_a_trajectory_takes_the_time_that_it_says(make) -> None:
    graph = make(pose_rate=1000.0, timeout=5.0).start()
    graph.choose(ControlMode.IK)
    heard = graph.heard[names.SIM_JOINT_STATES]
    began = time.monotonic()
    graph.command([-0.3, -0.3, -0.3], seconds=0.6)
    graph.wait(lambda: heard and heard[-1].position[0] <= -0.3 + 1e-9, "the target")
    assert time.monotonic() - began >= 0.6
    assert any(-0.2 < m.position[0] < -0.1 for m in heard)


def test_bad_commands_are_refused_counted_and_reported_and_move_nothing(make) -> None:
    graph = make().start()
    graph.choose(ControlMode.TELEOP)
    own, slide = names.SERVOS, (*names.SERVOS, names.SLIDE)
    empty = JointTrajectory(joint_names=list(own))
    bad: list[tuple[Callable[[], None], str]] = [
        (lambda: graph.command([0, NAN, 0]), "point 0: servo_1 is nan rad, allowed is -2.1 to 0.6 rad"),
        (lambda: graph.command([0, 0, INF]), "point 0: servo_2 is inf rad"),
        (lambda: graph.command([0.7, 0, 0]), "point 0: servo_0 is 0.7 rad, allowed is -2.1 to 0.6 rad"),
        (lambda: graph.command([-0.1] * 3 + [0.05], slide), "point 0: slide is 0.05 m, allowed is 0 to 0.04 m"),
        (lambda: graph.command([-0.1] * 3, ["servo_0", "servo_1", "elbow"]), "unknown joint 'elbow'; joints: servo_0,"),
        (lambda: graph.command([-0.1] * 3, ["servo_0", "servo_1", "servo_1"]), "joint 'servo_1' is named twice"),
        (lambda: graph.command([-0.1] * 2, ["servo_0", "servo_1"]), "joint 'servo_2' is missing"),
        (lambda: graph.command([-0.1] * 4), "point 0 has 4 positions for 3 joints"),
        (lambda: graph.command([-0.1] * 3, seconds=-1), "time of point 0 is -1 s"),
        (lambda: graph.trajectory.publish(empty), "0 points with 0 times; at least one of each is needed"),
        (lambda: graph.choose(77), "control mode 77 is unknown; modes: 0 STOP, 1 TELEOP, 2 IK, 3 REPLAY"),
    ]  # fmt: skip
    for count, (send, reason) in enumerate(bad, start=1):
        send()
        status = graph.status(rejected_commands=count)
        assert reason in status.last_rejection
        assert graph.joints() == [0, 0, 0, 0]
    assert graph.node._mode.mode == ControlMode.TELEOP
    graph.command([-0.1] * 3)
    graph.wait(lambda: graph.joints()[0] < -0.05, "a good command after the bad")
    assert graph.status().rejected_commands == len(bad)


def test_stop_holds_where_the_joints_are(make) -> None:
    graph = make(angle_speed=1.0).start()
    graph.choose(ControlMode.TELEOP)
    graph.command([-1.5, -1.5, -1.5], seconds=1.0)
    graph.wait(lambda: graph.joints()[0] < -0.1, "motion")
    graph.choose(ControlMode.STOP)
    graph.status(state=SimStatus.HOLDING)
    where = graph.joints()
    assert -1.4 < where[0] < -0.1
    graph.spin(0.2)
    assert graph.joints() == where


def test_silence_holds_and_then_parks(make) -> None:
    graph = make(timeout=0.15, park_after=0.6, park="[-0.1, -0.1, -0.1, 0.005]", angle_speed=20.0).start()
    graph.choose(ControlMode.TELEOP)
    began = time.monotonic()
    graph.command([-0.3, -0.2, 0.1])
    target = pytest.approx([-0.3, -0.2, 0.1, 0], abs=1e-9)
    graph.wait(lambda: graph.joints() == target, "the target")
    assert graph.status(state=SimStatus.HOLDING).message == ""
    graph.wait(lambda: graph.joints() != target, "leaving the target")
    assert time.monotonic() - began >= 0.75
    parked = pytest.approx([-0.1, -0.1, -0.1, 0.005], abs=1e-9)
    graph.wait(lambda: graph.joints() == parked, "the park position")
    graph.status(state=SimStatus.PARKED)


def test_the_newest_of_several_operators_decides_for_a_late_simulator(make) -> None:
    """The last word of each waits for the simulator, in any order: it must keep them all, not the last to arrive."""
    graph = make()
    operators = [graph.ear.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED) for _ in range(6)]
    for stamp, operator in enumerate(operators, start=1):
        newest = stamp == 3
        word = ControlMode(mode=ControlMode.IK if newest else ControlMode.TELEOP, source=str(stamp))
        word.header.stamp.sec = 1000 if newest else stamp
        operator.publish(word)

    def arrive() -> None:
        deadline = time.monotonic() + DEADLINE
        while not all(operator.get_subscription_count() for operator in operators):
            assert time.monotonic() < deadline, "the operators do not find the simulator"
            time.sleep(0.01)
        time.sleep(0.2)

    graph.start(arrive)
    graph.wait(lambda: graph.node._mode.mode == ControlMode.IK, "the newest word")
    graph.spin(0.2)
    assert graph.node._mode.mode == ControlMode.IK
    assert graph.status().rejected_commands == 0


def body_at_start(graph: Graph) -> tuple[float, ...]:
    """Reset and return the positions of step 0."""
    assert graph.reset().success
    return tuple(graph.next(names.BODY_STATE, lambda m: m.step == 0).positions)


def test_pause_step_and_reset(make) -> None:
    graph = make().start()
    answer = graph.step()
    assert not answer.success
    assert answer.message == "not paused; call sim/pause first"
    answer = graph.pause(True)
    assert (answer.success, answer.message) == (True, "paused")
    first = graph.status(state=SimStatus.PAUSED).step
    for k in (1, 2, 3):
        answer = graph.step()
        assert (answer.success, answer.message) == (True, f"step {first + k}")
    assert graph.status(state=SimStatus.PAUSED).step == first + 3
    graph.next(names.BODY_STATE, lambda m: m.step == first + 3)
    graph.next(names.BODY_STATE, lambda m: m.step == first + 3)  # again, for who comes late

    start = body_at_start(graph)
    assert graph.status(state=SimStatus.PAUSED).step == 0
    answer = graph.pause(False)
    assert (answer.success, answer.message) == (True, "running")
    graph.choose(ControlMode.TELEOP)
    graph.command([-0.4, -0.4, -0.4])
    graph.wait(lambda: graph.joints()[0] < -0.3, "motion")
    graph.pause(True)
    assert body_at_start(graph) == start
    graph.pause(False)
    assert graph.joints() == [0, 0, 0, 0]  # the old command is gone
    assert graph.status().state == SimStatus.PARKED


def test_reset_while_a_command_runs_goes_to_the_start_and_stays(make) -> None:
    graph = make(timeout=10.0, pose_rate=1000.0).start()
    graph.choose(ControlMode.TELEOP)
    graph.command([-0.5, -0.5, -0.5], seconds=3.0)
    graph.wait(lambda: graph.joints()[0] < -0.05, "motion")
    assert graph.reset().message == "back in the start state"
    assert graph.joints() == [0, 0, 0, 0]
    graph.spin(0.1)
    assert graph.joints() == [0, 0, 0, 0]
    assert graph.status().rejected_commands == 0


def test_a_failed_step_is_reported_and_reset_recovers(make, monkeypatch) -> None:
    graph = make().start()
    graph.status(state=SimStatus.PARKED)

    def crush(joints: object) -> None:
        raise StepError("element 7 is turned inside out")

    with monkeypatch.context() as patch:
        patch.setattr(graph.node._physics._simulation, "step", crush)
        status = graph.status(state=SimStatus.FAILED)
        assert status.message == "element 7 is turned inside out; call sim/reset"
        assert graph.status().step == status.step
        for answer in (graph.pause(True), graph.pause(False), graph.step()):
            assert not answer.success
            assert answer.message == "element 7 is turned inside out"
        body = graph.next(names.BODY_STATE)
        assert body.step == status.step  # the last good state, still shown
        report = graph.next(
            names.DIAGNOSTICS, lambda m: m.status[0].name.startswith(graph.node.get_namespace())
        )
        assert report.status[0].level == b"\x02"
        assert report.status[0].message == "element 7 is turned inside out"
    assert graph.reset().success
    status = graph.status(state=SimStatus.PARKED)
    assert status.message == ""
    graph.next(names.SIM_STATUS, lambda s: s.step > status.step)


def test_silicone_works_without_servos(make) -> None:
    graph = make(scene="silicone").start()
    status = graph.status(state=SimStatus.RUNNING)
    assert status.scene == "silicone"
    first = graph.next(names.BODY_STATE)
    graph.next(names.BODY_STATE, lambda m: m.step > first.step and m.positions != first.positions)
    graph.choose(ControlMode.TELEOP)
    graph.command([0, 0, 0])
    assert graph.status(rejected_commands=1).last_rejection == "scene 'silicone' has no servos"
    graph.listen(names.COMPLIANCE)
    graph.spin(0.3)
    for topic in (names.SIM_JOINT_STATES, names.EFFECTOR_POSE, names.COMPLIANCE):
        assert not graph.heard[topic]
    assert graph.status().state == SimStatus.RUNNING
    assert graph.reset().success


@pytest.mark.parametrize("scene", ["pendulum", "cloth"])
def test_a_body_of_springs_is_shown_by_its_surface(make, scene: str) -> None:
    graph = make(scene=scene, set="springs.nodes=5").start()
    mesh = graph.wait(lambda: graph.heard[names.MESH], "the mesh")[0]
    body = graph.next(names.BODY_STATE)
    graph.next(names.BODY_STATE, lambda m: m.step > body.step and m.positions != body.positions)
    assert len(body.positions) == 3 * len(mesh.vertices)
    assert body.topology_id == graph.node._skin.topology_id
    assert max(max(t.vertex_indices) for t in mesh.triangles) < len(mesh.vertices)
    graph.listen(names.MARKERS)
    assert len(graph.next(names.MARKERS).markers[0].points) == 3 * len(mesh.triangles)
    assert graph.reset().success


def test_maze_and_ball_are_told_once_and_shown_by_markers(make) -> None:
    graph = make(scene="maze", set="mesh.level=1;maze.source=first").start()
    shape = graph.wait(lambda: graph.heard[names.BALL_SHAPE], "the ball")[0]
    assert (shape.type, list(shape.dimensions)) == (SolidPrimitive.SPHERE, [0.002])
    maze = graph.wait(lambda: graph.heard[names.MAZE_MESH], "the maze")[0]
    z = [p.z for p in maze.vertices]
    assert (min(z), max(z)) == pytest.approx((0.006, 0.012))  # above the centre of the disc
    assert len(graph.heard[names.MAZE_MESH]) == len(graph.heard[names.BALL_SHAPE]) == 1
    graph.listen(names.MARKERS)
    _, plate, ball = graph.next(names.MARKERS).markers
    assert len(plate.points) == 3 * len(maze.triangles)
    assert plate.pose.position.z < ball.pose.position.z < plate.pose.position.z + max(z)


def test_without_maze_and_ball_that_is_what_is_told(make) -> None:
    graph = make().start()
    assert not graph.wait(lambda: graph.heard[names.MAZE_MESH], "the maze")[0].vertices
    assert not graph.wait(lambda: graph.heard[names.BALL_SHAPE], "the ball")[0].dimensions


def test_an_unstable_scheme_is_told_in_the_status_and_stops_at_the_last_good_state(make) -> None:
    graph = make(scene="pendulum", set="springs.node_mass=0.005;inertia.substeps=off").start()
    status = graph.status(state=SimStatus.FAILED)
    assert "overflows: the explicit scheme is unstable at dt 0.005 s" in status.message
    told = [s for s in graph.heard[names.SIM_STATUS] if s.message.startswith("unstable: since step")]
    assert graph.reset().success
    if not told:
        graph.next(names.SIM_STATUS, lambda s: s.message.startswith("unstable: since step"))


def test_the_estimated_error_of_the_steps_and_their_parts_are_in_the_status(make) -> None:
    graph = make(set="inertia.scheme=bdf2;dt=auto;time_error.tolerance=1e-7").start()
    status = graph.next(names.SIM_STATUS, lambda s: s.step > 5)
    assert status.parts >= 1
    assert 0 <= status.effector_time_error <= status.time_error < 1e-3


def test_an_estimate_that_nobody_asks_for_is_told_as_unknown(make) -> None:
    status = make().start().next(names.SIM_STATUS, lambda s: s.step > 5)
    assert (status.time_error, status.effector_time_error, status.parts) == (-1.0, -1.0, 1)


def test_an_effector_without_servos_has_a_compliance_of_its_own(make) -> None:
    graph = make(scene="silicone", set="mesh.level=1;effector={}").start()
    graph.listen(names.COMPLIANCE)
    compliance = graph.next(names.COMPLIANCE)
    assert list(compliance.joint_names) == []
    assert len(compliance.angles) == len(compliance.torques) == 0
    assert len(compliance.w) == 36
    assert graph.next(names.EFFECTOR_POSE).header.frame_id == "world"


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        ({"scene": "tripot"}, SceneError, "scene 'tripot' is unknown; .*did you mean 'tripod'"),
        ({"set": "mesh.level=1;dt=soon"}, SceneError, "dt is 'soon'; it must be a number"),
        ({"body_rate": 0}, ParameterError, "parameter 'body_rate' is 0.0; allowed: 0.1 to 1000 Hz"),
        ({"pose_rate": "fast"}, ParameterError, "parameter 'pose_rate' is 'fast'; it must be of type float"),
        ({"speed": 1.0}, ParameterError, "parameter 'speed' is unknown; parameters: .*angle_speed"),
        ({"park": "[0.0, 0.0]"}, CommandError, "park position has 2 values; it needs 4"),
        ({"angle_max": -0.1}, CommandError, "park position: servo_0 is 0 rad, allowed is -2.1 to -0.1 rad"),
        ({"angle_max": -2.5, "angle_min": -3.0}, CommandError, "park position: servo_0 is 0 rad"),
        ({"set": "mesh.level=1;servos.angles=[0.1,0,0]", "angle_max": 0.05}, CommandError,
         "start position: servo_0 is 0.1 rad, allowed is -2.1 to 0.05 rad"),
        ({"set": "mesh.level=1;solver.max_iterations=1;solver.max_halvings=0;servos.angles=[-2,-2,-2]"}, ParameterError,
         "scene 'tripod' has no start state: step 1 at 0 s cannot be saved"),
    ],
)  # fmt: skip
def test_bad_parameters_are_refused_by_name(make, parameters, error, message: str) -> None:
    graph = make(**parameters)
    with pytest.raises(error, match=message):
        graph.start()


def test_limits_are_the_narrower_of_parameters_and_scene() -> None:
    scene = load_scene("tripod", ["servos.angle_min=-1.0", "servos.angle_max=0.5", "servos.slide_max=0.03"])
    wide = _within_scene(CommandLimits(-2.0, 0.6, slide_max=0.04), scene)
    assert (wide.angle_min, wide.angle_max, wide.slide_max) == (-1.0, 0.5, 0.03)
    narrow = _within_scene(CommandLimits(-0.5, 0.2, slide_max=0.01), scene)
    assert (narrow.angle_min, narrow.angle_max, narrow.slide_max) == (-0.5, 0.2, 0.01)
    assert _within_scene(CommandLimits(), replace(scene, servos=None)) == CommandLimits()
    apart = SimpleNamespace(servos=replace(scene.servos, angle_min=-2.0, angle_max=-1.0))
    with pytest.raises(ParameterError, match=r"leave nothing of the scene's -2.0 to -1.0 rad"):
        _within_scene(CommandLimits(-0.5, 0.6), apart)


class Process:
    """The node as a user starts it; what it prints goes to a file."""

    def __init__(self, log: Path, *words: str) -> None:
        self._log = log
        environment = os.environ | {
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_DOMAIN_ID": str(random.SystemRandom().randint(1, 100)),
            "RCUTILS_LOGGING_BUFFERED_STREAM": "0",
        }
        own = f"__ns:=/robot_{random.getrandbits(48):x}"
        with log.open("w") as file:
            self.child = subprocess.Popen(
                [sys.executable, "-m", "tripod_sim.node", *words, own],
                cwd=ROOT,
                env=environment,
                stdout=file,
                stderr=file,
            )

    def output(self) -> str:
        return self._log.read_text()


@pytest.fixture
def launch(tmp_path: Path) -> Iterator[Callable[..., Process]]:
    started: list[Process] = []

    def run(*words: str) -> Process:
        started.append(Process(tmp_path / f"{len(started)}.log", *words))
        return started[-1]

    yield run
    for process in started:
        with contextlib.suppress(ProcessLookupError):
            process.child.kill()
        process.child.wait()


def test_the_process_refuses_bad_parameters_with_code_2_in_one_line(launch) -> None:
    refused = [
        (launch("scene:=tripot"), "sim: scene 'tripot' is unknown; scenes: "),
        (launch("set:=material.young=-1"), "sim: material.young is -1.0; it must be above 0 Pa"),
        (launch("body_rate:=0"), "sim: parameter 'body_rate' is 0.0; allowed: 0.1 to 1000 Hz"),
    ]
    for process, message in refused:
        assert process.child.wait(DEADLINE) == 2
        assert process.output().startswith(message)
        assert process.output().count("\n") == 1


def test_the_process_ends_in_order_on_signals(launch) -> None:
    running = [(launch("set:=mesh.level=1"), number) for number in (signal.SIGINT, signal.SIGTERM)]
    deadline = time.monotonic() + DEADLINE
    for process, number in running:
        while "scene tripod: 144 nodes" not in process.output():
            assert process.child.poll() is None, process.output()
            assert time.monotonic() < deadline, process.output()
            time.sleep(0.02)
        process.child.send_signal(number)
    for process, _ in running:
        assert process.child.wait(DEADLINE) == 0
        assert process.output().count("\n") == 1  # the greeting, and no traceback
