"""Run the programs of a set-up step: all that they say goes to the log, the newest line of it to the screen."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from tools.errors import StepError

SHOWN_LINES = 25
"""Lines of the output that an error repeats."""

UNREACHABLE = ("NewConnectionError", "NameResolutionError", "ConnectTimeoutError", "ProxyError")
"""What pip writes where it meets no server; what it says after that, of versions in conflict, misleads."""


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

    def start(self, *words: str | Path) -> "Job":
        """Start the program and arguments `words` beside what is run meanwhile. Raises StepError if it cannot be."""
        command, said = [str(w) for w in words], self.log.with_suffix(".beside.log")
        with said.open("w", encoding="utf-8") as out:
            try:
                process = subprocess.Popen(
                    command,
                    env=dict(self.environ),
                    stdin=subprocess.DEVNULL,
                    stdout=out,
                    stderr=subprocess.STDOUT,
                    pass_fds=(self.lock,),
                    start_new_session=True,
                )
            except OSError as error:
                raise StepError(f"{command[0]}: {error.strerror}") from error
        return Job(command, process, said, self.log)

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
            raise _failed(command, process.returncode, tail)


@dataclass(frozen=True)
class Job:
    """A program that runs beside others; see `Shell.start`.

    Attributes:
        command: Its words.
        process: It.
        said: File of its output.
        log: To which that is added at its end.
    """

    command: Sequence[str]
    process: "subprocess.Popen[bytes]"
    said: Path
    log: Path

    def end(self) -> None:
        """Wait until it has ended. Raises StepError if it failed."""
        while self.process.poll() is None:
            show_progress((self._lines() or [""])[-1])
            try:
                self.process.wait(0.2)
            except subprocess.TimeoutExpired:
                continue
        show_progress("")
        lines = self._lines()
        with self.log.open("a", encoding="utf-8") as log:
            log.write("\n".join([f"$ {' '.join(self.command)}", *lines, ""]))
        if self.process.returncode:
            raise _failed(self.command, self.process.returncode, lines[-SHOWN_LINES:])

    def kill(self) -> None:
        """End it and what it has started, if they still run."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self.said.unlink(missing_ok=True)

    def _lines(self) -> list[str]:
        return self.said.read_text(encoding="utf-8", errors="replace").splitlines()


def _failed(command: Sequence[str], code: int, tail: Sequence[str]) -> StepError:
    """Return what to tell of a program that failed: where pip met no server, that alone, else its last lines.

    Raises KeyboardInterrupt if it was ended by Ctrl-C, which this process may not have seen.
    """
    if code in (128 + signal.SIGINT, -signal.SIGINT):
        raise KeyboardInterrupt
    if "pip" in command and any(word in line for line in tail for word in UNREACHABLE):
        return StepError(
            "pip cannot reach the server of the Python packages, so nothing was installed; check the network (and "
            "HTTPS_PROXY or PIP_INDEX_URL, if you need them), then give the same command again"
        )
    said = "\n".join(f"  | {line}" for line in tail)
    return StepError(f"{Path(command[0]).name} failed with exit code {code}:\n{said}")


def show_progress(text: str) -> None:
    """Show `text` on the present line of a terminal, in place of what was there; elsewhere do nothing."""
    if sys.stdout.isatty():
        width = shutil.get_terminal_size().columns - 1
        print(f"\r\033[K{text.strip()[:width]}", end="" if text else "\r", flush=True)
