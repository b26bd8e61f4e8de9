"""Whether a board that answered may be driven."""

from collections.abc import Sequence
from typing import Final

from tripod_driver.calibration import Calibration
from tripod_driver.framed import VERSION
from tripod_driver.framed_messages import HelloReply, ResetCause
from tripod_driver.protocol import SERVO_COUNT
from tripod_driver.session import TENTHS
from tripod_graph.names import servo_names

FLASH_ADVICE: Final = "update the board: make -C firmware, then tripod flash"

STATE_SLACK: Final = 0.05
"""A servo may stand so far outside of its safe range when the driver takes over [rad]."""


def other_version(version: int) -> str:
    """Return the message for a board of another protocol version."""
    advice = (
        FLASH_ADVICE if version < VERSION else "update this program, or flash the firmware that belongs to it"
    )
    return (
        f"the firmware of the board speaks version {version} of the protocol, this driver version "
        f"{VERSION}; {advice}"
    )


_CAUSES: Final = {
    ResetCause.WATCHDOG: (
        "watchdog",
        (
            "the board was reset by its watchdog, as its firmware hung; if that happens again, flash it "
            "again: tripod flash"
        ),
    ),
    ResetCause.BROWN_OUT: (
        "brown-out",
        ("the board was reset because its supply voltage dropped; give the servos a supply of their own"),
    ),
    ResetCause.POWER_ON: (
        "power-on",
        "the board was reset because it lost power; check its supply and cable",
    ),
    ResetCause.EXTERNAL: (
        "external",
        (
            "the board was reset by its button, or because a program opened its port; press no button, "
            "and close other programs that use the port"
        ),
    ),
}
_UNKNOWN: Final = (
    "unknown",
    "the board was reset; its boot loader hides the reason: check its supply and cable",
)


def reset_told(cause: ResetCause) -> tuple[str, str]:
    """Return a word for why a board was reset, and what to say of such a reset during a conversation."""
    return next((told for flag, told in _CAUSES.items() if cause & flag), _UNKNOWN)


def is_failure(cause: ResetCause) -> bool:
    """Return whether a reset shows a fault of supply or firmware, and is none that opening or switching on makes."""
    return bool(cause & (ResetCause.BROWN_OUT | ResetCause.WATCHDOG)) and not cause & ResetCause.POWER_ON


def why_not(reply: HelloReply, calibration: Calibration) -> str:
    """Return why this board cannot be driven; empty if it can."""
    if reply.protocol != VERSION:
        return other_version(reply.protocol)
    count, found = len(calibration.servos), reply.servo_count
    if count and not found == count == len(reply.pulses):
        advice = (
            FLASH_ADVICE
            if count == SERVO_COUNT
            else "choose a scene of the robot at hand, or --set port=mock"
        )
        return f"the firmware drives {found} servos, the robot has {count}; {advice}"
    for name, servo in zip(servo_names(count), calibration.servos, strict=True):
        for angle in servo.safe_range:
            pulse = servo.pulse(angle)
            if not reply.pulse_min <= round(TENTHS * pulse) <= reply.pulse_max:
                allowed = f"{reply.pulse_min / TENTHS:g} to {reply.pulse_max / TENTHS:g} us"
                return (
                    f"{name} needs a pulse of {pulse:.1f} us at {angle:g} rad; the board can make {allowed}: "
                    "calibrate with `tripod calibrate`"
                )
    return ""


def why_not_from(position: Sequence[float], calibration: Calibration) -> str:
    """Return why motion must not begin at these joint values, shape (n,), because of a servo; empty if it may."""
    names = servo_names(
        len(calibration.servos)
    )  # a winch at home, or a vented chamber, may be beyond its range
    for name, angle, low, high in zip(names, position, calibration.lower, calibration.upper, strict=False):
        if not low - STATE_SLACK <= angle <= high + STATE_SLACK:
            return (
                f"{name} is at {angle:.3f} rad, outside its safe range of {low:g} to {high:g} rad: switch the "
                "board off and on, or calibrate with `tripod calibrate`"
            )
    return ""
