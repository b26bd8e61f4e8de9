"""Going to poses one after the other, slowly, and standing there: without port, clock or sensor. The time is given."""

from collections.abc import Sequence
from enum import Enum
from typing import Final

import numpy as np

from tripod_host.arrays import FloatArray

SPEED: Final = 0.5
"""Speed of the servos on the way [rad/s]: the piece follows without swinging, and a hand reaches the switch."""

SETTLE: Final = 1.5
"""Time after the servos have arrived until the piece is at rest [s]."""

LONGEST_TICK: Final = 0.05
"""The way of one tick is never longer than that of this time [s]: a late tick makes no jump."""


class Phase(Enum):
    """What it is doing."""

    GOING = "going"
    SETTLING = "coming to rest"
    STANDING = "standing"
    PARKING = "parking"
    PARKED = "parked"


class PosePlayer:
    """Where the servos should be on a tour of poses.

    Attributes:
        phase: What it is doing.
        number: Of the pose that it goes to or stands in.
        angles: Set-point [rad], shape (s,).
        held: Whether it keeps its place until `go_on`.
    """

    def __init__(self, poses: FloatArray, start: Sequence[float], park: Sequence[float]) -> None:
        """`poses` [rad], shape (k, s); `start`: where to begin, `park`: where to end [rad], shape (s,)."""
        self._poses, self._park = np.asarray(poses, float), np.asarray(park, float)
        self.angles = np.array(start, float)
        self.number = 0
        self.held = False
        self.phase = Phase.GOING if len(poses) else Phase.PARKING
        self._last = self._since = float("-inf")

    def advance(self, now: float, *, arrived: bool) -> FloatArray:
        """Return the set-point at `now` [s], shape (s,). `arrived`: the servos are where the last told them to be."""
        dt = 0.0 if self._last == float("-inf") else min(max(now - self._last, 0.0), LONGEST_TICK)
        self._last = now
        if self.held or self.phase is Phase.PARKED:
            self._since = now
            return self.angles
        goal = self._park if self.phase is Phase.PARKING else self._poses[self.number]
        there = arrived and bool(np.array_equal(self.angles, goal))
        self.angles = self.angles + np.clip(goal - self.angles, -SPEED * dt, SPEED * dt)
        if not there:
            self._since = now
        if there and self.phase is Phase.PARKING:
            self.phase = Phase.PARKED
        elif there and self.phase in (Phase.GOING, Phase.SETTLING):
            self.phase = Phase.STANDING if now - self._since >= SETTLE else Phase.SETTLING
        elif not there and self.phase in (Phase.SETTLING, Phase.STANDING):
            self.phase = Phase.GOING  # something has moved the servos
        return self.angles

    def next(self) -> None:
        """Go to the next pose; behind the last, park."""
        self.number += 1
        self.phase = Phase.GOING if self.number < len(self._poses) else Phase.PARKING

    def park(self) -> None:
        """Leave the tour and park."""
        self.held = False
        if self.phase is not Phase.PARKED:
            self.phase = Phase.PARKING

    def hold(self) -> None:
        """Keep the place."""
        self.held = True

    def go_on(self) -> None:
        """Go on after `hold`."""
        self.held = False
