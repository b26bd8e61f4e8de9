"""What the page knows of the recorder, from its answers and from its diagnostics. Pure."""

from dataclasses import dataclass

from tripod_graph.diagnostic_keys import Recording


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

    def answer(self, text: str, *, begin: bool, success: bool) -> None:
        """Take its answer to a request to begin, or to end, and whether it did."""
        self.records, self.text = begin and (success or self.records), text

    def hear(self, text: str, state: str, path: str) -> None:
        """Take its diagnostics: its text, one of the words of `Recording`, the path of the recording or nothing."""
        self.records = state == Recording.ON
        if path and state != Recording.OFF:
            self.text = f"{text}: {path}"
