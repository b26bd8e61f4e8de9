"""How fast this machine is, in less than half a second: the product that studies time beside their points; and how
much of it nobody uses."""

import os
import subprocess
import sys
from pathlib import Path

from tripod_host.program import SINGLE
from tripod_host.reading import read_file

BOOKS = Path("/proc/stat")
"""Where Linux tells what its processors did since it started [ticks]."""

SLOWEST = 20.0
"""Time after which a machine is taken to be too busy to be measured [s]."""


def product_time() -> float | None:
    """Return the CPU time of a 1000 x 1000 float64 product on one thread of this machine [s].

    A process of its own does it: here NumPy may have more threads. None where it cannot be measured.
    """
    code = "from tripod_sim.study.calibration import calibration; print(calibration())"
    environment = {**os.environ, **dict.fromkeys(SINGLE, "1")}
    try:
        done = subprocess.run(
            [sys.executable, "-c", code],
            check=True,
            capture_output=True,
            text=True,
            timeout=SLOWEST,
            env=environment,
        )
        return float(done.stdout)
    except (OSError, subprocess.SubprocessError, ValueError):
        return None


class Idle:
    """How many cores nobody uses, by Linux's own books; who stands back (nice) counts as nobody for who does not."""

    def __init__(self, path: Path = BOOKS) -> None:
        self._path = path
        self._before = self._ticks()

    def cores(self, seconds: float) -> float | None:
        """Return it as a mean since the last call, `seconds` ago; None where there are no such books."""
        before, self._before = self._before, self._ticks()
        if before is None or self._before is None or seconds <= 0:
            return None
        return (self._before - before) / os.sysconf("SC_CLK_TCK") / seconds

    def _ticks(self) -> int | None:
        try:
            _, _, nice, _, idle, waits = read_file(self._path, 10**6).split()[:6]
            return int(idle) + int(waits) + (int(nice) if os.getpriority(os.PRIO_PROCESS, 0) <= 0 else 0)
        except (OSError, ValueError):
            return None
