"""What was lost of a topic between its publishers and the recorder. Pure."""

from dataclasses import dataclass, field

MOST = 64
"""Ends of series that are kept: far more than a topic has publishers."""


@dataclass
class Losses:
    """Counts the messages of one topic.

    The middleware counts as lost also what a publisher had kept for those who come late, and threw away before it was
    here. Of a recording that is no loss: each publisher numbers its messages, so where what came is one series without
    a gap for each publisher, nothing is missing. The middleware does not tell of which publisher a message is.

    Attributes:
        told: Messages that the middleware says it has lost.
        reliable: Whether the publisher sends again what did not arrive, as long as it has it.
        publishers: All that were seen so far.
    """

    told: int = 0
    reliable: bool = True
    publishers: set[bytes] = field(default_factory=set)
    _ends: dict[int, int] = field(default_factory=dict)
    _series: int = 0

    def take(self, sequence: int) -> None:
        """Count a message that came; `sequence`: the publisher's number of it, 0 if it has none."""
        before = self._ends.pop(sequence - 1, 0) if sequence else 0
        if before > 1:
            self._ends[sequence - 1] = before - 1
        if not before:
            self._series += 1
        self._ends[sequence] = self._ends.get(sequence, 0) + 1
        if len(self._ends) > MOST:
            del self._ends[next(iter(self._ends))]

    @property
    def lost(self) -> int:
        """How many are missing since the first that came."""
        whole = 0 < self._series <= max(1, len(self.publishers))
        return 0 if whole else self.told

    @property
    def reason(self) -> str:
        """Why messages of this topic get lost, in words."""
        if self.reliable:
            return "the recorder was too slow for what publisher and middleware keep"
        return "best effort: nobody sends again what the recorder was too slow for"
