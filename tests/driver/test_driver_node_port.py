"""The driver node and what is at its port: nothing, a stranger, boards of this project and of others; its lifecycle."""

import math
import signal
import time
from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from tests import messages
from tests.driver.conftest import DEADLINE, NODE, Board
from tests.driver.operator import LONGEST_STEP, near
from tripod_driver.calibration import Calibration
from tripod_driver.framed import VERSION
from tripod_driver.framed_messages import BoardState, ResetCause
from tripod_driver.node import PARAMETERS, make_driver
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.protocol import RESOLUTION, LegacyProtocol
from tripod_graph import names
from tripod_graph.mode import Mode
from tripod_graph.qos import RELIABLE, SENSOR

PARKED = LegacyProtocol().decode(LegacyProtocol().encode([0.0, 0.0, 0.0]))


# the port -------------------------------------------------------------------------------------------------


@pytest.mark.ros
def test_a_port_that_vanishes_and_returns_is_opened_again(board, operator, client, start_driver) -> None:
    driver = start_driver(
        f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "retry_min:=0.1", "retry_max:=0.2"
    )
    operator.ready()
    client.wait(
        lambda: board.packets and near(board.packets[-1], [-1.0] * 3),
        "the pose",
        meanwhile=lambda: operator.send([-1.0] * 3),
    )
    board.unplug()
    operator.wait_state(operator.status.DISCONNECTED, "the loss")
    missing = (board.path, "exist", "serial ports", "next attempt")
    client.wait(lambda: messages.names(operator.status.message, *missing), "the reason")
    operator.send([math.nan] * 3)
    client.wait(lambda: operator.status.rejected_commands == 1, "life without a port")
    count = len(board.packets)
    board.plug()
    client.wait(lambda: operator.status.reconnects == 1, "the reconnection")
    operator.wait_state(operator.status.HOLDING, "the hold")
    assert len(board.packets) == count  # nothing before a command
    client.wait(
        lambda: board.packets and near(board.packets[-1], [-1.6] * 3),
        "the next pose",
        meanwhile=lambda: operator.send([-1.6] * 3),
    )
    way = np.array(board.packets[count:])
    assert near(way[0], [math.radians(93 - 180)] * 3)  # from where its firmware put the servos: 1502 us
    assert np.abs(np.diff(way, axis=0)).max() <= LONGEST_STEP
    client.wait(lambda: operator.status.message == "", "the end of the complaint")
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
    messages.assert_names(operator.status.message, board.path, "exist", "serial ports")
    name = f"{client.node.get_namespace()}/driver"
    client.wait(lambda: any(report.name == name for report in reports), "diagnostics")
    report = next(report for report in reports if report.name == name)
    assert (report.level, report.hardware_id) == (b"\x02", str(board.path))
    assert report.message in [status.message for status in operator.statuses]
    operator.statuses.clear()
    board.plug()
    client.wait(lambda: operator.statuses and operator.status.state == operator.status.HOLDING, "the board")
    assert board.packets == []  # nothing before a command
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
def test_a_brown_out_is_in_the_status_and_in_the_log_though_motion_goes_on(
    answering, operator, client, start_driver
) -> None:
    driver = start_driver(f"port:={answering.path}", "boot_time:=0")
    operator.ready()

    def stream() -> None:
        operator.send([-0.7 - 0.5 * math.sin(3 * time.monotonic())] * 3)

    client.wait(lambda: operator.status.state == operator.status.ACTIVE, "motion", meanwhile=stream)
    answering.firmware.cause = ResetCause.BROWN_OUT
    answering.firmware.restart()
    client.wait(lambda: messages.names(operator.status.message, "supply"), "the message", meanwhile=stream)
    operator.statuses.clear()
    client.wait(lambda: len(operator.statuses) > 10, "statuses", meanwhile=stream)
    assert all(messages.names(status.message, "reset", "supply") for status in operator.statuses)
    assert operator.status.state == operator.status.ACTIVE
    client.wait(lambda: messages.lines_naming(driver.log, "WARN", "reset", "supply"), "the log")


@pytest.mark.ros
def test_the_clock_of_an_active_driver_is_not_changed(operator, client, start_driver) -> None:
    from lifecycle_msgs.srv import ChangeState
    from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
    from rcl_interfaces.srv import SetParameters

    start_driver("port:=mock")
    operator.ready()

    def change(*, sim_time: bool):
        value = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=sim_time)
        request = SetParameters.Request(parameters=[Parameter(name="use_sim_time", value=value)])
        return client.call(SetParameters, "driver/set_parameters", request).results[0]

    refused = change(sim_time=True)
    assert not refused.successful
    messages.assert_names(refused.reason, "'use_sim_time'", "False", "active", "ros2 lifecycle set")
    messages.assert_names(refused.reason, f"{client.node.get_namespace()}/driver deactivate")
    operator.statuses.clear()
    client.wait(lambda: len(operator.statuses) > 3, "statuses")
    assert all(status.header.stamp.sec > 0 for status in operator.statuses)  # no /clock: it would be 0
    assert change(sim_time=False).successful  # no change
    request = ChangeState.Request()
    request.transition.label = "deactivate"
    assert client.call(ChangeState, "driver/change_state", request).success
    assert change(sim_time=True).successful


@pytest.mark.ros
def test_after_kill_9_on_a_port_that_resets_nothing_the_workshops_servos_creep_from_where_they_are(
    board, operator, client, start_driver
) -> None:
    """The board runs on, and its servos stand where the killed driver left them; the next one's packets begin there."""
    words = (f"port:={board.path}", "protocol:=legacy", "boot_time:=0.1")
    first = start_driver(*words, program=NODE)
    operator.ready()
    assert not operator.status.place_known
    pose = [math.radians(93 - 180)] * 3  # where that firmware starts: it need not creep far
    client.wait(lambda: operator.status.place_known, "the pose", meanwhile=lambda: operator.send(pose))
    far = [-0.6, -0.5, -0.4]
    client.wait(
        lambda: board.packets and near(board.packets[-1], far),
        "the far pose",
        meanwhile=lambda: operator.send(far),
    )
    assert first.stop(signal.SIGKILL) == -signal.SIGKILL
    killed, count = time.time(), len(board.packets)
    start_driver(*words, program=NODE)
    stamp = lambda: operator.status.header.stamp  # noqa: E731 - what the first driver told may still come
    client.wait(lambda: stamp().sec + 1e-9 * stamp().nanosec > killed, "the second driver")
    operator.ready()
    assert not operator.status.place_known
    messages.assert_names(operator.status.message, "unknown", "servos")
    client.wait(
        lambda: len(board.packets) > count + 20, "motion", meanwhile=lambda: operator.send([-1.5] * 3)
    )
    way = np.array(board.packets[count:])
    assert near(way[0], far)
    assert (
        np.abs(np.diff(way, axis=0)).max() <= 2 * RESOLUTION + 1e-9
    )  # a degree; 4 rad/s would be four or five


@pytest.mark.ros
def test_after_kill_9_bytes_stop_and_the_board_lets_go(answering, operator, client, start_driver) -> None:
    driver = start_driver(f"port:={answering.path}", "boot_time:=0")
    operator.ready()
    client.wait(
        lambda: operator.status.state == operator.status.ACTIVE,
        "motion",
        meanwhile=lambda: operator.send([-0.7 - 0.5 * math.sin(3 * time.monotonic())] * 3),
    )
    client.close()
    assert driver.stop(signal.SIGKILL) == -signal.SIGKILL

    def wait_while(*states: BoardState) -> None:
        end = time.monotonic() + DEADLINE
        while answering.firmware.state in states:
            assert time.monotonic() < end, f"waited in vain for the end of {states}"
            time.sleep(0.01)

    wait_while(BoardState.ACTIVE)  # its watchdog heard nothing for 0.5 s: nothing is on its way any more
    heard = len(answering.received)
    wait_while(BoardState.ACTIVE, BoardState.HOLDING)
    assert answering.firmware.state is BoardState.RELEASED
    assert len(answering.received) == heard


@pytest.mark.ros
def test_a_second_driver_on_the_port_is_told_who_has_it(answering, operator, client, start_driver) -> None:
    first = start_driver(f"port:={answering.path}", "boot_time:=0")
    operator.ready()
    second = start_driver(f"port:={answering.path}", "boot_time:=0", "__ns:=/second")
    holder = f"(process {first.process.pid})"  # this test holds the far end: it is named as well
    refusal = (answering.path, "in use", holder, "stop")
    client.wait(lambda: messages.lines_naming(second.log, *refusal), "the refusal")
    count = len(answering.firmware.history)
    client.wait(
        lambda: len(answering.firmware.history) > count + 5,
        "motion",
        meanwhile=lambda: operator.send([-0.4] * 3),
    )
    client.wait(  # the first goes on undisturbed
        lambda: operator.status.message == "",
        "the end of the creeping",
        meanwhile=lambda: operator.send([-0.4] * 3),
    )
    assert operator.status.place_known
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

    reason = (answering.path, "'$GPGGA,", "answer", "port")
    client.wait(lambda: messages.names(operator.status.message, *reason), "the reason", meanwhile=disturb)
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
    messages.assert_names(
        operator.status.message, answering.path, "firmware", "version 7", "driver version 2", "flash"
    )
    answering.firmware.version = VERSION  # flashed: the port was free for that
    assert change(Transition.TRANSITION_DEACTIVATE)
    assert change(Transition.TRANSITION_CLEANUP)
    operator.wait_state(6, "the fault that stays")
    assert change(Transition.TRANSITION_CONFIGURE)
    assert change(Transition.TRANSITION_ACTIVATE)
    client.wait(
        lambda: operator.status.state in (operator.status.HOLDING, operator.status.PARKED), "the cure"
    )
    messages.assert_names(operator.status.message, "unknown", "20 degrees a second")
    operator.ready()
    client.wait(
        lambda: answering.firmware.history,
        "a packet after the cure",
        meanwhile=lambda: operator.send([-0.1] * 3),
    )
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
    client.wait(
        lambda: board.received.startswith(b"150 150 150\n"),
        "the first line",
        meanwhile=lambda: operator.send([-0.5236] * 3),
    )
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
        lambda: messages.names(operator.status.message, "not active", "ignored"),
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
    client.wait(lambda: messages.names(operator.status.message, "port", "closed"), "the closed port")
    assert change(Transition.TRANSITION_CONFIGURE)
    assert change(Transition.TRANSITION_ACTIVATE)
    client.wait(lambda: operator.status.state > operator.status.READY, "motion allowed")
    count = len(board.packets)
    client.wait(lambda: len(board.packets) > count, "motion", meanwhile=lambda: operator.send([-0.5] * 3))
    assert change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    client.wait(lambda: board.packets[-1] == PARKED, "the park position")
    assert state() == "finalized"
    assert driver.stop() == 0
    assert "Traceback" not in driver.log
    messages.line_naming(driver.log, "transition 3", "unconfigured", "1 configure, 5 shutdown")
    assert "[ERROR]" not in driver.log, "what a manager asks for is no trouble"


DEFAULTS = {p.name: p.default for p in PARAMETERS}


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"port": "ttyUSB0"}, ("port 'ttyUSB0'", "mock, pty, auto", "/dev/ttyACM0")),
        ({"start": [0.0, 0.0]}, ("'start'", "2 values", 3)),
        ({"start": [0.0, -3.0, 0.0]}, ("start", "servo_1", "-3 rad", "-2.1 to 0.6 rad")),
        ({"baud": 300}, ("'baud'", 300, 0, 1200)),
        ({"calibration": "/nowhere.yaml"}, ("calibration /nowhere.yaml", "No such file", "tripod calibrate")),
        (
            {"angle_min": 0.1, "park": [0.2] * 3 + [0.0]},
            ("servo_0", "-2.1 to 0 rad", "angle_min 0.1", "angle_max 0.6 rad"),
        ),
        ({"protocol": "modbus"}, ("protocol 'modbus'", "framed, legacy, ascii, framed_or_legacy")),
        ({"retry_max": 0.1}, ("'retry_max'", "0.1 s", "retry_min 0.5 s")),
        ({"angle_min": 1.0}, ("angle_min 1.0 rad", "angle_max 0.6 rad")),
        ({"park": [0.0, 0.0, 9.0, 0.0]}, ("park", "servo_2", "9 rad")),
    ],
)
def test_parameters_that_make_no_sense_are_refused_by_name(
    changed: dict[str, object], named: tuple[object, ...]
) -> None:
    make_driver({**DEFAULTS, "port": "mock"})
    with messages.raises_naming(ValueError, *named):
        make_driver({**DEFAULTS, "port": "mock", **changed})


@pytest.mark.ros
def test_a_bad_parameter_ends_it_in_one_line(start_driver) -> None:
    driver = start_driver("port:=mock", "rate:=100")
    assert driver.process.wait(DEADLINE) == 2
    assert len(driver.log.splitlines()) == 1
    messages.assert_names(driver.log, "driver", "'rate'", 100.0, "5 to 50 Hz")
