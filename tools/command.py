"""Run the programs of a set-up step: all that they say goes to the log, the newest line of it to the screen."""

import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from tools.errors import StepError

SHOWN_LINES = 25
"""Lines of the output that an error repeats."""


@dataclass(frozen=True)
class Shell:
    """How programs are run.

    Attributes:
        environ: Their environment.
        log: File to which commands and output are appended.
        lock: Descriptor of the lock on the set-up. Each program inherits it, so that the next set-up waits for one
            that outlives a killed set-up.
    """

    environ: Mapping[str, str]
    log: Path
    lock: int

    def with_environ(self, **variables: str) -> "Shell":
        """Return the same with other values of some environment variables."""
        return replace(self, environ={**self.environ, **variables})

    def run(self, *words: str | Path) -> None:
        """Run the program and arguments `words` to their end.

        Raises StepError if it could not be started or failed; the message ends with the last lines of its output.
        """
        command = [str(w) for w in words]
        tail: list[str] = []
        with self.log.open("a", encoding="utf-8") as log:
            log.write(f"$ {' '.join(command)}\n")
            try:
                process = subprocess.Popen(
                    command,
                    env=dict(self.environ),
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    text=True,
                    errors="replace",
                    pass_fds=(self.lock,),
                )
            except OSError as error:
                raise StepError(f"{command[0]}: {error.strerror}") from error
            with process:
                for line in process.stdout or ():
                    log.write(line)
                    tail = [*tail[1 - SHOWN_LINES :], line.rstrip()]
                    show_progress(tail[-1])
        show_progress("")
        if process.returncode:
            said = "\n".join(f"  | {line}" for line in tail)
            raise StepError(f"{Path(command[0]).name} failed with exit code {process.returncode}:\n{said}")


def show_progress(text: str) -> None:
    """Show `text` on the present line of a terminal, in place of what was there; elsewhere do nothing."""
    if sys.stdout.isatty():
        width = shutil.get_terminal_size().columns - 1
        print(f"\r\033[K{text.strip()[:width]}", end="" if text else "\r", flush=True)
