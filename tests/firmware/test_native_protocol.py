"""Tier 1: the firmware's C protocol, built for this machine with sanitizers, against the model in Python."""

import random
import subprocess
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.firmware import build
from tests.firmware.model import ModelBoard, legacy_pulse
from tests.firmware.test_framed import framed
from tripod_driver.framed import (
    Acknowledgement,
    BoardState,
    Decoder,
    Error,
    ErrorCode,
    Flags,
    Frame,
    Hello,
    Hold,
    ImuLine,
    Release,
    SetPulses,
    encode,
)


class NativeProtocol:
    """The C code in a process of its own, where the sanitizers can stop it."""

    def __init__(self, servos: int = 3, channels: tuple[int, int] = (0, 0)) -> None:
        command = [build.native(servos, *channels)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._servos = servos
        self.state, self.emits, self.pulses = BoardState.IDLE, False, (0,) * servos

    def close(self) -> int:
        self._process.stdin.close()
        self._process.stdout.close()
        return self._process.wait(timeout=20)

    def _do(self, operation: bytes, count: int, data: bytes = b"") -> bytes:
        self._process.stdin.write(operation + count.to_bytes(2, "little") + data)
        self._process.stdin.flush()
        sent = self._take(int.from_bytes(self._take(2), "little"))
        tail = self._take(2 + 2 * self._servos)
        self.state, self.emits = BoardState(tail[0]), bool(tail[1])
        self.pulses = tuple(int.from_bytes(tail[i : i + 2], "little") for i in range(2, len(tail), 2))
        return sent

    def _take(self, size: int) -> bytes:
        data = self._process.stdout.read(size)
        assert len(data) == size, "the C code was stopped by a sanitizer or a check"
        return data

    def begin(self) -> None:
        self._do(b"Z", 0)

    def receive(self, data: bytes) -> bytes:
        return self._do(b"R", len(data), data)

    def tick(self, count: int = 1) -> None:
        self._do(b"T", count)

    def period(self, count: int = 1) -> None:
        self._do(b"P", count)

    def lose_input(self) -> None:
        self._do(b"L", 0)

    def lose_output(self) -> None:
        self._do(b"O", 0)

    def imu_line(self, text: str) -> bytes:
        return self._do(b"I", len(text), text.encode())


@pytest.fixture(scope="module")
def process() -> Iterator[NativeProtocol]:
    native = NativeProtocol()
    yield native
    assert native.close() == 0


@pytest.fixture(scope="module")
def five() -> Iterator[NativeProtocol]:
    native = NativeProtocol(5)
    yield native
    assert native.close() == 0


@pytest.fixture
def board(process: NativeProtocol) -> NativeProtocol:
    process.begin()
    return process


def answers(data: bytes) -> list[Frame]:
    decoder = Decoder()
    frames = decoder.feed(data)
    assert not decoder.dropped
    return frames


pulse = st.one_of(st.integers(5440, 24000), st.integers(0, 65535))
commands = st.one_of(
    st.sampled_from([Hello(), Hold(), Release()]),
    st.builds(SetPulses, st.tuples(pulse, pulse, pulse)),
    st.builds(SetPulses, st.tuples(*[pulse] * 5)),
)
angle = st.one_of(st.integers(0, 180), st.integers(0, 255))
legacy = st.tuples(angle, angle, angle).map(lambda a: bytes([255, *a]))
bodies = st.builds(
    lambda head, rest: bytes(head) + rest,
    st.tuples(
        st.sampled_from([0, 1, 2, 2, 2]), st.sampled_from([0, 1, 2, 3, 4, 5, 0x81, 0x83]), st.integers(0, 3)
    ),
    st.binary(max_size=37),
)
operations = st.one_of(
    st.tuples(st.just("receive"), st.binary(max_size=60)),
    st.tuples(st.just("receive"), st.builds(encode, commands, st.integers(0, 3))),
    st.tuples(st.just("receive"), bodies.map(framed)),
    st.tuples(st.just("receive"), st.lists(legacy, min_size=1, max_size=4).map(b"".join)),
    st.tuples(st.just("tick"), st.one_of(st.integers(1, 5), st.sampled_from([400, 499, 500, 501, 1001]))),
    st.tuples(st.just("period"), st.integers(1, 30)),
    st.tuples(st.sampled_from(["lose_input", "lose_output"]), st.none()),
    st.tuples(st.just("imu_line"), st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=32)),
)


@given(st.lists(operations, max_size=25), st.randoms(use_true_random=False))
def test_c_code_and_model_agree_on_any_course_of_events(process, course, rng) -> None:
    compare(process, ModelBoard(), course, rng)


@given(st.lists(operations, max_size=25), st.randoms(use_true_random=False))
def test_c_code_and_model_of_five_servos_agree_and_neither_takes_legacy_packets(five, course, rng) -> None:
    compare(five, ModelBoard(servos=5), course, rng)


def compare(process: NativeProtocol, model: ModelBoard, course: list, rng: random.Random) -> None:
    """Let both take the same course of events."""
    process.begin()
    for operation, given_argument in course:
        argument = given_argument
        if operation == "receive" and argument and rng.random() < 0.2:  # one byte damaged
            at = rng.randrange(len(argument))
            argument = argument[:at] + bytes([rng.randrange(256)]) + argument[at + 1 :]
        if operation in ("tick", "period"):
            getattr(process, operation)(argument)
            for _ in range(argument):
                getattr(model, operation)()
        elif operation in ("receive", "imu_line"):
            assert getattr(process, operation)(argument) == getattr(model, operation)(argument)
        else:
            getattr(process, operation)()
            getattr(model, operation)()
        assert (process.state, process.pulses) == (model.state, model.pulses)
        assert process.emits == (model.state in (BoardState.ACTIVE, BoardState.HOLDING))


def test_fuzz_half_a_million_bytes_of_damaged_traffic(board: NativeProtocol) -> None:
    rng, model = random.Random(7), ModelBoard()
    sent = replies = 0
    while sent < 500_000:
        traffic = bytearray()
        for _ in range(50):
            kind = rng.random()
            if kind < 0.5:
                pulses = tuple(rng.randrange(5000, 25000) for _ in range(3))
                traffic += encode(SetPulses(pulses), rng.randrange(256))
            elif kind < 0.7:
                traffic += framed(rng.randbytes(rng.randrange(0, 42))[:38])
            elif kind < 0.9:
                traffic += bytes([255, *(rng.randrange(181) for _ in range(3))])
            else:  # often as long as a frame can be, or one byte longer
                size = rng.choice([41, 41, 42, rng.randrange(100)])
                traffic += b"\0" + bytes(rng.choice([1, 2, 40, 41, 42, 43]) for _ in range(size)) + b"\0"
                traffic += rng.randbytes(rng.randrange(100))
        for _ in range(rng.choice([0, 3, 60])):
            traffic[rng.randrange(len(traffic))] = rng.randrange(256)
        if rng.random() < 0.3:
            board.begin()
            model = ModelBoard()
        expected = model.receive(bytes(traffic))
        assert board.receive(bytes(traffic)) == expected
        assert (board.state, board.pulses) == (model.state, model.pulses)
        sent += len(traffic)
        replies += expected.count(0) // 2
    assert replies > 5000


def test_all_degrees_of_a_legacy_packet_become_the_pulses_of_the_arduino_library(
    board: NativeProtocol,
) -> None:
    for degrees in range(181):
        board.tick(10)
        board.receive(bytes([255, degrees, 180 - degrees, 90]) * 3)
        wanted = [degrees, 180 - degrees, 90]
        assert board.pulses == tuple(10 * (544 + d * 1856 // 180) for d in wanted)
        assert board.pulses == tuple(map(legacy_pulse, wanted))


@pytest.mark.parametrize("before", [b"\0", b"\0\0\0", b"\x0b\x01\x02", b"\xff", b"\0" + b"A" * 200])
def test_garbage_does_not_lock_legacy_out(board: NativeProtocol, before: bytes) -> None:
    board.tick(5)
    board.receive(before)
    board.tick(5)
    board.receive(bytes([255, 0, 90, 180]) * 3)
    assert board.pulses == (5440, 14720, 24000)
    assert board.state is BoardState.ACTIVE


def test_a_legacy_host_that_never_pauses_is_understood_again_after_three_packets(
    board: NativeProtocol,
) -> None:
    board.receive(bytes([255, 10, 20, 30]) * 3)
    assert board.state is BoardState.ACTIVE
    board.receive(b"\x07" + bytes([255, 40, 50, 60]) * 2)
    assert board.pulses == tuple(map(legacy_pulse, (10, 20, 30)))
    board.receive(bytes([255, 40, 50, 60]))
    assert board.pulses == tuple(map(legacy_pulse, (40, 50, 60)))


def test_a_frame_ends_legacy_until_the_next_reset(board: NativeProtocol) -> None:
    board.receive(encode(Hello(), 0))
    board.tick(10)
    board.receive(bytes([255, 90, 90, 90]) * 5)
    assert (board.state, board.pulses) == (BoardState.IDLE, (0, 0, 0))
    board.begin()
    board.receive(bytes([255, 90, 90, 90]) * 3)
    assert board.state is BoardState.ACTIVE


def test_no_tail_of_a_stream_of_frames_is_taken_for_a_legacy_packet(board: NativeProtocol) -> None:
    """A reset in the midst of streaming: the board hears the rest of a frame, then the next, with no pause."""
    values = [5440, 5631, 5887, 11519, 15103, 23807]
    assert [v % 256 for v in values[1:]] == [255] * 5  # the 255 that a packet would begin with
    rng = random.Random(3)
    for _ in range(5000):
        pulses = tuple(rng.choice(values) for _ in range(3))
        sequence = rng.choice([255, rng.randrange(256)])
        first, second = encode(SetPulses(pulses), sequence), encode(SetPulses(pulses), (sequence + 1) % 256)
        board.begin()
        board.receive(first[rng.randrange(2, len(first)) :] + second[:-1])
        assert board.state is BoardState.IDLE
        board.receive(second[-1:])
        assert board.pulses == tuple((p + 2) // 5 * 5 for p in pulses)


def test_watchdog_holds_then_releases_and_a_command_ends_both(board: NativeProtocol) -> None:
    def state_after(ms: int) -> BoardState:
        board.tick(ms)
        return board.state

    board.receive(encode(SetPulses((15000, 15000, 15000)), 0))
    assert state_after(500) is BoardState.ACTIVE
    assert state_after(1) is BoardState.HOLDING
    assert board.emits
    assert state_after(499) is BoardState.HOLDING
    assert state_after(1) is BoardState.RELEASED
    assert not board.emits
    assert state_after(65535) is BoardState.RELEASED
    [frame] = answers(board.receive(encode(SetPulses((16000, 15000, 15000)), 1)))
    assert frame.message == Acknowledgement(BoardState.ACTIVE, Flags.WATCHDOG, (16000, 15000, 15000), 0)


@pytest.mark.parametrize(
    "noise",
    [
        encode(Hello(), 1),
        encode(SetPulses((5439, 15000, 15000)), 1),
        framed(b"\x01\x02\x01\x98\x3a\x98\x3a\x98\x3a"),
        encode(SetPulses((15000, 15000, 15000)), 1)[:-3] + b"\x99\x99\0",
        bytes([255, 90, 90, 90]),
    ],
)
def test_what_is_no_command_does_not_feed_the_watchdog(board: NativeProtocol, noise: bytes) -> None:
    board.receive(encode(SetPulses((15000, 15000, 15000)), 0))
    for _ in range(11):
        board.tick(100)
        board.receive(noise)
    assert board.state is BoardState.RELEASED


def test_hold_keeps_the_pulses_as_long_as_it_is_repeated(board: NativeProtocol) -> None:
    assert answers(board.receive(encode(Hold(), 0)))[0].message.state is BoardState.IDLE
    board.receive(encode(SetPulses((15000, 15000, 15000)), 1))
    for i in range(20):
        [frame] = answers(board.receive(encode(Hold(), 2 + i)))
        assert frame.message.state is BoardState.HOLDING
        board.tick(400)
    board.tick(601)
    assert board.state is BoardState.RELEASED


def test_release_stops_the_pulses_at_once_and_hold_does_not_start_them(board: NativeProtocol) -> None:
    board.receive(encode(SetPulses((15000, 15000, 15000)), 0))
    [frame] = answers(board.receive(encode(Release(), 1)))
    assert frame.message.state is BoardState.RELEASED
    board.receive(encode(Hold(), 2))
    assert not board.emits


@pytest.mark.parametrize(
    ("body", "reply"),
    [
        (b"\x01\x01\x09", Error(ErrorCode.VERSION, 1, 2)),
        (b"\x03\x01\x09", Error(ErrorCode.VERSION, 1, 2)),
        (b"\x02\x05\x09", Error(ErrorCode.TYPE, 5, 5)),
        (b"\x02\x00\x09", Error(ErrorCode.TYPE, 0, 0)),
        (b"\x02\x02\x09" + bytes(5), Error(ErrorCode.LENGTH, 2, 5)),
        (b"\x02\x01\x09\x00", Error(ErrorCode.LENGTH, 1, 1)),
        (b"\x02\x02\x09\x98\x3a\xc1\x5d\x98\x3a", Error(ErrorCode.PULSE, 2, 1)),
        (b"\x02\x02\x09\x3f\x15\xc1\x5d\x98\x3a", Error(ErrorCode.PULSE, 2, 0)),
    ],
)
def test_what_cannot_be_carried_out_is_answered_by_its_error(board, body: bytes, reply: Error) -> None:
    assert answers(board.receive(framed(body))) == [Frame(9, reply)]
    assert (board.state, board.pulses) == (BoardState.IDLE, (0, 0, 0))


def test_a_board_does_not_answer_its_own_replies(board: NativeProtocol) -> None:
    reply = board.receive(encode(Hello(), 0))
    assert reply and board.receive(reply) == b""


def test_flags_tell_what_happened_once(board: NativeProtocol) -> None:
    def flags(sequence: int) -> Flags:
        return answers(board.receive(encode(Hello(), sequence)))[0].message.flags

    assert flags(200) == Flags.RESTARTED
    assert flags(201) == Flags(0)
    assert flags(203) == Flags.SEQUENCE_GAP
    assert flags(203) == Flags.SEQUENCE_GAP
    assert flags(204) == Flags(0)
    board.lose_output()
    assert flags(205) == Flags.OVERRUN
    assert flags(206) == Flags(0)


def test_lost_input_voids_the_frame_it_hit_and_only_that(board: NativeProtocol) -> None:
    board.receive(encode(Hello(), 0))
    frame = encode(SetPulses((15000, 15000, 15000)), 1)
    board.receive(frame[:6])
    board.lose_input()
    assert board.receive(frame[6:]) == b""
    [answer] = answers(board.receive(encode(Hold(), 2)))
    assert answer.message == Acknowledgement(
        BoardState.IDLE, Flags.OVERRUN | Flags.SEQUENCE_GAP, (0, 0, 0), 1
    )


def test_an_imu_line_passes_as_text_before_and_as_a_frame_after_the_first_frame(
    board: NativeProtocol,
) -> None:
    assert board.imu_line("-3.5,12.25,") == b"-3.5,12.25,\n"
    board.receive(encode(Hello(), 0))
    longest = "x" * 32
    assert answers(board.imu_line("-3.5,12.25,")) == [Frame(0, ImuLine("-3.5,12.25,"))]
    assert answers(board.imu_line(longest)) == [Frame(1, ImuLine(longest))]
