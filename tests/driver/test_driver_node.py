"""The driver as users meet it: a process between the graph and a board, here a pseudo-terminal."""

import math
import signal
import time
from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from tests.driver.conftest import Board
from tripod_driver.calibration import Calibration
from tripod_driver.framed_messages import BoardState
from tripod_driver.node import PARAMETERS, make_driver
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.protocol import RESOLUTION, AngleMapping, LegacyProtocol
from tripod_graph import names
from tripod_graph.mode import Mode
from tripod_graph.qos import LATCHED, RELIABLE, SENSOR

EXACT = RESOLUTION + 1e-9
PARKED = LegacyProtocol().decode(LegacyProtocol().encode([0.0, 0.0, 0.0]))


class Operator:
    """What the tests say to the driver and hear from it."""

    def __init__(self, client) -> None:
        from sensor_msgs.msg import JointState
        from trajectory_msgs.msg import JointTrajectory
        from tripod_msgs.msg import ControlMode, RobotStatus

        self.client = client
        self.statuses: list[RobotStatus] = []
        self.joint_states: list[JointState] = []
        node = client.node
        self._trajectory = node.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)
        self._mode = node.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
        node.create_subscription(RobotStatus, names.ROBOT_STATUS, self.statuses.append, RELIABLE)
        node.create_subscription(JointState, names.ROBOT_JOINT_STATES, self.joint_states.append, RELIABLE)

    @property
    def status(self):
        return self.statuses[-1]

    def mode(self, mode: int, *, stamp: float | None = None) -> None:
        from rclpy.time import Time
        from tripod_msgs.msg import ControlMode

        message = ControlMode(mode=int(mode), source="test")
        now = self.client.node.get_clock().now()
        message.header.stamp = (now if stamp is None else Time(nanoseconds=int(stamp * 1e9))).to_msg()
        self._mode.publish(message)

    def send(self, *points: list[float], joints=names.SERVOS, times=(0.0,)) -> None:
        from builtin_interfaces.msg import Duration
        from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

        message = JointTrajectory(joint_names=list(joints))
        for point, t in zip(points, times, strict=True):
            since = Duration(sec=int(t), nanosec=round((t % 1) * 1e9))
            message.points.append(JointTrajectoryPoint(positions=point, time_from_start=since))
        self._trajectory.publish(message)

    def ready(self, mode: Mode = Mode.IK) -> None:
        """Wait until the driver has a link and hears the operator, then choose the mode."""
        self.client.wait(lambda: self.statuses and self.status.state >= 2, "the driver")
        for publisher in (self._trajectory, self._mode):
            self.client.wait(lambda p=publisher: p.get_subscription_count() == 1, "its subscription")
        self.mode(mode)

    def wait_state(self, state: int, what: str) -> None:
        self.client.wait(lambda: self.statuses and self.status.state == state, what)


@pytest.fixture
def operator(client) -> Operator:
    return Operator(client)


def near(angles, wanted) -> bool:
    return bool(np.abs(np.subtract(angles, wanted)).max() <= EXACT)


def changes(packets) -> list[list[float]]:
    """Return the packets without repetitions."""
    rows = [list(p) for p in packets]
    return [row for i, row in enumerate(rows) if i == 0 or row != rows[i - 1]]


# what leaves ----------------------------------------------------------------------------------------------


@pytest.mark.ros
@pytest.mark.parametrize("mapping", list(AngleMapping))
def test_packets_decoded_from_the_pseudo_terminal_equal_the_angles_commanded(
    mapping, board, operator, client, start_driver
) -> None:
    board.decoder.protocol = LegacyProtocol(mapping)
    start_driver(
        f"port:={board.path}",
        "protocol:=legacy",
        "boot_time:=0",
        f"angle_mapping:={mapping}",
        "angle_speed:=8",
    )
    operator.ready()
    poses = [
        [-0.1, -0.2, -0.3],
        [-1.4965, -1.4965, -1.4965],
        [-2.0, -0.05, -1.0],
        [-0.5236, -1.0472, -1.5708],
    ]
    for pose in poses:
        client.wait(
            lambda pose=pose: board.packets and near(board.packets[-1], pose),
            f"the packet of {pose}",
            meanwhile=lambda pose=pose: operator.send(pose),
        )
    count = len(board.packets)
    begin, end = np.array(poses[-1]), np.array([-0.8236, -0.6472, -1.3708])
    operator.send(list((begin + end) / 2), list(end), times=(0.5, 1.0))
    client.wait(lambda: near(board.packets[-1], end), "the end of the path")
    line = np.array(board.packets[count:])
    fractions = (line - begin) / (end - begin)  # of the way; all servos are equally far
    assert (np.ptp(fractions, axis=1) <= 2 * EXACT / np.abs(end - begin).min()).all()
    assert (np.diff(line, axis=0) * np.sign(end - begin) >= -1e-9).all()
    assert board.times[-1] - board.times[count] > 0.5  # the path takes 1 s; some may have passed unheard
    assert board.decoder.skipped == 0

    def same() -> bool:
        said = changes(message.position for message in operator.joint_states)
        return bool(said) and said == changes(board.packets)[-len(said) :]

    client.wait(same, "joint states equal to the packets")
    assert operator.joint_states[-1].name == list(names.SERVOS)
    client.wait(
        lambda: np.allclose(operator.status.commanded, end, rtol=0, atol=1e-9), "the end in the status"
    )
    client.wait(lambda: list(operator.status.sent) == list(board.packets[-1]), "the packet in the status")
    assert operator.status.bytes_sent == 4 * operator.status.packets_sent


@pytest.mark.ros
def test_at_most_50_packets_a_second_leave_and_unchanged_ones_are_kept_alive(
    board, operator, client, start_driver
) -> None:
    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "keep_alive:=0.1")
    operator.ready()
    begin = time.monotonic()
    client.wait(
        lambda: time.monotonic() > begin + 1.5,
        "1.5 s of motion",
        meanwhile=lambda: operator.send([-0.7 + 0.7 * math.cos(4 * (time.monotonic() - begin))] * 3),
    )
    moving = [t for t in board.times if t > begin]
    assert 10 <= len(moving) <= 50 * (moving[-1] - moving[0]) + 3
    client.wait(lambda: operator.status.state == operator.status.HOLDING, "the hold")
    count = len(board.packets)
    client.wait(lambda: len(board.packets) >= count + 5, "the keep-alive")
    assert len(set(board.packets[count:])) == 1


# what is refused ------------------------------------------------------------------------------------------


@pytest.mark.ros
def test_bad_commands_are_ignored_counted_and_reported(board, operator, client, start_driver) -> None:
    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0")
    operator.ready()
    client.wait(
        lambda: near(board.packets[-1], [-0.5] * 3),
        "the first pose",
        meanwhile=lambda: operator.send([-0.5] * 3),
    )
    bad = [
        ([math.nan, 0.0, 0.0], names.SERVOS, "point 0: servo_0 is nan rad, allowed is -2.1 to 0.6 rad"),
        ([0.0, 0.0, 0.7], names.SERVOS, "point 0: servo_2 is 0.7 rad, allowed is -2.1 to 0.6 rad"),
        ([0.0, 0.0, 0.0], ("servo_0", "servo_1", "elbow"), "unknown joint 'elbow'; joints: servo_0, servo_1"),
        ([0.0, 0.0], names.SERVOS, "point 0 has 2 positions for 3 joints"),
        (
            [0.0, 0.0],
            names.SERVOS[:2],
            "joint 'servo_2' is missing; a command names all of servo_0, servo_1, servo_2",
        ),
    ]
    for count, (point, joints, message) in enumerate(bad, start=1):
        operator.send(point, joints=joints)
        client.wait(lambda count=count: operator.status.rejected_commands == count, f"rejection {count}")
        assert message in operator.status.last_rejection
    operator.send([-1.0] * 3, [-1.5] * 3, times=(0.5, 0.2))
    client.wait(lambda: operator.status.rejected_commands == 6, "the falling times")
    assert "time of point 1 is 0.2 s; allowed is 0.5 to 600 s" in operator.status.last_rejection
    operator.mode(9)
    client.wait(lambda: operator.status.rejected_commands == 7, "the rejected mode")
    assert operator.status.last_rejection.startswith("control mode 9 is unknown; modes: 0 STOP, 1 TELEOP")
    operator.send([-0.6, -0.6, -0.6, 0.02], joints=(*names.SERVOS, names.SLIDE))  # the slide is no mistake
    client.wait(lambda: near(board.packets[-1], [-0.6] * 3), "the pose after")
    assert operator.status.rejected_commands == 7
    allowed = [p for p in changes(board.packets) if not all(-0.6 - EXACT <= a <= EXACT for a in p)]
    assert allowed == []


# holding and parking --------------------------------------------------------------------------------------


@pytest.mark.ros
def test_silence_holds_then_parks(board, operator, client, start_driver) -> None:
    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "timeout:=0.2", "park_after:=0.6")
    operator.ready()
    client.wait(
        lambda: near(board.packets[-1], [-0.5] * 3), "the pose", meanwhile=lambda: operator.send([-0.5] * 3)
    )
    operator.statuses.clear()
    client.wait(lambda: operator.statuses and operator.status.state == operator.status.PARKED, "parking")
    assert operator.status.HOLDING in [status.state for status in operator.statuses]
    client.wait(lambda: board.packets[-1] == PARKED, "the park position")


@pytest.mark.ros
def test_stop_service_and_stop_mode_hold_at_once_until_the_mode_changes(
    board, operator, client, start_driver
) -> None:
    from std_srvs.srv import Trigger

    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "angle_speed:=1")
    operator.ready()
    client.wait(
        lambda: board.packets[-1][0] < -0.1, "motion", meanwhile=lambda: operator.send([-2.0, -2.0, -2.0])
    )
    answer = client.call(Trigger, names.ROBOT_STOP, Trigger.Request())
    assert answer.success
    held = len(board.packets)
    operator.send([-2.0, -2.0, -2.0])
    client.wait(lambda: len(board.packets) > held + 3, "the keep-alive")
    assert len(set(board.packets[held:])) == 1
    operator.wait_state(operator.status.HOLDING, "the hold")
    assert operator.status.message == "stopped by service; change the control mode to go on"
    operator.mode(Mode.TELEOP)
    client.wait(lambda: operator.status.message == "", "the release")
    client.wait(
        lambda: board.packets[-1][0] < -0.5,
        "motion again",
        meanwhile=lambda: operator.send([-2.0, -2.0, -2.0]),
    )
    operator.mode(Mode.STOP)
    operator.wait_state(operator.status.HOLDING, "the hold")
    held = len(board.packets)
    client.wait(
        lambda: operator.status.message == "control mode is STOP: commands are ignored",
        "the reason",
        meanwhile=lambda: operator.send([-2.0, -2.0, -2.0]),
    )
    client.wait(lambda: len(board.packets) > held + 3, "the keep-alive")
    assert len(set(board.packets[held:])) == 1


@pytest.mark.ros
def test_a_late_driver_obeys_the_newest_decision_of_all_operators(
    board, operator, client, start_driver
) -> None:
    others = [Operator(client) for _ in range(2)]
    operator.mode(Mode.IK, stamp=2000.0)  # the newest decision was published first
    for other, mode, stamp in zip(others, (Mode.STOP, Mode.TELEOP), (1000.0, 1500.0), strict=True):
        other.mode(mode, stamp=stamp)
    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0")
    client.wait(
        lambda: board.packets and near(board.packets[-1], [-0.3] * 3),
        "motion in mode IK",
        meanwhile=lambda: operator.send([-0.3] * 3),
    )


@pytest.mark.ros
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_parks_the_servos_and_ends_in_order(number, board, operator, client, start_driver) -> None:
    driver = start_driver(
        f"port:={board.path}",
        "protocol:=legacy",
        "boot_time:=0",
        "park:=[-0.2,-0.3,0,0]",
        "start:=[-1.2,-1.2,-1.2]",
    )
    operator.ready()
    client.wait(
        lambda: near(board.packets[-1], [-1.5] * 3), "the pose", meanwhile=lambda: operator.send([-1.5] * 3)
    )
    moved = len(board.packets)
    assert driver.stop(number) == 0
    assert "Traceback" not in driver.log
    park = LegacyProtocol().decode(LegacyProtocol().encode([-0.2, -0.3, 0.0]))
    client.wait(lambda: board.packets[-1] == park, "the park position")
    way = np.array(board.packets[moved - 1 :])
    assert len(changes(way)) > 10  # 1.5 rad at 4 rad/s, in steps
    assert (
        np.abs(np.diff(way, axis=0)).max() <= 4.0 * 0.04 + 2 * RESOLUTION
    )  # no step longer than two periods


@pytest.mark.ros
def test_parking_takes_no_longer_than_allowed(board, operator, client, start_driver) -> None:
    driver = start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "angle_speed:=0.05",
                          "start:=[-1,-1,-1]", "park_time_max:=0.3")  # fmt: skip
    operator.ready()
    begin = time.monotonic()
    assert driver.stop() == 0
    assert time.monotonic() - begin < 5.0  # the whole way would take 20 s
    assert "not parked within park_time_max 0.3 s: servos left at -0.9" in driver.log
    assert board.packets[-1][0] < -0.9


@pytest.mark.ros
def test_a_failure_while_running_parks_too(board, operator, client, start_driver) -> None:
    from std_srvs.srv import Trigger

    code = (
        "import sys; from tripod_driver import node\n"
        "def fail(*_): raise RuntimeError('a defect')\n"
        "node.DriverNode._on_stop = fail\n"
        "sys.exit(node.main(sys.argv[1:]))"
    )
    driver = start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", program=("-c", code))
    operator.ready()
    client.wait(
        lambda: near(board.packets[-1], [-0.5] * 3), "the pose", meanwhile=lambda: operator.send([-0.5] * 3)
    )
    service = client.node.create_client(Trigger, names.ROBOT_STOP)
    client.wait(service.service_is_ready, "the service")
    service.call_async(Trigger.Request())
    client.wait(lambda: driver.process.poll() is not None, "the end")
    assert driver.process.returncode == 1
    assert "driver: stopped by RuntimeError: a defect" in driver.log
    client.wait(lambda: board.packets[-1] == PARKED, "the park position")


# the port -------------------------------------------------------------------------------------------------


@pytest.mark.ros
def test_a_port_that_vanishes_and_returns_is_opened_again(board, operator, client, start_driver) -> None:
    driver = start_driver(
        f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "retry_min:=0.1", "retry_max:=0.2"
    )
    operator.ready()
    client.wait(
        lambda: near(board.packets[-1], [-1.0] * 3), "the pose", meanwhile=lambda: operator.send([-1.0] * 3)
    )
    board.unplug()
    operator.wait_state(operator.status.DISCONNECTED, "the loss")
    missing = f"{board.path} does not exist; serial ports: "
    client.wait(lambda: operator.status.message.startswith(missing), "the reason")
    operator.send([math.nan] * 3)
    client.wait(lambda: operator.status.rejected_commands == 1, "life without a port")
    count = len(board.packets)
    board.plug()
    client.wait(lambda: operator.status.reconnects == 1, "the reconnection")
    client.wait(lambda: len(board.packets) > count, "packets")
    assert near(board.packets[count], [-1.0] * 3)  # from where it was
    client.wait(
        lambda: near(board.packets[-1], [-1.6] * 3),
        "the next pose",
        meanwhile=lambda: operator.send([-1.6] * 3),
    )
    way = np.array(board.packets[count:])
    assert np.abs(np.diff(way, axis=0)).max() <= 4.0 * 0.04 + 2 * RESOLUTION
    assert operator.status.message == ""
    assert driver.process.poll() is None


@pytest.mark.ros
def test_without_a_port_it_says_so_keeps_trying_and_ends_in_order(
    board, operator, client, start_driver
) -> None:
    from diagnostic_msgs.msg import DiagnosticArray

    reports: list = []
    client.node.create_subscription(
        DiagnosticArray, names.DIAGNOSTICS, lambda message: reports.extend(message.status), RELIABLE
    )
    board.unplug()
    driver = start_driver(
        f"port:={board.path}", "protocol:=legacy", "boot_time:=0.2", "retry_min:=0.1", "retry_max:=0.2"
    )
    operator.wait_state(0, "the status")
    assert f"{board.path} does not exist; serial ports: " in operator.status.message
    name = f"{client.node.get_namespace()}/driver"
    client.wait(lambda: any(report.name == name for report in reports), "diagnostics")
    report = next(report for report in reports if report.name == name)
    assert (report.level, report.hardware_id) == (b"\x02", str(board.path))
    assert report.message in [status.message for status in operator.statuses]
    operator.statuses.clear()
    board.plug()
    client.wait(lambda: board.packets, "the first packet")
    assert board.packets[0] == PARKED
    states = {status.state for status in operator.statuses}
    assert operator.status.CONNECTING in states  # the board has 0.2 s to boot
    board.unplug()
    operator.wait_state(operator.status.DISCONNECTED, "the loss")
    assert driver.stop() == 0
    assert "Traceback" not in driver.log


@pytest.mark.ros
def test_mock_needs_no_port(operator, client, start_driver) -> None:
    driver = start_driver("port:=mock")
    operator.ready()
    assert (operator.status.port, operator.status.protocol) == ("mock", "framed")
    client.wait(
        lambda: near(operator.status.sent, [-0.5] * 3),
        "the pose",
        meanwhile=lambda: operator.send([-0.5] * 3),
    )
    assert driver.stop() == 0


# the board ------------------------------------------------------------------------------------------------


@pytest.fixture
def answering(tmp_path) -> Iterator[Board]:
    """A board that speaks `framed`, with its watchdog."""
    board = Board(tmp_path / "ttyFramed")
    board.firmware = MockBoard(time.monotonic)
    board.plug()
    yield board
    board.unplug()


@pytest.mark.ros
def test_a_board_of_this_project_gets_pulses_and_is_told_in_the_diagnostics(
    answering, operator, client, start_driver
) -> None:
    from diagnostic_msgs.msg import DiagnosticArray

    reports: list = []
    client.node.create_subscription(
        DiagnosticArray, names.DIAGNOSTICS, lambda message: reports.extend(message.status), RELIABLE
    )
    start_driver(f"port:={answering.path}", "boot_time:=0")
    operator.ready()
    wanted = Calibration().pulses([-0.5, -0.7, -0.9])
    client.wait(
        lambda: np.abs(np.array(answering.firmware.pulses) / 10 - wanted).max() < 0.3,
        "the pulses",
        meanwhile=lambda: operator.send([-0.5, -0.7, -0.9]),
    )
    assert operator.status.protocol == "framed"
    client.wait(
        lambda: np.abs(np.subtract(operator.status.sent, [-0.5, -0.7, -0.9])).max() < 1e-3, "the status"
    )
    name = f"{client.node.get_namespace()}/driver"

    def told() -> dict[str, str]:
        return {v.key: v.value for report in reports if report.name == name for v in report.values}

    client.wait(lambda: told().get("firmware") == "0.0", "the firmware")
    assert float(told()["round trip [ms]"]) > 0


@pytest.mark.ros
def test_after_kill_9_bytes_stop_and_the_board_lets_go(answering, operator, client, start_driver) -> None:
    driver = start_driver(f"port:={answering.path}", "boot_time:=0")
    operator.ready()
    client.wait(
        lambda: operator.status.state == operator.status.ACTIVE,
        "motion",
        meanwhile=lambda: operator.send([-0.7 - 0.5 * math.sin(3 * time.monotonic())] * 3),
    )
    assert driver.stop(signal.SIGKILL) == -signal.SIGKILL
    begin = time.monotonic()
    client.wait(lambda: time.monotonic() > begin + 0.1, "what was on its way")
    heard = len(answering.received)
    client.wait(
        lambda: answering.firmware.state is BoardState.RELEASED,
        "the release",
        meanwhile=lambda: operator.send([-0.7] * 3),
    )
    assert len(answering.received) == heard


@pytest.mark.ros
def test_a_second_driver_on_the_port_is_told_who_has_it(answering, operator, client, start_driver) -> None:
    first = start_driver(f"port:={answering.path}", "boot_time:=0")
    operator.ready()
    second = start_driver(f"port:={answering.path}", "boot_time:=0", "__ns:=/second")
    client.wait(lambda: "in use by" in second.log, "the refusal")
    assert f" (process {first.process.pid}); stop that one" in second.log
    count = len(answering.firmware.history)
    client.wait(
        lambda: len(answering.firmware.history) > count + 5,
        "motion",
        meanwhile=lambda: operator.send([-0.4] * 3),
    )
    assert operator.status.message == ""  # the first goes on undisturbed
    assert second.stop() == 0


@pytest.mark.ros
def test_a_port_that_is_no_robot_is_told_and_gets_no_packet(
    answering, operator, client, start_driver
) -> None:
    answering.firmware = None
    driver = start_driver(f"port:={answering.path}", "boot_time:=0")
    client.wait(lambda: operator.statuses, "the status")
    operator.mode(Mode.IK)

    def disturb() -> None:
        answering.say(b"$GPGGA,123519,4807.038,N,01131.000,E*47\r\n")
        operator.send([-0.4] * 3)

    client.wait(lambda: "it sends '$GPGGA," in operator.status.message, "the reason", meanwhile=disturb)
    assert "and no answer to a hello: not the robot's port" in operator.status.message
    assert operator.status.state in (operator.status.DISCONNECTED, operator.status.CONNECTING)
    assert operator.status.packets_sent == 0
    assert driver.stop() == 0
    assert "Traceback" not in driver.log


@pytest.mark.ros
def test_another_firmware_is_a_fault_until_the_driver_is_configured_anew(
    answering, operator, client, start_driver
) -> None:
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState

    def change(transition: int) -> bool:
        request = ChangeState.Request(transition=Transition(id=transition))
        return client.call(ChangeState, "driver/change_state", request).success

    answering.firmware.version = 7
    driver = start_driver(f"port:={answering.path}", "boot_time:=0")
    operator.wait_state(6, "the fault")
    wrong = f"{answering.path}: its firmware speaks version 7 of the protocol, this driver 1; bring it up to date: "
    assert operator.status.message.startswith(wrong)
    answering.firmware.version = 1  # flashed: the port was free for that
    assert change(Transition.TRANSITION_DEACTIVATE)
    assert change(Transition.TRANSITION_CLEANUP)
    operator.wait_state(6, "the fault that stays")
    assert change(Transition.TRANSITION_CONFIGURE)
    assert change(Transition.TRANSITION_ACTIVATE)
    client.wait(
        lambda: operator.status.state > operator.status.READY and not operator.status.message, "the cure"
    )
    client.wait(lambda: answering.firmware.history, "a packet after the cure")
    assert driver.stop() == 0
    assert "Traceback" not in driver.log


@pytest.mark.ros
def test_the_closed_loop_variant_sends_text_and_publishes_its_imu(
    board, operator, client, start_driver
) -> None:
    from sensor_msgs.msg import Imu

    readings: list[Imu] = []
    client.node.create_subscription(Imu, names.ROBOT_IMU, readings.append, SENSOR)
    start_driver(f"port:={board.path}", "protocol:=ascii", "boot_time:=0", "start:=[-0.5236,-0.5236,-0.5236]")
    operator.ready()
    client.wait(lambda: board.received.startswith(b"150 150 150\n"), "the first line")
    client.wait(
        lambda: readings,
        "a reading",
        meanwhile=lambda: board.say(b"bno begin success\r\n10.0000,-20.0000,\r\n"),
    )
    orientation = readings[-1].orientation
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(2 * (w * y - z * x))
    assert (math.degrees(roll), math.degrees(pitch)) == pytest.approx((10.0, -20.0))
    assert readings[-1].header.frame_id == names.IMU_LINK
    assert readings[-1].orientation_covariance[8] > 9.0  # nobody knows the rotation about the vertical
    assert (
        readings[-1].angular_velocity_covariance[0] == readings[-1].linear_acceleration_covariance[0] == -1.0
    )


# lifecycle and parameters ---------------------------------------------------------------------------------


@pytest.mark.ros
def test_lifecycle_configure_opens_and_activate_moves(board, operator, client, start_driver) -> None:
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState, GetState

    def state() -> str:
        return client.call(GetState, "driver/get_state", GetState.Request()).current_state.label

    def change(transition: int) -> bool:
        request = ChangeState.Request(transition=Transition(id=transition))
        return client.call(ChangeState, "driver/change_state", request).success

    driver = start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "autostart:=false")
    assert state() == "unconfigured"
    assert not change(Transition.TRANSITION_ACTIVATE)  # not from here
    assert state() == "unconfigured"
    operator.wait_state(0, "the status")
    assert change(Transition.TRANSITION_CONFIGURE)
    operator.wait_state(operator.status.READY, "the open port")
    operator.ready()
    client.wait(
        lambda: operator.status.message == "not active: commands are ignored",
        "the reason",
        meanwhile=lambda: operator.send([-0.5] * 3),
    )
    assert board.packets == []
    assert change(Transition.TRANSITION_ACTIVATE)
    client.wait(
        lambda: board.packets and near(board.packets[-1], [-0.5] * 3),
        "motion",
        meanwhile=lambda: operator.send([-0.5] * 3),
    )
    assert change(Transition.TRANSITION_DEACTIVATE)
    operator.wait_state(operator.status.READY, "the rest")
    assert change(Transition.TRANSITION_CLEANUP)
    client.wait(lambda: operator.status.message == "the port is closed", "the closed port")
    assert change(Transition.TRANSITION_CONFIGURE)
    assert change(Transition.TRANSITION_ACTIVATE)
    client.wait(lambda: operator.status.state > operator.status.READY, "motion allowed")
    assert change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    client.wait(lambda: board.packets[-1] == PARKED, "the park position")
    assert state() == "finalized"
    assert driver.stop() == 0
    assert "Traceback" not in driver.log


DEFAULTS = {p.name: p.default for p in PARAMETERS}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"port": "ttyUSB0"}, "port 'ttyUSB0' is none of: mock, pty, auto, or the path of a device"),
        ({"start": [0.0, 0.0]}, "parameter 'start' has 2 values; it needs 3"),
        ({"start": [0.0, -3.0, 0.0]}, "start position: servo_1 is -3 rad, allowed is -2.1 to 0.6 rad"),
        ({"baud": 300}, "parameter 'baud' is 300; allowed: 0 or at least 1200"),
        (
            {"calibration": "/nowhere.yaml"},
            "calibration /nowhere.yaml: No such file or directory; make it with",
        ),
        (
            {"angle_min": 0.1, "park": [0.2] * 3 + [0.0]},
            "servo_0 may be sent -2.1 to 0 rad, which is nowhere within",
        ),
        ({"protocol": "modbus"}, "protocol 'modbus' is none of: framed, legacy, ascii, framed_or_legacy"),
        ({"retry_max": 0.1}, "parameter 'retry_max' is 0.1 s; allowed: at least retry_min 0.5 s"),
        ({"angle_min": 1.0}, "angle_min 1.0 rad must be below angle_max 0.6 rad"),
        ({"park": [0.0, 0.0, 9.0, 0.0]}, "park position: servo_2 is 9 rad"),
    ],
)
def test_parameters_that_make_no_sense_are_refused_by_name(changed: dict[str, object], message: str) -> None:
    make_driver({**DEFAULTS, "port": "mock"})
    with pytest.raises(ValueError) as caught:
        make_driver({**DEFAULTS, "port": "mock", **changed})
    assert message in str(caught.value)


@pytest.mark.ros
def test_a_bad_parameter_ends_it_in_one_line(start_driver) -> None:
    driver = start_driver("port:=mock", "rate:=100")
    assert driver.process.wait(20) == 2
    assert driver.log == "driver: parameter 'rate' is 100.0; allowed: 5 to 50 Hz\n"
