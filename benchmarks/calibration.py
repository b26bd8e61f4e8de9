"""What the other benchmarks share: one thread for the numerics, a product that tells how fast the machine is, and load.

Import it before NumPy, and before `tests`, which a script finds by it.
"""

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np  # noqa: E402 - after the number of threads is set


def calibration(repeats: int = 9) -> float:
    """Return the median CPU time of a 1000 x 1000 float64 matrix product on one thread [s]."""
    a, b = np.random.default_rng(0).standard_normal((2, 1000, 1000))
    taken = []
    for _ in range(repeats):
        start = time.thread_time()
        a @ b
        taken.append(time.thread_time() - start)
    return float(np.median(taken))


@contextlib.contextmanager
def busy(processors: int) -> Iterator[None]:
    """Keep processors busy until the block ends."""
    running = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(processors)]
    try:
        yield
    finally:
        for process in running:
            process.kill()
            process.wait()
