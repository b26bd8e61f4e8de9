"""Tier 2: boards of one to six servos, in virtual time: the pulses of each pin, and what such a board refuses."""

import random
from itertools import pairwise

import pytest

from tests.firmware.session import PERIOD, TOLERANCE, Session, is_row_of, pulses_so_far, rows
from tests.firmware.simulated_board import BOARD_PINS
from tests.firmware.test_line import send_imu_line
from tripod_driver.calibration import Calibration, ServoCalibration
from tripod_driver.framed import BoardState, Error, ErrorCode, Hello, ImuLine, SetPulses
from tripod_driver.framed_session import FramedSession
from tripod_driver.session import SessionState

COUNTS = (1, 2, 3, 4, 5, 6)
POSE = (11000, 15000, 19000, 5440, 24000, 12345)


@pytest.mark.parametrize("count", COUNTS)
def test_each_servo_gets_its_pulse_every_20_ms_and_the_other_pins_get_none(make_board, count: int) -> None:
    board = make_board(SERVO_COUNT=count)
    board.run(0.010)
    session = Session(board)
    hello = session.ask(Hello())
    assert (hello.servo_count, hello.state, hello.pulses) == (count, BoardState.IDLE, (0,) * count)
    session.stream([POSE[:count]] * 20)
    pulses = pulses_so_far(board)
    assert {pulse.servo for pulse in pulses} == set(range(count))
    assert len(BOARD_PINS) == len(POSE)
    found = rows(pulses, count)
    assert len(found) >= 19
    assert all(is_row_of(row, POSE[:count]) for row in found)
    for servo in range(count):
        starts = [pulse.start for pulse in pulses if pulse.servo == servo]
        gaps = [1e6 * (b - a) for a, b in pairwise(starts)]
        assert gaps == pytest.approx([20000] * len(gaps), abs=TOLERANCE[servo])


@pytest.mark.parametrize("count", COUNTS)
def test_longest_pulses_of_all_servos_fit_into_a_period_beside_the_line_of_an_imu(
    make_board, count: int
) -> None:
    """Only the first two come at the same time; the others one after another."""
    board = make_board(SERVO_COUNT=count, PULSE_MAX=26000, IMU_BAUD=9600)
    board.set_pin("B", 0, high=True)
    board.run(0.010)
    session = Session(board)
    for k in range(20):
        session.send(SetPulses((26000,) * count))
        if k % 4 == 0:
            send_imu_line(board, f"{k},1.5,\n".encode())
        board.run(PERIOD)
    pulses = pulses_so_far(board)
    found = rows(pulses, count)
    assert len(found) >= 19
    assert all(is_row_of(row, (26000,) * count) for row in found)
    late = sorted((pulse for pulse in pulses if pulse.servo != 1), key=lambda pulse: pulse.start)
    assert all(a.end < b.start for a, b in pairwise(late))
    assert len([f for f in session.received() if isinstance(f.message, ImuLine)]) == 5


@pytest.mark.parametrize("count", [2, 5, 6])
def test_commands_at_any_moment_never_mix_two_poses(make_board, count: int) -> None:
    board = make_board(SERVO_COUNT=count, SLEW=20000)
    board.run(0.010)
    rng, session = random.Random(count), Session(board)
    commands = [tuple(rng.randrange(5440, 24001) for _ in range(count)) for _ in range(400)]
    for command in commands:
        session.send(SetPulses(command))
        board.run(rng.uniform(0.002, 0.03))
    board.run(2 * PERIOD)
    found, at = rows(pulses_so_far(board), count), 0
    assert len(found) > 250
    for row in found:  # in their order, some never shown, some shown again
        while not is_row_of(row, commands[at]):
            at += 1
    assert at == len(commands) - 1


@pytest.mark.parametrize("count", [1, 5, 6])
def test_a_reset_keeps_the_last_pulses_of_all_servos_and_the_next_ones_are_slew_limited(
    make_board, count: int
) -> None:
    board = make_board(SERVO_COUNT=count)
    board.run(0.010)
    Session(board).stream([POSE[:count]] * 3)
    emitted = tuple(5 * ((pulse + 2) // 5) for pulse in POSE[:count])
    pulses_so_far(board)
    board.reset()
    board.run(0.010)
    session = Session(board)
    assert session.ask(Hello()).pulses == emitted
    session.stream([(15000,) * count] * 2)
    first = rows(pulses_so_far(board), count)[0]
    assert is_row_of(first, tuple(min(max(15000, e - 475), e + 475) for e in emitted))


@pytest.mark.parametrize("count", [1, 2, 4, 5, 6])
def test_a_board_of_another_number_refuses_three_pulses_and_ignores_packets_of_three(
    make_board, count: int
) -> None:
    board = make_board(SERVO_COUNT=count)
    board.run(0.010)
    board.write(bytes([255, 150, 150, 150]) * 10)
    board.run(5 * PERIOD)
    assert board.pulses() == []
    assert Session(board).ask(SetPulses((15000,) * 3)) == Error(ErrorCode.LENGTH, 2, 6)
    board.run(5 * PERIOD)
    assert board.pulses() == []


@pytest.mark.parametrize("count", COUNTS)
def test_the_session_of_the_driver_moves_every_servo(make_board, count: int) -> None:
    board = make_board(SERVO_COUNT=count)
    board.run(0.010)
    session = FramedSession(Calibration((ServoCalibration(),) * count))
    session.begin(0.0, 0.0)
    board.write(session.say(0.0))
    board.run(0.010)
    session.hear(board.read(board.in_waiting), 0.01)
    assert session.state is SessionState.READY, session.message
    angles = [-0.2 * (servo + 1) for servo in range(count)]
    content = session.content(angles)
    board.write(session.packet(content, 0.02))
    board.run(2 * PERIOD)
    session.hear(board.read(board.in_waiting), 0.05)
    assert session.settled
    assert is_row_of(rows(pulses_so_far(board), count)[-1], session.pulses(content))
