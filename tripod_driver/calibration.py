"""Joint values to the numbers of the board and back, joint by joint: the only place that knows both.

The shaft of servo i stands at s = offset + direction q when its joint is at q, both in radians, s within 0 to pi. Its
pulse is linear in s: p = pulse_min + (pulse_max - pulse_min) s / pi. The set-point of a winch or a pressure is
zero + q / scale, for a length q [m] or a pressure q [Pa].
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from tripod_driver.framed_messages import ChannelKind
from tripod_graph.joint import Joint
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


SETPOINT_MAX: Final = 65535
"""Largest set-point that a message carries."""


@dataclass(frozen=True)
class WinchCalibration:
    """How a winch pulls a cable. Its home switch closes where the cable is paid out; steps count from there.

    Which way the motor turns is a matter of its plug and of the firmware's WINCH_REVERSED.

    Attributes:
        radius: Of the drum, with the cable on it [m].
        steps: Of the motor in one turn of the drum.
        zero: Set-point at which nothing is pulled in and the cable is just taut [steps].
        safe_range: Smallest and largest length pulled in that may be sent [m].
    """

    radius: float = 5e-3
    steps: float = 400.0
    zero: float = 0.0
    safe_range: tuple[float, float] = (0.0, 0.03)

    def __post_init__(self) -> None:
        _check_positive("radius", self.radius, "m")
        _check_positive("steps", self.steps, "steps")
        _check_channel(self)

    @property
    def kind(self) -> ChannelKind:
        """What a channel of the board must drive for it."""
        return ChannelKind.WINCH

    @property
    def unit(self) -> str:
        """Of the joint."""
        return "m"

    @property
    def scale(self) -> float:
        """Length of a step [m]."""
        return 2.0 * math.pi * self.radius / self.steps


@dataclass(frozen=True)
class PressureCalibration:
    """How a pressure is measured.

    Attributes:
        scale: Pressure of one count of the board's sensor [Pa].
        zero: Set-point at ambient pressure [counts].
        safe_range: Smallest and largest pressure above ambient that may be sent [Pa].
    """

    scale: float = 50.0
    zero: float = 0.0
    safe_range: tuple[float, float] = (0.0, 20e3)

    def __post_init__(self) -> None:
        _check_positive("scale", self.scale, "Pa")
        _check_channel(self)

    @property
    def kind(self) -> ChannelKind:
        """What a channel of the board must drive for it."""
        return ChannelKind.PRESSURE

    @property
    def unit(self) -> str:
        """Of the joint."""
        return "Pa"


ChannelCalibration = WinchCalibration | PressureCalibration


def _check_positive(name: str, value: float, unit: str) -> None:
    if not 0 < value < math.inf:
        raise CalibrationError(f"{name} is {value:g} {unit}; it must be positive")


def _check_channel(channel: ChannelCalibration) -> None:
    low, high = channel.safe_range
    if not low < high:
        raise CalibrationError(
            f"safe_range[1] is {high:g} {channel.unit}; allowed: more than safe_range[0] {low:g} {channel.unit}"
        )
    for i, end in enumerate(channel.safe_range):
        setpoint = channel.zero + end / channel.scale
        if not -0.5 <= setpoint <= SETPOINT_MAX + 0.5:
            raise CalibrationError(
                f"safe_range[{i}] is {end:g} {channel.unit}, which is set-point {setpoint:.0f}; allowed: 0 to "
                f"{SETPOINT_MAX}: correct zero or safe_range"
            )


def default_channel(joint: Joint) -> ChannelCalibration:
    """Return the calibration of the board in memory for a joint. Raises CalibrationError: no channel takes its unit."""
    safe = (joint.low, joint.high)
    if joint.unit == "m":
        kind = WinchCalibration()
        return replace(kind, zero=max(0.0, -joint.low / kind.scale), safe_range=safe)
    if joint.unit == "Pa":
        return PressureCalibration(zero=max(0.0, -joint.low / PressureCalibration.scale), safe_range=safe)
    raise CalibrationError(
        f"{joint.name} is commanded by a {joint.quantity} [{joint.unit}]; a board drives angles, lengths [m] and "
        "pressures [Pa]"
    )


@dataclass(frozen=True)
class Calibration:
    """The calibration of the whole robot.

    Attributes:
        servos: One for each servo, in the order of their joints.
        channels: Of the other joints by name, in the order of the board's channels: winches, then pressures.
    """

    servos: tuple[ServoCalibration, ...] = field(default=(ServoCalibration(),) * len(SERVOS))
    channels: Mapping[str, ChannelCalibration] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all joints: the servos, then the channels."""
        return (*servo_names(len(self.servos)), *self.channels)

    @property
    def lower(self) -> tuple[float, ...]:
        """Smallest joint values that may be sent [rad, m, Pa], shape (n,)."""
        return tuple(joint.safe_range[0] for joint in (*self.servos, *self.channels.values()))

    @property
    def upper(self) -> tuple[float, ...]:
        """Largest joint values that may be sent [rad, m, Pa], shape (n,)."""
        return tuple(joint.safe_range[1] for joint in (*self.servos, *self.channels.values()))

    def setpoints(self, values: Sequence[float]) -> tuple[int, ...]:
        """Return the nearest set-points of the channels, shape (n - s,), for their joint values [m, Pa]."""
        pairs = zip(self.channels.values(), values, strict=True)
        return tuple(min(max(round(c.zero + value / c.scale), 0), SETPOINT_MAX) for c, value in pairs)

    def values(self, setpoints: Sequence[int]) -> tuple[float, ...]:
        """Return the joint values [m, Pa], shape (n - s,), of set-points of the channels."""
        return tuple((s - c.zero) * c.scale for c, s in zip(self.channels.values(), setpoints, strict=True))

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
        return replace(self, servos=tuple(servos))
