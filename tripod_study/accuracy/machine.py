"""How fast this machine is, in less than half a second: the product that studies time beside their points."""

import os
import subprocess
import sys

from tripod_host.program import SINGLE

SLOWEST = 20.0
"""Time after which a machine is taken to be too busy to be measured [s]."""


def product_time() -> float | None:
    """Return the CPU time of a 1000 x 1000 float64 product on one thread of this machine [s].

    A process of its own does it: here NumPy may have more threads. None where it cannot be measured.
    """
    code = "from tripod_study.calibration import calibration; print(calibration())"
    environment = {**os.environ, **dict.fromkeys(SINGLE, "1")}
    try:
        done = subprocess.run(
            [sys.executable, "-c", code],
            check=True,
            capture_output=True,
            text=True,
            timeout=SLOWEST,
            env=environment,
            start_new_session=True,  # Ctrl-C is for who asked: what is measured here ends by itself
        )
        return float(done.stdout)
    except (OSError, subprocess.SubprocessError, ValueError):
        return None
