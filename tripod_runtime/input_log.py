"""Log of the inputs of each step: enough to simulate the same steps again, bit for bit."""

import threading
from collections.abc import Mapping

import numpy as np

from tripod_host.arrays import FloatArray

HEAD = 4
"""Columns of a run before its joints."""

APPLIED = 7
"""Columns of a run of an applied force: epoch, first and last step, node, three components [N]."""


class InputLog:
    """Runs of steps with the same joints, noted by the physics and taken by whoever publishes them.

    A run is a row: epoch (how often the simulation was reset), first and last step since the reset, stamp of the last
    [ns], then the joints of these steps: angles [rad] and slide [m]; none in a scene without servos. Forces that
    somebody applies to nodes have runs of their own.

    Attributes:
        epoch: How often the simulation was reset.
    """

    def __init__(self) -> None:
        self.epoch = 0
        self._rows: list[list[float]] = []
        self._bits = b""  # of the joints of the last row: -0.0 is not 0.0
        self._forces: list[list[float]] = []
        self._open: dict[
            int, tuple[bytes, list[float]]
        ] = {}  # the newest run of each node, with the bits of its force
        self._lock = threading.Lock()

    def add(
        self, step: int, stamp: int, joints: FloatArray | None, forces: Mapping[int, FloatArray] | None = None
    ) -> None:
        """Note that `step` was made with `joints`, shape (s + 1,), and ended at `stamp` [ns].

        `forces`: what was applied to nodes [N], shape (3,), by their numbers.
        """
        bits = b"" if joints is None else joints.tobytes()
        with self._lock:
            if forces or self._open:
                self._add_forces(step, forces or {})
            if self._rows and bits == self._bits and self._rows[-1][2] == step - 1:
                self._rows[-1][2:HEAD] = step, stamp
                return
            self._bits = bits
            values = [] if joints is None else joints.tolist()
            self._rows.append([self.epoch, step, step, stamp, *values])

    def _add_forces(self, step: int, forces: Mapping[int, FloatArray]) -> None:
        last, self._open = self._open, {}
        for node, force in forces.items():
            bits = force.tobytes()
            before, run = last.get(node, (b"", []))
            if bits == before and run[2] == step - 1:
                run[2] = step
            else:
                run = [self.epoch, step, step, node, *force.tolist()]
                self._forces.append(run)
            self._open[node] = bits, run

    def reset(self) -> None:
        """Note that the simulation is back in its start state."""
        with self._lock:
            self.epoch, self._bits, self._open = self.epoch + 1, b"", {}

    def cut(self) -> None:
        """Begin a new run with the next step."""
        with self._lock:
            self._bits, self._open = b"cut", {}

    def take(self) -> tuple[FloatArray, FloatArray]:
        """Return the runs since the last call, shape (n, 4 + joints), and those of forces, (m, 7); forget them."""
        with self._lock:
            rows, self._rows = self._rows, []
            forces, self._forces, self._open = self._forces, [], {}
        runs = np.array(rows, dtype=np.float64).reshape(len(rows), -1 if rows else HEAD)
        return runs, np.array(forces, dtype=np.float64).reshape(-1, APPLIED)
