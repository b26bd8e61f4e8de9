"""Joint angles [rad] to pulse widths [us] and back, servo by servo: the only place that knows both.

The shaft of servo i stands at s = offset + direction q when its joint is at q, both in radians, s within 0 to pi. Its
pulse is linear in s: p = pulse_min + (pulse_max - pulse_min) s / pi.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from tripod_graph.names import SERVOS, servo_names

ARDUINO_PULSES: Final = (544.0, 2400.0)
"""Pulse widths of 0 and 180 degrees in the Servo library that the workshop's firmware uses [us]."""

ARDUINO_START: Final = 1500.0
"""Pulse that this library gives to a servo as soon as it is attached, whatever comes later [us]."""

PULSE_LOWEST, PULSE_HIGHEST = 500.0, 2500.0
"""Widest range of pulses of any servo that fits the robot [us]."""

PULSE_SPAN: Final = 200.0
"""Smallest distance of the ends of a pulse range [us]; a shorter one is a slip of the pen."""

SLACK: Final = 1e-4
"""A shaft may seem to stand so far beyond its end [rad]: files round."""


class CalibrationError(ValueError):
    """A calibration that is refused; the message names the servo, the field, the value and what is allowed."""


@dataclass(frozen=True)
class ServoCalibration:
    """How one servo is mounted and made.

    The defaults are a servo of the workshop: its shaft stands at 180 degrees when the piece is flat.

    Attributes:
        offset: Angle of the shaft when the joint is at 0 [rad], 0 to pi.
        direction: +1 if shaft and joint turn the same way, else -1.
        pulse_range: Pulse widths with the shaft at 0 and at pi [us], within 500 to 2500, the first the smaller.
        safe_range: Smallest and largest joint angle that may be sent [rad]; both within the reach of the shaft.
    """

    offset: float = math.pi
    direction: int = 1
    pulse_range: tuple[float, float] = ARDUINO_PULSES
    safe_range: tuple[float, float] = (-2.1, 0.0)

    def __post_init__(self) -> None:
        if not -SLACK <= self.offset <= math.pi + SLACK:  # NaN fails too
            raise CalibrationError(f"offset is {self.offset:g} rad; allowed: 0 to {math.pi:.4f} rad")
        if self.direction not in (1, -1):
            raise CalibrationError(f"direction is {self.direction}; allowed: 1 or -1")
        for i, pulse in enumerate(self.pulse_range):
            if not PULSE_LOWEST <= pulse <= PULSE_HIGHEST:
                allowed = f"{PULSE_LOWEST:g} to {PULSE_HIGHEST:g} us"
                raise CalibrationError(f"pulse_range[{i}] is {pulse:g} us; allowed: {allowed}")
        if not self.pulse_range[0] + PULSE_SPAN <= self.pulse_range[1]:
            least = f"at least pulse_range[0] + {PULSE_SPAN:g} = {self.pulse_range[0] + PULSE_SPAN:g} us"
            raise CalibrationError(f"pulse_range[1] is {self.pulse_range[1]:g} us; allowed: {least}")
        reach = sorted(((0.0 - self.offset) * self.direction, (math.pi - self.offset) * self.direction))
        for i, angle in enumerate(self.safe_range):
            if not reach[0] - SLACK <= angle <= reach[1] + SLACK:
                allowed = f"{reach[0] + 0.0:.4f} to {reach[1] + 0.0:.4f} rad, the reach of the shaft"
                raise CalibrationError(f"safe_range[{i}] is {angle:g} rad; allowed: {allowed}")
        if not self.safe_range[0] < self.safe_range[1]:
            more = f"more than safe_range[0] {self.safe_range[0]:g} rad"
            raise CalibrationError(f"safe_range[1] is {self.safe_range[1]:g} rad; allowed: {more}")

    def pulse(self, angle: float) -> float:
        """Return the pulse width [us] for a joint angle [rad]; beyond the end of the shaft, that of the end."""
        low, high = self.pulse_range
        pulse = low + (high - low) * (self.offset + self.direction * angle) / math.pi
        return min(max(pulse, low), high)

    def angle(self, pulse: float) -> float:
        """Return the joint angle [rad] of a pulse width [us]."""
        low, high = self.pulse_range
        return self.direction * (math.pi * (pulse - low) / (high - low) - self.offset)

    def workshop_angle(self, angle: float) -> float:
        """Return the joint angle [rad] for which the workshop's own servo would get the pulse of `angle`.

        For the default calibration it is `angle` to the last bit.
        """
        low, high = ARDUINO_PULSES
        scale = (self.pulse_range[1] - self.pulse_range[0]) / (high - low)
        shift = (self.pulse_range[0] - low) * math.pi / (high - low) + (scale - 1.0) * math.pi
        return scale * (self.direction * angle + (self.offset - math.pi)) + shift

    def joint_angle(self, workshop_angle: float) -> float:
        """Return the joint angle [rad] that `workshop_angle` turns into `workshop_angle` [rad]."""
        low, high = ARDUINO_PULSES
        scale = (self.pulse_range[1] - self.pulse_range[0]) / (high - low)
        shift = (self.pulse_range[0] - low) * math.pi / (high - low) + (scale - 1.0) * math.pi
        return self.direction * ((workshop_angle - shift) / scale - (self.offset - math.pi))


@dataclass(frozen=True)
class Calibration:
    """The calibration of the whole robot.

    Attributes:
        servos: One for each servo, in the order of their joints.
    """

    servos: tuple[ServoCalibration, ...] = field(default=(ServoCalibration(),) * len(SERVOS))

    @property
    def lower(self) -> tuple[float, ...]:
        """Smallest angles that may be sent [rad], shape (s,)."""
        return tuple(servo.safe_range[0] for servo in self.servos)

    @property
    def upper(self) -> tuple[float, ...]:
        """Largest angles that may be sent [rad], shape (s,)."""
        return tuple(servo.safe_range[1] for servo in self.servos)

    def pulses(self, angles: Sequence[float]) -> tuple[float, ...]:
        """Return the pulse widths [us], shape (s,), for joint angles [rad], shape (s,)."""
        return tuple(servo.pulse(angle) for servo, angle in zip(self.servos, angles, strict=True))

    def angles(self, pulses: Sequence[float]) -> tuple[float, ...]:
        """Return the joint angles [rad], shape (s,), of pulse widths [us], shape (s,)."""
        return tuple(servo.angle(pulse) for servo, pulse in zip(self.servos, pulses, strict=True))

    def turned(self, zeros: Sequence[float]) -> "Calibration":
        """Return the calibration of servos whose arms were found to stand `zeros` [rad] beyond the command, shape (s,).

        offset' = offset - direction zero; the same pulses as before are safe. Raises CalibrationError.
        """
        servos = []
        for name, servo, zero in zip(servo_names(len(self.servos)), self.servos, zeros, strict=True):
            low, high = servo.safe_range
            try:
                offset = servo.offset - servo.direction * zero
                servos.append(replace(servo, offset=offset, safe_range=(low + zero, high + zero)))
            except CalibrationError as error:
                raise CalibrationError(
                    f"{name}: {error}; move its horn by one tooth and calibrate again"
                ) from None
        return Calibration(tuple(servos))
