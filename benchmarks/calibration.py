"""What the other benchmarks share: one thread for the numerics, and a product that tells how fast the machine is.

Import it before NumPy.
"""

import os
import time

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

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
