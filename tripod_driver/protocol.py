"""Packets of the workshop's boards: angles [rad] to whole degrees and back (docs/protocol.md).

Its firmware (protocol `legacy`) reads `[255, a, b, c]`, one byte a servo in whole degrees, and never answers. 180 is
the flat piece, less bends the strip down; 255 occurs only at the start of a packet. Its closed-loop variant (`ascii`)
reads the same degrees as text and answers with lines of an IMU.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

HEADER = 255
"""First byte of a packet."""

BYTE_MIN, BYTE_MAX = 60, 180
"""Angle bytes that the workshop sends [degree]; others never leave and are never accepted."""

SERVO_COUNT = 3


class ProtocolError(ValueError):
    """An angle or a packet that is refused; the message names the value and what is allowed."""


class AngleMapping(StrEnum):
    """How an angle becomes a whole number of degrees.

    `ROUNDED` is within half a degree. `TUTORIAL` is what the workshop's program computes; on average it bends
    the strips 1.5 degrees further than asked.
    """

    ROUNDED = "rounded"
    TUTORIAL = "tutorial"

    def byte(self, angle: float) -> int:
        """Return the byte of `angle` [rad], 60 to 180: the nearest one when the angle is beyond its range.

        ROUNDED: round(degrees(angle)) + 180. TUTORIAL: floor(degrees(angle)) + 179.
        """
        degrees = math.degrees(angle)
        whole = round(degrees) + 180 if self is AngleMapping.ROUNDED else math.floor(degrees) + 179
        return min(max(whole, BYTE_MIN), BYTE_MAX)

    def angle(self, byte: int) -> float:
        """Return the middle of the angles that become `byte` [rad]."""
        return math.radians(byte - 180 if self is AngleMapping.ROUNDED else byte - 178.5)


RESOLUTION = math.radians(0.5)
"""Largest distance between an angle within the range and the decoded angle of its packet [rad]."""


@dataclass(frozen=True)
class LegacyProtocol:
    """The workshop's packet: 255, then one byte for each of the three servos.

    Attributes:
        mapping: How angles become bytes.
    """

    mapping: AngleMapping = AngleMapping.ROUNDED

    @property
    def name(self) -> str:
        """Name for status and messages."""
        return "legacy"

    @property
    def baud(self) -> int:
        """Speed of the workshop's boards [bit/s]."""
        return 115200

    @property
    def has_imu(self) -> bool:
        """Whether the board answers with lines of an IMU."""
        return False

    @property
    def lowest(self) -> float:
        """Smallest angle that a packet can carry to within RESOLUTION [rad]."""
        return self.mapping.angle(BYTE_MIN) - RESOLUTION

    @property
    def highest(self) -> float:
        """Largest angle that a packet can carry to within RESOLUTION [rad]."""
        return self.mapping.angle(BYTE_MAX) + RESOLUTION

    def degrees(self, angles: Sequence[float]) -> tuple[int, ...]:
        """Return the whole degrees of three angles [rad]; one beyond `lowest` or `highest` becomes the nearest.

        Raises:
            ProtocolError: the number of angles is wrong, or one is not finite.
        """
        if len(angles) != SERVO_COUNT:
            raise ProtocolError(f"{len(angles)} angles given; a packet carries {SERVO_COUNT}")
        for i, angle in enumerate(angles):
            if not math.isfinite(angle):
                raise ProtocolError(f"the angle of servo_{i} is {angle}; it must be finite")
        return tuple(self.mapping.byte(angle) for angle in angles)

    def packet(self, degrees: Sequence[int]) -> bytes:
        """Return the packet of three whole degrees, 60 to 180."""
        return bytes([HEADER, *degrees])

    def encode(self, angles: Sequence[float]) -> bytes:
        """Return the packet of three angles [rad]; errors as in `degrees`."""
        return self.packet(self.degrees(angles))

    def decode(self, packet: bytes) -> tuple[float, ...]:
        """Return the three angles of a packet [rad].

        Raises:
            ProtocolError: the length or a byte is not that of a packet.
        """
        if len(packet) != 1 + SERVO_COUNT:
            raise ProtocolError(f"packet of {len(packet)} bytes; it has {1 + SERVO_COUNT}")
        if packet[0] != HEADER:
            raise ProtocolError(f"packet begins with {packet[0]}; it begins with {HEADER}")
        for i, byte in enumerate(packet[1:]):
            if not BYTE_MIN <= byte <= BYTE_MAX:
                raise ProtocolError(f"the byte of servo_{i} is {byte}; allowed: {BYTE_MIN} to {BYTE_MAX}")
        return tuple(self.mapping.angle(byte) for byte in packet[1:])


@dataclass(frozen=True)
class AsciiProtocol(LegacyProtocol):
    """The closed-loop variant: three whole degrees as text, `"a b c\\n"`."""

    @property
    def name(self) -> str:
        """Name for status and messages."""
        return "ascii"

    @property
    def baud(self) -> int:
        """Speed of the workshop's closed-loop board [bit/s]."""
        return 57600

    @property
    def has_imu(self) -> bool:
        """It answers each packet with a line of its IMU."""
        return True

    def packet(self, degrees: Sequence[int]) -> bytes:
        """Return the line of three whole degrees."""
        return (" ".join(map(str, degrees)) + "\n").encode("ascii")

    def decode(self, packet: bytes) -> tuple[float, ...]:
        """Return the three angles of a line [rad].

        Raises:
            ProtocolError: it is not such a line.
        """
        if not re.fullmatch(rb"\d{2,3} \d{2,3} \d{2,3}\n", packet):
            raise ProtocolError(f"line {packet!r:.40}; it has three numbers with one space between")
        return super().decode(bytes([HEADER, *(min(int(part), HEADER) for part in packet.split())]))


WORKSHOP: Final[dict[str, type[LegacyProtocol]]] = {
    protocol().name: protocol for protocol in (LegacyProtocol, AsciiProtocol)
}
"""The protocols of whole degrees by name: `session.LegacySession` speaks each."""


@dataclass
class LegacyDecoder:
    """Finds packets in a stream with garbage in it: after an impossible byte it waits for a 255.

    Attributes:
        protocol: The protocol spoken.
        skipped: Bytes that belonged to no packet, so far.
    """

    protocol: LegacyProtocol = field(default_factory=LegacyProtocol)
    skipped: int = 0
    _partial: bytearray = field(default_factory=bytearray)

    def feed(self, data: bytes) -> list[tuple[float, ...]]:
        """Take the next bytes, cut anywhere; return the angles [rad] of every packet that they complete."""
        found = []
        for byte in data:
            if byte == HEADER:
                self.skipped += len(self._partial)
                self._partial[:] = [HEADER]
            elif self._partial and BYTE_MIN <= byte <= BYTE_MAX:
                self._partial.append(byte)
            else:
                self.skipped += len(self._partial) + 1
                self._partial.clear()
            if len(self._partial) == 1 + SERVO_COUNT:
                found.append(self.protocol.decode(bytes(self._partial)))
                self._partial.clear()
        return found
