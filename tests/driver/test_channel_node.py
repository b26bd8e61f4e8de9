"""The driver node with a cable and a chamber, on a board behind a pseudo-terminal."""

import time

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from tests import messages
from tests.decisions import SOURCE
from tests.driver.operator import Operator
from tests.messages import assert_names
from tripod_driver.calibration import Calibration, PressureCalibration, WinchCalibration
from tripod_driver.calibration_file import calibration_text
from tripod_driver.framed_messages import ChannelKind
from tripod_driver.ports.mock_board import MockBoard
from tripod_graph import names
from tripod_graph.joint import Joint
from tripod_graph.mode import Mode

pytestmark = pytest.mark.ros
WINCH, PRESSURE = WinchCalibration(radius=0.01), PressureCalibration()
TABLE = (Joint("left", "m", 0.0, 0.03, 0.03), Joint("air", "Pa", 0.0, 20e3, 20e3))


def send(operator: Operator, length: float, pressure: float) -> None:
    from trajectory_msgs.msg import JointTrajectory

    from tripod_graph.trajectory import point_of

    message = JointTrajectory(joint_names=[joint.name for joint in TABLE])
    message.points = [point_of((length, pressure), TABLE)]
    message.header.frame_id = SOURCE
    operator._trajectory.publish(message)


def test_a_cable_and_a_chamber_are_homed_moved_told_and_stopped(
    board, operator, client, start_driver, tmp_path
) -> None:
    from std_srvs.srv import Trigger

    kinds = (ChannelKind.WINCH, ChannelKind.PRESSURE)
    board.firmware = MockBoard(time.monotonic, servos=1, channels=kinds, homed=False)
    winch, chamber = board.firmware.channels.all
    file = tmp_path / "robot.yaml"
    file.write_text(calibration_text(Calibration((), {"left": WINCH, "air": PRESSURE})))
    start_driver(
        f"port:={board.path}", "servos:=0", "channels:=left m 0 0.03; air Pa 0 20000", f"calibration:={file}"
    )
    operator.ready()
    status = operator.status
    assert (list(status.joint_names), list(status.units)) == (["left", "air"], ["m", "Pa"])
    assert (list(status.lower), list(status.upper), list(status.speed)) == (
        [0, 0],
        [0.03, 20e3],
        [0.03, 20e3],
    )

    def told(*what: str) -> bool:
        return messages.names(operator.status.message, *what)

    client.wait(
        lambda: told("left", "homed", "robot/home"), "the reason", meanwhile=lambda: send(operator, 0.01, 5e3)
    )
    assert not operator.status.place_known
    assert (winch.setpoint, chamber.setpoint, operator.status.packets_sent) == (0, 0, 0)
    assert client.call(Trigger, names.ROBOT_HOME, Trigger.Request()).success
    client.wait(lambda: operator.status.place_known, "home")
    goal = (round(0.01 / WINCH.scale), round(5e3 / PRESSURE.scale))
    client.wait(
        lambda: (winch.setpoint, chamber.setpoint) == goal,
        "the goal",
        meanwhile=lambda: send(operator, 0.01, 5e3),
    )
    client.wait(lambda: operator.status.sent[1] == 5e3, "the status")
    state = operator.joint_states[-1]
    assert list(state.name) == ["left", "air"]
    assert state.position[0] == pytest.approx(0.01, abs=WINCH.scale)
    assert state.effort[1] == 5e3
    assert state.position[1] != state.position[1]  # NaN: a volume that nobody knows
    operator.mode(Mode.STOP)
    operator.wait_state(operator.status.HOLDING, "the stop")
    answer = client.call(Trigger, names.ROBOT_HOME, Trigger.Request())
    assert_names(answer.message, "control mode", "STOP")
    winch.broken = True
    operator.mode(Mode.TELEOP)
    client.wait(lambda: told("left", "tension"), "the report", meanwhile=lambda: send(operator, 0.02, 5e3))
    assert winch.setpoint < round(0.02 / WINCH.scale)
