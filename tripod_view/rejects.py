"""What came from outside and was refused: how often, and why last."""

from collections import Counter


class Rejects:
    """Counts refusals by where they came from.

    Attributes:
        last: The newest refusal, one line, empty if none.
    """

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self.last = ""

    @property
    def total(self) -> int:
        """Refusals since start."""
        return self._counts.total()

    def note(self, where: str, reason: object) -> str:
        """Count a refusal and return the line about it."""
        self._counts[where] += 1
        self.last = f"{where}: {reason}"
        return self.last
