"""Input files: only regular ones, of bounded size; a device, a FIFO or a directory is refused at once."""

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO, Final

KINDS: Final = {
    stat.S_IFDIR: "a directory",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFLNK: "a symbolic link",
}
"""What else than a file a name may stand for."""


def kind(mode: int) -> str:
    """Return in words what the `st_mode` of something that is no regular file stands for."""
    return KINDS.get(stat.S_IFMT(mode), "of an unknown kind")


def open_file(path: str | Path, most: int) -> BinaryIO:
    """Open the regular file at `path` for reading; links are followed.

    Args:
        path: The file.
        most: Size above which it is refused [B]. One that grows meanwhile is the reader's to bound.

    Raises:
        OSError: it is not there, not a regular file, or too large; `strerror` says which, in words.
    """
    path = Path(path)
    try:
        _check(
            path.stat(), path, most
        )  # before it is opened: opening a serial port resets the board behind it
        fd = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except ValueError as error:  # what Python itself refuses to look for
        raise OSError(errno.EINVAL, str(error), str(path)) from None
    try:
        _check(os.fstat(fd), path, most)
    except OSError:
        os.close(fd)
        raise
    return os.fdopen(fd, "rb")


def read_file(path: str | Path, most: int) -> bytes:
    """Return the content of the regular file at `path`, at most `most` bytes. Raises OSError as `open_file` does."""
    with open_file(path, most) as file:
        data = file.read(most + 1) or b""  # nothing: some of /proc would have to be waited for
    if len(data) > most:
        raise _too_large(Path(path), most)
    return data


def _check(found: os.stat_result, path: Path, most: int) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "it is not a file but a directory", str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, f"it is not a file but {kind(found.st_mode)}", str(path))
    if found.st_size > most:
        raise _too_large(path, most)


def _too_large(path: Path, most: int) -> OSError:
    return OSError(errno.EFBIG, f"it is larger than {most} bytes", str(path))
