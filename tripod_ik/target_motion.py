"""The motion behind a stream of targets: what the target will be when the effector gets there.

Pure: the caller gives the time.
"""

from collections import deque

import numpy as np

from tripod_host.arrays import FloatArray

HOLD = 0.1
"""Targets that come later than this after one another [s] are single ones: they do not move."""

FASTEST = 0.5
"""A target that moves faster than this has jumped [m/s]; of a normal, per second."""


class TargetMotion:
    """Extrapolates the last targets by `lead` [s].

    With p the last target, t its time and v its velocity (over the last two intervals, or one),

        target(now) = p + v (now - t + lead),   v = 0 once now - t > HOLD or where the target jumped.

    A robot that answers a command after `lead` then is where the target is now. A lead of zero changes nothing: the
    last target is followed as it is.
    """

    def __init__(self, lead: float) -> None:
        self.lead = lead
        self._known: deque[tuple[float, FloatArray]] = deque(maxlen=3)

    def clear(self) -> None:
        """Forget all targets."""
        self._known.clear()

    def add(self, target: FloatArray, now: float) -> None:
        """Take a target that comes at `now` [s]; one that comes at the same time replaces the one before."""
        if self._known:
            gap = now - self._known[-1][0]
            jumped = gap <= 0 or np.abs(target - self._known[-1][1]).max() > FASTEST * gap
            if gap > HOLD or jumped:
                self._known.clear()
        self._known.append((now, target))

    def moves(self, now: float) -> bool:
        """Return whether the target moves at `now` [s], and has not jumped."""
        if len(self._known) < 2 or not 0 <= now - self._known[-1][0] <= HOLD:
            return False
        return not np.array_equal(self._known[-1][1], self._known[0][1], equal_nan=True)

    def at(self, now: float, more: float = 0.0) -> FloatArray:
        """Return the target to aim at, at `now` [s]; there must be one. `more`: of the lead [s]."""
        time, target = self._known[-1]
        lead = self.lead + more
        if lead == 0.0 or not self.moves(now):
            return target
        begin, first = self._known[0]
        return target + (target - first) * ((now - time + lead) / (time - begin))
