"""Time-outs that count on a busy machine: what a process did and what it idled away, not what it had to wait for."""

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

LONGEST = 0.5
"""Most that one look at a process counts [s]: whoever looks may have waited for a processor, too."""


def look(pid: int) -> tuple[float, bool]:
    """Return the processor time that a process has had [s], and whether it would do more at this moment.

    It would if one of its threads runs, or waits for a processor or a disk; the thread that asks does not count. Where
    the system does not tell: no time, and no. A process that is gone does nothing any more.
    """
    used, active = 0.0, False
    with suppress(OSError):
        used = time.clock_gettime(_clock_of(pid))
        for stat in Path(f"/proc/{pid}/task").glob("*/stat"):
            with suppress(OSError):
                state = stat.read_text().rpartition(")")[2].split()[0]
                active |= state in "RD" and int(stat.parent.name) != threading.get_native_id()
    return used, active


def _clock_of(pid: int) -> int:
    """Return the clock of a process's processor time, as clock_getcpuclockid(3) names it on Linux; exact to 1 ns."""
    return (~pid << 3) | 2


class Effort:
    """A process since it was first looked at.

    Time in which it was ready to run and others ran instead is neither busy nor idle.

    Attributes:
        busy: Processor time that it had [s].
        idle: Time in which it wanted none [s].
        still: Time for which it has now neither had any nor wanted any [s].
    """

    def __init__(
        self,
        pid: int,
        *,
        look: Callable[[int], tuple[float, bool]] = look,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._pid, self._look, self._clock = pid, look, clock
        self.busy = self.idle = self.still = 0.0
        self._at, self._used = clock(), look(pid)[0]

    def again(self) -> "Effort":
        """Look again, several times a second, and return itself."""
        now = self._clock()
        used, active = self._look(self._pid)
        had, passed = max(0.0, used - self._used), min(now - self._at, LONGEST)
        if not active:
            self.idle += max(0.0, passed - had)
        self.still = 0.0 if active or had else self.still + passed
        self.busy += had
        self._at, self._used = now, used
        return self
