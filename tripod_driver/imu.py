"""Lines of an IMU, "z,y,\\n" in degrees, from a line that may hold anything."""

import math
from dataclasses import dataclass, field
from typing import Final

LONGEST_LINE: Final = 64
"""Bytes after which a line without an end is garbage."""

BAD_LINES_MAX: Final = 20
"""Bad lines after the last good one that an IMU may send: a board says a few words when it starts."""

STRANGE_BYTES: Final = 4 * LONGEST_LINE
"""Bytes without the end of a line, from which on the sender is no IMU."""

LARGEST_ANGLE: Final = 360.0
"""Angles beyond it are no angles [degree]."""


@dataclass(frozen=True)
class ImuReading:
    """Inclination of the effector as the board measures it.

    Attributes:
        roll: First number of the line: rotation about the x axis of the sensor [rad].
        pitch: Second number: rotation about its y axis [rad].
        time: When the line was complete [s], the caller's clock.
    """

    roll: float
    pitch: float
    time: float

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Orientation (x, y, z, w) of the sensor, first rolled, then pitched: q = q_y(pitch) q_x(roll), w >= 0.

        The rotation about the vertical axis is not measured and taken as 0.
        """
        cr, sr = math.cos(self.roll / 2), math.sin(self.roll / 2)
        cp, sp = math.cos(self.pitch / 2), math.sin(self.pitch / 2)
        sign = 1.0 if cp * cr >= 0 else -1.0
        return sign * cp * sr, sign * sp * cr, -sign * sp * sr, sign * cp * cr


def parse_line(line: bytes, now: float) -> ImuReading | None:
    """Return the reading in one line, without its end; None if it is anything else than two numbers of degrees.

    >>> reading = parse_line(b"-1.5000,30.0000,", 0.0)
    >>> round(math.degrees(reading.roll), 6), round(math.degrees(reading.pitch), 6)
    (-1.5, 30.0)
    """
    parts = line.strip(b"\r\n ").split(b",")
    if len(parts) == 3 and not parts[2].strip():
        parts = parts[:2]
    if len(parts) != 2 or len(line) > LONGEST_LINE:
        return None
    values = []
    for part in parts:
        text = part.strip(b" ")
        if not text or not set(text) <= set(b"+-.0123456789"):  # float() takes more: nan, 1e9, 1_0
            return None
        try:
            values.append(float(text))
        except ValueError:
            return None
    if not all(abs(value) <= LARGEST_ANGLE for value in values):
        return None
    return ImuReading(math.radians(values[0]), math.radians(values[1]), now)


@dataclass
class LineReader:
    """Cuts a stream into lines and finds the readings in it; holds LONGEST_LINE bytes at most.

    Attributes:
        bad_max: Bad lines after the last good one that are forgiven.
        good: Lines with a reading, so far.
        bad: Lines without.
        strange: What came, once it is too much to be an IMU that stutters; empty else.
    """

    bad_max: int = BAD_LINES_MAX
    good: int = 0
    bad: int = 0
    strange: bytes = b""
    _partial: bytearray = field(default_factory=bytearray)
    _overlong: bool = False
    _bad_in_a_row: int = 0
    _length: int = 0

    def feed(self, data: bytes, now: float) -> list[ImuReading]:
        """Take the next bytes, cut anywhere; return the readings that they complete at `now` [s]."""
        found = []
        *ended, rest = data.split(b"\n")
        for piece in ended:
            self._take(piece)
            reading = None if self._overlong else parse_line(bytes(self._partial), now)
            if reading is not None:
                self.good += 1
                self._bad_in_a_row = 0
                found.append(reading)
            elif self._overlong or self._partial.strip(b"\r\n "):
                self._reject()
            self._partial.clear()
            self._overlong, self._length = False, 0
        self._take(rest)
        return found

    def _take(self, piece: bytes) -> None:
        room = LONGEST_LINE - len(self._partial)
        self._overlong = self._overlong or len(piece) > room
        self._partial += piece[:room]
        self._length += len(piece)
        if self._length > STRANGE_BYTES:
            self.strange = self.strange or bytes(self._partial)

    def _reject(self) -> None:
        self.bad += 1
        self._bad_in_a_row += 1
        if self._bad_in_a_row > self.bad_max:
            self.strange = bytes(self._partial)
