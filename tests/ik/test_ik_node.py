import os
import random
import signal
import subprocess
import sys
import time
from array import array

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu, JointState
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import Compliance, ControlMode, IkStatus

from tests.ik.plant import SpringRobot
from tripod_graph import names
from tripod_graph.command import CommandFollower, CommandLimits
from tripod_graph.parameters import ParameterError
from tripod_graph.qos import LATCHED, RELIABLE, SENSOR
from tripod_ik.certificate import kkt_residual
from tripod_ik.model import StaticModel
from tripod_ik.node import PARAMETERS, IkNode
from tripod_ik.tracker import LONGEST_DT
from tripod_sim import load_scene
from tripod_sim.scene_file import scene_to_toml

pytestmark = pytest.mark.ros

WORKING = np.full(3, -1.4965)
NAN = float("nan")


class FakeSim(Node):
    """The graph around the node under test: a robot that obeys trajectories, an operator, and ears."""

    def __init__(self):
        super().__init__("fake_sim")
        self.robot = SpringRobot(slide=0.035)
        self.follower = CommandFollower(CommandLimits(), [*WORKING, 0.035])
        self.running, self.spoil = True, lambda message: None
        self.states, self.commands, self.diagnostics, self.stamp = [], [], [], 0.0
        self.compliance = self.create_publisher(Compliance, names.COMPLIANCE, RELIABLE)
        self.mode = self.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
        self.target = self.create_publisher(PoseStamped, names.TARGET_POSE, RELIABLE)
        self.create_subscription(JointTrajectory, names.JOINT_TRAJECTORY, self.on_command, RELIABLE)
        self.create_subscription(IkStatus, names.IK_STATUS, self.states.append, RELIABLE)
        self.create_subscription(DiagnosticArray, names.DIAGNOSTICS, self.diagnostics.append, RELIABLE)
        self.create_timer(0.01, self.publish)

    @property
    def angles(self):
        return self.follower.joints[:3]

    def on_command(self, message):
        self.commands.append(message)
        times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points]
        positions = [list(p.positions) for p in message.points]
        self.follower.accept(message.joint_names, times, positions, time.monotonic())

    def publish(self):
        self.follower.setpoint(time.monotonic())
        if not self.running:
            return
        state = self.robot.state(self.angles)
        message = Compliance()
        message.header.frame_id = "world"
        message.joint_names = list(state.joint_names)
        message.angles, message.torques = array("d", state.angles), array("d", state.torques)
        p = message.effector.position
        p.x, p.y, p.z = (float(v) for v in state.effector)
        message.equilibrium_offset = state.equilibrium_offset
        message.w = array("d", state.W.ravel())
        message.slide = 0.035
        self.spoil(message)
        self.compliance.publish(message)

    def say_mode(self, mode, *, stamp=None):
        self.stamp += 1.0
        message = ControlMode(mode=mode, source="test")
        message.header.stamp.sec = int(self.stamp if stamp is None else stamp)
        self.mode.publish(message)

    def say_target(self, position, frame="world"):
        message = PoseStamped()
        message.header.frame_id = frame
        p = message.pose.position
        p.x, p.y, p.z = (float(v) for v in position)
        self.target.publish(message)


class Graph:
    def __init__(self):
        rclpy.init(domain_id=random.SystemRandom().randint(1, 100))
        self.executor = SingleThreadedExecutor()
        self.sim = FakeSim()
        self.executor.add_node(self.sim)
        self.nodes = [self.sim]

    def start(self, **parameters):
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        before = Node.__init__
        node = None
        try:
            Node.__init__ = lambda self, name: before(self, name, parameter_overrides=overrides)
            node = IkNode()
        finally:
            Node.__init__ = before
        self.nodes.append(node)
        self.executor.add_node(node)
        sim = self.sim
        self.wait(lambda: sim.mode.get_subscription_count() and sim.target.get_subscription_count())
        self.wait(lambda: sim.compliance.get_subscription_count() and sim.states)
        return node

    def wait(self, condition, seconds=10.0):
        deadline = time.monotonic() + seconds
        while not (value := condition()):
            last = self.sim.states[-1] if self.sim.states else None
            assert time.monotonic() < deadline, f"nothing after {seconds} s; last status: {last}"
            self.executor.spin_once(timeout_sec=0.05)
        return value

    def spin(self, seconds):
        """Let time pass, to see that something does not happen."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=0.02)

    def wait_state(self, state, message=""):
        """Wait for a status in that state, newer than this call."""
        seen = len(self.sim.states)
        return self.wait(
            lambda: next(
                (s for s in self.sim.states[seen:] if s.state == state and message in s.message), None
            )
        )

    def close(self):
        for node in self.nodes:
            self.executor.remove_node(node)
        for node in self.nodes[1:]:
            node.close()
        self.sim.destroy_node()
        self.executor.shutdown()
        rclpy.try_shutdown()


def near(sim, offset):
    """Return the point at `offset` [m] from where the effector begins."""
    return sim.robot.rest(WORKING) + np.array(offset)


@pytest.fixture
def graph(monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    graph = Graph()
    yield graph
    graph.close()


def test_out_of_its_mode_it_says_idle_and_commands_nothing(graph):
    graph.start()
    sim = graph.sim
    sim.say_target(near(sim, [0.002, 0, 0]))
    sim.say_mode(ControlMode.TELEOP)
    sim.states.clear()
    graph.wait(lambda: len(sim.states) >= 3)
    assert {s.state for s in sim.states} == {IkStatus.IDLE}
    assert not sim.commands


def test_it_begins_at_rest_and_follows_a_target(graph):
    graph.start()
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    first = graph.wait_state(IkStatus.TRACKING, "no target yet")
    assert list(first.command) == pytest.approx(WORKING, abs=1e-12)
    graph.wait(lambda: len(sim.commands) > 20)
    assert sim.angles == pytest.approx(WORKING, abs=1e-6)

    target = near(sim, [0.002, -0.001, 0.001])
    sim.say_target(target)
    graph.wait(lambda: np.linalg.norm(sim.robot.rest(sim.angles) - target) < 1e-6)
    status = graph.wait(
        lambda: sim.states[-1] if sim.states[-1].error < 1e-6 and sim.states[-1].message == "" else None
    )
    assert status.state == IkStatus.TRACKING
    assert (status.target.x, status.target.y, status.target.z) == pytest.approx(tuple(target))
    assert status.residual < 1e-6
    assert status.solver_status == "solved"
    assert 0 < status.solve_time < 0.1
    assert not status.active_limits
    assert sim.follower.rejected == 0
    command = sim.commands[-1]
    assert (command.header.stamp.sec, command.header.stamp.nanosec) == (0, 0)
    assert tuple(command.joint_names) == names.SERVOS
    assert len(command.points) == 1
    steps = np.abs(np.diff([c.points[0].positions for c in sim.commands], axis=0))
    assert steps.max() <= 3.0 * 0.1 + 1e-9
    assert steps.max() > 1e-3
    assert any(s.residual < 0.9 * s.error for s in sim.states if s.error > 1e-4)


def test_commands_keep_to_the_speed_that_is_set(graph):
    graph.start(angle_speed=0.2)
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    graph.wait_state(IkStatus.TRACKING)
    began = time.monotonic()
    sim.say_target(near(sim, [0, 0, 0.1]))
    graph.spin(0.6)
    moved = np.abs(np.array(sim.commands[-1].points[0].positions) - WORKING).max()
    # the first command towards the target also has the time since the command before it, which was before `began`
    assert 0.02 < moved <= 0.2 * (time.monotonic() - began + LONGEST_DT)
    assert "servo_0 speed" in sim.states[-1].active_limits


def test_an_unreachable_target_gives_the_closest_pose_and_names_the_limits(graph):
    graph.start(angle_min=-1.6, angle_max=-1.4)
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    sim.say_target(near(sim, [0, 0, 0.1]))
    status = graph.wait_state(IkStatus.CLOSEST)
    assert set(status.active_limits) <= {f"{n} angle {side}" for n in names.SERVOS for side in ("min", "max")}
    assert status.active_limits
    assert status.residual > 0.05
    angles = np.array([c.points[0].positions for c in sim.commands])
    assert angles.min() >= -1.6
    assert angles.max() <= -1.4


def test_box_and_hard_torque_limit_are_parameters(graph):
    rest = SpringRobot(slide=0.035).rest(WORKING)
    low, high = (rest - 0.1).tolist(), (rest + np.array([0.001, 0.1, 0.1])).tolist()
    graph.start(box_low=low, box_high=high, hard=True, torque_max=0.018)
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    sim.say_target(near(sim, [0.003, 0.0, 0.0]))
    graph.wait(lambda: list(sim.states[-1].active_limits) == ["effector x"])
    graph.wait(lambda: abs(sim.robot.rest(np.array(sim.states[-1].command))[0] - rest[0] - 0.001) < 1e-6)
    sim.say_target(near(sim, [0.0, 0.0, 0.03]))

    def most():
        command = sim.states[-1].command
        return np.abs(sim.robot.state(np.array(command)).torques).max() if command else 0.0

    graph.wait(lambda: sum("torque" in name for name in sim.states[-1].active_limits) == 3)
    graph.wait(lambda: abs(most() - 0.018) < 1e-7)  # a soft one is passed by more


def test_the_status_tells_what_is_missing_of_the_tilt(graph):
    graph.start(goal="orientation")
    sim, message = graph.sim, PoseStamped()
    sim.say_mode(ControlMode.IK)
    assert graph.wait_state(IkStatus.TRACKING).tilt_error == pytest.approx(0.0, abs=1e-9)
    message.header.frame_id = "world"
    p, q = message.pose.position, message.pose.orientation
    p.x, p.y, p.z = (float(v) for v in near(sim, [0, 0, 0]))
    q.x, q.w = np.sin(0.02), np.cos(0.02)
    sim.target.publish(message)
    status = graph.wait(lambda: sim.states[-1] if sim.states[-1].tilt_error > 1e-3 else None)
    assert status.tilt_error == pytest.approx(0.04, abs=1e-6)  # this robot says that it stays level
    assert 0 < status.tilt_residual < 0.04


def test_bad_targets_are_refused_counted_and_reported(graph):
    graph.start()
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    good = near(sim, [0, 0, 0.001])
    sim.say_target(good)
    graph.wait(lambda: np.linalg.norm(sim.robot.rest(sim.angles) - good) < 1e-6)
    for number, (position, frame, reason) in enumerate(
        [
            ((NAN, 0, 0), "world", "target position[0] is nan; it must be finite and below 1e+09 in size"),
            ((0, 0, 0), "base_link", "target in frame 'base_link'; it must be 'world'"),
            ((0, -8.25, 0), "world", "target y is -8.25 m; allowed is -0.15 to 0.15 m"),
        ],
        start=1,
    ):
        sim.say_target(position, frame)
        status = graph.wait(lambda n=number: next((s for s in sim.states if s.rejected_targets == n), None))
        assert status.last_rejection == reason
        assert status.state == IkStatus.TRACKING
        assert (status.target.x, status.target.y, status.target.z) == pytest.approx(tuple(good))
    assert sim.robot.rest(sim.angles) == pytest.approx(good, abs=1e-6)


def test_without_fresh_compliance_it_falls_silent_and_begins_anew(graph):
    graph.start()
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    target = near(sim, [0.003, 0, 0.001])
    sim.say_target(target)
    graph.wait_state(IkStatus.TRACKING)
    graph.wait(lambda: sim.commands)
    sim.running = False
    began = time.monotonic()
    status = graph.wait_state(IkStatus.STALE, "no usable sim/compliance since")
    assert time.monotonic() - began < 1.0
    assert list(status.command) == []
    graph.spin(0.1)  # what was on its way
    sim.commands.clear()
    graph.spin(0.7)
    assert not sim.commands
    assert sim.states[-1].state == IkStatus.STALE

    where = np.array([-1.2, -1.3, -1.4])
    sim.follower = CommandFollower(CommandLimits(), [*where, 0.035])  # moved by something else meanwhile
    sim.running = True
    graph.wait(lambda: sim.commands)
    assert list(sim.commands[0].points[0].positions) == pytest.approx(where, abs=1e-9)
    graph.wait(lambda: np.linalg.norm(sim.robot.rest(sim.angles) - target) < 1e-6)


def test_without_a_simulator_it_says_so(graph):
    graph.sim.running = False
    graph.start()
    began = time.monotonic()
    graph.sim.say_mode(ControlMode.IK)
    graph.wait_state(IkStatus.STALE, "no usable sim/compliance yet: is the simulator running?")
    assert time.monotonic() - began > 0.2  # the simulator gets the time to begin
    assert not graph.sim.commands


class FakeDriver:
    """In place of the simulator: the driver alone tells the robot's angles."""

    def __init__(self, sim, names_told=names.SERVOS):
        sim.running = False
        sim.destroy_publisher(sim.compliance)
        self.sim, self.names = sim, list(names_told)
        self.joints = sim.create_publisher(JointState, names.ROBOT_JOINT_STATES, RELIABLE)
        sim.create_timer(0.01, self.publish)

    def publish(self):
        self.sim.follower.setpoint(time.monotonic())
        self.joints.publish(JointState(name=self.names, position=array("d", self.sim.angles)))


def start_alone(graph, **parameters):
    """Start the node where nobody publishes a compliance."""
    driver, sim = FakeDriver(graph.sim), graph.sim
    sim.compliance = sim.joints = driver.joints  # what `start` waits for
    graph.start(own_model_after=0.2, **parameters)
    sim.say_mode(ControlMode.IK)


def test_without_a_simulator_in_the_graph_it_runs_the_model_itself(graph):
    start_alone(graph, scene="tripod")
    sim = graph.sim
    first = graph.wait_state(IkStatus.TRACKING, "no target yet")
    assert list(first.command) == pytest.approx(WORKING, abs=1e-9)
    graph.wait(lambda: len(sim.commands) > 5)
    assert sim.angles == pytest.approx(WORKING, abs=1e-6)
    start = first.effector
    sim.say_target((start.x + 0.004, start.y - 0.002, start.z + 0.002))
    graph.wait(lambda: sim.states[-1].message == "" and sim.states[-1].error < 1e-6)
    assert sim.states[-1].effector.x == pytest.approx(start.x + 0.004, abs=1e-6)
    assert np.ptp(sim.angles) > 0.1
    sim.diagnostics.clear()
    (report,) = graph.wait(lambda: sim.diagnostics and sim.diagnostics[-1].status)
    assert {pair.key: pair.value for pair in report.values}["model"] == "own, quasi_static"


def test_its_own_model_may_be_the_reduced_one(graph, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    scene = tmp_path / "small.toml"
    scene.write_text(scene_to_toml(load_scene("tripod", ["mesh.level=1", "reduced.samples=12"])))
    StaticModel(load_scene(scene))  # trains it: the node may be in a hurry
    start_alone(graph, scene=str(scene), model="reduced")
    sim, node = graph.sim, graph.nodes[-1]
    first = graph.wait_state(IkStatus.TRACKING, "no target yet")
    assert list(first.command) == pytest.approx(WORKING, abs=1e-9)
    assert node._own._model.simulation.unknowns < 50
    sim.diagnostics.clear()
    (report,) = graph.wait(lambda: sim.diagnostics and sim.diagnostics[-1].status)
    assert {pair.key: pair.value for pair in report.values}["model"] == "own, reduced"


def test_its_own_model_needs_to_know_where_the_robot_is(graph):
    start_alone(graph)
    graph.sim.joints.publish = lambda message: None
    driver = names.ROBOT_JOINT_STATES
    graph.wait_state(IkStatus.STALE, f"the own model needs {driver}: is the driver running?")
    graph.sim.commands.clear()
    graph.spin(0.3)
    assert not graph.sim.commands


def test_a_scene_that_has_no_inverse_is_named(graph):
    start_alone(graph, scene="silicone")
    status = graph.wait_state(IkStatus.STALE, "no own model")
    assert "scene 'silicone' has no servos or no effector" in status.message
    assert not graph.sim.commands


def test_an_imu_corrects_the_tilt_and_what_it_says_wrongly_is_counted(graph):
    """The robot hangs 0.05 rad beside what its model says: the target's tilt is turned back by that."""
    start_alone(graph, goal="orientation", feedback="imu", feedback_time=0.1)
    sim = graph.sim
    first = graph.wait_state(IkStatus.TRACKING, "no target yet")
    z = first.effector.z
    imu = sim.create_publisher(Imu, names.ROBOT_IMU, SENSOR)
    sim.say_target((0.0, 0.0, z))
    graph.wait(lambda: sim.states[-1].error < 1e-6 and "no measurement" in sim.states[-1].message)
    level = sim.angles.copy()
    bad = Imu()
    bad.orientation_covariance[0] = -1.0
    message = Imu()
    message.orientation.x, message.orientation.w = np.sin(0.025), np.cos(0.025)
    graph.wait(imu.get_subscription_count)
    imu.publish(bad)
    timer = sim.create_timer(0.01, lambda: imu.publish(message))
    graph.wait(lambda: np.abs(sim.angles - level).max() > 0.02 and sim.states[-1].message == "")
    before = sim.angles.copy()
    graph.wait(
        lambda: np.abs(sim.angles - before).max() > 0.1
    )  # nothing it does changes what the IMU says: it goes on
    sim.destroy_timer(timer)
    sim.diagnostics.clear()
    (report,) = graph.wait(lambda: sim.diagnostics and sim.diagnostics[-1].status)
    values = {pair.key: pair.value for pair in report.values}
    assert values["rejected measurements"] == "1"
    assert float(values["correction of tilt [rad]"]) > 0.04


def test_coming_back_in_a_moment_begins_from_where_the_robot_is(graph):
    graph.start()
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    graph.wait(lambda: len(sim.commands) > 5)
    sim.running = False
    sim.say_mode(ControlMode.STOP)
    graph.wait_state(IkStatus.IDLE)
    where = np.array([-1.4, -1.5, -1.6])
    sim.follower = CommandFollower(CommandLimits(), [*where, 0.035])
    sim.say_mode(ControlMode.IK)
    graph.spin(0.02)
    sim.commands.clear()
    sim.running = True
    graph.wait(lambda: len(sim.commands) > 5)
    assert list(sim.commands[0].points[0].positions) == pytest.approx(where, abs=1e-9)
    assert sim.angles == pytest.approx(where, abs=1e-6)


def test_leaving_the_mode_ends_commands_and_forgets_the_target(graph):
    graph.start()
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    sim.say_target(near(sim, [0, 0, 0.004]))
    graph.wait_state(IkStatus.TRACKING)
    graph.wait(lambda: np.abs(sim.angles - WORKING).max() > 0.01)
    sim.say_mode(ControlMode.STOP)
    graph.wait_state(IkStatus.IDLE)
    graph.spin(0.1)
    sim.commands.clear()
    graph.spin(0.4)
    assert not sim.commands
    where = sim.angles.copy()
    sim.say_mode(ControlMode.IK, stamp=1)  # older than the STOP: another operator's word that arrives late
    graph.spin(0.3)
    assert not sim.commands
    sim.say_mode(ControlMode.IK)
    graph.wait_state(IkStatus.TRACKING, "no target yet")
    graph.wait(lambda: len(sim.commands) > 20)
    assert sim.angles == pytest.approx(where, abs=1e-6)


def swap_joints(message):
    message.joint_names = ["servo_1", "servo_0", "servo_2"]


def drop_entry(message):
    message.w = message.w[:-1]


def poison(message):
    message.w[40] = NAN


def displace(message):
    message.header.frame_id = "map"


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (poison, "W[4, 4] is nan"),
        (drop_entry, "80 entries; 3 joints give 81"),
        (swap_joints, "joints ['servo_1', 'servo_0', 'servo_2']; they must be servo_0, servo_1, servo_2"),
        (displace, "frame 'map'; it must be 'world'"),
    ],
)
def test_a_bad_compliance_is_not_acted_on(graph, spoil, reason):
    sim = graph.sim
    sim.spoil = spoil
    graph.start()
    sim.say_mode(ControlMode.IK)
    status = graph.wait_state(IkStatus.STALE)
    assert reason in status.message
    assert not sim.commands
    sim.spoil = lambda message: None
    status = graph.wait_state(IkStatus.TRACKING)
    assert status.message == "no target yet: the effector is kept where it is"


def test_a_program_that_is_not_solved_sends_nothing(graph, monkeypatch):
    graph.start()
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    graph.wait_state(IkStatus.TRACKING)
    with monkeypatch.context() as patch:
        patch.setattr("tripod_ik.solver.polish", lambda p, x, y: (x + 1, y, kkt_residual(p, x + 1, y)))
        status = graph.wait_state(IkStatus.SOLVER_FAILED, "not solved")
        graph.spin(0.05)
        sim.commands.clear()
        graph.spin(0.2)
        assert not sim.commands
        assert list(status.command) == []
    graph.wait_state(IkStatus.TRACKING)
    graph.wait(lambda: sim.commands)


def test_diagnostics_carry_state_and_counts(graph):
    node = graph.start()
    sim = graph.sim
    sim.mode.publish(ControlMode(mode=77))
    graph.wait(lambda: node._rejected["modes"])  # it is the last word that is kept
    sim.say_mode(ControlMode.IK)
    sim.say_target((NAN, 0, 0))
    graph.wait_state(IkStatus.TRACKING)
    sim.diagnostics.clear()
    (status,) = graph.wait(lambda: sim.diagnostics and sim.diagnostics[-1].status)
    values = {pair.key: pair.value for pair in status.values}
    assert status.name == "/ik"
    assert status.level == b"\x00"
    assert values["mode"] == "IK"
    assert values["state"] == "TRACKING"
    assert values["rejected targets"] == "1"
    assert values["rejected modes"] == "1"
    assert int(values["solves"]) > 0


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"angle_speed": 0.0}, "parameter 'angle_speed' is 0.0; allowed: 0.01 to 20 rad/s"),
        ({"goal": "yaw"}, "parameter 'goal' is 'yaw'; allowed: one of position, orientation, pose"),
        ({"feedback": "eye"}, "parameter 'feedback' is 'eye'; allowed: one of none, pose, imu"),
        ({"weights": [1.0, 1.0]}, "parameter 'weights' has 2 values; it needs 3"),
        ({"box_low": [0.0, 0.0, 0.0]}, "parameter 'box_high' has 0 values; it needs 3: x, y, z"),
        ({"box_low": [0.0] * 3, "box_high": [0.1, 0.0, 0.1]}, "effector box: low .* must be below high"),
        ({"target_low": [0.0, 0.0]}, r"target_low has shape \(2,\)"),
        ({"target_low": [0.2, 0.0, 0.0]}, "target_low .* must be below target_high"),
        ({"angle_min": 0.7}, "low 0.7 rad must be below high 0.6 rad"),
        ({"speed": 1.0}, "parameter 'speed' is unknown; parameters: "),
    ],
)
def test_bad_parameters_are_refused_by_name(graph, parameters, message):
    with pytest.raises((ParameterError, ValueError), match=message):
        graph.start(**parameters)


def environment():
    domain = str(random.SystemRandom().randint(1, 100))
    return os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": domain}


def test_the_process_refuses_bad_parameters_with_code_2():
    run = subprocess.run(
        [sys.executable, "-m", "tripod_ik.node", "tolerance:=-1"],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    assert run.returncode == 2
    assert "parameter 'tolerance' is -1.0; allowed: at least 1e-07 m" in run.stderr
    assert "Traceback" not in run.stderr


def test_the_process_ends_in_order_on_ctrl_c():
    """It says so in its last status, and leaves with code 0."""
    env = environment()
    rclpy.init(domain_id=int(env["ROS_DOMAIN_ID"]))
    ear = rclpy.create_node("ear")
    states = []
    ear.create_subscription(IkStatus, names.IK_STATUS, states.append, RELIABLE)
    process = subprocess.Popen(
        [sys.executable, "-m", "tripod_ik.node", "torque_max:=.inf"],
        env=env,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        deadline = time.monotonic() + 20
        while not states and time.monotonic() < deadline:
            rclpy.spin_once(ear, timeout_sec=0.1)
        assert states
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=10)
        while states[-1].message != "stopped" and time.monotonic() < deadline:
            rclpy.spin_once(ear, timeout_sec=0.1)
    finally:
        process.kill()
        process.wait()
        ear.destroy_node()
        rclpy.try_shutdown()
    assert process.returncode == 0
    assert errors == ""
    assert states[-1].message == "stopped"


def test_every_parameter_says_what_it_does():
    assert len({p.name for p in PARAMETERS}) == len(PARAMETERS)
    for parameter in PARAMETERS:
        parameter.check(parameter.default)
        assert len(parameter.help) > 10
