"""The node with cables, chambers and forces: a graph around a real model, which obeys as the simulator does."""

import time
from array import array
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from sensor_msgs.msg import JointState
from tripod_msgs.msg import ControlMode, IkStatus, RobotStatus

from benchmarks.ik_actuators import scene_of
from tests.ik.ik_graph import FakeSim, Graph
from tripod_graph import names
from tripod_graph.command import CommandFollower, CommandLimits
from tripod_graph.joint import Joint
from tripod_graph.qos import RELIABLE
from tripod_graph.trajectory import command_of
from tripod_ik.model import StaticModel
from tripod_ik.solve_once import solve_once
from tripod_runtime.messages import compliance_message
from tripod_sim.scene.file import scene_to_toml
from tripod_sim.tables.short_forms import joints_of

pytestmark = pytest.mark.ros


class ActuatedSim(FakeSim):
    """A robot at rest with other joints than servos."""

    def __init__(self, model):
        self.model, self.joints_of_scene = model, joints_of(model.scene)
        super().__init__()
        others = tuple(
            Joint(a.name, a.unit, a.low, a.high, a.high - a.low) for a in self.joints_of_scene.others
        )
        self.follower = CommandFollower(CommandLimits(count=0, others=others, park_after=1e6))

    @property
    def angles(self):
        return self.follower.joints[:-1]

    def on_command(self, message):
        self.commands.append(message)
        c = command_of(message, 0.0, time.monotonic())
        self.follower.accept(c.names, c.times, c.positions, c.now, velocities=c.velocities, efforts=c.efforts)

    def publish(self):
        self.follower.setpoint(time.monotonic())
        if not self.running:
            return
        self.model.move(self.angles / self.model.spans)
        simulation = self.model.simulation
        told = SimpleNamespace(compliance=simulation.compliance(), stamp=0, report=simulation.report)
        message = compliance_message(told, self.joints_of_scene)
        self.spoil(message)
        self.compliance.publish(message)

    @property
    def effector(self):
        return self.model.state().equilibrium

    def say_joints(self, publisher):
        """Publish the commands as a driver tells them: of a pressure the effort."""
        units = [joint.unit for joint in self.follower.limits.others]
        message = JointState(name=[joint.name for joint in self.follower.limits.others])
        message.position = array(
            "d", [0.0 if u in ("N", "Pa") else v for v, u in zip(self.angles, units, strict=True)]
        )
        message.effort = array(
            "d", [v if u in ("N", "Pa") else 0.0 for v, u in zip(self.angles, units, strict=True)]
        )
        publisher.publish(message)


class Robot:
    """A scene of the benchmark, a graph around it, and where its effector can go."""

    def __init__(self, domain, folder, name):
        scene = scene_of(name, folder)
        mesh = scene.mesh if scene.chamber else replace(scene.mesh, cells=(6, 1, 1))
        self.scene = replace(scene, mesh=mesh)
        self.path = folder / "scene.toml"
        self.path.write_text(scene_to_toml(self.scene), encoding="utf-8")
        model = StaticModel(self.scene)
        self.graph = Graph(domain, lambda: ActuatedSim(model))
        self.sim = self.graph.sim

    def reachable(self, share=0.3):
        """Return where the effector rests at a share of each range, the first joint at twice that."""
        model, joints = StaticModel(self.scene), joints_of(self.scene)
        commands = joints.low + share * (joints.high - joints.low) * ([2.0] + [1.0] * (joints.count - 1))
        return model.move(commands / model.spans).equilibrium

    def far(self):
        """Return a place that the effector cannot reach."""
        return self.sim.effector + np.array([0.08, 0.0, 0.0])

    def arrived(self, target):
        """Return the newest status if it says that the effector rests at the target, and it does."""
        status, missing = self.sim.states[-1], np.linalg.norm(self.sim.effector - target)
        return (
            status if missing < 1e-5 and status.state == IkStatus.TRACKING and status.error < 1e-5 else None
        )


@pytest.fixture
def robot(domain, tmp_path, request):
    made = Robot(domain, tmp_path, request.param)
    yield made
    made.graph.close()


KINDS = pytest.mark.parametrize(
    ("robot", "unit"), [("cables", "m"), ("chambers", "Pa"), ("tensions", "N")], indirect=["robot"]
)


@KINDS
def test_a_target_is_reached_and_joints_are_commanded_in_their_units(robot, unit):
    graph, sim = robot.graph, robot.sim
    node = graph.start(stale_after=0.5)
    sim.say_mode(ControlMode.IK)
    graph.wait_state(IkStatus.TRACKING, "no target yet")
    target = robot.reachable()
    sim.say_target(target)
    status = graph.wait(lambda: robot.arrived(target))
    joints = joints_of(robot.scene)
    assert list(status.joint_names) == [a.name for a in joints.others] == list(sim.commands[-1].joint_names)
    assert set(status.units) == {unit}

    def sent():
        return np.array([c.points[0].positions if unit == "m" else c.points[0].effort for c in sim.commands])

    graph.wait(lambda: np.abs(sent()[-1] - sim.angles).max() < 1e-3 * joints.high.max())
    (told,) = sim.commands[-1].points
    assert status.command.tolist() in sent().tolist()
    assert unit == "m" or not any(told.positions)
    assert (list(status.lower), list(status.upper)) == (joints.low.tolist(), joints.high.tolist())
    assert sim.follower.rejected == 0
    assert node._tracker._limits[1].speed * node._spans == pytest.approx(joints.high - joints.low)


@pytest.mark.parametrize("robot", ["chambers"], indirect=True)
def test_a_target_out_of_reach_names_the_range_and_that_no_other_poses_are_searched(robot):
    graph, sim = robot.graph, robot.sim
    node = graph.start(scene=str(robot.path), stale_after=0.5)
    sim.say_mode(ControlMode.IK)
    target = robot.far()
    sim.say_target(target)
    status = graph.wait_state(IkStatus.CLOSEST, "closest pose", "pressure max", "servos alone")
    best = solve_once(robot.scene, target.tolist(), slide=0.0)
    graph.wait(lambda: sim.angles == pytest.approx(best["angles"], rel=1e-3, abs=1.0))
    assert set(status.active_limits) <= {
        f"air_{i} pressure {side}" for i in range(3) for side in ("min", "max")
    }
    assert node._roadmap is None


@pytest.mark.parametrize("robot", ["chambers"], indirect=True)
def test_commands_keep_to_range_and_rate_of_the_driver(robot):
    graph, sim = robot.graph, robot.sim
    node = graph.start(scene=str(robot.path), stale_after=0.5)
    driver = sim.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)
    told = RobotStatus(
        joint_names=["air_0", "air_1", "air_2"], lower=[0.0] * 3, upper=[4e3] * 3, speed=[2e3] * 3
    )
    sim.create_timer(0.1, lambda: driver.publish(told))
    graph.wait(lambda: node._range.narrowed)
    sim.say_mode(ControlMode.IK)
    sim.say_target(robot.far())
    status = graph.wait_state(IkStatus.CLOSEST)
    sent = np.array([c.points[0].effort for c in sim.commands])
    assert 3.9e3 < sent.max() <= 4e3 * (1 + 1e-9) and sent.min() >= 0.0
    assert node._tracker._limits[1].speed * node._spans == pytest.approx([2e3] * 3)
    assert list(status.upper) == [4e3] * 3


@pytest.mark.parametrize("robot", ["chambers"], indirect=True)
def test_without_a_simulator_its_own_model_starts_at_the_pressures_of_the_driver(robot):
    graph, sim = robot.graph, robot.sim
    sim.running = False
    sim.destroy_publisher(sim.compliance)
    sim.compliance = sim.create_publisher(JointState, names.ROBOT_JOINT_STATES, RELIABLE)
    start = np.array([1e3, 2e3, 0.0])
    limits = sim.follower.limits
    sim.follower = CommandFollower(limits, [*start, 0.0])
    sim.create_timer(0.02, lambda: sim.say_joints(sim.compliance))
    graph.start(scene=str(robot.path), own_model_after=0.2, stale_after=0.5)
    sim.say_mode(ControlMode.IK)
    first = graph.wait_state(IkStatus.TRACKING, "no target yet")
    assert list(first.command) == pytest.approx(start.tolist(), rel=1e-6, abs=1e-3)
    target = robot.reachable()
    sim.say_target(target)
    model = StaticModel(robot.scene)

    def arrived():
        sim.follower.setpoint(time.monotonic())
        return np.linalg.norm(model.move(sim.angles / model.spans).equilibrium - target) < 1e-5

    graph.wait(arrived)


@pytest.mark.parametrize("robot", ["cables"], indirect=True)
def test_an_orientation_of_a_set_is_refused_with_the_reason(robot):
    robot.graph.start(goal="orientation")
    robot.sim.say_mode(ControlMode.IK)
    robot.graph.wait_state(IkStatus.STALE, "goal", "'orientation'", "goal=position")
    assert not robot.sim.commands


@pytest.mark.parametrize("robot", ["cables"], indirect=True)
def test_no_load_is_told_of_a_robot_of_cables(robot):
    robot.graph.start(observe_load=True, feedback="pose")
    robot.sim.say_mode(ControlMode.IK)
    robot.graph.wait_state(IkStatus.STALE, "observe_load", "servos", "cable_0", "observe_load=false")
    assert not robot.sim.commands


@pytest.mark.parametrize("robot", ["cables"], indirect=True)
def test_a_simulator_that_begins_again_goes_to_the_cables_of_the_robot_and_leaves_these_slack(robot):
    graph, sim = robot.graph, robot.sim
    limits, start = sim.follower.limits, sim.angles.copy()
    held = np.array([0.006, -0.009, 0.002, -0.004])  # two of them slack
    driver = sim.create_publisher(JointState, names.ROBOT_JOINT_STATES, RELIABLE)
    message = JointState(name=[joint.name for joint in limits.others], position=held, effort=[0.0] * 4)
    sim.create_timer(0.02, lambda: driver.publish(message))
    node = graph.start(scene=str(robot.path), stale_after=3.0)  # the model computes in this thread
    graph.wait(lambda: node._angles is not None)
    sim.say_mode(ControlMode.IK)
    for _ in range(2):
        graph.wait(lambda: sim.commands)
        assert list(sim.commands[0].points[0].positions) == pytest.approx(held.tolist(), rel=1e-12)
        graph.wait_state(IkStatus.TRACKING, "no target yet")
        assert sim.angles[[0, 2]] == pytest.approx(held[[0, 2]], abs=1e-3)
        sim.running = False
        graph.wait_state(IkStatus.STALE, names.COMPLIANCE)
        sim.follower = CommandFollower(limits, [*start, 0.0])
        sim.commands.clear()
        sim.running = True


def lack_units(message):
    message.units = []


def lack_rows(message):
    message.jacobian = message.jacobian[:-1]


def unknown_unit(message):
    message.units = ["psi"] * 4


def upside_down(message):
    message.lower, message.upper = message.upper, message.lower


def too_few(message):
    message.effort_max = []


@pytest.mark.parametrize(
    ("robot", "spoil", "named"),
    [
        ("cables", lack_units, ("cable_0", "units", "recording")),
        ("cables", lack_rows, ("23 entries", "jacobian", "4 joints", 24)),
        ("cables", unknown_unit, ("cable_0", "'psi'")),
        ("cables", upside_down, ("cable_0", "0.012 to -0.012 m")),
        ("cables", too_few, ("4 joints", "effort_max")),
    ],
    indirect=["robot"],
)
def test_a_compliance_that_does_not_fit_together_is_not_acted_on(robot, spoil, named):
    robot.sim.spoil = spoil
    robot.graph.start()
    robot.sim.say_mode(ControlMode.IK)
    robot.graph.wait_state(IkStatus.STALE, names.COMPLIANCE, *named)
    assert not robot.sim.commands
