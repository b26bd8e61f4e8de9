"""The place in a recording that is played: it runs, pauses, steps. Pure; the caller gives the time."""


class Transport:
    """Maps steady time to time since the beginning of a recording.

    Attributes:
        rate: Recorded time over steady time.
        paused: Whether the place stands still.
    """

    def __init__(self, start: float, rate: float, now: float) -> None:
        """Begin at `start` [s] in the recording, at the steady time `now` [s]."""
        self.rate, self.paused = rate, False
        self._place, self._since = start, now

    def place(self, now: float) -> float:
        """Return the place at the steady time `now` [s]."""
        return self._place if self.paused else self._place + self.rate * (now - self._since)

    def toggle(self, now: float) -> None:
        """Pause, or go on."""
        self._place, self._since, self.paused = self.place(now), now, not self.paused

    def move(self, place: float, now: float) -> None:
        """Go to `place` [s]."""
        self._place, self._since = place, now
