"""One joint that is commanded: a servo, the slide, a cable, a chamber or a force. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from tripod_graph.names import servo_names

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
