"""What the model said a while ago: a measurement is old when it comes, and is held against that. Pure."""

from collections import deque
from typing import Generic, TypeVar

from tripod_ik.errors import IkError

HISTORY = 1.0
"""How long it is remembered [s]: delays are shorter."""

Said = TypeVar("Said")


class History(Generic[Said]):
    """What was said, by time, for the last `HISTORY`."""

    def __init__(self) -> None:
        self._said: deque[tuple[float, Said]] = deque()

    def add(self, said: Said, now: float) -> None:
        """Remember what is said at `now` [s]; times do not fall."""
        self._said.append((now, said))
        while now - self._said[0][0] > HISTORY:
            self._said.popleft()

    def at(self, time: float) -> Said | None:
        """Return what was said at `time` [s], the newest that is not younger; None if it is too long ago."""
        return next((said for when, said in reversed(self._said) if when <= time + 1e-9), None)


def check_delay(delay: float, of: str) -> None:
    """Raise IkError for a delay [s] that is longer than is remembered; `of` names it."""
    if not 0 <= delay <= HISTORY / 2:
        raise IkError(f"{of} is {delay} s; allowed: 0 to {HISTORY / 2} s")
