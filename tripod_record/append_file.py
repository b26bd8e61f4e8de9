"""A file that is a complete mcap file after every flush, so that a killed recording opens in any reader."""

import os
import struct
from contextlib import suppress
from pathlib import Path

MAGIC = b"\x89MCAP0\r\n"
DATA_END, FOOTER = 0x0F, 0x02

TAIL = struct.pack("<BQI", DATA_END, 4, 0) + struct.pack("<BQQQI", FOOTER, 20, 0, 0, 0) + MAGIC
"""End of an mcap file without summary: readers then scan it. Fifty bytes, overwritten by what follows."""


class AppendFile:
    """Output stream for `mcap.writer.Writer` on a new file.

    Whole records collect in memory; `flush` writes them together with `TAIL` in one call and waits for the
    disk. The next flush overwrites that tail. So a kill between two flushes leaves a valid file without
    summary, and a loss of power at worst one with a torn end.
    """

    def __init__(self, path: Path) -> None:
        """Create the file; raises FileExistsError, or OSError if it cannot be."""
        self._fd: int | None = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        self._end = 0  # bytes of the file before the tail
        self._waiting: list[bytes] = []
        self._waiting_size = 0
        sync_directory(path.parent)

    def write(self, data: bytes) -> int:
        """Keep `data`, whole records, for the next flush."""
        self._waiting.append(bytes(data))
        self._waiting_size += len(data)
        return len(data)

    def tell(self) -> int:
        """Return the position at which the next `write` will stand in the file."""
        return self._end + self._waiting_size

    def flush(self) -> None:
        """Write everything to the disk; raises OSError, and then the file stays as the last flush left it."""
        if self._waiting:
            self._put(TAIL)

    def close(self) -> None:
        """Write what is left, which ends with the caller's own end of file, and close; raises OSError."""
        if self._fd is None:
            return
        try:
            self._put(b"")  # longer than the tail of the last flush, which it overwrites
        finally:
            self._release()

    def abandon(self) -> None:
        """Drop what is not yet flushed and close, leaving the file as it was after the last flush."""
        if self._fd is not None:
            self._roll_back(self._fd)
            self._release()

    def _put(self, tail: bytes) -> None:
        if self._fd is None:
            raise OSError("the recording is closed")
        data = b"".join((*self._waiting, tail))
        try:
            done = 0
            while done < len(data):
                done += os.pwrite(self._fd, memoryview(data)[done:], self._end + done)
            os.fdatasync(self._fd)
        except OSError:
            self._roll_back(self._fd)
            raise
        self._end += len(data) - len(tail)
        self._waiting, self._waiting_size = [], 0

    def _roll_back(self, fd: int) -> None:
        with suppress(OSError):  # no more can be done, and `reading` still reads a file with a torn end
            os.ftruncate(fd, self._end)
            if self._end:
                os.pwrite(fd, TAIL, self._end)

    def _release(self) -> None:
        fd, self._fd = self._fd, None
        if fd is not None:
            os.close(fd)


def sync_directory(directory: Path) -> None:
    """Make the names of new files in `directory` survive a loss of power, where the file system can."""
    with suppress(OSError):
        fd = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(fd)
        finally:
            os.close(fd)
