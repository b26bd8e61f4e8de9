import time
from array import array

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import Imu, JointState
from tripod_msgs.msg import ControlMode, IkStatus, RobotStatus

from tests import messages
from tests.ik.ik_graph import NAN, WORKING, near, standing_at, start_alone
from tests.ik.plant import SpringRobot
from tests.messages import assert_names
from tripod_graph import names
from tripod_graph.qos import RELIABLE, SENSOR
from tripod_ik.certificate import kkt_residual
from tripod_ik.tracker import LONGEST_DT

pytestmark = pytest.mark.ros


def test_out_of_its_mode_it_says_idle_and_commands_nothing(graph):
    graph.start()
    sim = graph.sim
    sim.say_target(near(sim, [0.002, 0, 0]))
    sim.say_mode(ControlMode.TELEOP)
    sim.states.clear()
    graph.wait(lambda: len(sim.states) >= 3)
    assert {s.state for s in sim.states} == {IkStatus.IDLE}
    assert not sim.commands


def test_it_begins_at_rest_and_follows_a_target(graph, clock):
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
    settled = lambda s: s.error < 1e-6 and s.message == "" and not s.active_limits  # noqa: E731
    status = graph.wait(lambda: sim.states[-1] if settled(sim.states[-1]) else None)
    assert status.state == IkStatus.TRACKING
    assert (status.target.x, status.target.y, status.target.z) == pytest.approx(tuple(target))
    assert status.residual < 1e-6
    assert status.solver_status == "solved"
    assert {s.solve_time for s in sim.states if s.solver_status} == {clock.SOLVE}
    assert sim.follower.rejected == 0
    command = sim.commands[-1]
    assert (command.header.stamp.sec, command.header.stamp.nanosec) == (0, 0)
    assert tuple(command.joint_names) == names.SERVOS
    assert len(command.points) == 1
    steps = np.abs(np.diff([c.points[0].positions for c in sim.commands], axis=0))
    assert steps.max() <= 3.0 * 0.1 + 1e-9
    assert steps.max() > 1e-3
    assert any(s.residual < 0.9 * s.error for s in sim.states if s.error > 1e-4)


def test_an_answer_tells_the_error_of_the_mesh_that_its_state_came_with(graph):
    graph.start()
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    assert graph.wait_state(IkStatus.TRACKING).effector_mesh_error == -1.0

    def spoil(message):
        message.effector_mesh_error = 9e-5

    sim.spoil = spoil
    graph.wait(lambda: sim.states[-1].effector_mesh_error == 9e-5)
    sim.spoil = lambda message: None
    graph.wait(lambda: sim.states[-1].effector_mesh_error == -1.0)


def test_commands_keep_to_the_speed_that_is_set(graph):
    graph.start(angle_speed=0.2)
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    graph.wait_state(IkStatus.TRACKING)
    began = time.monotonic()
    sim.say_target(near(sim, [0, 0, 0.1]))

    def moved():
        return np.abs(np.array(sim.commands[-1].points[0].positions) - WORKING).max() if sim.commands else 0.0

    graph.wait(lambda: moved() > 0.1)
    # the first command towards the target also has the time since the command before it, which was before `began`
    assert moved() <= 0.2 * (time.monotonic() - began + LONGEST_DT)
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
        return np.abs(sim.robot.state(np.array(command)).efforts).max() if command else 0.0

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
    for number, (position, frame, named) in enumerate(
        [
            ((NAN, 0, 0), "world", ("target position[0]", "nan", "finite", "below 1e+09")),
            ((0, 0, 0), "base_link", ("target", "frame 'base_link'", "'world'")),
            ((0, -8.25, 0), "world", ("target y", "-8.25 m", "-0.15 to 0.15 m")),
        ],
        start=1,
    ):
        sim.say_target(position, frame)
        status = graph.wait(lambda n=number: next((s for s in sim.states if s.rejected_targets == n), None))
        assert_names(status.last_rejection, *named)
        assert status.state == IkStatus.TRACKING
        assert (status.target.x, status.target.y, status.target.z) == pytest.approx(tuple(good))
    assert sim.robot.rest(sim.angles) == pytest.approx(good, abs=1e-6)


def test_without_fresh_compliance_it_falls_silent_and_begins_anew(graph, clock):
    graph.start(stale_after=0.2)
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    target = near(sim, [0.003, 0, 0.001])
    sim.say_target(target)
    graph.wait_state(IkStatus.TRACKING)
    clock.hold()
    sim.commands.clear()
    graph.wait(lambda: len(sim.commands) > 3)  # the last compliance that the node hears comes at this time
    sim.running = False
    graph.wait_looks(clock)
    clock.advance(0.19)
    graph.wait_looks(clock)
    assert sim.states[-1].state == IkStatus.TRACKING
    clock.advance(0.02)
    status = graph.wait_state(IkStatus.STALE, names.COMPLIANCE, "0.2 s")
    assert list(status.command) == []
    clock.release()
    sim.commands.clear()
    graph.hear(2)
    assert not sim.commands
    assert sim.states[-1].state == IkStatus.STALE

    where = np.array([-1.2, -1.3, -1.4])
    sim.follower = standing_at(where)  # moved by something else meanwhile
    sim.running = True
    graph.wait(lambda: sim.commands)
    assert list(sim.commands[0].points[0].positions) == pytest.approx(where, abs=1e-9)
    graph.wait(lambda: np.linalg.norm(sim.robot.rest(sim.angles) - target) < 1e-6)


def test_without_a_simulator_it_says_so(graph):
    graph.sim.running = False
    graph.start()
    began = time.monotonic()
    graph.sim.say_mode(ControlMode.IK)
    graph.wait_state(IkStatus.STALE, names.COMPLIANCE, "simulator running")
    assert time.monotonic() - began > 0.2  # the simulator gets the time to begin
    assert not graph.sim.commands


def test_an_imu_corrects_the_tilt_and_what_it_says_wrongly_is_counted(graph):
    """The robot hangs 0.05 rad beside what its model says: the target's tilt is turned back by that."""
    start_alone(graph, goal="orientation", feedback="imu", feedback_time=0.1, observe_load=True)
    sim = graph.sim
    first = graph.wait_state(IkStatus.TRACKING, "no target yet")
    z = first.effector.z
    imu = sim.create_publisher(Imu, names.ROBOT_IMU, SENSOR)
    sim.say_target((0.0, 0.0, z))
    graph.wait(lambda: sim.states[-1].error < 1e-6 and messages.names(sim.states[-1].message, "measurement"))
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
    assert values["load [N]"] == values["load, half of 90 % [N]"] == "not told", (
        "a disc that the model has level tells nothing of a weight"
    )


def test_coming_back_in_a_moment_begins_from_where_the_robot_is(graph, clock):
    graph.start()
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    graph.wait(lambda: len(sim.commands) > 5)
    clock.hold()  # in no time at all: no compliance is too old
    sim.running = False
    sim.say_mode(ControlMode.STOP)
    graph.wait_state(IkStatus.IDLE)
    where = np.array([-1.4, -1.5, -1.6])
    sim.follower = standing_at(where)
    sim.say_mode(ControlMode.IK)
    graph.wait_looks(clock)  # what was on its way
    sim.commands.clear()
    sim.running = True
    graph.wait(lambda: sim.commands)
    clock.release()
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
    graph.hear(1)  # what was on its way
    sim.commands.clear()
    graph.hear(1)
    assert not sim.commands
    where = sim.angles.copy()
    sim.say_mode(ControlMode.IK, stamp=1)  # older than the STOP: another operator's word that arrives late
    graph.hear(2)
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
    ("spoil", "named"),
    [
        (poison, ("W[4, 4]", "nan")),
        (drop_entry, ("80 entries", "3 joints", 81)),
        (swap_joints, ("['servo_1', 'servo_0', 'servo_2']", "servo_0, servo_1")),
        (displace, ("frame 'map'", "'world'")),
    ],
)
def test_a_bad_compliance_is_not_acted_on(graph, spoil, named):
    sim = graph.sim
    sim.spoil = spoil
    graph.start()
    sim.say_mode(ControlMode.IK)
    graph.wait_state(IkStatus.STALE, names.COMPLIANCE, *named)
    assert not sim.commands
    sim.spoil = lambda message: None
    status = graph.wait_state(IkStatus.TRACKING)
    assert_names(status.message, "no target", "effector")


def test_a_program_that_is_not_solved_sends_nothing(graph, monkeypatch):
    graph.start()
    sim = graph.sim
    sim.say_mode(ControlMode.IK)
    graph.wait_state(IkStatus.TRACKING)
    with monkeypatch.context() as patch:
        patch.setattr("tripod_ik.solver.polish", lambda p, x, y, *_: (x + 1, y, kkt_residual(p, x + 1, y)))
        patch.setattr("tripod_ik.solver.solve_exactly", lambda p: (p.q, p.l, np.inf))
        status = graph.wait_state(IkStatus.SOLVER_FAILED, "no solution")
        graph.hear(5)  # what was on its way
        sim.commands.clear()
        graph.hear(20)
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

    def told():  # a machine that stalls makes a state stale for a moment, rightly
        status = sim.diagnostics[-1].status[0] if sim.diagnostics else None
        values = {pair.key: pair.value for pair in status.values} if status else {}
        there = values.get("state") == "TRACKING" and values["rejected targets"] == "1"
        return (status, values) if there else None

    status, values = graph.wait(told)
    assert status.name == "/ik"
    assert status.level == b"\x00"
    assert values["control mode"] == "IK"
    assert values["rejected modes"] == "1"
    assert int(values["solves"]) > 0


def test_it_commands_nothing_beyond_the_range_of_the_driver(graph):
    node = graph.start()
    sim = graph.sim
    driver = sim.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)
    lower, upper = [-1.55, -2.1, -2.1], [0.0, -1.45, 0.0]
    sim.create_timer(0.1, lambda: driver.publish(RobotStatus(lower=lower, upper=upper, speed=[0.5] * 3)))
    graph.wait(lambda: node._range.narrowed)
    sim.say_mode(ControlMode.IK)
    sim.say_target(near(sim, (0.004, 0.0, 0.004)))
    status = graph.wait_state(IkStatus.CLOSEST)
    graph.wait(lambda: len(sim.commands) > 50)
    angles = np.array([c.points[0].positions for c in sim.commands])
    assert (angles >= np.array(lower) - 1e-9).all()
    assert (angles <= np.array(upper) + 1e-9).all()
    assert (list(status.lower), list(status.upper)) == (lower, upper)
    assert {c.header.frame_id for c in sim.commands} == {node._source}


def test_a_lost_operator_ends_commands_and_is_named(graph):
    graph.start()
    sim = graph.sim
    message = ControlMode(mode=ControlMode.IK, source="/sends#1")
    operator = sim.create_timer(0.1, lambda: sim.mode.publish(message))
    sim.say_target(near(sim, (0.0, 0.0, 0.001)))
    graph.wait_state(IkStatus.TRACKING)
    sim.destroy_timer(operator)
    lost = graph.wait_state(IkStatus.IDLE, "'/sends#1'", "silent")
    assert (lost.authority.lost, lost.authority.mode) == ("/sends#1", ControlMode.STOP)
    graph.hear(1)  # what was on its way
    sim.commands.clear()
    graph.hear(1)
    assert not sim.commands


def test_a_simulator_that_begins_anew_is_sent_to_where_the_robot_stands(graph, clock):
    node = graph.start()
    sim = graph.sim
    joints = sim.create_publisher(JointState, names.ROBOT_JOINT_STATES, RELIABLE)
    told = JointState(name=list(names.servo_names(3)), position=array("d", WORKING))
    timer = sim.create_timer(0.01, lambda: joints.publish(told))
    sim.say_mode(ControlMode.IK)
    graph.wait_state(IkStatus.TRACKING, "no target yet")
    graph.wait(lambda: node._angles is not None)
    clock.hold()  # a state that comes late could have been reached
    sim.commands.clear()
    sim.follower = standing_at(np.zeros(3))
    graph.wait_state(IkStatus.STALE, "simulated servos", "robot's")
    graph.wait(lambda: np.abs(sim.angles - WORKING).max() < 0.05)
    graph.wait_state(IkStatus.TRACKING, "no target yet")
    sent = np.array([command.points[0].positions for command in sim.commands])
    assert np.abs(sent - WORKING).max() < 0.06  # the robot's servos are asked for nothing else
    sim.destroy_timer(timer)
