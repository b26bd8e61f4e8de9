"""What the page knows of the recorder, from its answers and from its diagnostics. Pure."""

from dataclasses import dataclass

ENDED = ("recording ended", "not recording")
"""What diagnostics begin with while nothing is recorded."""


@dataclass
class Recorder:
    """The recorder of the same robot.

    Attributes:
        there: Whether one runs.
        records: Whether it records.
        text: What it said last.
    """

    there: bool = False
    records: bool = False
    text: str = ""

    def answer(self, text: str) -> None:
        """Take its answer to being asked to begin or to end."""
        self.records, self.text = text.startswith("recording"), text

    def hear(self, text: str, path: str) -> None:
        """Take its diagnostics; `path`: of the recording, empty if there is none."""
        self.records = bool(path) and not text.startswith(ENDED)
        if path and not text.startswith("not recording"):
            self.text = f"{text}: {path}"
