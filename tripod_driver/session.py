"""What is said on the line, from the opening of a port to its loss. Pure: bytes in, bytes out, time given."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Final

from tripod_driver.calibration import ARDUINO_PULSES, Calibration
from tripod_driver.imu import ImuReading, LineReader
from tripod_driver.place import Place, library_start
from tripod_driver.protocol import LegacyProtocol

Content = tuple[int, ...]
"""The numbers in one packet, one for each joint, in the unit of its protocol: equal numbers need no new packet."""

ROUNDED: Final = 1e-3
"""An angle is known so well by the pulse that a board tells, in ticks of its timer of 0.5 us [rad]."""

TENTHS: Final = 10
"""Units of a pulse in one microsecond, in a frame and where pulses are kept."""

READINGS_MAX: Final = 16
"""Readings of the IMU that wait to be taken; older ones are forgotten."""


class SessionState(Enum):
    """How far the conversation is."""

    OPENING = "opening"
    """The board starts, or has not answered yet."""
    READY = "ready"
    """Packets may be sent."""
    LOST = "lost"
    """The board does not answer as it should; another attempt may help."""
    REFUSED = "refused"
    """This board must not be driven; another attempt does not help."""


class Session(ABC):
    """One conversation with a board.

    Attributes:
        name: Of its protocol.
        baud: Its usual speed [bit/s].
        acknowledges: Whether the board acknowledges each packet.
        state: How far it is.
        message: Why it is not ready; empty when it is.
        incident: What the board did by itself, so that motion must be given up: a reset, its watchdog. The caller takes
            it and empties it.
        place: Where the servos are since the session became ready, as the board says; of a board that says nothing,
            where its firmware puts them when it starts. None if the board does not know.
        told: What is in force as the board said last, taken and emptied by the caller; None: nothing new.
        readings: Readings of the IMU that came and were not taken yet, the newest last.
        firmware: What the board says that it runs; empty if it says nothing.
        reset: Why the board was reset last, in a word; empty if it does not say.
        round_trip: Time from the newest acknowledged frame to its answer [s]; None if the protocol has no answers.
    """

    name: str
    baud: int = 115200
    acknowledges: bool = False

    def __init__(self, calibration: Calibration) -> None:
        self._calibration = calibration
        self.state = SessionState.OPENING
        self.message = ""
        self.incident = ""
        self.place: Place | None = None
        self.told: Content | None = None
        self.readings: list[ImuReading] = []
        self.firmware = self.reset = ""
        self.round_trip: float | None = None

    @abstractmethod
    def begin(self, now: float, boot_time: float) -> None:
        """The port was opened at `now` [s]; the board may lose bytes for `boot_time` [s]."""

    @abstractmethod
    def hear(self, data: bytes, now: float) -> None:
        """Take what came from the board."""

    @abstractmethod
    def say(self, now: float) -> bytes:
        """Return what is due on the line besides packets; empty if nothing is. Call it often: time-outs count here."""

    @abstractmethod
    def content(self, values: Sequence[float]) -> Content:
        """Return what a packet of joint values [rad, m, Pa], shape (n,), would hold."""

    @abstractmethod
    def packet(self, content: Content, now: float) -> bytes:
        """Return the packet of `content`, which is now taken as sent."""

    @abstractmethod
    def angles(self, content: Content) -> tuple[float, ...]:
        """Return the joint values [rad, m, Pa], shape (n,), for which `content` stands."""

    @abstractmethod
    def pulses(self, content: Content) -> Content:
        """Return the pulse widths [0.1 us] of the servos, shape (s,), for which `content` stands."""

    def angles_of_pulses(self, pulses: Content) -> tuple[float, ...]:
        """Return the angles [rad], shape (s,), of pulse widths [0.1 us]."""
        return self._calibration.angles([tenths / TENTHS for tenths in pulses])

    @abstractmethod
    def bounds(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the smallest and largest joint values [rad, m, Pa] that a packet can carry, shape (n,) each."""

    @property
    def rounding(self) -> tuple[float, ...]:
        """How far what the board tells may be from what it does in its next period [rad, m, Pa], shape (n,)."""
        return (ROUNDED,) * len(self._calibration.servos)

    @property
    def channel_values(self) -> tuple[float, ...]:
        """Where the joints are that are no servos, as the board told last [m, Pa]."""
        return ()

    @property
    def unplaced(self) -> str:
        """Why nothing may move since the board does not know a place; empty if it does."""
        return ""

    @property
    def held(self) -> Mapping[int, float]:
        """Largest value [m, Pa] that joints may have for now, by their number: cable or hose has failed."""
        return {}

    @property
    def homing(self) -> bool:
        """Whether the board looks for a place."""
        return False

    def home(self, now: float, *, begin: bool) -> bytes:
        """Return what lets the board begin to look for places that it does not know, or continue; empty: nothing."""
        return b""

    def hold(self, now: float) -> bytes:
        """Return what ends homing at once."""
        return b""

    @property
    def watchdog(self) -> float | None:
        """Silence after which the board holds by itself [s]; None if it has no watchdog or has not told."""
        return None

    @property
    def pulse_range(self) -> tuple[float, float] | None:
        """Shortest and longest pulse that the board makes [us]; None if it does not tell or has not told."""
        return None

    @property
    def slew(self) -> float | None:
        """Largest speed of a pulse that the board makes [us/s]; None if it has no limit or has not told."""
        return None

    @property
    def unheard(self) -> bool:
        """Whether nothing at all has come since `begin`."""
        return False

    @property
    def settled(self) -> bool:
        """Whether the board has the newest packet, as far as can be known."""
        return True

    @property
    def odd(self) -> str:
        """What is odd on the line though it works; empty if nothing is."""
        return ""

    @property
    def diagnostics(self) -> dict[str, object]:
        """Figures for people."""
        return {}


ECHO: Final = (
    "the port returns what is written to it (loopback), so it is not the robot; choose another "
    "with --set port=PATH"
)
"""Said of modems, and of two wires that touch."""

STRAY_LINES_MAX: Final = 2
"""Lines that are no readings and yet may come from a board that is silent but for them: lines crackle at a reset."""


class LegacySession(Session):
    """The workshop's packets. Their firmware says nothing but lines of an IMU, if it has one; what says more is none.

    What the joints are asked for passes through the calibration as an angle for which the workshop's own servo would
    get the same pulse; without a calibration that is the angle itself.
    """

    def __init__(
        self, protocol: LegacyProtocol, calibration: Calibration, start: Sequence[float] | None = None
    ) -> None:
        """`start`: angles of the servos after the firmware's own start [rad], shape (3,); None: those of the library.

        A port that resets the board when it is opened leaves them there, wherever they were before.
        """
        super().__init__(calibration)
        self.name = protocol.name
        self.baud = protocol.baud
        self._protocol = protocol
        angles = library_start(calibration) if start is None else tuple(map(float, start))
        self.place = Place(angles, "its firmware attaches the servos there when it starts")
        self._ready_at = 0.0
        self._lines = self._reader()
        self._sent = b""

    def begin(self, now: float, boot_time: float) -> None:
        """Wait for the board to boot: it never says that it has."""
        self.state, self._ready_at = SessionState.OPENING, now + boot_time
        self.message = f"the board starts within {boot_time:g} s"
        self._lines, self._sent = self._reader(), b""

    def hear(self, data: bytes, now: float) -> None:
        """Take lines of an IMU; anything else does not belong here."""
        if self._sent and self._sent in data:
            self.state, self.message = SessionState.LOST, ECHO
            return
        self.readings += self._lines.feed(data, now)
        del self.readings[:-READINGS_MAX]
        if self._lines.strange:
            self.state = SessionState.LOST
            what = (
                "which is not an IMU reading"
                if self._protocol.has_imu
                else "but the workshop's firmware sends nothing"
            )
            sent = shown(self._lines.strange)
            self.message = f"the board sends {sent}, {what}; is this the right port, baud rate and protocol?"

    def say(self, now: float) -> bytes:
        """Nothing is due besides packets."""
        if self.state is SessionState.OPENING and now >= self._ready_at:
            self.state, self.message = SessionState.READY, ""
        return b""

    def content(self, angles: Sequence[float]) -> Content:
        """Return the degrees of the packet."""
        pairs = zip(self._calibration.servos, angles, strict=True)
        return self._protocol.degrees([servo.workshop_angle(angle) for servo, angle in pairs])

    def packet(self, content: Content, now: float) -> bytes:
        """Return the packet of these degrees."""
        self._sent = self._protocol.packet(content)
        return self._sent

    def angles(self, content: Content) -> tuple[float, ...]:
        """Return the angles [rad] in the middle of those that become these degrees."""
        middle = [self._protocol.mapping.angle(degrees) for degrees in content]
        return tuple(s.joint_angle(a) for s, a in zip(self._calibration.servos, middle, strict=True))

    def pulses(self, content: Content) -> Content:
        """Return the pulse widths [0.1 us] in the middle of those that become these degrees."""
        low, high = ARDUINO_PULSES
        shafts = [math.pi + self._protocol.mapping.angle(degrees) for degrees in content]
        return tuple(round(TENTHS * (low + (high - low) * shaft / math.pi)) for shaft in shafts)

    def bounds(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return what the degrees of the protocol can carry and the calibration allows."""
        ends = [
            sorted((s.joint_angle(self._protocol.lowest), s.joint_angle(self._protocol.highest)))
            for s in self._calibration.servos
        ]
        lower = tuple(max(e[0], a) for e, a in zip(ends, self._calibration.lower, strict=True))
        upper = tuple(min(e[1], a) for e, a in zip(ends, self._calibration.upper, strict=True))
        return lower, upper

    @property
    def diagnostics(self) -> dict[str, object]:
        """Lines of the IMU, good and bad."""
        return {"IMU lines": self._lines.good, "bad lines": self._lines.bad}

    def _reader(self) -> LineReader:
        return LineReader() if self._protocol.has_imu else LineReader(STRAY_LINES_MAX)


def shown(data: bytes, most: int = 24) -> str:
    """Return bytes for a message: as text where they are text."""
    return repr(data[:most]).removeprefix("b") + ("..." if len(data) > most else "")
