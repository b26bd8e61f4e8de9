"""The driver node and what is at its port: nothing, a stranger, boards of this project and of others; its lifecycle."""

import math
import signal
import time
from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from tests.driver.conftest import DEADLINE, Board
from tests.driver.operator import LONGEST_STEP, near
from tripod_driver.calibration import Calibration
from tripod_driver.framed import VERSION
from tripod_driver.framed_messages import BoardState
from tripod_driver.node import PARAMETERS, make_driver
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.protocol import LegacyProtocol
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
    missing = f"{board.path} does not exist; serial ports: "
    client.wait(lambda: operator.status.message.startswith(missing), "the reason")
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
    time.sleep(0.1)  # what was on its way
    heard = len(answering.received)
    end = time.monotonic() + DEADLINE
    while answering.firmware.state is not BoardState.RELEASED:
        assert time.monotonic() < end, "waited in vain for the release"
        time.sleep(0.01)
    assert len(answering.received) == heard


@pytest.mark.ros
def test_a_second_driver_on_the_port_is_told_who_has_it(answering, operator, client, start_driver) -> None:
    first = start_driver(f"port:={answering.path}", "boot_time:=0")
    operator.ready()
    second = start_driver(f"port:={answering.path}", "boot_time:=0", "__ns:=/second")
    client.wait(lambda: "in use by" in second.log, "the refusal")
    refusal = next(line for line in second.log.splitlines() if "in use by" in line)
    assert f" (process {first.process.pid})" in refusal  # this test holds the far end: it is named as well
    assert "; stop that one" in refusal
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
    wrong = f"{answering.path}: its firmware speaks version 7 of the protocol, this driver 2; bring this program up "
    assert operator.status.message.startswith(wrong)
    answering.firmware.version = VERSION  # flashed: the port was free for that
    assert change(Transition.TRANSITION_DEACTIVATE)
    assert change(Transition.TRANSITION_CLEANUP)
    operator.wait_state(6, "the fault that stays")
    assert change(Transition.TRANSITION_CONFIGURE)
    assert change(Transition.TRANSITION_ACTIVATE)
    client.wait(
        lambda: operator.status.state in (operator.status.HOLDING, operator.status.PARKED), "the cure"
    )
    assert operator.status.message.startswith("nobody knows where the servos are")
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
    count = len(board.packets)
    client.wait(lambda: len(board.packets) > count, "motion", meanwhile=lambda: operator.send([-0.5] * 3))
    assert change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    client.wait(lambda: board.packets[-1] == PARKED, "the park position")
    assert state() == "finalized"
    assert driver.stop() == 0
    assert "Traceback" not in driver.log
    assert "transition 3 is refused in the state unconfigured; allowed: 1 configure, 5 shutdown" in driver.log
    assert "[ERROR]" not in driver.log, "what a manager asks for is no trouble"


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
