"""Finding a calibration by hand: keys move one shaft at a time, slowly, and mark what is found. Pure: time is given."""

import math
from dataclasses import dataclass
from typing import Final

from tripod_driver.calibration import (
    PULSE_HIGHEST,
    PULSE_LOWEST,
    Calibration,
    CalibrationError,
    ServoCalibration,
)
from tripod_graph.names import servo_names

SPEED: Final = 0.25
"""Speed of a shaft whose key is down [rad/s]."""

HOLD: Final = 0.2
"""Time for which a press counts [s]: a terminal tells no release, so silence means stop."""

FINE: Final = math.radians(0.5)
"""Step of the keys for fine moves [rad]."""

PULSE_SPEED: Final = 40.0
"""Speed of a pulse whose key is down, in the step that finds the pulse range [us/s]."""

PULSE_STEP: Final = 5.0
"""Step of the keys for fine moves there [us]: about half a degree."""

PULSE_PAUSE: Final = 0.1
"""Shortest time between two such steps [s]: a key held down repeats faster."""

_HELP: Final = """\
  {digits:<12} choose the servo
  Up, Down     turn its shaft while the key is down, slowly; + and - by half a degree
  space        stop
  z            the piece is flat here: joint angle 0
  r            up is down: reverse the direction
  [, ]         the joint may go no further down, no further up
  p            find the pulse range of the servo, p again ends that. Take the piece off before. Up and + then
               lengthen the pulse, [ and ] mark where the shaft stands at 0 and at 180 degrees; beyond the range
               known so far only + and - go on, by 5 us: leave off where the servo hums or stops
  w            write the file
  q            leave, Ctrl-C too: all servos go slowly to where the piece is flat; any other key stops that"""


def help_text(count: int) -> str:
    """Return what the keys do, for a robot of `count` servos; one line each."""
    digits = ", ".join(map(str, range(count))) if count <= 4 else f"0 to {count - 1}"
    return _HELP.format(digits=digits)


@dataclass
class Draft:
    """What is known of one servo so far; angles are of its shaft [rad], 0 to pi.

    Attributes:
        pulse_range: Pulse widths with the shaft at 0 and at pi [us].
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

    def pulse(self, shaft: float) -> float:
        """Return the pulse width [us] with the shaft at `shaft` [rad]."""
        low, high = self.pulse_range
        return low + (high - low) * shaft / math.pi

    def shaft(self, pulse: float) -> float:
        """Return where the shaft is [rad] with `pulse` [us]."""
        low, high = self.pulse_range
        return math.pi * (pulse - low) / (high - low)

    def with_end(self, side: int, pulse: float) -> "Draft":
        """Return the draft with `pulse` [us] for the shaft at 0 (`side` 0) or at pi (`side` 1).

        What else was found keeps its pulses, as far as they are within the new range. Raises CalibrationError.
        """
        low, high = self.pulse_range
        found = (pulse, high) if side == 0 else (low, pulse)
        ServoCalibration(pulse_range=found)
        kept = [self.pulse(shaft) for shaft in (self.flat, *self.ends)]
        new = Draft(found, 0.0, self.direction, [])
        new.flat, *new.ends = (min(max(new.shaft(pulse), 0.0), math.pi) for pulse in kept)
        return new

    def joint(self, shaft: float) -> float:
        """Return the joint angle [rad] with the shaft at `shaft` [rad]."""
        return self.direction * (shaft - self.flat)

    def calibration(self) -> ServoCalibration:
        """Return the calibration. Raises CalibrationError."""
        low, high = sorted(self.joint(end) for end in self.ends)
        return ServoCalibration(self.flat, self.direction, self.pulse_range, (low, high))


class Calibrator:
    """What the keys have found and where the shafts should be.

    Positions of shafts are kept as pulses, which mean the same before and after a pulse range was found.

    Attributes:
        pulses: Set-points [us], shape (s,).
        chosen: Number of the servo that moves.
        finds_range: Whether the keys find its pulse range.
        drafts: What is known of each servo.
        notice: What the newest key did.
        changed: Whether anything was found since the last `saved`.
    """

    def __init__(self, calibration: Calibration, lower: tuple[float, ...], upper: tuple[float, ...]) -> None:
        """Begin with all shafts where `calibration` says that the piece is flat; bounds of pulses [us], shape (s,)."""
        self.drafts = [Draft.of(servo) for servo in calibration.servos]
        self._lower, self._upper = lower, upper
        self.pulses = self._flat
        self.chosen = 0
        self.finds_range = False
        self.notice = ""
        self.changed = False
        self._board: tuple[float, float] | None = None
        self._sign, self._until, self._last = 0, float("-inf"), float("-inf")
        self._parking = False
        self._stepped_at = float("-inf")

    @property
    def chosen_name(self) -> str:
        """Name of the servo that moves."""
        return servo_names(len(self.drafts))[self.chosen]

    @property
    def shafts(self) -> list[float]:
        """Set-points [rad], 0 to pi within the pulse ranges found so far, shape (s,)."""
        return [draft.shaft(pulse) for draft, pulse in zip(self.drafts, self.pulses, strict=True)]

    @property
    def _flat(self) -> list[float]:
        """Where the piece is flat [us], as far as that can be sent, shape (s,)."""
        return [
            min(max(draft.pulse(draft.flat), low), high)
            for draft, low, high in zip(self.drafts, self._lower, self._upper, strict=True)
        ]

    def park(self) -> None:
        """Let all shafts go to where the piece is flat, until a key is pressed."""
        self._sign, self._parking = 0, True

    @property
    def parked(self) -> bool:
        """Whether all set-points are where the piece is flat."""
        return self.pulses == self._flat

    def board(self, pulse_range: tuple[float, float] | None) -> None:
        """Take what pulses the board makes [us]: none moves beyond. None: it does not tell, so none is found."""
        self._board = pulse_range
        self.finds_range = self.finds_range and pulse_range is not None

    def press(self, key: str, now: float) -> bool:
        """Do what `key` asks for at `now` [s]; return False if it means nothing here."""
        self.advance(now)
        moving, self._sign, self._parking = self._sign or self._parking, 0, False  # any other key stops
        self.notice = ""
        if key == "space":
            self.notice = "stopped" if moving else "at rest"
        elif key in map(str, range(len(self.drafts))):
            self.chosen, self.finds_range = int(key), False
            self.notice = f"{self.chosen_name} moves now"
        elif key == "p":
            self._begin_or_end_range()
        elif self.finds_range:
            return self._press_for_range(key, now)
        else:
            return self._press_for_joint(key, now)
        return True

    def _press_for_joint(self, key: str, now: float) -> bool:
        draft, shaft = self.drafts[self.chosen], self.shafts[self.chosen]
        match key:
            case "up" | "down":
                self._sign = draft.direction if key == "up" else -draft.direction
                self._until = now + HOLD
            case "+" | "-":
                step = draft.pulse(FINE) - draft.pulse(0.0)
                self._move((draft.direction if key == "+" else -draft.direction) * step, draft.pulse_range)
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
                    self.notice = "refused: this is beyond the other end of the range"
            case _:
                return False
        return True

    # the pulse range --------------------------------------------------------------------------------------------

    def _begin_or_end_range(self) -> None:
        name = self.chosen_name
        if self.finds_range:
            self.finds_range, self.notice = False, f"pulse range of {name} left; mark flat, [ and ] again"
        elif self._board is None:
            self.notice = "refused: this board does not report its pulses; use protocol framed"
        else:
            self.finds_range = True
            self.notice = f"pulse range of {name}: is the piece off? Up, Down, + and - move; p ends this"

    def _press_for_range(self, key: str, now: float) -> bool:
        draft, pulse = self.drafts[self.chosen], self.pulses[self.chosen]
        match key:
            case "up" | "down":
                self._sign, self._until = 1 if key == "up" else -1, now + HOLD
            case "+" | "-":
                if now - self._stepped_at >= PULSE_PAUSE:
                    self._stepped_at = now
                    self._move(PULSE_STEP if key == "+" else -PULSE_STEP, self._board or draft.pulse_range)
                if self._board and self.pulses[self.chosen] == pulse == self._board[key == "+"]:
                    self.notice = f"the board makes no {'longer' if key == '+' else 'shorter'} pulse"
            case "[" | "]":
                side = 0 if key == "[" else 1
                try:
                    found = draft.with_end(side, pulse)
                except CalibrationError as error:
                    self.notice = f"refused: {error}"
                else:
                    self._try(found, f"{180 * side} degrees at {pulse:.0f} us")
            case _:
                return False
        return True

    def advance(self, now: float) -> list[float]:
        """Return the pulses due at `now` [s], in us, shape (s,); call it at a regular rate."""
        if self._parking:
            duration = min(max(0.0, now - self._last), HOLD)
            for i, (draft, flat) in enumerate(zip(self.drafts, self._flat, strict=True)):
                way = duration * (draft.pulse(SPEED) - draft.pulse(0.0))
                self.pulses[i] = min(max(flat, self.pulses[i] - way), self.pulses[i] + way)
        elif self._sign:
            duration = min(max(0.0, min(now, self._until) - self._last), HOLD)
            draft = self.drafts[self.chosen]
            speed = PULSE_SPEED if self.finds_range else draft.pulse(SPEED) - draft.pulse(0.0)
            self._move(self._sign * speed * duration, draft.pulse_range)
            if now >= self._until:
                self._sign = 0
        self._last = now
        return list(self.pulses)

    def calibration(self) -> Calibration:
        """Return what was found."""
        return Calibration(tuple(draft.calibration() for draft in self.drafts))

    def saved(self) -> None:
        """What was found so far is in a file."""
        self.changed = False

    def _move(self, step: float, within: tuple[float, float]) -> None:
        """Move the chosen servo by `step` [us], no farther out than `within`; a set-point that is out already stays."""
        i = self.chosen
        before, board = self.pulses[i], self._board or within
        low, high = max(self._lower[i], within[0], board[0]), min(self._upper[i], within[1], board[1])
        self.pulses[i] = min(max(before + step, min(before, low)), max(before, high))

    def _try(self, draft: Draft, notice: str) -> None:
        """Take `draft` for the chosen servo if it is a calibration."""
        try:
            draft.calibration()
        except CalibrationError as error:
            self.notice = f"refused: {error}"
            return
        self.drafts[self.chosen] = draft
        self.notice, self.changed = notice, True


def any_pulse(count: int) -> Calibration:
    """Return the calibration for the conversation with a board of `count` servos: its joint angles are pulses of any
    width, 0 the shortest, pi the longest.
    """
    servo = ServoCalibration(0.0, 1, (PULSE_LOWEST, PULSE_HIGHEST), (0.0, math.pi))
    return Calibration((servo,) * count)


def shaft_calibration(calibration: Calibration) -> Calibration:
    """Return the calibration whose joint angles are the angles of the shafts, 0 to pi, with the same pulses.

    What a board must be able to make before it is calibrated.
    """
    return Calibration(
        tuple(ServoCalibration(0.0, 1, servo.pulse_range, (0.0, math.pi)) for servo in calibration.servos)
    )
