"""The time in which motions are meant: simulated time where the node uses that, else steady time."""

import time
from typing import Any

STALL = 0.5
"""A simulated clock that stands still for longer than this [s] holds nobody up: time goes on by the steady one."""

STALLED = (
    "/clock does not advance, and use_sim_time is true: start the node that publishes it, or set "
    "use_sim_time to false"
)
"""What there is to say then."""

JUMP = 1.0
"""A simulated clock that goes on by more than this at once [s] was set, it has not passed."""


class MotionClock:
    """Maps steady time to the time in which trajectories, speeds and paths of a node are meant.

    With `use_sim_time` that passes as /clock does, so that a motion is as slow, or as fast, as what is simulated. It
    never goes back, whatever /clock does. Leases, watchdogs and what else keeps a robot safe stay on the steady clock.

    Attributes:
        stalled: Whether /clock stands still, so that motions have to hold.
        rate: How much faster than steady time it passes without `use_sim_time`.
    """

    def __init__(self, node: Any) -> None:
        """`node`: whose clock it is."""
        self._clock = node.get_clock()
        self._time = self._steady = time.monotonic()
        self._told: int | None = None
        self._moved_at = self._steady
        self.stalled, self.rate = False, 1.0

    def at(self, now: float) -> float:
        """Return the time of motions [s] at the steady time `now` [s], which is the present."""
        passed, self._steady = max(0.0, now - self._steady), max(now, self._steady)
        if not self._clock.ros_time_is_active:
            self._told, self.stalled = None, False
            self._time += self.rate * passed
            return self._time
        told = self._clock.now().nanoseconds
        step = 0.0 if self._told is None else 1e-9 * (told - self._told)
        if told != self._told:
            self._told, self._moved_at = told, now
        self.stalled = now - self._moved_at > STALL
        if self.stalled:
            self._time += passed
        elif 0.0 < step <= JUMP:
            self._time += step
        return self._time
