"""Set-points that follow the keys: one servo while its key is down, or all joints to a pose."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tripod_graph.command import CommandLimits
from tripod_teleop.keys import Move

FloatArray = NDArray[np.float64]

PEAK = 1.5
"""Largest speed of a motion to a pose, as a multiple of its mean."""
LONGEST_STEP = 0.1
"""A caller that comes later than this [s] has stalled; the joints do not catch up."""


def smooth(ratio: float) -> float:
    """Return the part of the way done after that part of the time: at rest at both ends, 1.5 times as fast midway."""
    ratio = min(max(ratio, 0.0), 1.0)
    return ratio * ratio * (3.0 - 2.0 * ratio)


class Drive:
    """The set-point of the joints, moved by keys and motions within limits.

    A terminal reports no release of a key, only repeats while it is down: a press counts for `hold` [s], and
    silence means stop. (A key held down therefore pauses once, until the terminal begins to repeat it.) A motion
    to a pose is not sent ahead as one long trajectory but streamed, so that it ends with its operator, wherever
    it is.

    Attributes:
        joints: The set-point: three angles [rad], and the slide [m] if it is known.
        motion: Name of the motion under way, empty if none.
        at_once: Whether the set-point has jumped: followers are not to take the time between two set-points for it.
    """

    def __init__(self, limits: CommandLimits, *, speed: float, hold: float, pose_time: float) -> None:
        """Begin without a set-point; `start` gives one.

        Args:
            limits: Bounds of the set-point.
            speed: Of a servo whose key is down [rad/s].
            hold: Time for which a press counts [s].
            pose_time: Shortest time of a motion to a pose [s].
        """
        self._limits, self._speed, self._hold, self._pose_time = limits, speed, hold, pose_time
        self.joints: FloatArray = np.zeros(3)
        self.motion = ""
        self.at_once = False
        self._last: float | None = None
        self._pressed: dict[int, tuple[int, float]] = {}  # servo: sign, until
        self._path = (self.joints, self.joints, 0.0, 0.0)  # from, to, start, duration

    def start(self, joints: Sequence[float]) -> None:
        """Begin at rest at `joints`: three angles [rad], and the slide [m] if it is known."""
        values = np.array(joints, float)
        self.joints = np.clip(values, self._limits.lower[: len(values)], self._limits.upper[: len(values)])
        self._last = None
        self.rest()

    def rest(self) -> None:
        """Stay where the set-point is."""
        self.motion, self.at_once = "", False
        self._pressed.clear()

    def press(self, move: Move, now: float) -> None:
        """Take a press, or its repeat, at `now` [s]; it ends a motion to a pose."""
        self.setpoint(now)  # what was pressed before counts until here
        if self.motion or self.at_once:
            self.rest()
        self._pressed[move.servo] = (move.sign, now + self._hold)

    def is_pressed(self, move: Move, now: float) -> bool:
        """Return whether `move` counts at `now` [s]: another press of its key changes no speed."""
        sign, until = self._pressed.get(move.servo, (0, now))
        return sign == move.sign and until > now

    def go(self, name: str, pose: Sequence[float], now: float) -> None:
        """Begin a motion to `pose`, three angles [rad] and the slide [m], all joints in proportion."""
        self.rest()
        size = len(self.joints)
        goal = np.clip(np.array(pose, float), self._limits.lower, self._limits.upper)[:size]
        fastest = PEAK * np.abs(goal - self.joints) / self._limits.speed[:size]
        self._path = (self.joints.copy(), goal, now, max(self._pose_time, float(fastest.max())))
        self.motion = name

    def jump(self, angles: Sequence[float]) -> None:
        """Put the set-point at three `angles` [rad] in one step; the slide stays.

        The joints go there as fast as their followers' slew rates let them.
        """
        self.rest()
        self.at_once = True
        self.joints[:3] = np.clip(np.array(angles, float), self._limits.lower[:3], self._limits.upper[:3])

    def setpoint(self, now: float) -> FloatArray:
        """Return the set-point at `now` [s], shape (3,) or (4,); to be called at a regular rate.

        `now` may be a little ahead of the clock; a call with an earlier time then moves nothing that a key moves.
        """
        last = now if self._last is None else max(self._last, now - LONGEST_STEP)
        self._last = max(last, now)
        if self.motion:
            begin, goal, start, duration = self._path
            if now - start >= duration:
                self.joints, self.motion = goal.copy(), ""
            else:
                self.joints = begin + smooth((now - start) / duration) * (goal - begin)
        for servo, (sign, until) in self._pressed.items():
            self.joints[servo] += sign * self._speed * max(0.0, min(now, until) - last)
        size = len(self.joints)
        self.joints = np.clip(self.joints, self._limits.lower[:size], self._limits.upper[:size])
        return self.joints.copy()
