"""Whether something is done as often as it should be. Pure: the caller gives the time."""

ENOUGH = 0.95
"""Share of the declared rate from which on it counts as reached."""

SHORTEST = 0.5
"""Time over which turns are counted at least [s]: over less they tell nothing."""


class Turns:
    """Counts turns from one question to the next."""

    def __init__(self) -> None:
        self._count, self._since = 0, float("-inf")
        self._rate: float | None = None

    def add(self) -> None:
        """Note a turn."""
        self._count += 1

    def rate(self, now: float) -> float | None:
        """Return the turns a second since the last question, asked at `now` [s]; None before there was one."""
        passed = now - self._since
        if passed >= SHORTEST:
            self._rate = self._count / passed if passed < float("inf") else None
            self._count, self._since = 0, now
        return self._rate


def short(what: str, rate: float | None, declared: float) -> str:
    """Return that `what` is done less often than declared [Hz], for people; empty if it is not, or nobody knows.

    >>> short("sim/joint_states", 75.2, 100.0)
    'sim/joint_states 75 of 100 Hz'
    """
    return "" if rate is None or rate >= ENOUGH * declared else f"{what} {rate:.0f} of {declared:.0f} Hz"
