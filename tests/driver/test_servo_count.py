"""Robots with another number of servos than the Tripod: a board that tells the same is driven, another is not."""

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tripod_driver.calibration import Calibration, ServoCalibration
from tripod_driver.choose_session import PROTOCOLS
from tripod_driver.framed_session import FramedSession
from tripod_driver.memory import LINE_SIZE, Memory
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.session import SessionState
from tripod_driver.settings import PARAMETERS, make_driver
from tripod_graph.mode import Decision, Mode
from tripod_graph.names import joint_names


def asked(robot: int, board: int) -> tuple[FramedSession, MockBoard]:
    """Return a session of a robot with so many servos that has said hello to a board with so many."""
    session, there = FramedSession(Calibration((ServoCalibration(),) * robot)), MockBoard(servos=board)
    session.begin(0.0, 0.0)
    there.write(session.say(0.0))
    session.hear(there.read(), 0.01)
    return session, there


@pytest.mark.parametrize("count", [1, 4, 10])
def test_a_board_with_as_many_servos_gets_a_pulse_for_each(count: int) -> None:
    session, board = asked(count, count)
    assert session.state is SessionState.READY
    angles = np.linspace(-1.5, -0.1, count).tolist()
    board.write(session.packet(session.content(angles), 0.02))
    session.hear(board.read(), 0.03)
    assert session.settled
    assert session.angles(board.pulses) == pytest.approx(angles, abs=2e-3)


@pytest.mark.parametrize(("robot", "board"), [(4, 3), (3, 4), (6, 2)])
def test_a_board_with_another_number_is_refused_in_one_line(robot: int, board: int) -> None:
    session, _ = asked(robot, board)
    assert session.state is SessionState.REFUSED
    assert_names(session.message, "firmware", f"{board} servos", f"robot has {robot}")
    assert session.say(5.0) == b""


def driver_of(**changes):
    return make_driver({p.name: p.default for p in PARAMETERS} | {"port": "mock"} | changes)


def test_a_driver_of_five_servos_follows_five_joints_and_refuses_three(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    driver = driver_of(servos=5)
    driver.connect()
    driver.safety.activate(0.0)
    for k in range(20):
        driver.tick(0.02 * k)
    driver.safety.control_mode(Decision(Mode.TELEOP, "me", 100.0, 60.0), 100.0, 0.4)
    with raises_naming(ValueError, "'servo_3'", "missing", "servo_0, servo_1, servo_2, servo_3, servo_4"):
        driver.safety.trajectory(joint_names(3)[:-1], [0.1], [[-0.1] * 3], 0.4, source="me")
    goal = [-0.05, -0.1, -0.15, -0.2, -0.25]
    driver.safety.trajectory(joint_names(5)[:-1], [0.1], [goal], 0.4, source="me")
    for k in range(20, 60):
        driver.tick(0.02 * k)
    assert driver.sent == pytest.approx(goal, abs=2e-3)
    assert len(driver.safety.range.lower) == 6


@pytest.mark.parametrize("protocol", [p for p in PROTOCOLS if p != "framed"])
def test_packets_of_the_workshop_are_for_three(protocol: str) -> None:
    with raises_naming(ValueError, "4 servos", f"protocol {protocol}", "3 angles", "protocol framed"):
        driver_of(servos=4, protocol=protocol)


def test_a_place_of_any_number_of_servos_is_remembered_and_cut_where_it_was_longer(tmp_path) -> None:
    for content in ((1500,) * 3, tuple(range(15000, 15010)), (1, 2, 3)):
        memory = Memory(tmp_path)
        memory.turn_to("board")
        memory.keep(content)
        assert memory.path.stat().st_size == (LINE_SIZE if len(content) == 3 else 2 * LINE_SIZE)
        memory.close()
        again = Memory(tmp_path)
        again.turn_to("board")
        assert again.recall() == (content, True)
        again.close()
