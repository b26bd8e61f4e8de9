"""Waiting for what other processes do, however busy the machine."""

import time
from collections.abc import Callable
from pathlib import Path

DEADLINE = 120.0
"""For a loaded machine [s]; nothing waits so long unless it fails."""


def alive(pid: int) -> bool:
    """Return whether a process still runs; one that has ended and was not waited for does not."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] not in "ZX"


def wait_until(condition: Callable[[], object]) -> bool:
    """Wait until `condition` holds; return whether it did within `DEADLINE`."""
    end = time.monotonic() + DEADLINE
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True
