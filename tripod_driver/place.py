"""Where the servos stand when a conversation with a board begins: ramps begin there."""

from dataclasses import dataclass

from tripod_driver.calibration import ARDUINO_START, Calibration


@dataclass(frozen=True)
class Place:
    """Where the servos stand, and how that is known.

    Attributes:
        angles: Values of the joints [rad, m, Pa], shape (n,); they may be outside of every limit.
        source: Who says so, for people; empty: nobody does, and `angles` are the best guess.
        kept: Whether the board holds them there only as long as it hears of this driver.
    """

    angles: tuple[float, ...]
    source: str = ""
    kept: bool = False

    @property
    def known(self) -> bool:
        """Whether anybody knows."""
        return bool(self.source)


def library_start(calibration: Calibration) -> tuple[float, ...]:
    """Return the joint angles [rad], shape (s,), at which the Arduino Servo library attaches its servos."""
    return calibration.angles([ARDUINO_START] * len(calibration.servos))
