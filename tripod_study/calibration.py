"""How fast this machine is: a product of matrices that every study times beside its points."""

import time
from functools import cache

import numpy as np

SIZE = 1000
"""Rows of the matrices."""


LATELY = 10.0
"""A time that was taken so long ago still counts [s]."""

_last = {"when": -float("inf"), "taken": 0.0}


def lately() -> float:
    """Return `calibration`, or what it was less than `LATELY` ago: short points are many."""
    if time.monotonic() - _last["when"] > LATELY:
        _last["taken"] = calibration()
        _last["when"] = time.monotonic()
    return _last["taken"]


@cache
def _matrices() -> np.ndarray:
    return np.random.default_rng(0).standard_normal((2, SIZE, SIZE))


def calibration(repeats: int = 3) -> float:
    """Return the CPU time of a 1000 x 1000 float64 product [s], the least of `repeats`.

    The CPU time of this thread: it is a machine's speed only where the linear algebra has one thread
    (OPENBLAS_NUM_THREADS=1 before NumPy is imported).
    """
    a, b = _matrices()
    taken = []
    for _ in range(repeats):
        start = time.thread_time()
        a @ b
        taken.append(time.thread_time() - start)
    return min(taken)
