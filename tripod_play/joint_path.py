"""A recorded motion of the joints: whether the robot may follow it, and what to ask of them when. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tripod_graph.joint import Joint
from tripod_graph.names import servo_names
from tripod_host.arrays import FloatArray
from tripod_play.errors import PlayError

WINDOW = 0.05
"""Time over which speeds are taken [s]: stamps are a little late or early."""

SLACK = 1.1
"""Speed that recorded stamps may seem to have over the one allowed."""

SAFE_SPEED = 0.5
"""Largest speed on the way to the first pose [rad/s]."""

SAFE_SHARE = 1 / 3
"""The same of joints other than servos, as a share of their range in a second [1/s]."""


@dataclass(frozen=True, eq=False)
class JointPath:
    """Joints over time.

    Attributes:
        times: From the beginning of the recording [s], rising, shape (n,).
        joints: Angles [rad], values of `others` [m, N, Pa] and, where it is known, the slide [m]; shape (n, size) or
            (n, size + 1).
        servos: How many there are.
        others: Names of the joints that are no servos.
    """

    times: FloatArray
    joints: FloatArray
    servos: int
    others: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Of the joints without the slide."""
        return (*servo_names(self.servos), *self.others)

    @property
    def size(self) -> int:
        """Number of joints without the slide."""
        return self.servos + len(self.others)

    @property
    def end(self) -> float:
        """Time of the last pose [s]."""
        return float(self.times[-1])

    def at(self, time: float) -> FloatArray:
        """Return the joints at `time` [s], between two poses in proportion."""
        return np.array([np.interp(time, self.times, column) for column in self.joints.T])

    def check(self, joints: Sequence[Joint], *, start: float, rate: float) -> tuple[Joint, ...]:
        """Return the driver's `joints` in the order of this motion.

        Raises PlayError unless all from `start` [s] on is within their ranges and slew rates.
        """
        table = {joint.name: joint for joint in joints}
        if set(table) != set(self.names):
            whose, has = (", ".join(names) or "nothing" for names in (self.names, table))
            raise PlayError(
                f"the motion is of {whose}, the driver has {has}; nothing moves: record it with this robot"
            )
        if not start < self.end:
            raise PlayError(
                f"--start is {start:g} s; the motion ends at {self.end:.2f} s: give an earlier time"
            )
        kept = self.times >= start
        found = tuple(table[name] for name in self.names)
        for i, joint in enumerate(found):
            values, slack = self.joints[kept, i], 1e-9 * (1.0 if joint.unit == "rad" else joint.span)
            outside = (values < joint.low - slack) | (values > joint.high + slack) | ~np.isfinite(values)
            if outside.any():
                k = int(outside.argmax())
                raise PlayError(
                    f"{joint.name} would be at {_shown(joint, values[k])} at {self.times[kept][k]:.2f} s; the driver "
                    f"allows {_shown(joint, joint.low, joint.high)}, so nothing moves: calibrate, or play a smaller "
                    "motion"
                )
        grid = np.arange(start, self.end + WINDOW, WINDOW)
        for i, joint in enumerate(found):
            moved = np.abs(np.diff(np.interp(grid, self.times, self.joints[:, i]))) * rate / WINDOW
            k = int(moved.argmax())
            if moved[k] > SLACK * joint.speed:
                slower = 0.99 * joint.speed / moved[k]
                fast, allowed = (_shown(joint, value, digits=2) for value in (moved[k], joint.speed))
                raise PlayError(
                    f"{joint.name} would move at {fast}/s at {grid[k]:.2f} s; the driver allows {allowed}/s: let it "
                    f"take {1 / slower:.2f} times as long (a rate of {rate * slower:.2f})"
                )
        return found


def _shown(joint: Joint, *values: float, digits: int = 3) -> str:
    """Return a value, or a range, for people."""
    if joint.unit == "rad":
        return " to ".join(f"{value:.{digits}f}" for value in values) + " rad"
    return " to ".join(joint.shown(value) for value in values)


def ramp_time(here: FloatArray, there: FloatArray, joints: Sequence[Joint]) -> float:
    """Return the time from one pose to another [s] at a safe speed, at most the driver's."""
    safe = [SAFE_SPEED if joint.unit == "rad" else SAFE_SHARE * joint.span for joint in joints]
    fastest = np.minimum(safe, [joint.speed for joint in joints])
    count = len(joints)
    return float(np.max(np.abs(there[:count] - here[:count]) / fastest)) + 0.1
