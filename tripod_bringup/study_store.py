"""Points that are done, on disk: one JSON object a line, each safe before the next is begun."""

import errno
import fcntl
import json
import os
from contextlib import suppress
from io import BytesIO, FileIO
from pathlib import Path
from types import TracebackType
from typing import Any

from tripod_host.locks import open_lock


class StoreBusyError(Exception):
    """Another process adds to the file; the message names it and says what to do."""


class Store:
    """A file of records by key, to which each new one is added and synchronised.

    A process that is killed at any moment loses no finished point: a last line that was torn is cut off when the file
    is opened again. Of a record for which the disk has no room, nothing is left in the file. One process at a time has
    the file: two would measure everything twice, and disturb each other's times.
    """

    def __init__(self, path: Path, *, fresh: bool = False) -> None:
        """Open `path` and read what is there; `fresh`: forget that. Raises OSError, StoreBusyError."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self.records: dict[str, dict[str, Any]] = {}
        self._path = path
        self._file = FileIO(open_lock(path, 0o666), "r+")
        try:
            self._lock(path)
            if fresh:
                self._file.truncate(0)
            self._read()
        except BaseException:
            self._file.close()
            raise

    def _lock(self, path: Path) -> None:
        """Keep others from the file until it is closed, however this process ends."""
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StoreBusyError(
                f"another `tripod study` writes to {str(path)!r}: wait until it has ended, stop it, or name "
                "another folder with --out"
            ) from None
        except OSError as error:
            if error.errno not in (
                errno.ENOLCK,
                errno.ENOSYS,
                errno.EOPNOTSUPP,
            ):  # a file system without locks
                raise

    def _read(self) -> None:
        good = 0
        for line in BytesIO(self._file.readall()):
            if not line.endswith(b"\n"):
                break
            try:
                record = json.loads(line)
                self.records[record["key"]] = record
            except (ValueError, KeyError, TypeError):  # zeros where a disk lost its power
                pass
            good += len(line)
        self._file.truncate(good)
        self._end = good

    def add(self, key: str, record: dict[str, Any]) -> None:
        """Keep a record; when this returns it is on the disk. Raises OSError: then the file is as before."""
        kept = {"key": key, **record}
        line, done = memoryview(json.dumps(kept).encode() + b"\n"), 0
        try:
            while done < len(line):
                done += os.pwrite(self._file.fileno(), line[done:], self._end + done)
            os.fsync(self._file.fileno())
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(self._end)
            raise OSError(error.errno, error.strerror, str(self._path)) from None
        self._end += done
        self.records[key] = kept

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> "Store":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
