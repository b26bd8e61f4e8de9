"""Tier 2: the real firmware on a bad line, on a silent one, and with an IMU, in virtual time."""

import random

import pytest

from tests.driver.bench import hello_reply
from tests.firmware.session import PERIOD, Session, is_row_of, pulses_so_far, rows
from tripod_driver.framed import (
    VERSION,
    Acknowledgement,
    BoardState,
    Error,
    ErrorCode,
    Flags,
    Frame,
    Hello,
    HelloReply,
    Hold,
    ImuLine,
    Release,
    SetPulses,
    encode,
)

WATCHDOG = 0.500
HELLO_REPLY = hello_reply(flags=Flags.RESTARTED)
NEXT_PERIOD = PERIOD + 0.003
"""Longest time until the output shows a change of state [s]: the rest of a period with its pulses, and a tick."""


def damaged(data: bytes, rate: float, rng: random.Random) -> bytes:
    return bytes(rng.randrange(256) if rng.random() < rate else byte for byte in data)


def test_hello_tells_what_the_board_is(board) -> None:
    session = Session(board)
    assert session.ask(Hello()) == HELLO_REPLY
    assert session.ask(Hello()).flags == Flags(0)


def test_the_line_is_as_fast_as_promised(board) -> None:
    """A frame and its acknowledgement are 14 and 17 bytes of 87 us; the board's own part is small."""
    session = Session(board)
    for _ in range(20):
        begin = board.now
        session.send(SetPulses((15000, 15000, 15000)))
        board.run(0.006)
        board.in_waiting  # noqa: B018 collects
        assert 0.0024 < board.arrivals[-1] - begin < 0.0035
        session.received()


def test_damaged_bytes_make_no_wrong_pulse_in_framed_mode(free_board) -> None:
    rng, board = random.Random(11), free_board
    session = Session(board)
    session.ask(Hello())
    commands = [tuple(rng.randrange(5440, 24001) for _ in range(3)) for _ in range(3000)]
    hit = 0
    for command in commands:
        frame = encode(SetPulses(command), session.sequence)
        session.sequence = (session.sequence + 1) % 256
        wire = damaged(frame, 0.02, rng)
        hit += wire != frame
        board.write(wire)
        board.run(PERIOD)
    widths = rows(pulses_so_far(board))
    acknowledged = [frame for frame in session.received() if isinstance(frame.message, Acknowledgement)]
    assert hit > 500 and len(widths) >= 2990
    at = 0
    for row in widths:  # only what was commanded, in its order; after a loss the last one again
        while not is_row_of(row, commands[at]):
            at += 1
    assert len(acknowledged) >= 3000 - hit
    assert 0 < acknowledged[-1].message.dropped <= 3 * hit


def test_the_same_damage_makes_wrong_pulses_in_legacy_mode(free_board) -> None:
    """So the test above can see one."""
    rng, board = random.Random(11), free_board
    packets = [bytes([255, *(120 + rng.randrange(-3, 4) for _ in range(3))]) for _ in range(1000)]
    for packet in packets:
        board.write(damaged(packet, 0.02, rng))
        board.run(PERIOD)
    allowed = {tuple(10 * (544 + d * 1856 // 180) for d in packet[1:]) for packet in packets}
    wrong = [row for row in rows(pulses_so_far(board)) if not any(is_row_of(row, c) for c in allowed)]
    assert 3 < len(wrong) < 100


@pytest.mark.parametrize("sent", [0, 1, 5, 9, 13])
@pytest.mark.parametrize("phase", [0.0, 0.0073, 0.0151])
def test_when_the_host_vanishes_the_board_holds_then_releases(board, sent: int, phase: float) -> None:
    """kill -9 of the driver at any moment, also with `sent` bytes of a frame on the line."""
    session, command = Session(board), (11000, 15000, 19000)
    board.run(phase)
    session.stream([command] * 10)
    board.run(0.004)
    last = board.now - 0.004 - PERIOD + 14 * 10 / 115200  # when the last whole frame had arrived
    board.write(encode(SetPulses((5440, 5440, 5440)), session.sequence)[:sent])
    board.run(0.002)
    board.vanish()
    board.run(1.2)
    pulses = board.pulses()
    assert all(is_row_of(row, command) for row in rows(pulses))
    silent = pulses[-1].start - last
    assert 2 * WATCHDOG - PERIOD < silent < 2 * WATCHDOG + NEXT_PERIOD
    board.run(0.5)
    assert board.pulses() == []


def test_the_watchdog_takes_its_times(board) -> None:
    """Hello shows the state and does not feed the watchdog."""
    session = Session(board)
    session.send(SetPulses((15000, 15000, 15000)))
    board.run(0.0015)
    begin, changes, state = board.now, [], BoardState.ACTIVE
    session.received()
    while board.now < begin + 1.2:
        session.send(Hello())
        board.run(0.004)
        for frame in session.received():
            if isinstance(frame.message, HelloReply) and frame.message.state is not state:
                state = frame.message.state
                changes.append((state, board.now - begin))
    assert [state for state, _ in changes] == [BoardState.HOLDING, BoardState.RELEASED]
    held, released = (time for _, time in changes)
    assert WATCHDOG - 0.001 < held < WATCHDOG + 0.010
    assert 2 * WATCHDOG - 0.001 < released < 2 * WATCHDOG + 0.010
    [*_, last] = pulses_so_far(board)
    assert begin + 2 * WATCHDOG - PERIOD < last.start < begin + 2 * WATCHDOG + NEXT_PERIOD


def test_a_legacy_host_that_vanishes_is_treated_the_same(board) -> None:
    board.write(bytes([255, 150, 150, 150]) * 3)
    board.run(1.5)
    pulses = board.pulses()
    assert 2 * WATCHDOG - PERIOD < pulses[-1].start - pulses[0].start < 2 * WATCHDOG + NEXT_PERIOD


def test_garbage_is_no_sign_of_life(make_board) -> None:
    """A host at another rate, or a modem's chatter, keeps nothing alive."""
    board = make_board(baudrate=111000)  # so that the line is never silent
    board.run(0.010)
    rng, session = random.Random(2), Session(board)
    session.ask(SetPulses((15000, 15000, 15000)))
    begin = board.now
    for _ in range(150):
        noise = rng.randbytes(110)
        board.write(noise, bad_stop_bits=[i for i in range(110) if rng.random() < 0.3])
        board.run(0.010)
    [*_, last] = board.pulses()
    assert last.start - begin < 2 * WATCHDOG + NEXT_PERIOD


def test_the_watchdogs_time_is_a_parameter_of_the_build(make_board) -> None:
    board = make_board(WATCHDOG_MS=200)
    board.run(0.010)
    session = Session(board)
    assert session.ask(Hello()).watchdog == 200
    session.send(SetPulses((15000, 15000, 15000)))
    board.run(1.0)
    pulses = board.pulses()
    assert 0.400 - PERIOD < pulses[-1].start - pulses[0].start < 0.400 + NEXT_PERIOD


def test_after_a_reset_in_motion_there_are_no_pulses_until_the_next_command(board) -> None:
    rng, session = random.Random(4), Session(board)
    for _ in range(30):
        session.stream([(11000, 15000, 19000)] * 2)
        board.write(encode(SetPulses((11000, 15000, 19000)), session.sequence))
        board.run(rng.uniform(0.0, 0.0013))  # in the midst of the frame
        board.reset()
        board.run(0.1)
        board.pulses()
        board.run(0.2)
        assert board.pulses() == []
        reply = session.ask(Hello())
        assert (reply.state, reply.flags) == (BoardState.IDLE, Flags.RESTARTED)


def test_a_reset_while_the_host_streams_on_shows_nothing_but_its_commands(board) -> None:
    rng, session, command = random.Random(8), Session(board), (15103, 15103, 15103)
    for _ in range(40):
        session.stream([command] * 3)
        board.run(rng.uniform(0, 0.02))
        pulses_so_far(board)
        frames = [encode(SetPulses(command), (session.sequence + i) % 256) for i in range(4)]
        rest = frames[0][rng.randrange(14) :]
        board.reset()
        board.pulses()  # the one that the reset itself cut
        board.write(rest)  # what is left of the frame in which the reset came
        for frame in frames[1:]:
            board.run(PERIOD)
            board.write(frame)
        board.run(PERIOD)
        assert all(is_row_of(row, command) for row in rows(pulses_so_far(board)))


def test_a_byte_without_its_stop_bit_voids_its_frame_only(board) -> None:
    session = Session(board)
    session.ask(SetPulses((15000, 15000, 15000)))
    board.write(encode(SetPulses((16000, 16000, 16000)), 1), bad_stop_bits=[5])
    board.run(0.010)
    assert session.received() == []
    session.sequence = 2
    flags = Flags.OVERRUN | Flags.SEQUENCE_GAP
    assert session.ask(Hold()) == Acknowledgement(BoardState.HOLDING, flags, (15000, 15000, 15000), 1)


def test_a_byte_without_its_stop_bit_voids_its_legacy_packet(board) -> None:
    board.write(bytes([255, 90, 90, 90]) * 3, bad_stop_bits=[2])
    board.run(0.1)
    assert board.pulses() == []
    board.write(bytes([255, 90, 90, 90]))
    board.run(0.1)
    assert board.pulses() != []


def test_frames_without_a_pause_are_all_answered_or_counted(board) -> None:
    """Frames as fast as the line carries them: the answers are longer, so the board must say that it lost some."""
    session = Session(board)
    session.ask(Hello())
    for _ in range(300):
        session.send(SetPulses((15000, 15000, 15000)))
    board.run(0.6)
    answers = session.received()
    assert len(answers) > 200
    assert session.decoder.dropped.total() == 0
    flags = session.ask(Hold()).flags
    assert Flags.OVERRUN in flags or any(Flags.OVERRUN in a.message.flags for a in answers)


def test_another_version_is_told_ours(board) -> None:
    from tests.firmware.test_framed import framed

    board.write(framed(b"\x07\x01\x05"))
    board.run(0.010)
    assert Session(board).received() == [Frame(5, Error(ErrorCode.VERSION, 1, VERSION))]


def test_a_minute_at_fifty_hertz_loses_no_acknowledgement(free_board) -> None:
    board, rng = free_board, random.Random(9)
    session = Session(board)
    for _ in range(30):
        expected = []
        for _ in range(100):
            command = tuple(5 * rng.randrange(1088, 4801) for _ in range(3))
            expected.append((session.send(SetPulses(command)), command))
            board.run(PERIOD)
        assert [(f.sequence, f.message.pulses) for f in session.received()] == expected
        board.pulses()


def send_imu_line(board, text: bytes) -> None:
    """Drive D8 as a serial output at 9600 baud does."""
    bit = 1 / 9600
    for byte in text:
        for level in [0, *(byte >> i & 1 for i in range(8)), 1]:
            board.set_pin("B", 0, bool(level))
            board.run(bit)


def test_lines_of_an_imu_pass_while_pulses_stay_right(make_board) -> None:
    board = make_board(IMU_BAUD=9600)
    board.set_pin("B", 0, True)
    board.run(0.010)
    session, command = Session(board), (11000, 15000, 19000)
    send_imu_line(board, b"-3.51,12.25,\n")
    board.run(0.010)
    assert board.read(board.in_waiting) == b"-3.51,12.25,\n"
    session.ask(Hello())
    lines = [f"{-0.37 * i:.2f},{0.11 * i:.2f}," for i in range(40)]
    for line in lines:
        session.send(SetPulses(command))
        send_imu_line(board, line.encode() + b"\r\n")
        board.run(0.003)
    frames = session.received()
    assert [f.message.text for f in frames if isinstance(f.message, ImuLine)] == lines
    assert [f.sequence for f in frames if isinstance(f.message, ImuLine)] == list(range(40))
    assert sum(isinstance(f.message, Acknowledgement) for f in frames) == 40
    widths = rows(pulses_so_far(board))
    assert len(widths) > 30
    assert all(is_row_of(row, command) for row in widths)


@pytest.mark.parametrize("line", [b"x" * 33 + b"\n", b"a\x07b\n", b"caf\xc3\xa9\n", b"\n"])
def test_a_line_that_is_none_is_dropped_and_the_next_passes(make_board, line: bytes) -> None:
    board = make_board(IMU_BAUD=9600)
    board.set_pin("B", 0, True)
    board.run(0.010)
    send_imu_line(board, line + b"1,2,\n")
    board.run(0.010)
    assert board.read(board.in_waiting) == b"1,2,\n"


def test_without_the_option_an_imu_is_not_heard(board) -> None:
    board.set_pin("B", 0, True)
    send_imu_line(board, b"1,2,\n")
    assert board.in_waiting == 0


def test_memory_with_the_stack_stays_below_the_limit(make_board) -> None:
    """The stack grows down from 0x8ff; what it never touched keeps its mark. What outlives a reset is at 0x500."""
    board = make_board(IMU_BAUD=9600)
    board.set_pin("B", 0, True)
    board.run(0.010)
    bottom, top, mark = 0x510, 0x8C0, 0xA5
    for address in range(bottom, top):
        board.set_memory(address, mark)
    session, rng = Session(board), random.Random(1)
    for i in range(100):
        session.send(rng.choice([Hello(), Hold(), Release(), SetPulses((15000, 15000, 15000))]))
        board.write(rng.randbytes(30) if i % 3 == 0 else b"")
        send_imu_line(board, b"-3.51,12.25,\n")
    assert len(session.received()) > 100
    lowest = next(a for a in range(bottom, 0x900) if board.memory(a) != mark)
    stack = 0x900 - lowest
    assert 20 < stack < 512 - 280
