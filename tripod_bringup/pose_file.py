"""Poses measured on a robot, as CSV that `tripod identify` reads: a row is on the disk as soon as it is measured."""

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.reading import read_file
from tripod_host.writing import check_place, replaced_text
from tripod_identify.errors import DataError

LARGEST_FILE = 1_000_000
"""Bytes of a file that is gone on with."""

SAME = 1e-5
"""Poses that differ by less are one [rad]: files round."""


class PoseFile:
    """The file of one tour. What it holds already is kept, and need not be measured again.

    Attributes:
        done: Numbers of the poses that it holds.
    """

    def __init__(self, path: Path, poses: FloatArray, columns: Sequence[str], made: str) -> None:
        """`poses` [rad], shape (k, s); `columns` of what is measured; `made`: with which calibration and slide.

        Raises DataError: there is a file of something else. Raises OSError: it cannot be written.
        """
        self.path, self._poses = path, poses
        names = [f"servo_{i}_rad" for i in range(poses.shape[1])]
        self._head = [f"# {made}", ",".join([*names, *columns])]
        self._lines: list[str] = []
        self.done: set[int] = set()
        check_place(path)
        if os.path.lexists(path):
            self._read()

    def keep(self, number: int, values: Sequence[float]) -> None:
        """Write a pose; NaN is an empty cell. Raises OSError."""
        cells = [f"{angle:.6f}" for angle in self._poses[number]]
        cells += [f"{value:.4f}" if math.isfinite(value) else "" for value in values]
        self._lines.append(",".join(cells))
        with replaced_text(self.path) as file:
            file.write("\n".join([*self._head, *self._lines]) + "\n")
        self.done.add(number)

    def _read(self) -> None:
        try:
            lines = read_file(self.path, LARGEST_FILE).decode("utf-8").splitlines()
        except UnicodeDecodeError:
            raise DataError(f"{self.path} is not UTF-8 text; give --data another name") from None
        if lines[:2] != self._head:
            raise DataError(
                f"{self.path} was measured with other poses, sensor, calibration, slide or scene "
                f"({self._head[0][2:]}); give --data another name"
            )
        for line in lines[2:]:
            try:
                angles = [float(cell) for cell in line.split(",")[: self._poses.shape[1]]]
                found = np.flatnonzero((np.abs(self._poses - angles) < SAME).all(axis=1))
            except ValueError:
                found = np.zeros(0, dtype=np.int64)
            if len(found) != 1 or int(found[0]) in self.done:
                raise DataError(
                    f"{self.path}: {line[:60]!r} is not one of these poses; give --data another name"
                )
            self.done.add(int(found[0]))
            self._lines.append(line)
