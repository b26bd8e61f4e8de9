"""Points that are done, on disk: one JSON object a line, each safe before the next is begun."""

import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any


class Store:
    """A file of records by key, to which each new one is added and synchronised.

    A process that is killed at any moment loses no finished point: a last line that was torn is cut off when the file
    is opened again.
    """

    def __init__(self, path: Path, *, fresh: bool = False) -> None:
        """Open `path` and read what is there; `fresh`: forget that. Raises OSError."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self.records: dict[str, dict[str, Any]] = {}
        if fresh:
            path.unlink(missing_ok=True)
        self._file = path.open("a+b")
        self._read()

    def _read(self) -> None:
        self._file.seek(0)
        good = 0
        for line in self._file:
            if not line.endswith(b"\n"):
                break
            try:
                record = json.loads(line)
                self.records[record["key"]] = record
            except (ValueError, KeyError, TypeError):  # zeros where a disk lost its power
                pass
            good += len(line)
        self._file.truncate(good)
        self._file.seek(0, os.SEEK_END)

    def add(self, key: str, record: dict[str, Any]) -> None:
        """Keep a record; when this returns it is on the disk."""
        kept = {"key": key, **record}
        self._file.write(json.dumps(kept).encode() + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())
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
