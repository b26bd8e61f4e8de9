"""Log of the inputs of each step: enough to simulate the same steps again, bit for bit."""

import threading

import numpy as np

from tripod_host.arrays import FloatArray

HEAD = 4
"""Columns of a run before its joints."""


class InputLog:
    """Runs of steps with the same joints, noted by the physics and taken by whoever publishes them.

    A run is a row: epoch (how often the simulation was reset), first and last step since the reset, stamp of the last
    [ns], then the joints of these steps: angles [rad] and slide [m]; none in a scene without servos.

    Attributes:
        epoch: How often the simulation was reset.
    """

    def __init__(self) -> None:
        self.epoch = 0
        self._rows: list[list[float]] = []
        self._bits = b""  # of the joints of the last row: -0.0 is not 0.0
        self._lock = threading.Lock()

    def add(self, step: int, stamp: int, joints: FloatArray | None) -> None:
        """Note that `step` was made with `joints`, shape (s + 1,), and ended at `stamp` [ns]."""
        bits = b"" if joints is None else joints.tobytes()
        with self._lock:
            if self._rows and bits == self._bits and self._rows[-1][2] == step - 1:
                self._rows[-1][2:HEAD] = step, stamp
                return
            self._bits = bits
            values = [] if joints is None else joints.tolist()
            self._rows.append([self.epoch, step, step, stamp, *values])

    def reset(self) -> None:
        """Note that the simulation is back in its start state."""
        with self._lock:
            self.epoch, self._bits = self.epoch + 1, b""

    def cut(self) -> None:
        """Begin a new run with the next step."""
        with self._lock:
            self._bits = b"cut"

    def take(self) -> FloatArray:
        """Return the runs since the last call, shape (n, 4 + joints), and forget them."""
        with self._lock:
            rows, self._rows = self._rows, []
        return np.array(rows, dtype=np.float64).reshape(len(rows), -1 if rows else HEAD)
