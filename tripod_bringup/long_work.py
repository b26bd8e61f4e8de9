"""What a command that takes long says: at once that it works, and at Ctrl-C what it has kept."""

import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tripod_host.stop import first

ERASE = "\r\x1b[2K"
"""Empties the line of a terminal."""


@contextmanager
def loading(command: str, work: str = "loading", *, shown: bool = True) -> Iterator[None]:
    """Show in a terminal what `command` does, as long as the block runs, which prints nothing itself."""
    if not (shown and sys.stderr.isatty()):
        yield
        return
    print(f"{command}: {work} ...", end="", file=sys.stderr, flush=True)
    try:
        with interruptible(command):
            yield
    finally:
        print(ERASE, end="", file=sys.stderr, flush=True)


@contextmanager
def interruptible(command: str, *files: Path | None) -> Iterator[None]:
    """Say, where a signal such as Ctrl-C ends the block, which of `files` the command has written."""
    start = time.time()

    def tell() -> None:
        line = f"{ERASE if sys.stderr.isatty() else ''}{command}: {kept_words(files, start)}\n"
        os.write(2, line.encode(errors="backslashreplace"))  # print may be at work just now

    with first(tell):
        yield


def kept_words(files: Sequence[Path | None], start: float) -> str:
    """Return what is kept of `files`: of those written since `start` [s], a time of the system's clock."""
    kept = [file for file in files if file and file.exists() and file.stat().st_mtime >= start - 0.01]
    return f"stopped; kept: {', '.join(map(str, kept))}" if kept else "stopped; nothing was written"
