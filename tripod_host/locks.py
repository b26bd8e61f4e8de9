"""Files that one process at a time holds; where no other user can put, hold or see them."""

import errno
import os
import stat
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from tripod_host.reading import kind


def private_directory(environment: Mapping[str, str]) -> Path:
    """Return a directory that belongs to this user alone, made if need be, for what processes tell each other.

    That is the first of XDG_RUNTIME_DIR, `tripod` in the user's cache directory, and one in the directory for
    temporary files, that is this user's and closed to others: there another user may have put anything.

    Raises:
        OSError: none is; the message says what to do.
    """
    for directory, make in _candidates(environment):
        try:
            if make:
                directory.mkdir(mode=0o700, parents=True, exist_ok=True)
            found = directory.lstat()
        except (OSError, ValueError):
            continue
        own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
        if own and not found.st_mode & 0o022 and os.access(directory, os.W_OK):
            return directory
    raise OSError(
        errno.EACCES,
        "no directory belongs to this user only; set XDG_RUNTIME_DIR to one that only you can write to",
    )


def open_lock(path: Path, mode: int = 0o600) -> int:
    """Open the file at `path`, made with `mode` if need be, to be locked; never follows a link, never waits.

    Who can open a file can lock it: by default nobody else can.

    Raises:
        OSError: it is no regular file, or cannot be opened; `strerror` says so in words.
    """
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
    try:
        fd = os.open(path, flags, mode)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OSError(errno.ELOOP, "it is a symbolic link; remove it", str(path)) from None
        raise
    if not stat.S_ISREG(found := os.fstat(fd).st_mode):
        os.close(fd)
        raise OSError(errno.EINVAL, f"it is {kind(found)}, not a file; remove it", str(path))
    return fd


def _candidates(environment: Mapping[str, str]) -> Iterator[tuple[Path, bool]]:
    """Yield directories to try, and whether to make them."""
    if given := environment.get("XDG_RUNTIME_DIR"):
        yield Path(given), False
    if cache := environment.get("XDG_CACHE_HOME"):
        yield Path(cache) / "tripod", True
    if home := environment.get("HOME"):
        yield Path(home) / ".cache" / "tripod", True
    yield Path(tempfile.gettempdir()) / f"tripod-{os.getuid()}", True
