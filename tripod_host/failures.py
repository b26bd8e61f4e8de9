"""What to say where the machine fails: what happened, to which file, and what to do. Pure but for looking at places."""

import errno
import os
import tempfile
import traceback
from collections.abc import Sequence
from pathlib import Path

FULL = (errno.ENOSPC, errno.EDQUOT)
"""Errors of a disk, or a share of it, without room."""

MAKE_ROOM = "free space on that disk, or name a place on another disk"

PACKAGE = Path(__file__).resolve().parents[1] / "tripod_sim"
"""Where most of the compiled loops are."""

NUMBA_CACHE = "numba.core.caching"
"""The module of Numba that keeps compiled loops."""

ELSEWHERE = "set NUMBA_CACHE_DIR to a directory that you can write to"


class RemediedError(OSError):
    """Something of the machine is wrong; the message says what, and what to do.

    Attributes:
        found: What is wrong.
        remedy: What to do.
    """

    def __init__(self, found: str, remedy: str) -> None:
        super().__init__(f"{found}; {remedy}")
        self.found, self.remedy = found, remedy


def reason(error: OSError) -> str:
    """Return why a file could not be used, with what to do where its disk is full; the file is not named."""
    why = error.strerror or str(error)
    return f"{why}; {MAKE_ROOM}" if error.errno in FULL and MAKE_ROOM not in why else why


def failure_words(error: Exception) -> str:
    """Return an error for people, on one line: where compiled loops cannot be kept, or a file and what befell it."""
    if words := _kernel_words(error):
        return words
    if isinstance(error, OSError) and error.strerror:
        where = f"{error.filename}: " if error.filename else ""
        return f"{where}{reason(error)}"
    return " ".join(str(error).split())


def kernel_places() -> list[Path]:
    """Return where Numba tries to keep compiled loops, in its order."""
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    given = os.environ.get("NUMBA_CACHE_DIR")
    return [*([Path(given)] if given else []), PACKAGE / "__pycache__", user / "numba"]


def first_writable(places: Sequence[Path]) -> Path | None:
    """Return the first of some directories that could be written to, or made; None if there is none."""
    return next((place for place in places if _can_write(existing(place))), None)


def existing(path: Path) -> Path:
    """Return `path`, or the nearest parent that exists."""
    path = path.absolute()
    while not path.exists() and path != path.parent:
        path = path.parent
    return path


def _can_write(directory: Path) -> bool:
    try:
        with tempfile.TemporaryFile(dir=directory):
            return True
    except OSError:
        return False


def _kernel_words(error: Exception) -> str:
    """Return that compiled loops cannot be kept, if an error says so; else nothing.

    Numba raises RuntimeError where it finds no place, and an OSError without a file name where the disk is full.
    """
    frames = traceback.walk_tb(error.__traceback__)
    if not any(frame.f_globals.get("__name__") == NUMBA_CACHE for frame, _ in frames):
        return ""
    places = kernel_places()
    if isinstance(error, OSError):
        where = error.filename or first_writable(places) or places[0]
        return (
            f"compiled loops cannot be stored in {where}: {error.strerror or error}; {ELSEWHERE} with "
            "free space"
        )
    if "cannot cache" not in str(error):
        return ""
    barred = ", ".join(str(place) for place in places if not _can_write(existing(place)))
    return f"compiled loops cannot be stored; not writable: {barred}; {ELSEWHERE}"
