"""A recorded motion of the joints: whether the servos may follow it, and what to ask of them when. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tripod_graph.names import servo_names
from tripod_host.arrays import FloatArray
from tripod_play.errors import PlayError

WINDOW = 0.05
"""Time over which speeds are taken [s]: stamps are a little late or early."""

SLACK = 1.1
"""Speed that recorded stamps may seem to have over the one allowed."""

SAFE_SPEED = 0.5
"""Largest speed on the way to the first pose [rad/s]."""


@dataclass(frozen=True, eq=False)
class JointPath:
    """Joints over time.

    Attributes:
        times: From the beginning of the recording [s], rising, shape (n,).
        joints: The angles [rad] and, where it is known, the slide [m]; shape (n, servos) or (n, servos + 1).
        servos: How many there are.
    """

    times: FloatArray
    joints: FloatArray
    servos: int

    @property
    def end(self) -> float:
        """Time of the last pose [s]."""
        return float(self.times[-1])

    def at(self, time: float) -> FloatArray:
        """Return the joints at `time` [s], between two poses in proportion."""
        return np.array([np.interp(time, self.times, column) for column in self.joints.T])

    def check(
        self,
        lower: Sequence[float],
        upper: Sequence[float],
        speed: Sequence[float],
        *,
        start: float,
        rate: float,
    ) -> None:
        """Raise PlayError unless all from `start` [s] on is within the driver's range [rad] and slew rates [rad/s]."""
        if len(lower) != self.servos:
            raise PlayError(
                f"the motion is of {self.servos} servos, the driver has {len(lower)}; nothing moves: record "
                "it with this robot"
            )
        if not start < self.end:
            raise PlayError(
                f"--start is {start:g} s; the motion ends at {self.end:.2f} s: give an earlier time"
            )
        kept = self.times >= start
        names = servo_names(self.servos)
        for i, name in enumerate(names):
            angles = self.joints[kept, i]
            outside = (angles < lower[i] - 1e-9) | (angles > upper[i] + 1e-9) | ~np.isfinite(angles)
            if outside.any():
                k = int(outside.argmax())
                raise PlayError(
                    f"{name} would be at {angles[k]:.3f} rad at {self.times[kept][k]:.2f} s; the driver allows "
                    f"{lower[i]:.3f} to {upper[i]:.3f} rad, so nothing moves: calibrate, or play a smaller motion"
                )
        grid = np.arange(start, self.end + WINDOW, WINDOW)
        for i, name in enumerate(names):
            moved = np.abs(np.diff(np.interp(grid, self.times, self.joints[:, i]))) * rate / WINDOW
            k = int(moved.argmax())
            if moved[k] > SLACK * speed[i]:
                slower = 0.99 * speed[i] / moved[k]
                raise PlayError(
                    f"{name} would move at {moved[k]:.2f} rad/s at {grid[k]:.2f} s; the driver allows "
                    f"{speed[i]:.2f} rad/s: let it take {1 / slower:.2f} times as long (a rate of {rate * slower:.2f})"
                )


def ramp_time(here: FloatArray, there: FloatArray, speed: Sequence[float]) -> float:
    """Return the time from one pose to another [s] at a safe speed, at most the driver's [rad/s]."""
    fastest = np.minimum(SAFE_SPEED, speed)
    return float(np.max(np.abs(there[: len(speed)] - here[: len(speed)]) / fastest)) + 0.1
