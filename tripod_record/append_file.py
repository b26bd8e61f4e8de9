"""A file that is a complete mcap file after every flush, so that a killed recording opens in any reader."""

import os
import stat
import struct
from array import array
from bisect import bisect_right
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from tripod_host.writing import sync_directory
from tripod_record.errors import FileLostError

MAGIC = b"\x89MCAP0\r\n"
DATA_END, FOOTER = 0x0F, 0x02

TAIL = struct.pack("<BQI", DATA_END, 4, 0) + struct.pack("<BQQQI", FOOTER, 20, 0, 0, 0) + MAGIC
"""End of an mcap file without summary: readers then scan it. Fifty bytes, overwritten by what follows."""


class AppendFile:
    """A new file, readable by its owner only, to which whole records are appended.

    They collect in memory; `flush` writes them together with `TAIL` in one call and waits for the disk. The next
    flush overwrites that tail. So a kill between two flushes leaves a valid file without summary, and a loss of
    power at worst one with a torn end. Before it writes, each flush looks whether the file is still there, as it was
    left; what it cannot write stays in memory, for the next attempt.

    Attributes:
        path: Where the file is.
    """

    def __init__(self, path: Path) -> None:
        """Create the file; raises FileExistsError, or OSError if it cannot be."""
        self.path = path
        self._fd: int | None = _create(path)
        self._ends = array("Q")  # of the flushes: how much of a file that was cut may be believed
        self._tail = b""  # what stands behind them
        self._waiting: list[bytes] = []
        self._waiting_size = 0

    @property
    def size(self) -> int:
        """Bytes of the file before the tail, as far as it is flushed."""
        return self._ends[-1] if self._ends else 0

    @property
    def descriptor(self) -> int:
        """For reading; raises OSError once closed."""
        if self._fd is None:
            raise OSError("the recording is closed")
        return self._fd

    def write(self, data: bytes) -> None:
        """Keep `data`, whole records, for the next flush."""
        self._waiting.append(data)
        self._waiting_size += len(data)

    def tell(self) -> int:
        """Return the position at which the next `write` will stand in the file."""
        return self.size + self._waiting_size

    def flush(self) -> None:
        """Write everything to the disk.

        Raises:
            FileLostError: another program deleted, moved, replaced or changed the file; see `rescue`.
            OSError: the disk does not take it; the file stays as the last flush left it.
        """
        self._check()
        if self._waiting:
            self._put(TAIL)

    def close(self) -> None:
        """Write what is left, which ends with the caller's own end of file, and close; raises as `flush` does."""
        self._check()
        self._put(b"")  # longer than the tail of the last flush, which it overwrites
        self._release()

    def abandon(self) -> None:
        """Drop what is not yet flushed and close; the file stays as it was after the last flush."""
        self._release()

    def rescue(self, path: Path, readable: Callable[[int, int], int], head: bytes, again: bytes) -> None:
        """Go on in a new file at `path`, with what can still be read of the present one, and flush it.

        Args:
            path: The new file; it must not exist.
            readable: Given a descriptor and a size, returns where the records that can be read end.
            head: Begins a file of which nothing is left.
            again: Comes before what waits: what readers must know to understand it.

        Raises:
            OSError: the new file cannot be made or written; then everything is as before.
        """
        old = self.descriptor
        end = readable(old, min(os.fstat(old).st_size, self.size))
        ends = self._ends[: bisect_right(self._ends, end)]
        end = ends[-1] if ends else 0
        data = b"".join((b"" if end else head, again, *self._waiting, TAIL))
        new = _create(path)
        try:
            _copy(old, new, end)
            _write(new, data, end)
        except BaseException:
            os.close(new)
            path.unlink(missing_ok=True)
            raise
        self._release()
        self._fd, self.path, self._ends = new, path, ends
        self._flushed(end + len(data) - len(TAIL), TAIL)

    def _check(self) -> None:
        """Raise FileLostError unless the file is at its path, and as the last flush left it."""
        own = os.fstat(self.descriptor)
        size = self.size + len(self._tail)
        if own.st_size < size:
            raise FileLostError(f"was cut from {size} to {own.st_size} bytes by another program")
        if own.st_size > size or os.pread(self.descriptor, len(self._tail), self.size) != self._tail:
            raise FileLostError("was changed by another program")
        try:
            there = os.lstat(self.path)
        except (FileNotFoundError, NotADirectoryError):
            raise FileLostError("is gone: another program deleted or moved it") from None
        if (there.st_dev, there.st_ino) != (own.st_dev, own.st_ino):
            raise FileLostError("was replaced by another program")

    def _put(self, tail: bytes) -> None:
        data = b"".join((*self._waiting, tail))
        try:
            _write(self.descriptor, data, self.size)
        except OSError:
            self._roll_back()
            raise
        self._flushed(self.size + len(data) - len(tail), tail)

    def _flushed(self, end: int, tail: bytes) -> None:
        self._ends.append(end)
        self._tail = tail
        self._waiting, self._waiting_size = [], 0

    def _roll_back(self) -> None:
        """Leave the file as the last flush left it, whatever the disk still takes."""
        try:
            if self._tail:  # where the last one stood: that needs no room
                _write(self.descriptor, TAIL, self.size)
            os.ftruncate(self.descriptor, self.size + len(self._tail))
        except OSError:
            self._tail = b""  # `reading` reads a file with a torn end too
            with suppress(OSError):
                os.ftruncate(self.descriptor, self.size)

    def _release(self) -> None:
        fd, self._fd = self._fd, None
        if fd is not None:
            os.close(fd)


def make_private_directory(directory: Path) -> None:
    """Make a new directory, with its parents, that only its owner may enter; raises OSError."""
    if not directory.parent.exists():
        with suppress(FileExistsError):
            make_private_directory(directory.parent)
    directory.mkdir(stat.S_IRWXU)
    sync_directory(directory.parent)


def _create(path: Path) -> int:
    fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, stat.S_IRUSR | stat.S_IWUSR)
    sync_directory(path.parent)
    return fd


def _write(fd: int, data: bytes, at: int) -> None:
    done, view = 0, memoryview(data)
    while done < len(data):
        done += os.pwrite(fd, view[done:], at + done)
    os.fdatasync(fd)


def _copy(old: int, new: int, size: int) -> None:
    at = 0
    while at < size:
        part = os.sendfile(new, old, at, size - at)
        if not part:
            raise OSError("the file became shorter while it was copied; another program changes it")
        at += part
