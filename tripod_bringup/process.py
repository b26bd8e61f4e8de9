"""One supervised process: in its own session, its output read by line, stopped politely or not."""

import contextlib
import os
import signal
import subprocess
import sys
import sysconfig
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from tripod_host.effort import Effort

LineHandler = Callable[[str, str], None]
"""Called with the process's name and one line of its output, from a reading thread."""

KEPT_LINES = 20


@dataclass(frozen=True)
class ProcessSpec:
    """What to run and what its end means.

    Attributes:
        name: As people read it, such as "driver".
        module: Python module that is run as a program.
        arguments: Its command line.
        exit_code: What the supervisor exits with when this process ends unasked.
        ready: Whether the process does its work; the next stage of start-up waits for it.
        start_time: How long it may idle before it is `ready` [s]; while it works, it is waited for.
        stop_time: How long it may take to stop in order before it is killed, busy and idle time together [s]. That it
            waits for a processor counts neither here nor there.
    """

    name: str
    module: str
    arguments: Sequence[str] = ()
    exit_code: int = 1
    ready: Callable[[], bool] = lambda: True
    start_time: float = 60.0
    stop_time: float = 5.0


@dataclass
class SupervisedProcess:
    """A running process of a `ProcessSpec`.

    The process has its own session, so that Ctrl-C in the terminal reaches the supervisor only, and its
    standard input is the lifeline of `tripod_bringup.child`.

    Attributes:
        spec: What runs.
        tail: The newest lines of its output, for the report of its death.
        effort: What it does, since it was started or told to stop.
        killed: Why it had to be killed, empty if it had not.
    """

    spec: ProcessSpec
    on_line: LineHandler
    tail: deque[str] = field(default_factory=lambda: deque(maxlen=KEPT_LINES))
    killed: str = ""

    def __post_init__(self) -> None:
        self._popen = subprocess.Popen(
            [sys.executable, "-P", "-m", "tripod_bringup.child", self.spec.module, *self.spec.arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            env=child_environment(),
        )
        self.effort = Effort(self.pid)
        self._readers = [
            threading.Thread(target=self._read, args=(stream,), name=f"read {self.spec.name}", daemon=True)
            for stream in (self._popen.stdout, self._popen.stderr)
        ]
        for reader in self._readers:
            reader.start()

    @property
    def pid(self) -> int:
        """Its process id, which is also its group's."""
        return self._popen.pid

    @property
    def returncode(self) -> int | None:
        """None while it runs; negative: the signal that ended it."""
        return self._popen.poll()

    @property
    def end(self) -> str:
        """How it ended, for people."""
        code = self.returncode
        if code is None:
            return "is running"
        if code < 0:
            return f"was ended by {signal.Signals(-code).name}"
        return f"exited with code {code}"

    @property
    def left_in_order(self) -> bool:
        """Whether it ended as it should: by itself with 0, or by SIGTERM, when it had nothing yet to leave in order."""
        return not self.killed and self.returncode in (0, -signal.SIGTERM)

    def terminate(self) -> None:
        """Ask it to stop in order."""
        self.effort = Effort(self.pid)
        if self.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                self._popen.terminate()

    def kill(self, why: str = "was killed") -> None:
        """End it and whatever it started, at once."""
        if self.returncode is None:
            self.killed = why
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.pid, signal.SIGKILL)
            self._popen.wait()

    def wait_for_output(self, timeout: float = 1.0) -> None:
        """Wait until its last lines are read; call it after the process ended."""
        deadline = time.monotonic() + timeout
        for reader in self._readers:
            reader.join(max(0.0, deadline - time.monotonic()))
        if self._popen.stdin is not None:
            self._popen.stdin.close()

    def _read(self, stream: IO[bytes]) -> None:
        for raw in stream:
            line = raw.decode("utf-8", "replace").rstrip()
            if line:
                self.tail.append(line)
                self.on_line(self.spec.name, line)


def child_environment() -> dict[str, str]:
    """Return a child's environment: unbuffered, without colours, able to import what this process can."""
    environment = dict(os.environ, PYTHONUNBUFFERED="1", RCUTILS_COLORIZED_OUTPUT="0")
    root = Path(__file__).resolve().parents[1]
    if root != Path(sysconfig.get_path("purelib")).resolve():
        before = environment.get("PYTHONPATH", "")
        environment["PYTHONPATH"] = os.pathsep.join([str(root), *([before] if before else [])])
    return environment
