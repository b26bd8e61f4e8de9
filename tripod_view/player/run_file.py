"""Reads the recording of a run, `.npz`, that `tripod run --out` has written. Pure."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from tripod_host.reading import open_file
from tripod_view.player.film import FilmError

MOST_BYTES = 5_000_000_000
"""Of a recording."""


def read_run(path: Path) -> dict[str, Any]:
    """Return the arrays of a recording by name.

    Raises:
        FilmError: it is not such a file.
        OSError: it cannot be read.
    """
    if path.suffix.lower() != ".npz":
        raise FilmError(f"{str(path)!r} does not end in .npz; `tripod run --out run.npz` writes such a file")
    with open_file(path, MOST_BYTES) as file:
        try:
            with zipfile.ZipFile(file) as members:
                size = sum(member.file_size for member in members.infolist())
            if size > MOST_BYTES:
                raise FilmError(
                    f"{str(path)!r} would take {size:.2g} bytes of memory; at most {MOST_BYTES:.2g}"
                )
            file.seek(0)
            with np.load(file, allow_pickle=False) as arrays:
                return dict(arrays)
        except (zipfile.BadZipFile, ValueError, EOFError, KeyError) as error:
            raise FilmError(f"{str(path)!r} is no recording of a run: {error}") from None
