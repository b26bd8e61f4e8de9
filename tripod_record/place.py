"""Where a recording goes: a directory that can be written, with room, and a name that is not taken."""

import os
import tempfile
from datetime import datetime
from pathlib import Path

from tripod_record.append_file import make_private_directory
from tripod_record.errors import RecordError

MEGABYTE = 10**6


def check_place(directory: Path, min_free: int) -> None:
    """Check that a file can be written in `directory` and that `min_free` [B] are left.

    If need be, the directory is made, for its owner only. Raises RecordError; the message names the directory and says
    what to do.
    """
    advice = "choose another directory, or make this one writable"
    try:
        _make(directory)
        with tempfile.TemporaryFile(dir=directory) as probe:
            probe.write(b"\0")
            probe.flush()
    except OSError as error:
        raise RecordError(f"cannot record into {directory}: {error.strerror or error}; {advice}") from None
    free = free_space(directory)
    if free < min_free:
        raise RecordError(
            f"cannot record into {directory}: {free / MEGABYTE:.1f} MB are free, "
            f"{min_free / MEGABYTE:.1f} MB are needed; delete something or choose another directory"
        )


def _make(directory: Path) -> None:
    try:
        make_private_directory(directory)
    except FileExistsError:
        if not directory.is_dir():
            raise


def free_space(directory: Path) -> int:
    """Return the space left for this user on the file system of `directory` [B]; raises OSError."""
    numbers = os.statvfs(directory)
    return numbers.f_bavail * numbers.f_frsize


def recording_directory(directory: Path, name: str, now: datetime) -> Path:
    """Return a new directory in `directory`: `name`, or date and time, with a number added if it is taken.

    Raises RecordError if `name` is not the name of a file.
    """
    if name in {".", ".."} or "/" in name or not name.isprintable():
        raise RecordError(f"recording name {name!r} is not allowed; use letters, digits, '_', '-' and '.'")
    stem = name or now.strftime("tripod_%Y-%m-%d_%H-%M-%S")
    path, number = directory / stem, 2
    while path.exists():
        path, number = directory / f"{stem}_{number}", number + 1
    return path
