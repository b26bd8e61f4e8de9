"""Tier 2: the pulses that the real firmware makes, in virtual time."""

import random
from itertools import pairwise

import pytest

from tests.firmware.session import PERIOD, TOLERANCE, Session, is_row_of, pulses_so_far, rows
from tripod_driver.framed import Acknowledgement, BoardState, Error, ErrorCode, Hello, Release, SetPulses
from tripod_driver.protocol import AngleMapping

DDRB, PORTB = 0x24, 0x25
SERVO_PINS = 0b1110  # of port B: D9, D10, D11


def test_no_pulse_before_the_first_command_and_all_pins_low(board) -> None:
    board.run(1.0)
    assert Session(board).ask(Hello()).state is BoardState.IDLE
    assert board.pulses() == []
    assert board.memory(DDRB) & SERVO_PINS == SERVO_PINS
    assert board.memory(PORTB) & SERVO_PINS == 0


def test_the_first_pulse_is_whole_and_right_whenever_the_command_comes(make_board) -> None:
    for delay in range(40):
        board = make_board()
        board.run(0.010 + delay * 0.0005 + delay * 1.3e-6)
        Session(board).send(SetPulses((6000, 15000, 23000)))
        board.run(3 * PERIOD)
        widths = rows(pulses_so_far(board))
        assert len(widths) >= 1
        assert all(is_row_of(row, (6000, 15000, 23000)) for row in widths)


def test_every_angle_in_steps_of_a_tenth_of_a_degree(free_board) -> None:
    angles = [0.1 * i for i in range(1801)]  # [degree]; 544 to 2400 us over 180 degrees
    scattered = random.Random(1).sample(angles, len(angles))
    table = list(zip(angles, reversed(angles), scattered, strict=True))
    session = Session(free_board)
    session.stream([tuple(round(5440 + 18560 * a / 180) for a in row) for row in table])
    widths = rows(pulses_so_far(free_board))
    assert len(widths) == len(table)
    for row, wanted in zip(widths, table, strict=True):
        for width, angle, tolerance in zip(row, wanted, TOLERANCE[:3], strict=True):
            assert width == pytest.approx(544 + 1856 * angle / 180, abs=tolerance)


def test_all_degrees_of_legacy_equal_the_arduino_library(free_board) -> None:
    board, table = free_board, [(d, 180 - d, 37 * d % 181) for d in range(181)]
    board.write(bytes([255, *table[0]]) * 2)
    for row in table:
        board.write(bytes([255, *row]))
        board.run(PERIOD)
    board.run(PERIOD)
    assert board.in_waiting == 0  # legacy is never answered
    widths = rows(pulses_so_far(board))[: len(table)]
    assert len(widths) == len(table)
    for row, degrees in zip(widths, table, strict=True):
        # Servo::write: map(degrees, 0, 180, 544, 2400) in whole numbers
        assert is_row_of(row, tuple(10 * (544 + d * 1856 // 180) for d in degrees))


def test_the_workshops_first_packets_and_rate(board) -> None:
    """150, 150, 150 first, then a hundred packets a second: every period shows one that was sent."""
    packets = [bytes([255, 150, 150, 150])]
    packets += [bytes([255, *[AngleMapping.TUTORIAL.byte(-0.01 * i)] * 3]) for i in range(100)]
    for packet in packets:
        board.write(packet)
        board.run(0.010)
    allowed = [tuple(10 * (544 + d * 1856 // 180) for d in packet[1:]) for packet in packets]
    widths = rows(pulses_so_far(board))
    assert len(widths) >= 45
    assert all(any(is_row_of(row, command) for command in allowed) for row in widths)


def test_commands_at_any_moment_never_make_a_pulse_that_was_not_commanded(free_board) -> None:
    """Three values change together: a row of two commands mixed would be a wrong pose."""
    rng, board = random.Random(5), free_board
    session = Session(board)
    commands = [tuple(rng.randrange(5440, 24001) for _ in range(3)) for _ in range(1500)]
    for command in commands:
        session.send(SetPulses(command))
        board.run(rng.uniform(0.002, 0.03))
    board.run(2 * PERIOD)
    widths, at = rows(pulses_so_far(board)), 0
    assert len(widths) > 1000
    for row in widths:  # in their order, some never shown, some shown again
        while not is_row_of(row, commands[at]):
            at += 1
    assert at == len(commands) - 1


def test_release_at_any_moment_cuts_no_pulse_and_a_command_starts_whole_ones(board) -> None:
    rng, session, command = random.Random(6), Session(board), (24000, 24000, 24000)
    for _ in range(100):
        session.send(SetPulses(command))
        board.run(rng.uniform(0.02, 0.06))
        session.send(Release())
        board.run(0.03)
        assert all(is_row_of(row, command) for row in rows(pulses_so_far(board)))
        board.run(0.05)
        assert board.pulses() == []


def test_a_pulse_comes_every_twenty_milliseconds(board) -> None:
    Session(board).stream([(15000, 5440, 24000)] * 50)
    pulses = board.pulses()
    for servo in range(3):
        starts = [p.start for p in pulses if p.servo == servo]
        assert len(starts) >= 49
        gaps = [1e6 * (b - a) for a, b in pairwise(starts)]
        assert gaps == pytest.approx([20000] * len(gaps), abs=TOLERANCE[servo])


def test_acknowledgements_carry_what_is_applied(board) -> None:
    session = Session(board)
    applied = session.ask(SetPulses((5440, 15002, 15003)))
    assert isinstance(applied, Acknowledgement)
    assert applied.pulses == (5440, 15000, 15005)
    board.run(PERIOD)
    assert is_row_of(rows(pulses_so_far(board))[-1], applied.pulses)


@pytest.mark.parametrize(("pulses", "servo"), [((5439, 15000, 15000), 0), ((15000, 15000, 24001), 2)])
def test_a_pulse_out_of_range_is_refused_and_the_robot_unmoved(board, pulses, servo: int) -> None:
    session = Session(board)
    session.ask(SetPulses((10000, 11000, 12000)))
    assert session.ask(SetPulses(pulses)) == Error(ErrorCode.PULSE, 2, servo)
    board.run(3 * PERIOD)
    assert all(is_row_of(row, (10000, 11000, 12000)) for row in rows(pulses_so_far(board)))


def test_the_pulse_range_is_a_parameter_of_the_build(make_board) -> None:
    board = make_board(PULSE_MIN=6000, PULSE_MAX=22000)
    board.run(0.010)
    session = Session(board)
    reply = session.ask(Hello())
    assert (reply.pulse_min, reply.pulse_max) == (6000, 22000)
    assert session.ask(SetPulses((5995, 15000, 15000))) == Error(ErrorCode.PULSE, 2, 0)
    assert session.ask(SetPulses((6000, 22000, 22005))) == Error(ErrorCode.PULSE, 2, 2)
    board.power_cycle()
    board.run(0.010)
    board.write(bytes([255, 0, 90, 180]) * 3)  # the library's pulses, kept within the range
    board.run(3 * PERIOD)
    assert all(is_row_of(row, (6000, 14720, 22000)) for row in rows(pulses_so_far(board)))
