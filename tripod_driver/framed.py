"""Bytes of the `framed` protocol, as docs/protocol.md specifies them: messages to frames and back, without a port.

A frame is 00 | COBS(version, type, sequence, payload, CRC) | 00. Numbers have the low byte first; pulse widths are
in tenths of a microsecond. The decoder takes any bytes: what is no frame is dropped and counted by its reason.
"""

import struct
from binascii import crc_hqx
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TypeVar

from tripod_driver.framed_messages import (
    TEXT_MAX,
    Acknowledgement,
    BoardState,
    ChannelDescription,
    ChannelFlags,
    ChannelKind,
    ChannelState,
    ChannelStates,
    DescribeChannel,
    Error,
    ErrorCode,
    Flags,
    Frame,
    GetChannels,
    Hello,
    HelloReply,
    Hold,
    HomeChannel,
    ImuLine,
    Message,
    OtherVersion,
    Pulses,
    Release,
    ResetCause,
    SetChannels,
    SetPulses,
)
from tripod_driver.protocol import SERVO_COUNT, ProtocolError

__all__ = [
    "BODY_MAX",
    "TEXT_MAX",
    "TYPES",
    "VERSION",
    "Acknowledgement",
    "BoardState",
    "ChannelDescription",
    "ChannelFlags",
    "ChannelKind",
    "ChannelState",
    "ChannelStates",
    "Decoder",
    "DescribeChannel",
    "Drop",
    "Error",
    "ErrorCode",
    "Flags",
    "Frame",
    "GetChannels",
    "Hello",
    "HelloReply",
    "Hold",
    "HomeChannel",
    "ImuLine",
    "Message",
    "OtherVersion",
    "Pulses",
    "Release",
    "ResetCause",
    "SetChannels",
    "SetPulses",
    "cobs_decode",
    "cobs_encode",
    "encode",
]

VERSION = 2
"""Version of the protocol that this module speaks."""

BODY_MAX = 40
"""Longest body, the bytes from the version to the CRC; a longer one is dropped."""

_HEADER_SIZE, _CRC_SIZE = 3, 2


class Drop(StrEnum):
    """Why bytes between two delimiters were dropped."""

    TOO_LONG = "longer than a frame can be"
    COBS = "stuffing wrong"
    TOO_SHORT = "shorter than a frame can be"
    CRC = "checksum wrong"
    TYPE = "unknown type"
    LENGTH = "payload of the wrong length"
    VALUE = "value without a meaning"


_HELLO_REPLY = struct.Struct("<4B4H3B")
_STATE = struct.Struct("<2B")
_DROPPED = struct.Struct("<H")
_ERROR = struct.Struct("<2BH")
_DESCRIPTION = struct.Struct("<3B2H")
_CHANNEL = struct.Struct("<B2H")

TYPES: dict[type, int] = {
    Hello: 0x01,
    SetPulses: 0x02,
    Hold: 0x03,
    Release: 0x04,
    DescribeChannel: 0x05,
    SetChannels: 0x06,
    HomeChannel: 0x07,
    GetChannels: 0x08,
    HelloReply: 0x81,
    Acknowledgement: 0x82,
    Error: 0x83,
    ImuLine: 0x84,
    ChannelDescription: 0x85,
    ChannelStates: 0x86,
}
"""Type bytes of messages."""

M = TypeVar("M", Hello, Hold, Release, GetChannels)


def _payload(message: Message) -> bytes:  # noqa: PLR0911 - one for each kind
    match message:
        case SetPulses():
            return _packed(message.pulses)
        case HelloReply() as m:
            return _HELLO_REPLY.pack(
                *m.firmware,
                m.protocol,
                m.servo_count,
                m.pulse_min,
                m.pulse_max,
                m.watchdog,
                m.slew,
                m.reset,
                m.state,
                m.flags,
            ) + _packed(m.pulses)
        case Acknowledgement() as m:
            return _STATE.pack(m.state, m.flags) + _packed(m.pulses) + _DROPPED.pack(m.dropped)
        case Error():
            return _ERROR.pack(message.code, message.type, message.detail)
        case ImuLine():
            return message.text.encode("ascii")
        case DescribeChannel() | HomeChannel():
            return bytes([message.number])
        case SetChannels():
            return _packed(message.targets)
        case ChannelDescription() as m:
            return _DESCRIPTION.pack(m.count, m.number, m.kind, m.highest, m.slew)
        case ChannelStates():
            return b"".join(_CHANNEL.pack(c.flags, c.setpoint, c.measured) for c in message.channels)
        case _:
            return b""


def _empty(kind: type[M]) -> Callable[[bytes], M]:
    def decode(payload: bytes) -> M:
        if payload:
            raise struct.error
        return kind()

    return decode


def _packed(pulses: Pulses) -> bytes:
    return struct.pack(f"<{len(pulses)}H", *pulses)


def _pulses(payload: bytes) -> Pulses:
    return struct.unpack(f"<{len(payload) // 2}H", payload)


def _set_pulses(payload: bytes) -> SetPulses:
    return SetPulses(_pulses(payload))


def _hello_reply(payload: bytes) -> HelloReply:
    size = _HELLO_REPLY.size
    major, minor, protocol, count, low, high, watchdog, slew, *rest = _HELLO_REPLY.unpack(payload[:size])
    reset, state, flags = rest
    limits = (low, high, watchdog, slew)
    told = (ResetCause(reset), BoardState(state), Flags(flags), _pulses(payload[size:]))
    return HelloReply((major, minor), protocol, count, *limits, *told)


def _acknowledgement(payload: bytes) -> Acknowledgement:
    state, flags = _STATE.unpack(payload[: _STATE.size])
    (dropped,) = _DROPPED.unpack(payload[-_DROPPED.size :])
    return Acknowledgement(
        BoardState(state), Flags(flags), _pulses(payload[_STATE.size : -_DROPPED.size]), dropped
    )


def _error(payload: bytes) -> Error:
    code, kind, detail = _ERROR.unpack(payload)
    return Error(ErrorCode(code), kind, detail)


def _imu_line(payload: bytes) -> ImuLine:
    return ImuLine(payload.decode("ascii"))


def _channel_description(payload: bytes) -> ChannelDescription:
    count, number, kind, highest, slew = _DESCRIPTION.unpack(payload)
    return ChannelDescription(count, number, ChannelKind(kind), highest, slew)


def _channel_states(payload: bytes) -> ChannelStates:
    found = _CHANNEL.iter_unpack(payload)
    return ChannelStates(tuple(ChannelState(ChannelFlags(flags), *values) for flags, *values in found))


_DECODERS: dict[int, Callable[[bytes], Message]] = {
    0x01: _empty(Hello),
    0x02: _set_pulses,
    0x03: _empty(Hold),
    0x04: _empty(Release),
    0x05: lambda payload: DescribeChannel(*struct.unpack("B", payload)),
    0x06: lambda payload: SetChannels(_pulses(payload)),
    0x07: lambda payload: HomeChannel(*struct.unpack("B", payload)),
    0x08: _empty(GetChannels),
    0x81: _hello_reply,
    0x82: _acknowledgement,
    0x83: _error,
    0x84: _imu_line,
    0x85: _channel_description,
    0x86: _channel_states,
}


_SIZES = {0x02: 0, 0x82: _STATE.size + _DROPPED.size}
"""Length of payloads that have a pulse for each servo, without these."""


def cobs_encode(data: bytes) -> bytes:
    """Return `data`, at most 253 bytes, without zero bytes and one byte longer [CheshireBaker1999].

    Each zero becomes the distance to the next one; a byte in front holds the distance to the first.
    """
    return b"".join(bytes([len(run) + 1]) + run for run in data.split(b"\0"))


def cobs_decode(data: bytes) -> bytes | None:
    """Return what `cobs_encode` was given, or None when `data` cannot have come from it."""
    if 0 in data:
        return None
    runs, at = [], 0
    while at < len(data):
        end = at + data[at]
        if end > len(data):
            return None
        runs.append(data[at + 1 : end])
        at = end
    return b"\0".join(runs) if runs else None


def encode(message: Message, sequence: int) -> bytes:
    """Return the frame of `message`, delimiters included.

    Raises:
        ProtocolError: `sequence` is not in 0..255.
    """
    if not 0 <= sequence <= 0xFF:
        raise ProtocolError(f"sequence is {sequence}; allowed: 0 to 255")
    body = bytes([VERSION, TYPES[type(message)], sequence]) + _payload(message)
    return b"\0" + cobs_encode(body + crc_hqx(body, 0xFFFF).to_bytes(_CRC_SIZE, "little")) + b"\0"


@dataclass
class Decoder:
    """Finds frames in a stream with garbage in it; holds BODY_MAX + 1 bytes at most.

    Attributes:
        servos: How many each message is about; only a hello reply may tell of another number.
        dropped: How often something between two delimiters was dropped, by reason.
    """

    servos: int = SERVO_COUNT
    dropped: Counter[Drop] = field(default_factory=Counter)
    _partial: bytearray = field(default_factory=bytearray)
    _too_long: bool = False

    def feed(self, data: bytes) -> list[Frame]:
        """Take the next bytes, cut anywhere; return the frames that they complete."""
        found = []
        *ended, rest = data.split(b"\0")
        for piece in ended:
            self._take(piece)
            frame = self._end()
            if frame is not None:
                found.append(frame)
        self._take(rest)
        return found

    def _take(self, piece: bytes) -> None:
        room = BODY_MAX + 1 - len(self._partial)
        self._too_long = self._too_long or len(piece) > room
        self._partial += piece[:room]

    def _end(self) -> Frame | None:
        """Return the frame that the delimiter just seen ends, if it is one."""
        encoded, too_long = bytes(self._partial), self._too_long
        self._partial.clear()
        self._too_long = False
        if not encoded:
            return None
        result = Drop.TOO_LONG if too_long else _frame(encoded, self.servos)
        if isinstance(result, Drop):
            self.dropped[result] += 1
            return None
        return result


def _frame(encoded: bytes, servos: int) -> Frame | Drop:
    body = cobs_decode(encoded)
    if body is None:
        return Drop.COBS
    if len(body) < _HEADER_SIZE + _CRC_SIZE:
        return Drop.TOO_SHORT
    if crc_hqx(body[:-_CRC_SIZE], 0xFFFF) != int.from_bytes(body[-_CRC_SIZE:], "little"):
        return Drop.CRC
    version, kind, sequence = body[:_HEADER_SIZE]
    if version != VERSION:
        return Frame(sequence, OtherVersion(version))
    message = _message(kind, body[_HEADER_SIZE:-_CRC_SIZE], servos)
    return message if isinstance(message, Drop) else Frame(sequence, message)


def _message(kind: int, payload: bytes, servos: int) -> Message | Drop:
    if kind not in _DECODERS:
        return Drop.TYPE
    if len(payload) != _SIZES.get(kind, 0) + 2 * servos and kind in _SIZES:
        return Drop.LENGTH
    try:
        return _DECODERS[kind](payload)
    except struct.error:
        return Drop.LENGTH
    except ValueError:
        return Drop.VALUE
