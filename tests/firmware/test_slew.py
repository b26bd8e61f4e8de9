"""Tier 2: no pulse of the real firmware differs from the one before it by more than its limit, whoever asks."""

import random
from itertools import pairwise

import pytest

from tests.firmware.session import PERIOD, Session, is_row_of, pulses_so_far, rows
from tests.firmware.simulated_board import Pulse, SimulatedBoard
from tripod_driver.framed import BoardState, Hello, Hold, Release, SetPulses

SLEW = 47.5
"""Of the firmware unless it is built otherwise [us]."""

JITTER = (0.6, 0.6, 2.0)
"""How far two pulses of one width differ on D9, D10, D11 [us]."""


def largest_step(pulses: list[Pulse]) -> float:
    """Return by how much a pulse exceeds the limit of its step from the one before it, at most [us]."""
    over = [
        abs(after - before) - JITTER[servo]
        for servo in range(3)
        for before, after in pairwise(p.width for p in pulses if p.servo == servo)
    ]
    return max(over)


def reset(board: SimulatedBoard) -> list[Pulse]:
    """Reset the board after the last pulse of a period, so that none is cut; return the pulses before."""
    pulses, end = board.pulses(), board.now + 2 * PERIOD
    while board.now < end and not any(p.servo == 2 and p.end > end - 2 * PERIOD for p in pulses):
        board.run(0.001)
        pulses += board.pulses()
    board.reset()
    board.run(0.010)
    return pulses


@pytest.mark.parametrize("ends", [((11000, 15000, 19000), (20000, 6000, 19000)), ((5440,) * 3, (24000,) * 3)])
def test_a_jump_becomes_a_ramp_of_equal_steps_that_ends_where_it_was_asked_to(board, ends) -> None:
    session, (begin, end) = Session(board), ends
    session.stream([begin] * 5)
    session.stream([end] * 50)
    widths = rows(pulses_so_far(board))
    assert is_row_of(widths[0], begin) and is_row_of(widths[-1], end)
    for servo in range(3):
        steps = [abs(b[servo] - a[servo]) for a, b in pairwise(widths)]
        assert max(steps) <= SLEW + JITTER[servo]
        ramp = [step for step in steps if step > JITTER[servo]]
        assert len(ramp) == -(-abs(end[servo] - begin[servo]) // 475)
        assert all(step == pytest.approx(SLEW, abs=JITTER[servo]) for step in ramp[:-1])


def test_the_limit_is_a_parameter_of_the_build_and_told(make_board) -> None:
    board = make_board(SLEW=100)
    board.run(0.010)
    session = Session(board)
    assert session.ask(Hello()).slew == 100
    session.stream([(11000, 15000, 19000)] * 3 + [(12000, 14000, 19000)] * 12)
    pulses = pulses_so_far(board)
    assert largest_step(pulses) <= 10.0
    assert is_row_of(rows(pulses)[-1], (12000, 14000, 19000))


def test_acknowledgements_tell_what_the_servos_get_not_what_was_asked(board) -> None:
    """The pulses of an answer are those of the next period."""
    session = Session(board)
    session.stream([(15000, 15000, 15000)] * 3)
    session.received()
    pulses_so_far(board)
    told = []
    for _ in range(25):
        told.append(session.ask(SetPulses((20000, 15000, 10000))).pulses)
        board.run(PERIOD - 0.010)
    shown = rows(pulses_so_far(board))
    assert told[0] == (15475, 15000, 14525)
    assert told[-1] == (20000, 15000, 10000)
    assert len(set(told)) > 8
    assert all(any(is_row_of(row, pulses) for pulses in told) for row in shown)


@pytest.mark.parametrize("seed", range(3))
def test_no_course_of_commands_steps_further(board: SimulatedBoard, seed: int) -> None:
    """A second writer, silence beyond both times of the watchdog, holding, letting go, resets: framed."""
    rng, session = random.Random(seed), Session(board)
    pulses: list[Pulse] = []
    for _ in range(150):
        match rng.randrange(8):
            case 0:
                session.send(Hold())
            case 1:
                session.send(Release())
            case 2:
                board.run(rng.choice([0.3, 0.6, 1.2]))
            case 3:
                pulses += reset(board)
                session.sequence = 0
        for _ in range(rng.randrange(1, 12)):
            session.send(SetPulses(tuple(rng.randrange(5440, 24001) for _ in range(3))))
            board.run(rng.uniform(0.002, 0.025))
        pulses += board.pulses()
        session.received()
    pulses += pulses_so_far(board)
    assert len(pulses) > 3 * 500
    assert largest_step(pulses) <= SLEW


def test_legacy_packets_step_no_further_either(board) -> None:
    rng, pulses = random.Random(3), []
    for _ in range(200):
        packet = bytes([255, *(rng.randrange(181) for _ in range(3))])
        for _ in range(rng.randrange(1, 10)):
            board.write(packet * rng.randrange(1, 3))
            board.run(0.010)
        pulses += board.pulses()
        if rng.random() < 0.1:
            pulses += reset(board)
    pulses += pulses_so_far(board)
    assert len(pulses) > 3 * 400
    assert largest_step(pulses) <= SLEW


@pytest.mark.parametrize("phase", range(0, 20, 2))
def test_a_main_loop_that_is_late_by_a_period_does_not_step_twice_as_far(board, phase: int) -> None:
    """It makes pulses for a period that has passed, and stops again: these must not come after what came since."""
    session = Session(board)
    session.stream([(15000, 15000, 15000)] * 5)
    session.send(SetPulses((20000, 20000, 20000)))
    board.run(0.004 + 0.001 * phase)
    mend = board.hang("protocol_receive")
    session.send(SetPulses((10000, 10000, 10000)))
    board.run(PERIOD)
    board.hang("servo_period")
    mend()
    board.run(2 * PERIOD)
    pulses = board.pulses()
    assert len(pulses) > 17
    assert largest_step(pulses) <= SLEW


def test_hold_stops_the_way_to_a_far_target_at_once_and_so_does_silence(board) -> None:
    session = Session(board)
    session.stream([(6000, 15000, 24000)] * 3 + [(24000, 15000, 6000)] * 5)
    held = session.ask(Hold())
    assert held.state is BoardState.HOLDING and 8000 < held.pulses[0] < 9000
    board.run(2 * PERIOD)
    board.pulses()
    board.run(0.3)
    assert all(is_row_of(row, held.pulses) for row in rows(pulses_so_far(board)))
    session.ask(SetPulses((24000, 15000, 6000)))  # and then the host falls silent: 0.5 s of 1.2
    board.run(0.52)
    board.pulses()
    board.run(0.3)
    widths = rows(pulses_so_far(board))
    assert max(w[0] for w in widths) < 2200 and max(w[0] for w in widths) - min(w[0] for w in widths) < 1
