"""What was lost of a topic between its publisher and the recorder. Pure."""

from dataclasses import dataclass


@dataclass
class Losses:
    """Counts the messages of one topic.

    The middleware counts as lost also what a publisher had kept for those who come late, and threw away before it was
    here. Of a recording that is no loss: where the numbers of what came follow each other, nothing is missing.

    Attributes:
        told: Messages that the middleware says it has lost.
    """

    told: int = 0
    _first: int = 0
    _last: int = 0
    _count: int = 0

    def take(self, sequence: int) -> None:
        """Count a message that came; `sequence`: the publisher's number of it, 0 if it has none."""
        if not self._count:
            self._first = sequence
        self._last, self._count = sequence, self._count + 1

    @property
    def lost(self) -> int:
        """How many are missing since the first that came."""
        whole = self._count and self._last - self._first + 1 == self._count
        return 0 if whole else self.told
