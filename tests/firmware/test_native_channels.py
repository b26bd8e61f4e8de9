"""Tier 1: winches and pressures in the firmware's C code, built for this machine with sanitizers."""

from collections.abc import Iterator

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.firmware.test_native_protocol import NativeProtocol, answers
from tripod_driver.framed import (
    ChannelDescription,
    ChannelFlags,
    ChannelKind,
    ChannelState,
    Decoder,
    DescribeChannel,
    Error,
    ErrorCode,
    GetChannels,
    Hold,
    HomeChannel,
    Message,
    Release,
    SetChannels,
    encode,
)
from tripod_driver.ports.mock_board import MockBoard

KNOWN, HOMING, FAILED = ChannelFlags.KNOWN, ChannelFlags.HOMING, ChannelFlags.HOME_FAILED
WINCH_SLEW, PRESSURE_SLEW, WINCH_MAX, PRESSURE_MAX = 10, 16, 6000, 800
AT_HOME, SLACK = 1, 2


class ChannelBoard(NativeProtocol):
    """A board with a winch and a pressure, whose sensors the test sets."""

    def __init__(self) -> None:
        super().__init__(channels=(1, 1))
        self._sequence = 0

    def ask(self, message: Message) -> Message:
        self._sequence = (self._sequence + 1) % 256
        (frame,) = answers(self.receive(encode(message, self._sequence)))
        return frame.message

    def set(self, winch: int, pressure: int) -> tuple[ChannelState, ...] | Message:
        found = self.ask(SetChannels((winch, pressure)))
        return found if isinstance(found, Error) else found.channels

    def measure(self, winch: int, pressure: int) -> None:
        self._do(b"M", winch)
        self._do(b"M", pressure)

    def channels(self, periods: int = 1) -> None:
        self._do(b"C", periods)

    def home(self) -> tuple[ChannelState, ...]:
        return self.ask(HomeChannel(0)).channels


@pytest.fixture
def board() -> Iterator[ChannelBoard]:
    native = ChannelBoard()
    yield native
    assert native.close() == 0


@pytest.fixture
def homed(board: ChannelBoard) -> ChannelBoard:
    board.home()
    board.measure(AT_HOME, 0)
    board.channels()
    board.measure(0, 0)
    return board


def test_a_board_describes_its_channels(board: ChannelBoard) -> None:
    assert board.ask(DescribeChannel(0)) == ChannelDescription(2, 0, ChannelKind.WINCH, WINCH_MAX, WINCH_SLEW)
    pressure = ChannelDescription(2, 1, ChannelKind.PRESSURE, PRESSURE_MAX, PRESSURE_SLEW)
    assert board.ask(DescribeChannel(1)) == pressure
    assert board.ask(DescribeChannel(2)) == Error(ErrorCode.CHANNEL, 5, 2)


def test_a_board_of_servos_only_refuses_messages_on_channels() -> None:
    board = NativeProtocol()
    messages = (DescribeChannel(0), SetChannels((1,)), HomeChannel(0), GetChannels())
    for kind, message in enumerate(messages, start=5):
        (frame,) = answers(board.receive(encode(message, kind)))
        assert frame.message == Error(ErrorCode.TYPE, kind, kind)
    assert board.close() == 0


def test_asking_for_the_states_changes_nothing_and_keeps_nothing(homed: ChannelBoard) -> None:
    homed.measure(0, 100)
    homed.set(100, 100)
    homed.channels(2)
    assert [c.setpoint for c in homed.ask(GetChannels()).channels] == [2 * WINCH_SLEW, 2 * PRESSURE_SLEW]
    homed.channels(2)
    homed.tick(400)
    assert [c.setpoint for c in homed.ask(GetChannels()).channels] == [4 * WINCH_SLEW, 4 * PRESSURE_SLEW]
    homed.tick(101)
    assert [c.setpoint for c in homed.ask(GetChannels()).channels] == [4 * WINCH_SLEW, 0]


def test_set_points_keep_homing_alive_and_do_not_begin_it_again(board: ChannelBoard) -> None:
    board.home()
    board.channels(20)
    for _ in range(3):
        board.tick(400)
        assert board.set(0, 0)[0].flags == HOMING
    board.measure(AT_HOME, 0)
    board.channels()
    assert board.set(0, 0)[0].flags == KNOWN


def test_a_winch_moves_only_after_homing(board: ChannelBoard) -> None:
    assert board.set(100, 0) == Error(ErrorCode.PLACE, 6, 0)
    board.channels(10)
    assert board.set(0, 0)[0] == ChannelState(ChannelFlags(0), 0, 0)
    assert board.home()[0].flags == HOMING
    board.measure(AT_HOME, 0)
    board.channels()
    assert board.set(100, 0)[0] == ChannelState(KNOWN, 0, AT_HOME)
    board.channels(4)
    assert board.set(100, 0)[0].setpoint == 4 * WINCH_SLEW
    board.channels(20)
    assert board.set(100, 0)[0].setpoint == 100


def test_homing_ends_without_the_switch_after_the_range_and_a_quarter(board: ChannelBoard) -> None:
    board.home()
    board.channels(WINCH_MAX + WINCH_MAX // 4)
    assert board.home()[0].flags == HOMING
    board.channels(2)
    found = board.set(0, 0)
    assert isinstance(found, tuple) and found[0].flags == FAILED
    assert board.set(1, 0) == Error(ErrorCode.PLACE, 6, 0)


def test_homing_ends_when_the_host_is_silent(board: ChannelBoard) -> None:
    board.home()
    board.tick(400)
    assert board.home()[0].flags == HOMING
    board.tick(501)
    assert board.set(0, 0)[0].flags == ChannelFlags(0)


def test_set_points_out_of_range_change_nothing(homed: ChannelBoard) -> None:
    assert homed.set(WINCH_MAX + 1, 0) == Error(ErrorCode.CHANNEL, 6, 0)
    assert homed.set(50, PRESSURE_MAX + 1) == Error(ErrorCode.CHANNEL, 6, 1)
    homed.channels(10)
    assert [c.setpoint for c in homed.set(0, 0)] == [0, 0]
    assert homed.ask(HomeChannel(1)) == Error(ErrorCode.CHANNEL, 7, 1)
    assert homed.ask(SetChannels((1,))) == Error(ErrorCode.LENGTH, 6, 2)


def test_hold_stops_both_and_silence_vents_and_holds_the_winch(homed: ChannelBoard) -> None:
    homed.measure(0, 100)
    homed.set(100, 100)
    homed.channels(3)
    homed.ask(Hold())
    homed.channels(30)
    assert [c.setpoint for c in homed.set(30, 48)] == [3 * WINCH_SLEW, 3 * PRESSURE_SLEW]
    homed.tick(501)
    homed.channels(30)
    assert [c.setpoint for c in homed.set(30, 0)] == [3 * WINCH_SLEW, 0]


def test_release_vents_and_holds_the_winch(homed: ChannelBoard) -> None:
    homed.measure(0, 100)
    homed.set(30, 48)
    homed.channels(3)
    homed.ask(Release())
    homed.channels(3)
    assert [c.setpoint for c in homed.set(30, 0)] == [30, 0]


def test_a_leak_stops_the_rise_and_a_new_target_tries_again(homed: ChannelBoard) -> None:
    homed.measure(0, 0)
    homed.set(0, 100)
    homed.channels(60)
    found = homed.set(0, 100)[1]
    assert found.flags == KNOWN | ChannelFlags.LEAK
    assert found.setpoint == 100
    homed.channels(60)
    assert homed.set(0, 700)[1] == ChannelState(KNOWN | ChannelFlags.LEAK, 100, 0)
    homed.channels(10)
    assert homed.set(0, 99)[1] == ChannelState(KNOWN, 100, 0)


def test_a_pressure_near_its_set_point_is_no_leak(homed: ChannelBoard) -> None:
    homed.measure(0, 41)
    homed.set(0, 100)
    homed.channels(500)
    assert homed.set(0, 100)[1] == ChannelState(KNOWN, 100, 41)


def test_a_slack_cable_stops_the_pull(homed: ChannelBoard) -> None:
    homed.set(500, 0)
    homed.channels(5)
    homed.measure(SLACK, 0)
    homed.channels(5)
    found = homed.set(500, 0)[0]
    assert (found.flags, found.setpoint) == (KNOWN | ChannelFlags.SLACK, 5 * WINCH_SLEW)
    homed.measure(0, 0)
    homed.channels(5)
    assert homed.set(500, 0)[0].setpoint == 5 * WINCH_SLEW
    assert homed.set(40, 0)[0].flags == KNOWN


operation = st.one_of(
    st.tuples(st.just("set"), st.integers(0, 6100), st.integers(0, 820)),
    st.tuples(st.just("set"), st.integers(0, 40), st.integers(0, 200)),
    st.tuples(st.sampled_from(["home", "hold", "release", "get", "break", "mend"])),
    st.tuples(st.just("wait"), st.sampled_from([1, 3, 20, 60])),
)


HOMED = [("home",), *[("wait", 20), ("set", 0, 0)] * 3]
UP = [("set", 100, 300), ("wait", 20)] * 3
FAILED_HARDWARE = [
    *HOMED,
    *UP,
    ("break",),
    *[("set", 200, 400), ("wait", 3)] * 25,
    ("set", 50, 100),
    ("wait", 20),
]


@example([*FAILED_HARDWARE, ("mend",), *UP])
@example([*HOMED, *UP, ("wait", 60), *UP, ("release",), ("wait", 3), *UP, ("hold",), ("wait", 3)])
@given(st.lists(operation, max_size=25))
@settings(max_examples=40, deadline=None)
def test_the_board_in_memory_does_what_the_firmware_does(operations: list[tuple]) -> None:
    now = [0.0]
    mock = MockBoard(lambda: now[0], channels=(ChannelKind.WINCH, ChannelKind.PRESSURE), homed=False)
    native, decoder = ChannelBoard(), Decoder()
    messages = {"home": HomeChannel(0), "hold": Hold(), "release": Release(), "get": GetChannels()}
    try:
        for word, *values in operations:
            if word in ("break", "mend"):
                for channel in mock.channels.all:
                    channel.broken = word == "break"
            elif word == "wait":
                for _ in range(values[0]):
                    for channel in mock.channels.all:
                        channel._measure()
                    native.tick(20)
                    native.measure(*(channel.measured for channel in mock.channels.all))
                    native.channels()
                    now[0] += 0.02 + 1e-9
                    mock.write(b"")
            else:
                message = messages.get(word) or SetChannels(tuple(values))
                mock.write(encode(message, 1))
                [frame] = decoder.feed(mock.read())
                found, wanted = frame.message, native.ask(message)
                if isinstance(wanted, Error):
                    assert found == wanted
            told = [(c.flags, c.setpoint) for c in native.ask(GetChannels()).channels]
            assert [(c.flags, c.setpoint) for c in mock.channels.all] == told, word
    finally:
        assert native.close() == 0
