"""A smooth motion from the present joint values to given ones, as the points of a trajectory."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tripod_graph.joint import Joint
from tripod_graph.names import SLIDE
from tripod_host.arrays import FloatArray

POINTS = 24
"""Points of a motion; followers interpolate linearly between them."""

PEAK = 15 / 8
"""Largest speed of a motion over its mean speed."""

SLIDE_SPEED = 0.01
"""Mean speed of the slide in a motion [m/s]."""

SHORTEST = 0.5
"""Least duration of a motion [s]."""


@dataclass(frozen=True)
class Trajectory:
    """Points for the joints to pass, from when it is received.

    Attributes:
        joints: Which.
        times: Time of each point from the start [s], shape (m,).
        positions: Joint values at each point [rad, m], shape (m, len(joints)).
    """

    joints: tuple[Joint, ...]
    times: FloatArray
    positions: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(joint.name for joint in self.joints)


def motion_duration(start: FloatArray, goal: FloatArray, speed: float, joints: Sequence[Joint]) -> float:
    """Return the time [s] from `start` to `goal`, shape (n + 1,), of `joints`; servos at mean `speed` [rad/s]."""
    speeds = [
        speed if j.unit == "rad" else SLIDE_SPEED if j.name == SLIDE else j.speed / PEAK for j in joints
    ]
    return float(max((np.abs(goal - start) / speeds).max(), SHORTEST))


def motion(
    start: Sequence[float] | FloatArray,
    goal: Sequence[float] | FloatArray,
    speed: float,
    joints: Sequence[Joint],
) -> Trajectory:
    """Return the motion of `joints` from `start` to `goal`, both shape (n + 1,): all joints, the slide last.

    All joints move in proportion along s(u) = u^3 (10 - 15 u + 6 u^2): speed and acceleration are zero at
    both ends, and the strips keep about their length on the way, because angle and slide go together.
    """
    a, b = np.asarray(start, float), np.asarray(goal, float)
    u = np.arange(1, POINTS + 1) / POINTS
    s = u**3 * (10 - 15 * u + 6 * u**2)
    return Trajectory(tuple(joints), motion_duration(a, b, speed, joints) * u, a + s[:, None] * (b - a))
