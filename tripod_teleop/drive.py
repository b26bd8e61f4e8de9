"""Set-points that follow the keys: one joint while its key is down, or all joints to a pose."""

from collections.abc import Sequence

import numpy as np

from tripod_graph.command import CommandLimits
from tripod_host.arrays import FloatArray
from tripod_teleop.keys import Move

PEAK = 1.5
"""Largest speed of a motion to a pose, as a multiple of its mean."""
SHARE = 0.25
"""Of its range that a joint other than a servo passes through in a second while its key is down."""
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
        limits: Bounds of the set-point.
        joints: The set-point: the angle of each servo [rad], other joints [m, N, Pa], and the slide [m] if it is known.
        speed: Of a servo whose key is down [rad/s]; other joints pass through `SHARE` of their range in a second.
        hold: Time for which a press counts [s].
        pose_time: Shortest time of a motion to a pose [s].
        motion: Name of the motion under way, empty if none.
        at_once: Whether the set-point has jumped: followers are not to take the time between two set-points for it.
    """

    def __init__(self, limits: CommandLimits, *, speed: float, hold: float, pose_time: float) -> None:
        """Begin without a set-point; `start` gives one. The arguments are the attributes."""
        self.limits, self.speed, self.hold, self.pose_time = limits, speed, hold, pose_time
        self.joints: FloatArray = np.zeros(limits.size)
        self.motion = ""
        self.at_once = False
        self._pressed: dict[int, tuple[int, float, float]] = {}  # servo: sign, moved until, pressed until
        self._begin, self._due = (float("-inf"), self.joints), float("-inf")  # of the way to the set-point
        self._path = (self.joints, self.joints, 0.0, 0.0)  # from, to, start, duration

    def start(self, joints: Sequence[float]) -> None:
        """Begin at rest at `joints`: as the attribute."""
        values = np.array(joints, float)
        self.joints = np.clip(values, self.limits.lower[: len(values)], self.limits.upper[: len(values)])
        self._due = float("-inf")
        self.rest()

    def fit(self, limits: CommandLimits) -> None:
        """Be for a robot with other joints; `start` is due."""
        self.limits, self.joints, self._due = limits, np.zeros(limits.size), float("-inf")
        self.rest()

    def rest(self) -> None:
        """Stay where the set-point is."""
        self.motion, self.at_once = "", False
        self._pressed.clear()

    def press(self, move: Move, now: float) -> None:
        """Take a press, or its repeat, at `now` [s]; it ends a motion to a pose.

        What was not pressed begins to move at `now`, also where the set-point is ahead of that; what is turned back
        begins where the joint is at `now`.
        """
        self.setpoint(now)  # what was pressed before counts until here
        if self.motion or self.at_once:
            self.rest()
        i = move.servo
        sign, moved, until = self._pressed.get(i, (0, now, now))
        if until <= now:
            moved = now
        elif sign != move.sign:
            here = self._at(now)
            self._begin, self.joints[i], moved = (now, here), here[i], now
        self._pressed[i] = (move.sign, moved, now + self.hold)

    def is_pressed(self, move: Move, now: float) -> bool:
        """Return whether `move` counts at `now` [s]: another press of its key changes no speed."""
        sign, _, until = self._pressed.get(move.servo, (0, now, now))
        return sign == move.sign and until > now

    def go(self, name: str, pose: Sequence[float], now: float) -> None:
        """Begin a motion to `pose`, all joints and the slide, in proportion."""
        self.rest()
        size = len(self.joints)
        goal = np.clip(np.array(pose, float), self.limits.lower, self.limits.upper)[:size]
        fastest = PEAK * np.abs(goal - self.joints) / self.limits.speed[:size]
        self._path = (self.joints.copy(), goal, now, max(self.pose_time, float(fastest.max())))
        self.motion = name

    def jump(self, angles: Sequence[float]) -> None:
        """Put the set-point at `angles` [rad], shape (s,), in one step; slide and other joints stay.

        The joints go there as fast as their followers' slew rates let them.
        """
        self.rest()
        self.at_once = True
        servos = self.limits.count
        self.joints[:servos] = np.clip(
            np.array(angles, float), self.limits.lower[:servos], self.limits.upper[:servos]
        )

    def setpoint(self, now: float, ahead: float = 0.0) -> FloatArray:
        """Return where the joints should be `ahead` [s] after `now` [s], shape (n,) or (n + 1,); call it regularly.

        What a key moves was moved by an earlier call until its time: only what comes after that is added.
        """
        time = now + ahead
        if time > self._due:
            self._begin, self._due = (now, self._at(now)), time
        if self.motion:
            begin, goal, start, duration = self._path
            if time - start >= duration:
                self.joints, self.motion = goal.copy(), ""
            else:
                self.joints = begin + smooth((time - start) / duration) * (goal - begin)
        for servo, (sign, moved, until) in self._pressed.items():
            last = max(moved, time - LONGEST_STEP)
            self.joints[servo] += sign * self.key_speed(servo) * max(0.0, min(time, until) - last)
            self._pressed[servo] = (sign, max(moved, time), until)
        size = len(self.joints)
        self.joints = np.clip(self.joints, self.limits.lower[:size], self.limits.upper[:size])
        return self.joints.copy()

    def key_speed(self, joint: int) -> float:
        """Return the speed of a joint whose key is down, at most its slew rate [rad/s, m/s, N/s, Pa/s]."""
        if joint < self.limits.count:
            return self.speed
        return min(SHARE * self.limits.table[joint].span, float(self.limits.speed[joint]))

    def at_limits(self) -> dict[int, float]:
        """Return the limit of each joint whose set-point is there, by its number."""
        size = min(self.limits.size, len(self.joints))
        values, low, high = self.joints[:size], self.limits.lower[:size], self.limits.upper[:size]
        return {i: float(v) for i, v in enumerate(values) if v <= low[i] or v >= high[i]}

    def _at(self, now: float) -> FloatArray:
        """Return where followers are at `now` [s], on a straight way to a set-point that may be ahead of that."""
        begun, joints = self._begin
        if not begun <= now < self._due:
            return self.joints.copy()
        return joints + (now - begun) / (self._due - begun) * (self.joints - joints)
