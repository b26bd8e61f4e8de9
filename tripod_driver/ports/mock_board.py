"""A board in memory that speaks the `framed` protocol as the firmware does (docs/protocol.md)."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Final

from tripod_driver.framed import TYPES, VERSION, Decoder, encode
from tripod_driver.framed_messages import (
    Acknowledgement,
    BoardState,
    ChannelDescription,
    ChannelKind,
    ChannelStates,
    DescribeChannel,
    Error,
    ErrorCode,
    Flags,
    GetChannels,
    Hello,
    HelloReply,
    Hold,
    HomeChannel,
    Message,
    Pulses,
    Release,
    ResetCause,
    SetChannels,
    SetPulses,
)
from tripod_driver.ports import mock_channels
from tripod_driver.protocol import SERVO_COUNT

STEP: Final = 5
"""Steps of the timer [0.1 us]."""

PULSE_RANGE: Final = (5440, 24000)
"""PULSE_MIN and PULSE_MAX of the firmware unless it is built otherwise [0.1 us]."""

MEMORY: Final = 4096
"""Pulses that are remembered: a board runs for days."""


SLEW: Final = 20000
"""Largest change from pulse to pulse [0.1 us]: all of it at once, which the firmware's default does not allow."""


class MockBoard:
    """Answers hellos, takes pulses within its range, holds and releases when the host is silent.

    Attributes:
        servos: How many it drives.
        channels: Its winches and pressures.
        pulses: What the servos get, or got last [0.1 us]; 0 before the first.
        version: Of the protocol that it speaks.
        pulse_range: Shortest and longest pulse that it makes [0.1 us].
        cause: Of its last reset.
    """

    def __init__(
        self,
        clock: Callable[[], float] = lambda: 0.0,
        *,
        version: int = VERSION,
        servos: int = SERVO_COUNT,
        channels: Sequence[ChannelKind] = (),
        homed: bool = True,
    ) -> None:
        """`clock` gives the time of watchdog and winches [s]; without it they sleep. `homed`: see `MockChannels`."""
        self.servos = servos
        self.pulse_range = PULSE_RANGE
        self.cause = ResetCause.EXTERNAL
        self.version = version
        self._history: deque[Pulses] = deque(maxlen=MEMORY)
        self._clock = clock
        self._watchdog = 0.5
        self.channels = mock_channels.MockChannels(channels, clock, self._watchdog, homed=homed)
        self.restart()

    def restart(self) -> None:
        """Forget everything, as a reset does."""
        self.pulses: Pulses = (0,) * self.servos
        self._state, self._flags = BoardState.IDLE, Flags.RESTARTED
        self._decoder = Decoder(self.servos)
        self._heard_at = self._clock()
        self._sequence: int | None = None
        self._answers = b""
        self.channels.restart()

    @property
    def history(self) -> list[Pulses]:
        """What pulses were set since it was made, in order; the last MEMORY of them."""
        return list(self._history)

    @property
    def state(self) -> BoardState:
        """What it does with the servos now."""
        self._watch()
        return self._state

    def write(self, data: bytes) -> None:
        """Take bytes from the host."""
        self._watch()
        for frame in self._decoder.feed(data):
            if self._sequence is not None and frame.sequence != (self._sequence + 1) % 256:
                self._flags |= Flags.SEQUENCE_GAP
            self._sequence = frame.sequence
            self._answers += encode(self._answer(frame.message), frame.sequence)

    def read(self) -> bytes:
        """Return its answers."""
        answers, self._answers = self._answers, b""
        return answers

    def _answer(self, message: object) -> Message:
        low, high = self.pulse_range
        if self.version != VERSION:
            return Error(ErrorCode.VERSION, 1, self.version)
        match message:
            case Hello():
                limits, told = (low, high, 500, SLEW), (self._state, self._taken_flags(), self.pulses)
                return HelloReply((0, 0), VERSION, self.servos, *limits, self.cause, *told)
            case SetPulses(pulses) if all(low <= pulse <= high for pulse in pulses):
                self.pulses = tuple(STEP * round(pulse / STEP) for pulse in pulses)
                self._history.append(self.pulses)
                self._state, self._heard_at = BoardState.ACTIVE, self._clock()
            case SetPulses(pulses):
                wrong = next(i for i, pulse in enumerate(pulses) if not low <= pulse <= high)
                return Error(ErrorCode.PULSE, 2, wrong)
            case Hold():
                for channel in self.channels.all:
                    channel.hold()
                self.channels.keep()
                self._heard_at = self._clock()
                self._state = BoardState.HOLDING if self._state is not BoardState.IDLE else BoardState.IDLE
            case Release():
                for channel in self.channels.all:
                    channel.vent()
                self._state = BoardState.RELEASED
            case DescribeChannel() | SetChannels() | HomeChannel() | GetChannels():
                return self._answer_channels(message)
        dropped = sum(self._decoder.dropped.values())
        return Acknowledgement(self._state, self._taken_flags(), self.pulses, dropped % 65536)

    def _answer_channels(self, message: DescribeChannel | SetChannels | HomeChannel | GetChannels) -> Message:
        channels, kind = self.channels.all, TYPES[type(message)]
        if wrong := self._why_not(message, kind):
            return wrong
        match message:
            case DescribeChannel(i):
                what = channels[i].kind
                limits = mock_channels.HIGHEST[what], mock_channels.SLEW[what]
                return ChannelDescription(len(channels), i, what, *limits)
            case HomeChannel(i):
                channels[i].home()
                self.channels.keep()
            case SetChannels(targets):
                for channel, target in zip(channels, targets, strict=True):
                    channel.set(target)
                self.channels.keep()
        return ChannelStates(tuple(channel.state for channel in channels))

    def _why_not(self, message: Message, kind: int) -> Error | None:
        """Return why a message on channels is refused."""
        channels = self.channels.all
        winches = [i for i, channel in enumerate(channels) if channel.kind is ChannelKind.WINCH]
        if not channels:
            return Error(ErrorCode.TYPE, kind, kind)
        match message:
            case DescribeChannel(i) if i >= len(channels):
                return Error(ErrorCode.CHANNEL, kind, i)
            case HomeChannel(i) if i not in winches:
                return Error(ErrorCode.CHANNEL, kind, i)
            case SetChannels(targets) if len(targets) != len(channels):
                return Error(ErrorCode.LENGTH, kind, 2 * len(targets))
            case SetChannels(targets) if wrong := self.channels.refusal(targets):
                return Error(wrong[0], kind, wrong[1])
        return None

    def _taken_flags(self) -> Flags:
        flags, self._flags = self._flags, Flags(0)
        return flags

    def _watch(self) -> None:
        if self.channels.advance():
            self._flags |= Flags.WATCHDOG
        silent = self._clock() - self._heard_at
        if self._state is BoardState.ACTIVE and silent >= self._watchdog:
            self._state = BoardState.HOLDING
            self._flags |= Flags.WATCHDOG
        if self._state is BoardState.HOLDING and silent >= 2 * self._watchdog:
            self._state = BoardState.RELEASED
