"""Finding a calibration by hand: keys move one shaft at a time, slowly, and mark what is found. Pure: time is given."""

import math
from dataclasses import dataclass
from typing import Final

from tripod_driver.calibration import Calibration, CalibrationError, ServoCalibration
from tripod_graph.names import SERVOS

SPEED: Final = 0.25
"""Speed of a shaft whose key is down [rad/s]."""

HOLD: Final = 0.2
"""Time for which a press counts [s]: a terminal tells no release, so silence means stop."""

FINE: Final = math.radians(0.5)
"""Step of the keys for fine moves [rad]."""

HELP: Final = """\
  0, 1, 2      choose the servo
  Up, Down     turn its shaft while the key is down, slowly; + and - by half a degree
  space        stop
  z            the piece is flat here: joint angle 0
  r            up is down: reverse the direction
  [, ]         the joint may go no further down, no further up
  w            write the file; q leaves, Ctrl-C too
Pulse ranges are the data sheet's: change them in the file."""


@dataclass
class Draft:
    """What is known of one servo so far; angles are of its shaft [rad], 0 to pi.

    Attributes:
        pulse_range: Pulse widths with the shaft at 0 and at pi [us]; not changed here.
        flat: Where the piece is flat.
        direction: +1 if shaft and joint turn the same way, else -1.
        ends: The two ends of the safe range, in any order.
    """

    pulse_range: tuple[float, float]
    flat: float
    direction: int
    ends: list[float]

    @classmethod
    def of(cls, servo: ServoCalibration) -> "Draft":
        """Return what a calibration says."""
        ends = [servo.offset + servo.direction * angle for angle in servo.safe_range]
        return cls(servo.pulse_range, servo.offset, servo.direction, ends)

    def joint(self, shaft: float) -> float:
        """Return the joint angle [rad] with the shaft at `shaft` [rad]."""
        return self.direction * (shaft - self.flat)

    def calibration(self) -> ServoCalibration:
        """Return the calibration. Raises CalibrationError."""
        low, high = sorted(self.joint(end) for end in self.ends)
        return ServoCalibration(self.flat, self.direction, self.pulse_range, (low, high))


class Calibrator:
    """What the keys have found and where the shafts should be.

    Attributes:
        shafts: Set-points [rad], 0 to pi, shape (3,).
        chosen: Number of the servo that moves.
        drafts: What is known of each servo.
        notice: What the newest key did.
        changed: Whether anything was found since the last `saved`.
    """

    def __init__(self, calibration: Calibration, lower: tuple[float, ...], upper: tuple[float, ...]) -> None:
        """Begin with all shafts where `calibration` says that the piece is flat; bounds of shafts [rad], shape (3,)."""
        self.drafts = [Draft.of(servo) for servo in calibration.servos]
        self._lower, self._upper = lower, upper
        self.shafts = [
            min(max(draft.flat, low), high)
            for draft, low, high in zip(self.drafts, lower, upper, strict=True)
        ]
        self.chosen = 0
        self.notice = ""
        self.changed = False
        self._sign, self._until, self._last = 0, float("-inf"), float("-inf")

    def press(self, key: str, now: float) -> bool:
        """Do what `key` asks for at `now` [s]; return False if it means nothing here."""
        self.advance(now)
        moving, self._sign = self._sign, 0  # any other key stops
        self.notice = ""
        draft, shaft = self.drafts[self.chosen], self.shafts[self.chosen]
        match key:
            case "up" | "down":
                self._sign = draft.direction if key == "up" else -draft.direction
                self._until = now + HOLD
            case "+" | "-":
                self._move((draft.direction if key == "+" else -draft.direction) * FINE)
            case "0" | "1" | "2":
                self.chosen = int(key)
                self.notice = f"{SERVOS[self.chosen]} moves now"
            case "space":
                self.notice = "stopped" if moving else "at rest"
            case "z":
                self._try(Draft(draft.pulse_range, shaft, draft.direction, draft.ends), "flat here")
            case "r":
                self._try(Draft(draft.pulse_range, draft.flat, -draft.direction, draft.ends), "reversed")
            case "[" | "]":
                ends = sorted(draft.ends, key=draft.joint)
                ends[0 if key == "[" else 1] = shaft
                found = Draft(draft.pulse_range, draft.flat, draft.direction, ends)
                if found.joint(ends[0]) < found.joint(ends[1]):
                    self._try(found, "no further down" if key == "[" else "no further up")
                else:
                    self.notice = "refused: that is beyond the other end"
            case _:
                return False
        return True

    def advance(self, now: float) -> list[float]:
        """Return where the shafts should be at `now` [s], shape (3,); call it at a regular rate."""
        if self._sign:
            duration = min(now, self._until) - self._last
            self._move(self._sign * SPEED * min(max(0.0, duration), HOLD))
            if now >= self._until:
                self._sign = 0
        self._last = now
        return list(self.shafts)

    def calibration(self) -> Calibration:
        """Return what was found."""
        return Calibration(tuple(draft.calibration() for draft in self.drafts))

    def saved(self) -> None:
        """What was found so far is in a file."""
        self.changed = False

    def _move(self, step: float) -> None:
        i = self.chosen
        self.shafts[i] = min(max(self.shafts[i] + step, self._lower[i]), self._upper[i])

    def _try(self, draft: Draft, notice: str) -> None:
        """Take `draft` for the chosen servo if it is a calibration."""
        try:
            draft.calibration()
        except CalibrationError as error:
            self.notice = f"refused: {error}"
            return
        self.drafts[self.chosen] = draft
        self.notice, self.changed = notice, True


def shaft_calibration(calibration: Calibration) -> Calibration:
    """Return the calibration whose joint angles are the angles of the shafts, 0 to pi, with the same pulses."""
    return Calibration(
        tuple(ServoCalibration(0.0, 1, servo.pulse_range, (0.0, math.pi)) for servo in calibration.servos)
    )
