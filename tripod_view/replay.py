"""The last half minute of pictures, and going through it again. Pure."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_view.pose import Pose

SPAN = 30.0
"""What is kept [s]."""

MOST_BYTES = 100_000_000
"""Of all node positions that are kept; large bodies are kept for less long."""


@dataclass(frozen=True, eq=False)
class Moment:
    """What was drawn at a time [s]: node positions [m], joints, poses, slack cables; None for what was not known."""

    time: float
    nodes: NDArray[np.float32]
    joints: FloatArray | None
    effector: Pose | None
    ball: Pose | None
    slack: frozenset[str] = frozenset()


class Replay:
    """Keeps moments of the last `SPAN` seconds, and says which of them is shown, if any.

    Attributes:
        running: Whether the past goes on as fast as it went.
    """

    def __init__(self) -> None:
        self._moments: deque[Moment] = deque()
        self._bytes = 0
        self._shown: float | None = None
        self._since = 0.0
        self.running = False

    @property
    def active(self) -> bool:
        """Whether the past is shown."""
        return self._shown is not None

    def keep(self, moment: Moment) -> None:
        """Keep one more, unless the past is shown: nothing is forgotten while somebody looks at it."""
        if self.active:
            return
        if self._moments and len(self._moments[-1].nodes) != len(moment.nodes):
            self.clear()
        self._moments.append(moment)
        self._bytes += moment.nodes.nbytes
        while moment.time - self._moments[0].time > SPAN or self._bytes > MOST_BYTES:
            self._bytes -= self._moments.popleft().nodes.nbytes

    def clear(self) -> None:
        """Forget everything: another body is drawn."""
        self._moments.clear()
        self._bytes = 0
        self._shown, self.running = None, False

    def length(self) -> float:
        """Return for how long there are moments [s]."""
        return self._moments[-1].time - self._moments[0].time if self._moments else 0.0

    def show(self, age: float | None, running: bool, now: float) -> None:
        """Show what was `age` [s] before the newest moment, and go on from there if `running`; None: the present."""
        if age is None or not self._moments:
            self._shown, self.running = None, False
            return
        self._shown = min(max(age, 0.0), self.length())
        self._since, self.running = now, running

    def moment(self, now: float) -> tuple[Moment, float] | None:
        """Return what is shown at `now` [s], and its age [s]; None: the present, also when the past has caught up."""
        if self._shown is None:
            return None
        age = self._shown - (now - self._since if self.running else 0.0)
        if age < 0:
            self._shown, self.running = None, False
            return None
        time = self._moments[-1].time - age
        return min(self._moments, key=lambda m: abs(m.time - time)), age
