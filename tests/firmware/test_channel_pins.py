"""Tier 2: the firmware with a winch and a pressure on a simulated processor: what its pins do, and what it reports."""

from collections.abc import Iterator

import pytest

from tests.firmware import build
from tests.firmware.simulated_board import SimulatedBoard
from tripod_driver.framed import (
    ChannelDescription,
    ChannelFlags,
    ChannelKind,
    Decoder,
    DescribeChannel,
    Error,
    ErrorCode,
    GetChannels,
    HomeChannel,
    Message,
    SetChannels,
    encode,
)

DIRECTION, STEP, HOME, TAUT = ("D", 3), ("D", 2), ("C", 1), ("C", 2)
INLET, OUTLET = ("C", 5), ("B", 0)
OUTPUTS = {"B": 0x25, "C": 0x28, "D": 0x2B}
"""Addresses of the ports' registers."""


class Board:
    """The simulated board, asked by messages."""

    def __init__(self) -> None:
        elf = build.firmware(SERVO_COUNT=1, WINCH_COUNT=1, PRESSURE_COUNT=1)
        self.simulated = SimulatedBoard(build.simulator(), elf)
        self._decoder, self._sequence = Decoder(1), 0
        self.set(HOME, True)
        self.set(TAUT, False)
        self.simulated.run(0.05)

    def set(self, pin: tuple[str, int], high: bool) -> None:
        self.simulated.set_pin(*pin, high)

    def level(self, pin: tuple[str, int]) -> bool:
        return bool(self.simulated.memory(OUTPUTS[pin[0]]) & 1 << pin[1])

    def ask(self, message: Message) -> Message:
        self._sequence = (self._sequence + 1) % 256
        self.simulated.write(encode(message, self._sequence))
        self.simulated.run(0.01)
        [frame] = self._decoder.feed(self.simulated.read(self.simulated.in_waiting))
        return frame.message

    def steps(self, duration: float) -> int:
        """Return how often the step pin rises."""
        count, before = 0, False
        for _ in range(round(duration / 1.5e-6)):
            self.simulated.run(1.5e-6)
            now = self.level(STEP)
            count, before = count + (now and not before), now
        return count


@pytest.fixture
def board() -> Iterator[Board]:
    made = Board()
    yield made
    made.simulated.close()


def test_it_says_what_its_channels_are(board: Board) -> None:
    assert board.ask(DescribeChannel(0)) == ChannelDescription(2, 0, ChannelKind.WINCH, 6000, 10)
    assert board.ask(DescribeChannel(1)) == ChannelDescription(2, 1, ChannelKind.PRESSURE, 800, 16)


def test_a_winch_pays_out_until_the_switch_closes_and_then_takes_as_many_steps_as_asked(board: Board) -> None:
    assert board.ask(SetChannels((5, 0))) == Error(ErrorCode.PLACE, 6, 0)
    board.ask(HomeChannel(0))
    assert board.steps(0.1) in (4, 5, 6)
    assert not board.level(DIRECTION)
    board.set(HOME, False)
    board.simulated.run(0.05)
    assert board.ask(GetChannels()).channels[0].flags == ChannelFlags.KNOWN
    board.ask(SetChannels((23, 0)))
    made = board.steps(0.12)
    assert board.level(DIRECTION)
    state = board.ask(GetChannels()).channels[0]
    assert state.setpoint == 23
    assert 0 <= 23 - made <= 10  # the first may have been made while it answered


def test_a_cable_that_is_slack_stops_its_winch(board: Board) -> None:
    board.set(HOME, False)
    board.ask(HomeChannel(0))
    board.simulated.run(0.05)
    board.set(TAUT, True)
    board.ask(SetChannels((100, 0)))
    board.simulated.run(0.1)
    state = board.ask(GetChannels()).channels[0]
    assert state.flags == ChannelFlags.KNOWN | ChannelFlags.SLACK
    assert state.setpoint == 0


def test_a_pressure_opens_its_inlet_and_silence_its_outlet(board: Board) -> None:
    assert (board.level(INLET), board.level(OUTLET)) == (False, False)
    board.ask(SetChannels((0, 100)))
    board.simulated.run(0.2)
    assert (board.level(INLET), board.level(OUTLET)) == (True, True)
    assert board.ask(GetChannels()).channels[1].setpoint == 100
    board.simulated.run(0.4)
    assert (board.level(INLET), board.level(OUTLET)) == (False, False)
    assert board.ask(GetChannels()).channels[1].setpoint == 0
