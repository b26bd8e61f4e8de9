"""One joint that is commanded: a servo, the slide, a cable, a chamber or a force. Pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from tripod_graph.names import SLIDE, count_servos, servo_names

EFFORT_UNITS: Final = {"N": "force", "Pa": "pressure"}
"""Units of commands that are efforts, and what they are; those of all other joints are positions."""

POSITION_UNITS: Final = {"rad": "angle", "m": "length", "m³": "volume"}
"""Units of commands that are positions, and what they are."""

SHOWN: Final = {
    "rad": (1.0, "rad"),
    "m": (1e3, "mm"),
    "m³": (1e6, "mL"),
    "N": (1.0, "N"),
    "Pa": (1e-3, "kPa"),
}
"""Factor and unit in which people read a command."""

ANSWERS: Final = {
    "rad": (1.0, "N m"),
    "m": (1.0, "N"),
    "m³": (1e-3, "kPa"),
    "N": (1e3, "mm"),
    "Pa": (1e6, "mL"),
}
"""Factor and unit in which people read what a joint gives in return."""


class JointError(ValueError):
    """A joint state that is refused; the message names the joint and why."""


@dataclass(frozen=True)
class Joint:
    """A joint as its commands know it.

    Attributes:
        name: By which it is commanded.
        unit: Of the command, SI: rad, m, m³ (positions), N or Pa (efforts).
        low, high: Smallest and largest command [unit].
        speed: Slew rate [unit/s].
    """

    name: str
    unit: str
    low: float
    high: float
    speed: float

    @property
    def is_effort(self) -> bool:
        """Whether a force, a tension or a pressure is commanded, not a position."""
        return self.unit in EFFORT_UNITS

    @property
    def quantity(self) -> str:
        """What is commanded, in a word."""
        return EFFORT_UNITS.get(self.unit) or POSITION_UNITS.get(self.unit, "position")

    @property
    def park(self) -> float:
        """The command nearest to 0 within the range [unit]."""
        return min(max(0.0, self.low), self.high)

    @property
    def span(self) -> float:
        """Length of the range [unit]."""
        return self.high - self.low

    def shown(self, value: float) -> str:
        """Return a command for people.

        >>> Joint("tendon", "m", 0.0, 0.03, 0.03).shown(0.0125)
        '12.5 mm'
        """
        factor, unit = SHOWN.get(self.unit, (1.0, self.unit))
        return f"{factor * value:.4g} {unit}"

    @property
    def answer(self) -> tuple[float, str]:
        """Factor and unit in which people read what the joint gives in return for its command: torque, tension, way."""
        return ANSWERS.get(self.unit, (1.0, ""))

    def within(self, low: float, high: float, speed: float) -> "Joint":
        """Return the joint narrowed to a range and a slew rate; a range without overlap stays upside down."""
        return replace(self, low=max(self.low, low), high=min(self.high, high), speed=min(self.speed, speed))


def joints_told(
    names: Sequence[str],
    units: Sequence[str],
    lower: Sequence[float],
    upper: Sequence[float],
    speed: Sequence[float],
) -> tuple[Joint, ...]:
    """Return the joints of a status that are no servos; none where its arrays differ in length or are no ranges."""
    if not len(names) == len(units) == len(lower) == len(upper) == len(speed):
        return ()
    servos = set(servo_names(len(names)))
    told = (
        Joint(*row) for row in zip(names, units, lower, upper, speed, strict=True) if row[0] not in servos
    )
    return tuple(joint for joint in told if joint.low < joint.high and joint.speed > 0)


def joint_values(
    names: Sequence[str],
    positions: Sequence[float],
    efforts: Sequence[float] = (),
    others: Sequence[Joint] = (),
) -> tuple[float, ...]:
    """Return the angles of all servos [rad], commands of `others` and, if it is named, the slide [m] of a joint state.

    The command of a joint that takes an effort is its effort. Joints of other names are passed over. Raises JointError.
    """
    if len(names) != len(positions):
        raise JointError(f"the message has {len(positions)} positions for {len(names)} joints")
    told = dict(zip(names, positions, strict=True))
    done = dict(zip(names, efforts, strict=False))
    servos = servo_names(count_servos(told))
    if not (servos or others) or any(n.startswith("servo_") and n not in servos for n in told):
        raise JointError(f"joint 'servo_{len(servos)}' is missing; joints: {', '.join(names)[:80] or 'none'}")
    for joint in others:
        if joint.name not in (done if joint.is_effort else told):
            raise JointError(f"joint {joint.name!r} is missing; joints: {', '.join(names)[:80] or 'none'}")
    told |= {joint.name: done[joint.name] for joint in others if joint.is_effort}
    known = [n for n in (*servos, *(j.name for j in others), SLIDE) if n in told]
    if strange := [n for n in known if not math.isfinite(told[n])]:
        raise JointError(f"joint {strange[0]!r} is at {told[strange[0]]}; it must be a finite number")
    return tuple(float(told[n]) for n in known)
