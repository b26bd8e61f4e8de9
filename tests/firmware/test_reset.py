"""Tier 2: a firmware that hangs is reset by the watchdog; the board tells why it was reset, and where servos were."""

import pytest

from tests.firmware.session import PERIOD, Session, is_row_of, pulses_so_far, rows
from tests.firmware.simulated_board import SimulatedBoard
from tripod_driver.framed import Acknowledgement, BoardState, Flags, Hello, ResetCause, SetPulses

DOG = 0.250
"""Time of the hardware watchdog [s]."""

POSE = (11000, 15000, 19000)
MCUSR = 0x54


def moving(board: SimulatedBoard) -> Session:
    session = Session(board)
    session.stream([POSE] * 5)
    session.received()
    return session


@pytest.mark.parametrize(
    "function",
    ["clock_elapsed", "protocol_receive", "servo_set", "__vector_14", "__vector_11"],
)
def test_a_firmware_that_hangs_is_reset_and_lets_go_until_the_host_speaks(board, function: str) -> None:
    """In the main loop, where the pulses would go on for ever, or with interrupts off, in those of clock and pulses."""
    session = moving(board)
    hung, mend = board.now, board.hang(function)
    while board.now < hung + 3.0:
        session.send(SetPulses(POSE))  # the host goes on
        board.run(PERIOD)
    last = max((p.end for p in board.pulses()), default=hung)
    assert last < hung + DOG + 2 * PERIOD
    board.vanish()
    board.run(2 * DOG)
    mend()
    board.run(2 * DOG)
    board.read(board.in_waiting)
    session = Session(board)
    reply = session.ask(Hello())
    assert reply.reset == ResetCause.WATCHDOG
    assert (reply.state, reply.flags, reply.pulses) == (BoardState.IDLE, Flags.RESTARTED, POSE)
    board.run(0.5)
    assert board.pulses() == []
    session.stream([POSE] * 3)
    assert is_row_of(rows(pulses_so_far(board))[-1], POSE)


def test_the_watchdog_leaves_a_sound_firmware_alone_in_silence_and_under_a_flood(board) -> None:
    session = moving(board)
    board.run(60)
    assert Flags.RESTARTED not in session.ask(Hello()).flags
    for _ in range(300):
        board.write(b"\0\x07" * 100)
        board.run(0.018)
        board.read(board.in_waiting)
    board.run(0.1)
    board.read(board.in_waiting)
    reply = Session(board).ask(Hello())
    assert Flags.RESTARTED not in reply.flags and reply.reset == ResetCause.POWER_ON


def test_why_it_was_reset_is_told_until_the_next_reset(board) -> None:
    assert [Session(board).ask(Hello()).reset for _ in range(2)] == [ResetCause.POWER_ON] * 2
    board.reset()
    board.run(0.010)
    assert Session(board).ask(Hello()).reset == ResetCause.EXTERNAL


@pytest.mark.parametrize(
    "flags", [ResetCause.BROWN_OUT, ResetCause.EXTERNAL | ResetCause.WATCHDOG, ResetCause(0)]
)
def test_flags_of_the_processor_are_passed_on(board, flags: ResetCause) -> None:
    """Zero: Optiboot, the boot loader of the Uno, has cleared them."""
    board.reset()
    board.set_memory(MCUSR, flags)
    board.run(0.010)
    assert Session(board).ask(Hello()).reset == flags


def test_behind_a_boot_loader_that_clears_the_flags_a_hung_main_loop_is_told_all_the_same(board) -> None:
    moving(board)
    mend = board.hang("clock_elapsed")
    board.run(0.2)  # the watchdog is about to bite
    mend()
    board.reset()
    board.set_memory(MCUSR, 0)
    board.run(0.010)
    assert Session(board).ask(Hello()).reset == ResetCause.WATCHDOG


def test_where_the_servos_were_outlives_a_reset_and_no_power_failure(board) -> None:
    session = moving(board)
    session.stream([(20000, 15000, 19000)] * 5)  # on the way there
    pulses = pulses_so_far(board)
    last = tuple(next(p.width for p in reversed(pulses) if p.servo == servo) for servo in range(3))
    board.reset()
    board.run(0.010)
    reply = Session(board).ask(Hello())
    assert reply.state is BoardState.IDLE and is_row_of(last, reply.pulses)
    assert 13000 < reply.pulses[0] < 14000
    for _ in range(20):
        board.power_cycle()
        board.run(0.010)
        assert Session(board).ask(Hello()).pulses == (0, 0, 0)


def test_where_the_memory_lost_a_bit_nobody_knows_where_the_servos_were(board) -> None:
    moving(board)
    board.reset()
    board.set_memory(0x500, board.memory(0x500) ^ 4)
    board.set_memory(0x504, board.memory(0x504) ^ 1)
    board.run(0.010)
    reply = Session(board).ask(Hello())
    assert reply.pulses == (0, 0, 0)
    session = Session(board)
    session.sequence = 1
    assert session.ask(SetPulses(POSE)) == Acknowledgement(BoardState.ACTIVE, Flags(0), POSE, 0)
