"""Where `tripod up` writes: log lines, and one status line that is redrawn in a terminal."""

import os
import shutil
import sys
import time
from collections.abc import Callable, Mapping
from typing import TextIO

from rich.cells import set_cell_size

REDRAW = 0.2
"""Between two drawings of the status line [s]."""

PLAIN_PERIOD = 5.0
"""Between two status lines where there is no terminal [s]."""


def is_terminal(stream: TextIO, environment: Mapping[str, str]) -> bool:
    """Return whether `stream` is a terminal in which a line can be redrawn."""
    return stream.isatty() and environment.get("TERM", "") not in ("", "dumb")


class Screen:
    """Writes lines and a status to a stream, and nothing more once the stream is broken (a closed pipe).

    Attributes:
        terminal: Whether the status line is redrawn in place.
    """

    def __init__(self, stream: TextIO | None = None, *, terminal: bool | None = None) -> None:
        """`stream`: None means standard output; `terminal`: None means look."""
        self._stream = sys.stdout if stream is None else stream
        self.terminal = is_terminal(self._stream, os.environ) if terminal is None else terminal
        self._drawn = ""
        self._next = float("-inf")
        self._broken = False

    def line(self, text: str) -> None:
        """Write a line above the status line."""
        self._write(f"{self._erase()}{text}\n{self._drawn}")

    def status(self, tell: str | Callable[[], str]) -> None:
        """Show a status, or what tells it: often in place in a terminal, every few seconds as a line elsewhere."""
        now = time.monotonic()
        if now < self._next:
            return
        text = tell if isinstance(tell, str) else tell()
        self._next = now + (REDRAW if self.terminal else PLAIN_PERIOD)
        if self.terminal:
            width = shutil.get_terminal_size().columns - 1
            fitted = set_cell_size(text, width).rstrip()
            self._write(f"{self._erase()}{fitted}")
            self._drawn = fitted
        else:
            self._write(f"{text}\n")

    def close(self) -> None:
        """Leave the terminal on a fresh line; the last status is erased."""
        self._write(self._erase())
        self._drawn = ""

    def _erase(self) -> str:
        return "\r\x1b[2K" if self._drawn else ""

    def _write(self, text: str) -> None:
        if self._broken or not text:
            return
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):  # ValueError: the stream was closed
            self._broken = True
