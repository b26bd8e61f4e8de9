"""What the command must keep to: intervals of each servo angle. Limits of anything else are in `row_limits`.

Angle, step and speed limits are intervals of the commanded angle. They are hard and are applied in order,
each within what the ones before it leave. Where one leaves nothing of the rest (a robot found outside its
angle limits, say) the nearest edge remains: an earlier limit outranks a later one, and there is always a
command that keeps to all of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Protocol

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.arrays import per_joint
from tripod_ik.errors import IkError
from tripod_ik.state import LinearState


@dataclass(frozen=True, eq=False)
class Motion:
    """What limits refer to.

    Attributes:
        state: The linearised state.
        previous: The command before this one [rad], shape (n,).
        dt: Time since then [s].
    """

    state: LinearState
    previous: FloatArray
    dt: float


class IntervalLimit(Protocol):
    """A limit on the commanded angle of each servo."""

    @property
    def kind(self) -> str:
        """What it limits, for people: "angle", "step", "speed"."""

    @property
    def sides(self) -> tuple[str, str]:
        """What is added for its lower and upper end."""

    def interval(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return the smallest and the largest command [rad], each of shape (n,)."""


@dataclass(frozen=True)
class AngleLimit:
    """Commands stay within [low, high] [rad], one number or one a servo."""

    low: float | FloatArray
    high: float | FloatArray
    kind: str = field(default="angle", init=False)
    sides: tuple[str, str] = field(default=(" min", " max"), init=False)

    def __post_init__(self) -> None:
        if not np.all(np.less(self.low, self.high)):
            raise IkError(f"angle limits: low {self.low} rad must be below high {self.high} rad")

    def interval(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return the limits themselves."""
        n = len(motion.previous)
        return per_joint("low", self.low, n), per_joint("high", self.high, n)


@dataclass(frozen=True)
class StepLimit:
    """Commands stay within `step` [rad] of the present angles.

    The linear model is trusted no farther than that, and a robot that does not follow (paused, reset,
    blocked) is not left behind by its commands. It is to be larger than the speed times the delay of the
    loop.
    """

    step: float
    kind: str = field(default="step", init=False)
    sides: tuple[str, str] = field(default=("", ""), init=False)

    def __post_init__(self) -> None:
        if not self.step > 0:
            raise IkError(f"step limit is {self.step} rad; it must be positive")

    def interval(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return the present angles -+ `step`."""
        return motion.state.angles - self.step, motion.state.angles + self.step


@dataclass(frozen=True)
class SpeedLimit:
    """Successive commands differ by at most `speed` [rad/s] times dt.

    It bounds the motion of the command that is sent, not the distance from the present angles: those lag
    behind by the delay of the loop, and a limit around them would slow the robot down the more the longer the
    delay.
    """

    speed: float
    kind: str = field(default="speed", init=False)
    sides: tuple[str, str] = field(default=("", ""), init=False)

    def __post_init__(self) -> None:
        if not self.speed > 0:
            raise IkError(f"speed limit is {self.speed} rad/s; it must be positive")

    def interval(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return the previous command -+ `speed` dt."""
        reach = self.speed * motion.dt
        return motion.previous - reach, motion.previous + reach


@dataclass(frozen=True, eq=False)
class CommandBox:
    """The commands that keep to all interval limits, and which limit each side comes from.

    Attributes:
        low: Smallest command [rad], shape (n,).
        high: Largest command [rad], shape (n,), not below `low`.
        low_names: For each servo the limit that gives `low`, such as "servo_0 angle min"; empty if none.
        high_names: The same for `high`.
    """

    low: FloatArray
    high: FloatArray
    low_names: tuple[str, ...]
    high_names: tuple[str, ...]


def command_box(limits: Sequence[IntervalLimit], motion: Motion) -> CommandBox:
    """Return the commands that keep to `limits`, the first of them first."""
    names, quantities = motion.state.joint_names, motion.state.quantities
    low, high = [-inf] * len(names), [inf] * len(names)
    low_names, high_names = [""] * len(names), [""] * len(names)
    for limit in limits:
        asked = (side.tolist() for side in limit.interval(motion))
        for i, (name, *sides) in enumerate(zip(names, *asked, strict=True)):
            new_low, new_high = (min(max(side, low[i]), high[i]) for side in sides)
            kind = quantities[i] if isinstance(limit, AngleLimit) else limit.kind
            if new_low > low[i]:
                low_names[i] = f"{name} {kind}{limit.sides[0]}"
            if new_high < high[i]:
                high_names[i] = f"{name} {kind}{limit.sides[1]}"
            low[i], high[i] = new_low, new_high
    return CommandBox(np.array(low), np.array(high), tuple(low_names), tuple(high_names))
