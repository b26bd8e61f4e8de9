"""When a machine is too slow for a setting, and when it has room for a dearer one. Pure; the caller has the clock.

A look tells, since the look before, the real-time factor f, and the CPU time c of the thread of the steps for a
simulated second. Where f < `LAG`, the thread takes all it gets: the share c f of a core. Of rung k, whose cost over
that of the present one is r_k, it needs c r_k. So it goes down to the most exact k with c r_k <= `FITS` c f.

Up again goes what needs at most `FULL` of a core, and no more in addition than the other processes leave idle. The
thread cannot know that by itself: while it sleeps between short steps, it goes first when it wakes.

The r_k are the study's until a rung was left for another: then the costs just before and after tell it of this machine.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

LAG = 0.95
"""Real-time factor below which the machine is too slow."""

DOWN = 3.0
"""How long it has to be too slow [s]."""

UP = 10.0
"""How long there has to be room [s], the first time."""

LONGEST = 160.0
"""The same at most: it doubles each time that going up was wrong [s]."""

WRONG = 60.0
"""Going up was wrong where the machine is too slow again within this time [s]."""

FITS = 0.8
"""What a rung may need of the share that is there, when going down."""

FULL = 0.85
"""What a rung may need of one core, when going up."""

SPARE = 0.1
"""What is left idle beside that [cores]."""


@dataclass(frozen=True)
class Look:
    """What is seen of the steps since the look before.

    Attributes:
        now: Steady time [s].
        factor: Simulated time over wall time.
        cost: CPU time of the thread of the steps over simulated time.
        idle: Cores that nobody used; None where that is not known.
    """

    now: float
    factor: float
    cost: float
    idle: float | None = None


class Pace:
    """Chooses rungs of a ladder: 0 is what was asked for, each next one is cheaper and less exact.

    Attributes:
        at: The present rung.
        slow: Whether the machine has been too slow for `DOWN`.
        wait: How long there has to be room before it goes up [s].
    """

    def __init__(self) -> None:
        self._costs = [1.0]
        self.at, self.slow, self.wait = 0, False, UP
        self._useless = set[int]()
        self._slow_since: float | None = None
        self._room_since: float | None = None
        self._recent: deque[float] = deque(maxlen=3)  # costs
        self._left: tuple[int, float] | None = None  # rung and cost before the last change
        self._rose = -math.inf

    def learn(self, costs: Sequence[float]) -> None:
        """Take the costs of all rungs, in any common unit."""
        self._costs = list(costs)

    def drop(self, rung: int) -> None:
        """Never choose a rung again: it did not work."""
        self._useless.add(rung)
        self.rest()

    def put_off(self) -> None:
        """Take note that the rung chosen last did not work just now."""
        self.wait = min(2 * self.wait, LONGEST)
        self.rest()

    def rest(self) -> None:
        """Begin to look anew: something else than the steps took the time, or they were paused."""
        self._slow_since = self._room_since = None
        self.slow = False
        self._recent.clear()

    def moved(self, rung: int, now: float) -> None:
        """Take note that `rung` is the present one since `now` [s]."""
        if rung < self.at:
            self._rose = now
        elif now - self._rose < WRONG:
            self.wait = min(2 * self.wait, LONGEST)
        else:
            self.wait = UP
        self._left = (self.at, self._cost) if self._recent else None
        self.at = rung
        self.rest()

    def look(self, seen: Look) -> int | None:
        """Return the rung to go to, None to stay."""
        self._recent.append(seen.cost)
        if self._left and len(self._recent) == self._recent.maxlen:
            rung, cost = self._left
            self._costs[rung], self._left = self._costs[self.at] * cost / self._cost, None
        if seen.factor < LAG:
            self._room_since = None
            return self._down(seen)
        self._slow_since, self.slow = None, False
        return self._up(seen)

    def _down(self, seen: Look) -> int | None:
        self._slow_since = seen.now if self._slow_since is None else self._slow_since
        self.slow = seen.now - self._slow_since >= DOWN
        cheaper = self._usable(self.at + 1, len(self._costs))
        if not self.slow or not cheaper:
            return None
        share = FITS * self._cost * seen.factor
        return next((k for k in cheaper if self._needs(k) <= share), cheaper[-1])

    def _up(self, seen: Look) -> int | None:
        better = next((k for k in self._usable(0, self.at) if self._has_room(k, seen)), None)
        if better is None:
            self._room_since = None
            return None
        self._room_since = seen.now if self._room_since is None else self._room_since
        return better if seen.now - self._room_since >= self.wait else None

    def _usable(self, first: int, end: int) -> list[int]:
        return [k for k in range(first, end) if k not in self._useless]

    def _has_room(self, rung: int, seen: Look) -> bool:
        needs = self._needs(rung)
        return needs <= FULL and (seen.idle is None or needs - self._cost <= seen.idle - SPARE)

    def _needs(self, rung: int) -> float:
        """Return the CPU time for a simulated second that a rung is expected to take."""
        return self._cost * self._costs[rung] / self._costs[self.at]

    @property
    def _cost(self) -> float:
        return sum(self._recent) / len(self._recent)
