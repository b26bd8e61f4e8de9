"""Which steps of the set-up are done, kept in `.venv` so that it survives whatever interrupts the set-up."""

import hashlib
import json
import os
from collections.abc import Iterable
from pathlib import Path

BUSY = "busy"


class SetupState:
    """The steps that are done, each with the key of what it was done from.

    Written before a step begins (it and what it spoils are not done) and when it ends, each time by replacing
    the file, so that it never claims more than is there.
    """

    FILE = "tripod-setup.json"

    def __init__(self, venv: Path) -> None:
        self._path = venv / self.FILE
        self._done: dict[str, str] = {}
        try:
            content = json.loads(self._path.read_text(encoding="utf-8"))
            self._done = {str(k): str(v) for k, v in content.items()}
        except (OSError, ValueError, AttributeError):
            pass  # no file, or not ours: nothing is done

    @property
    def known(self) -> bool:
        """Whether a set-up has ever noted anything here."""
        return bool(self._done)

    @property
    def interrupted(self) -> str:
        """Name of the step that was begun and neither ended nor failed in order; empty if none."""
        return self._done.get(BUSY, "")

    def is_done(self, step: str, key: str) -> bool:
        """Whether `step` was done from the inputs that `key` stands for."""
        return self._done.get(step) == key

    def begin(self, step: str, spoiled: Iterable[str] = ()) -> None:
        """Note that `step` runs now, and that neither it nor the steps that it spoils are done."""
        for name in (step, *spoiled):
            self._done.pop(name, None)
        self._write({**self._done, BUSY: step})

    def fail(self) -> None:
        """Note that the step which runs gave up in order: it can be tried again on what is there."""
        self._write({k: v for k, v in self._done.items() if k != BUSY})

    def finish(self, step: str, key: str) -> None:
        """Note that `step` is done."""
        self._write({**{k: v for k, v in self._done.items() if k != BUSY}, step: key})

    def _write(self, content: dict[str, str]) -> None:
        self._done = content
        self._path.parent.mkdir(exist_ok=True)
        fresh = self._path.with_suffix(".new")
        with fresh.open("w", encoding="utf-8") as file:
            json.dump(content, file, indent=1)
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(self._path)


def key_of(*parts: object) -> str:
    """Return a short hash of `parts`: text as it stands, files (as Path) by name and content."""
    digest = hashlib.sha256()
    for part in parts:
        data = (
            part.name.encode() + b"\0" + part.read_bytes() if isinstance(part, Path) else repr(part).encode()
        )
        digest.update(len(data).to_bytes(8, "big") + data)
    return digest.hexdigest()[:16]
