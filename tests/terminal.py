"""A terminal with a shell in it, for tests that type commands as a person does."""

import os
import pty
import re
import select
import signal
import time
from collections.abc import Mapping
from pathlib import Path

PROMPT = re.compile(r"<(\d+)>\$ $")
"""The shell's prompt, with the exit code of the command before."""
PATIENCE = 600.0
"""Longest time of one command on a loaded machine [s]."""


class Terminal:
    """A bash in a pseudo-terminal; what is typed goes on in the folder and the environment that it has by then."""

    def __init__(self, folder: Path, environ: Mapping[str, str]) -> None:
        environ = {
            **environ,
            "PS1": "<$?>$ ",
            "TERM": "dumb",
            "COLUMNS": "200",
            "VIRTUAL_ENV_DISABLE_PROMPT": "1",
        }
        self._pid, self._file = pty.fork()
        if not self._pid:
            os.chdir(folder)
            os.execvpe("bash", ["bash", "--norc", "--noprofile", "-i"], environ)
        self._read(PROMPT)

    def type(self, line: str) -> tuple[int, str]:
        """Type a line; return its exit code and what the terminal showed until the next prompt."""
        shown = self.start(line, PROMPT.pattern)
        found = PROMPT.search(shown)
        assert found
        return int(found[1]), shown[: found.start()]

    def start(self, line: str, until: str) -> str:
        """Type a line; return what the terminal showed until it shows the pattern `until`."""
        self.press(f"{line}\n")
        return self._read(re.compile(until))

    def finish(self, keys: str = "\x03") -> tuple[int, str]:
        """Press keys that end what runs, Ctrl-C by default; return as `type` does."""
        self.press(keys)
        shown = self._read(PROMPT)
        found = PROMPT.search(shown)
        assert found
        return int(found[1]), shown[: found.start()]

    def press(self, keys: str) -> None:
        """Press keys."""
        os.write(self._file, keys.encode())

    def close(self) -> None:
        """Close the window: the shell and what it runs get SIGHUP."""
        os.kill(self._pid, signal.SIGHUP)
        os.close(self._file)
        os.waitpid(self._pid, 0)

    def _read(self, until: re.Pattern[str]) -> str:
        shown, end = "", time.monotonic() + PATIENCE
        while not until.search(shown):
            ready = select.select([self._file], [], [], max(0.0, end - time.monotonic()))[0]
            assert ready, f"not seen within {PATIENCE:g} s: {until.pattern}\n{shown}"
            shown += os.read(self._file, 65536).decode("utf-8", "replace").replace("\r\n", "\n")
        return shown
