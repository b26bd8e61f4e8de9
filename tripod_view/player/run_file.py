"""Reads the recording of a run, `.npz`, that `tripod run --out` has written: of what moves only what is shown. Pure."""

import math
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from tripod_host.reading import open_file
from tripod_view.player.film import FilmError
from tripod_view.player.of_run import MOVING

MOST_BYTES = 5_000_000_000
"""Of a recording."""

MOST_STILL = 500_000_000
"""Bytes of all arrays that are read as a whole: a small file may hold large ones, compressed."""

MOST_ROW = 240_000_000
"""Bytes of one step of an array."""

HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
"""Readers of the headers of arrays, by their version."""

BROKEN = (
    zipfile.BadZipFile,
    ValueError,
    EOFError,
    KeyError,
    NotImplementedError,
    RuntimeError,
    OverflowError,
)
"""What a damaged archive raises."""


class Rows:
    """An array of a recording, a row for each step, of which those asked for are read from the file.

    Attributes:
        shape: Of the whole array.
        dtype: Of its numbers.
    """

    def __init__(self, path: Path, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
        """`name`: of the array in the file at `path`."""
        self._path, self._name, self.shape, self.dtype = path, name, shape, dtype

    def __len__(self) -> int:
        """Return the number of steps."""
        return self.shape[0]

    def __getitem__(self, steps: Any) -> np.ndarray:
        """Return rows by their numbers, ascending. Raises FilmError where the file has fewer than it says."""
        row = math.prod(self.shape[1:]) * self.dtype.itemsize
        found = np.empty((len(steps), *self.shape[1:]), self.dtype)
        with _archive(self._path) as archive, _member(archive, self._name) as (file, *_):
            first = file.tell()
            for k, step in enumerate(np.asarray(steps).tolist()):
                file.seek(first + step * row)
                data = file.read(row)
                if len(data) < row:
                    raise EOFError(f"{self._name} has no step {step}")
                found[k] = np.frombuffer(data, self.dtype).reshape(self.shape[1:])
        return found


def read_run(path: Path) -> dict[str, Any]:
    """Return the arrays of a recording by name; those with a row for each step as `Rows`, but the times.

    Raises:
        FilmError: it is not such a file, or would take more memory than a recording does.
        OSError: it cannot be read.
    """
    if path.suffix.lower() != ".npz":
        raise FilmError(
            f"{str(path)!r} does not end in .npz; write such a file with `tripod run SCENE --out run.npz`"
        )
    found, still = dict[str, Any](), 0
    with _archive(path) as archive:
        for member in archive.namelist():
            name = member.removesuffix(".npy")
            with _member(archive, name) as (file, shape, in_columns, dtype):
                size = math.prod(shape) * dtype.itemsize
                if name in MOVING and shape and not in_columns:
                    if size > MOST_ROW * max(1, shape[0]):
                        raise FilmError(
                            f"{name} has {size / shape[0]:.2g} bytes for each step; allowed: at most {MOST_ROW:.2g}"
                        )
                    found[name] = Rows(path, name, shape, dtype)
                    continue
                still += size
                if still > MOST_STILL:
                    raise FilmError(
                        f"{str(path)!r} would take {still:.2g} bytes of memory, {size:.2g} of them for {name}; "
                        f"allowed: at most {MOST_STILL:.2g}, not counting what has a row for each step"
                    )
            with archive.open(f"{name}.npy") as file:
                found[name] = npy.read_array(file, allow_pickle=False)
    return found


@contextmanager
def _archive(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open the archive at `path`. Raises OSError; FilmError where it is damaged, also while it is read."""
    with open_file(path, MOST_BYTES) as file:
        try:
            with zipfile.ZipFile(file) as archive:
                yield archive
        except FilmError:
            raise
        except BROKEN as error:
            raise FilmError(
                f"{str(path)!r} is not a recording of a run: {error}; write one with `tripod run SCENE --out "
                "run.npz`"
            ) from None


@contextmanager
def _member(
    archive: zipfile.ZipFile, name: str
) -> Iterator[tuple[IO[bytes], tuple[int, ...], bool, "np.dtype[Any]"]]:
    """Open an array; yield the file where its numbers begin, its shape, whether columns come first, its kind."""
    with archive.open(f"{name}.npy") as file:
        version = npy.read_magic(file)
        if version not in HEADERS:
            raise ValueError(f"the array {name} has the unknown format version {version}")
        shape, in_columns, dtype = HEADERS[version](file)
        if dtype.hasobject or any(n < 0 for n in shape):
            raise ValueError(f"{name}: object arrays hold neither numbers nor text")
        yield file, shape, in_columns, dtype
