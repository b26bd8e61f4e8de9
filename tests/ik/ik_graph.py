"""The graph around the node of inverse kinematics: a robot that obeys, an operator, and ears."""

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
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import Compliance, ControlMode, IkStatus

from tests import messages
from tests.ik.plant import SpringRobot
from tripod_graph import names
from tripod_graph.command import CommandFollower, CommandLimits
from tripod_graph.qos import LATCHED, RELIABLE
from tripod_ik.node import IkNode

WORKING = np.full(3, -1.4965)
NAN = float("nan")
DEADLINE = 60.0
"""For a loaded machine [s]; nothing here waits so long unless it fails."""


def standing_at(angles):
    """Return a robot that stands there, and does not park however long a busy machine lets it wait."""
    return CommandFollower(CommandLimits(park_after=1e6), [*angles, 0.035])


class NodeClock:
    """The clock of the node, in place of its module `time`: the steady one, or what a test makes of it.

    Attributes:
        reads: How often the node has looked at it. Its timers do so.
    """

    SOLVE = 2.0**-8
    """Time that a solve takes by it [s]."""

    def __init__(self):
        self.reads, self._held, self._solving = 0, None, 0.0

    def hold(self):
        """Let no time pass but by `advance`."""
        self._held = time.monotonic()

    def advance(self, seconds):
        self._held += seconds

    def release(self):
        self._held = None

    def monotonic(self):
        self.reads += 1
        return time.monotonic() if self._held is None else self._held

    def perf_counter(self):
        self._solving += self.SOLVE
        return self._solving


class FakeSim(Node):
    """The graph around the node under test: a robot that obeys trajectories, an operator, and ears."""

    def __init__(self):
        super().__init__("fake_sim")
        self.robot = SpringRobot(slide=0.035)
        self.follower = standing_at(WORKING)
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
        message.angles, message.efforts = array("d", state.angles), array("d", state.efforts)
        p = message.effector.position
        p.x, p.y, p.z = (float(v) for v in state.effector)
        message.equilibrium_offset = state.equilibrium_offset
        message.w = array("d", state.W.ravel())
        message.slide = 0.035
        self.spoil(message)
        self.compliance.publish(message)

    def say_mode(self, mode, *, stamp=None):
        self.stamp += 1.0
        message = ControlMode(mode=mode, source="test", lease=600.0)
        message.header.stamp.sec = int(self.stamp if stamp is None else stamp)
        self.mode.publish(message)

    def say_target(self, position, frame="world"):
        message = PoseStamped()
        message.header.frame_id = frame
        p = message.pose.position
        p.x, p.y, p.z = (float(v) for v in position)
        self.target.publish(message)


class Graph:
    def __init__(self, domain, make=FakeSim):
        rclpy.init(domain_id=domain)
        self.executor = SingleThreadedExecutor()
        self.sim = make()
        self.executor.add_node(self.sim)
        self.nodes = [self.sim]

    def start(self, **parameters):
        """Start the node: with no model to look farther, since none is of this robot, unless another scene is named."""
        parameters = {"scene": "silicone", **parameters}
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

    def wait(self, condition, seconds=DEADLINE):
        deadline = time.monotonic() + seconds
        while not (value := condition()):
            last = self.sim.states[-1] if self.sim.states else None
            assert time.monotonic() < deadline, f"nothing after {seconds} s; last status: {last}"
            self.executor.spin_once(timeout_sec=0.05)
        return value

    def hear(self, count):
        """Wait for so many statuses more, to see that something does not happen meanwhile."""
        seen = len(self.sim.states)
        self.wait(lambda: len(self.sim.states) >= seen + count)

    def wait_looks(self, clock, count=20):
        """Wait until the node has looked at its clock so often."""
        seen = clock.reads
        self.wait(lambda: clock.reads >= seen + count)

    def wait_state(self, state, *named):
        """Wait for a status in that state, newer than this call, whose message names each of `named`."""
        seen = len(self.sim.states)

        def fits(status):
            return status.state == state and (not named or messages.names(status.message, *named))

        return self.wait(lambda: next((s for s in self.sim.states[seen:] if fits(s)), None))

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
    graph.start(**{"own_model_after": 0.2, "scene": "tripod", **parameters})
    sim.say_mode(ControlMode.IK)
