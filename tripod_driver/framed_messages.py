"""Messages of the `framed` protocol (docs/protocol.md): what host and board tell each other, without the bytes."""

from dataclasses import dataclass
from enum import IntEnum, IntFlag

from tripod_driver.protocol import ProtocolError

TEXT_MAX = 32
"""Longest text of an `ImuLine`."""

Pulses = tuple[int, ...]
"""Pulse width of each servo [0.1 us], 0 to 65535."""

SERVOS_MAX = 10
"""Most servos of one board: a hello reply with more pulses is longer than a frame can be."""

CHANNELS_MAX = 7
"""Most channels beside the servos: the states of more are longer than a frame can be."""


def _check_number(name: str, value: int, highest: int) -> None:
    if not 0 <= value <= highest:
        raise ProtocolError(f"{name} is {value}; allowed: 0 to {highest}")


def _check_channels(count: int) -> None:
    if not 0 < count <= CHANNELS_MAX:
        raise ProtocolError(f"{count} channels given; a message carries 1 to {CHANNELS_MAX}")


def _check_pulses(pulses: Pulses, fewest: int = 1) -> None:
    if not fewest <= len(pulses) <= SERVOS_MAX:
        raise ProtocolError(f"{len(pulses)} pulses given; a message carries {fewest} to {SERVOS_MAX}")
    for i, pulse in enumerate(pulses):
        _check_number(f"pulse of servo_{i}", pulse, 0xFFFF)


class BoardState(IntEnum):
    """What the board does with the servos."""

    IDLE = 0
    """No command came yet: no pulses."""
    ACTIVE = 1
    """Pulses as commanded."""
    HOLDING = 2
    """The last pulses, because of `Hold` or of silence."""
    RELEASED = 3
    """No pulses, because of `Release` or of silence."""


class Flags(IntFlag):
    """What happened since the last reply that carried flags."""

    RESTARTED = 1
    """This is the first reply since the board was reset."""
    WATCHDOG = 2
    """The host was silent so long that the board held, and perhaps released, by itself."""
    SEQUENCE_GAP = 4
    """The sequence did not follow the last one: frames were lost, or someone else writes too."""
    OVERRUN = 8
    """Bytes were lost because the board could not take, or send, them in time."""


class ResetCause(IntFlag):
    """Why the board was reset last; 0 where its boot loader does not let it know."""

    POWER_ON = 1
    """It was switched on."""
    EXTERNAL = 2
    """By its button, or because its port was opened."""
    BROWN_OUT = 4
    """Its supply broke down."""
    WATCHDOG = 8
    """By its hardware watchdog: the firmware had hung."""


class ChannelKind(IntEnum):
    """What a channel beside the servos drives."""

    WINCH = 1
    """A cable; its set-point is the length pulled in from home [steps]."""
    PRESSURE = 2
    """A chamber; its set-point is the pressure above ambient [counts]."""


class ChannelFlags(IntFlag):
    """What is known of a channel."""

    KNOWN = 1
    """Its place is known: a winch was homed since the last reset. Always set for a pressure."""
    HOMING = 2
    """A winch looks for its home switch."""
    HOME_FAILED = 4
    """The home switch did not close over the whole range and a quarter of it."""
    SLACK = 8
    """The cable of a winch went slack while it was pulled in: the board holds it."""
    LEAK = 16
    """A pressure stayed below its set-point: the board does not raise it further."""


class ErrorCode(IntEnum):
    """Why the board refused a message whose CRC was right."""

    VERSION = 1
    """Another version of the protocol; the detail is the board's own."""
    TYPE = 2
    """No such message; the detail is its type."""
    LENGTH = 3
    """Payload of the wrong length; the detail is its length."""
    PULSE = 4
    """Pulse out of the board's range; the detail is the number of the servo."""
    CHANNEL = 5
    """No such channel, or a set-point out of its range; the detail is its number."""
    PLACE = 6
    """A winch that was not homed must not be moved; the detail is its number."""


@dataclass(frozen=True)
class Hello:
    """Host to board: who are you? Changes nothing on the board."""


@dataclass(frozen=True)
class SetPulses:
    """Host to board: emit these pulses from the next period on.

    Attributes:
        pulses: Pulse width of each servo [0.1 us].
    """

    pulses: Pulses

    def __post_init__(self) -> None:
        _check_pulses(self.pulses)


@dataclass(frozen=True)
class Hold:
    """Host to board: keep the pulses as they are; without pulses, change nothing."""


@dataclass(frozen=True)
class Release:
    """Host to board: no more pulses; the servos let go."""


@dataclass(frozen=True)
class DescribeChannel:
    """Host to board: what is this channel? A board without channels answers with an error.

    Attributes:
        number: Of the channel, 0 the first.
    """

    number: int

    def __post_init__(self) -> None:
        _check_number("channel", self.number, 0xFF)


@dataclass(frozen=True)
class SetChannels:
    """Host to board: bring the channels to these set-points, each at its limited rate.

    Attributes:
        targets: Set-point of each channel [steps, counts].
    """

    targets: tuple[int, ...]

    def __post_init__(self) -> None:
        _check_channels(len(self.targets))
        for i, target in enumerate(self.targets):
            _check_number(f"set-point of channel {i}", target, 0xFFFF)


@dataclass(frozen=True)
class HomeChannel:
    """Host to board: move this winch slowly to its home switch, as long as the host keeps the channels.

    Attributes:
        number: Of the channel.
    """

    number: int

    def __post_init__(self) -> None:
        _check_number("channel", self.number, 0xFF)


@dataclass(frozen=True)
class GetChannels:
    """Host to board: how are the channels? Changes nothing on the board."""


@dataclass(frozen=True)
class ChannelDescription:
    """Board to host: what a channel is.

    Attributes:
        count: How many channels the board has.
        number: Of this one.
        kind: What it drives.
        highest: Largest set-point [steps, counts]; the smallest is 0.
        slew: Largest change of the set-point in 20 ms [steps, counts].
    """

    count: int
    number: int
    kind: ChannelKind
    highest: int
    slew: int

    def __post_init__(self) -> None:
        _check_channels(self.count)
        _check_number("channel", self.number, self.count - 1)
        _check_number("highest", self.highest, 0xFFFF)
        _check_number("slew", self.slew, 0xFFFF)


@dataclass(frozen=True)
class ChannelState:
    """One channel in `ChannelStates`.

    Attributes:
        flags: What is known of it.
        setpoint: Its set-point now [steps, counts]; of a winch without `KNOWN` it means nothing.
        measured: A pressure [counts]; of a winch bit 0: at home, bit 1: slack.
    """

    flags: ChannelFlags
    setpoint: int
    measured: int

    def __post_init__(self) -> None:
        _check_number("flags", self.flags, 0xFF)
        _check_number("setpoint", self.setpoint, 0xFFFF)
        _check_number("measured", self.measured, 0xFFFF)


@dataclass(frozen=True)
class ChannelStates:
    """Board to host: the channels now, in answer to `SetChannels`, `HomeChannel` and `GetChannels`.

    Attributes:
        channels: One for each channel.
    """

    channels: tuple[ChannelState, ...]

    def __post_init__(self) -> None:
        _check_channels(len(self.channels))


@dataclass(frozen=True)
class HelloReply:
    """Board to host: what it is and what it does.

    Attributes:
        firmware: Version of the firmware: major, minor.
        protocol: Version of the protocol.
        servo_count: Number of servos, which is that of its pulses.
        pulse_min: Shortest pulse that the board emits [0.1 us].
        pulse_max: Longest pulse that the board emits [0.1 us].
        watchdog: Silence after which the board holds, and after as much again releases [ms].
        slew: Largest change of a pulse from one period of 20 ms to the next [0.1 us].
        reset: Why the board was reset last.
        state: What the board does with the servos.
        flags: What happened since the last reply.
        pulses: Pulse widths of the next period or, when there are none, the last ones, also if they were emitted before
            a reset [0.1 us]; 0 where nobody knows them.
    """

    firmware: tuple[int, int]
    protocol: int
    servo_count: int
    pulse_min: int
    pulse_max: int
    watchdog: int
    slew: int
    reset: ResetCause
    state: BoardState
    flags: Flags
    pulses: Pulses

    def __post_init__(self) -> None:
        if len(self.firmware) != 2:
            raise ProtocolError(f"firmware version {self.firmware}; it has two numbers")
        for name, value in (
            ("firmware", self.firmware[0]),
            ("firmware", self.firmware[1]),
            ("protocol", self.protocol),
            ("servo_count", self.servo_count),
            ("reset", self.reset),
            ("flags", self.flags),
        ):
            _check_number(name, value, 0xFF)
        for name, value in (
            ("pulse_min", self.pulse_min),
            ("pulse_max", self.pulse_max),
            ("watchdog", self.watchdog),
            ("slew", self.slew),
        ):
            _check_number(name, value, 0xFFFF)
        _check_pulses(self.pulses, 0)


@dataclass(frozen=True)
class Acknowledgement:
    """Board to host: the message with this frame's sequence was carried out.

    Attributes:
        state: What the board does with the servos now.
        flags: What happened since the last reply.
        pulses: As in `HelloReply`: what the servos get after the board's limit of their speed, in the steps of its
            timer; where that is not yet what was asked for, the board goes on towards it in every period.
        dropped: Frames that reached the board damaged, from the first sound one on, modulo 65536.
    """

    state: BoardState
    flags: Flags
    pulses: Pulses
    dropped: int

    def __post_init__(self) -> None:
        _check_number("flags", self.flags, 0xFF)
        _check_number("dropped", self.dropped, 0xFFFF)
        _check_pulses(self.pulses, 0)


@dataclass(frozen=True)
class Error:
    """Board to host: the message with this frame's sequence was refused and changed nothing.

    Attributes:
        code: Why.
        type: Type byte of the refused message.
        detail: What `code` says of it.
    """

    code: ErrorCode
    type: int
    detail: int

    def __post_init__(self) -> None:
        _check_number("type", self.type, 0xFF)
        _check_number("detail", self.detail, 0xFFFF)


@dataclass(frozen=True)
class ImuLine:
    """Board to host: one line that an IMU wrote.

    Attributes:
        text: The line without its end, printable ASCII, at most TEXT_MAX characters.
    """

    text: str

    def __post_init__(self) -> None:
        if len(self.text) > TEXT_MAX or not (self.text.isascii() and self.text.isprintable()):
            raise ProtocolError(f"IMU line {self.text!r}: printable ASCII, at most {TEXT_MAX} characters")


@dataclass(frozen=True)
class OtherVersion:
    """A frame of another version of the protocol, sound but not understood. Only received, never sent.

    Attributes:
        version: Version of the protocol that the sender speaks.
    """

    version: int


Message = (
    Hello
    | SetPulses
    | Hold
    | Release
    | DescribeChannel
    | SetChannels
    | HomeChannel
    | GetChannels
    | HelloReply
    | Acknowledgement
    | Error
    | ImuLine
    | ChannelDescription
    | ChannelStates
)
"""What can be sent."""


@dataclass(frozen=True)
class Frame:
    """A message received.

    Attributes:
        sequence: Sequence number, 0 to 255; a reply has that of what it answers.
        message: The message.
    """

    sequence: int
    message: Message | OtherVersion
