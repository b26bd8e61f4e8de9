"""A board in memory that speaks the `framed` protocol as the firmware does (docs/protocol.md)."""

from collections import deque
from collections.abc import Callable
from typing import Final

from tripod_driver.framed import VERSION, Decoder, encode
from tripod_driver.framed_messages import (
    Acknowledgement,
    BoardState,
    Error,
    ErrorCode,
    Flags,
    Hello,
    HelloReply,
    Hold,
    Message,
    Pulses,
    Release,
    ResetCause,
    SetPulses,
)
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
        pulses: What the servos get, or got last [0.1 us]; 0 before the first.
        version: Of the protocol that it speaks.
        pulse_range: Shortest and longest pulse that it makes [0.1 us].
        cause: Of its last reset.
    """

    def __init__(
        self, clock: Callable[[], float] = lambda: 0.0, *, version: int = VERSION, servos: int = SERVO_COUNT
    ) -> None:
        """`clock` gives the time of its watchdog [s]; without it the watchdog sleeps."""
        self.servos = servos
        self.pulse_range = PULSE_RANGE
        self.cause = ResetCause.EXTERNAL
        self.version = version
        self._history: deque[Pulses] = deque(maxlen=MEMORY)
        self._clock = clock
        self._watchdog = 0.5
        self.restart()

    def restart(self) -> None:
        """Forget everything, as a reset does."""
        self.pulses: Pulses = (0,) * self.servos
        self._state, self._flags = BoardState.IDLE, Flags.RESTARTED
        self._decoder = Decoder(self.servos)
        self._heard_at = self._clock()
        self._sequence: int | None = None
        self._answers = b""

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
                self._heard_at = self._clock()
                self._state = BoardState.HOLDING if self._state is not BoardState.IDLE else BoardState.IDLE
            case Release():
                self._state = BoardState.RELEASED
        dropped = sum(self._decoder.dropped.values())
        return Acknowledgement(self._state, self._taken_flags(), self.pulses, dropped % 65536)

    def _taken_flags(self) -> Flags:
        flags, self._flags = self._flags, Flags(0)
        return flags

    def _watch(self) -> None:
        silent = self._clock() - self._heard_at
        if self._state is BoardState.ACTIVE and silent >= self._watchdog:
            self._state = BoardState.HOLDING
            self._flags |= Flags.WATCHDOG
        if self._state is BoardState.HOLDING and silent >= 2 * self._watchdog:
            self._state = BoardState.RELEASED
