"""Start processes in stages, keep watch, stop them in the reverse order; knows nothing of what they do."""

import contextlib
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from types import FrameType

from tripod_bringup.process import ProcessSpec, SupervisedProcess

KILLED_BY_USER = 130
PERIOD = 0.1
"""Between two looks at the children [s]."""


@dataclass
class Ending:
    """How a supervised run ended.

    Attributes:
        code: Exit code: 0, the `exit_code` of the process at fault, or 130 after a second Ctrl-C.
        cause: Why it ended, one line for people.
        output: Last lines of the process at fault.
    """

    code: int = 0
    cause: str = ""
    output: list[str] = field(default_factory=list)


@dataclass
class Interruption:
    """Counts the signals that ask to stop: the first stops in order, the second kills.

    Signals that come together count as one: `make` passes on what the terminal has already sent to everybody.

    Attributes:
        together: Signals closer than this are one [s].
    """

    together: float = 0.5
    count: int = 0
    name: str = ""
    _last: float = float("-inf")

    @contextlib.contextmanager
    def caught(self) -> Iterator["Interruption"]:
        """Catch SIGINT, SIGTERM and SIGHUP meanwhile; only in the main thread."""
        numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        before = {number: signal.signal(number, self._on_signal) for number in numbers}
        try:
            yield self
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        now = time.monotonic()
        if now > self._last + self.together:
            self.count += 1
            self._last = now
        self.name = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name


class Supervisor:
    """Runs stages of processes; a stage starts when all of the one before are ready.

    Stopping goes through the stages in reverse, the same way whatever the reason (asked, a process died, a
    process never became ready); the ending says which.
    """

    def __init__(
        self,
        stages: Sequence[Sequence[ProcessSpec]],
        *,
        on_line: Callable[[str, str], None] = lambda _name, _line: None,
        on_tick: Callable[[str], None] = lambda _phase: None,
        before_stop: Callable[[], None] = lambda: None,
    ) -> None:
        """Set up; nothing starts before `run`.

        Args:
            stages: What to start, first stage first.
            on_line: Takes name and line of each process's output, in the thread of `run`.
            on_tick: Called every `PERIOD` with the phase, "starting NAME, NAME", "" or "stopping NAME, NAME".
            before_stop: Called once before the first process is asked to stop.
        """
        self.stages = [list(stage) for stage in stages if stage]
        self.processes: dict[str, SupervisedProcess] = {}
        self._lines: queue.SimpleQueue[tuple[str, str]] = queue.SimpleQueue()
        self._on_line, self._on_tick, self._before_stop = on_line, on_tick, before_stop
        self._interruption = Interruption()

    @property
    def running(self) -> bool:
        """Whether every process of every stage has started."""
        return len(self.processes) == sum(map(len, self.stages))

    def run(self, until: Callable[[], str]) -> Ending:
        """Start all, watch until `until` returns a reason, a signal arrives or a process ends; then stop all.

        Call it in the main thread: signals are caught meanwhile. No process is left behind, also after an
        exception.
        """
        if threading.current_thread() is not threading.main_thread():
            raise RuntimeError("a supervisor runs in the main thread: only that one receives signals")
        with self._interruption.caught():
            try:
                ending = self._start() or self._watch(until)
                self._stop(ending)
            except (
                BaseException
            ):  # a callback failed: the servos are parked and the recording closed all the same
                self._on_line, self._on_tick = (lambda _name, _line: None), (lambda _phase: None)
                self._stop(Ending(1))
                raise
            finally:
                for process in self.processes.values():
                    process.kill()
        return ending

    def _start(self) -> Ending | None:
        for stage in self.stages:
            for spec in stage:
                self.processes[spec.name] = SupervisedProcess(
                    spec, lambda n, line: self._lines.put((n, line))
                )
            while waiting := [spec for spec in stage if not spec.ready()]:
                if ending := self._look():
                    return ending
                for spec in waiting:
                    if time.monotonic() > self.processes[spec.name].started + spec.start_time:
                        cause = f"{spec.name} did not come up within {spec.start_time:g} s"
                        return Ending(spec.exit_code, cause, list(self.processes[spec.name].tail))
                self._pause("starting " + ", ".join(spec.name for spec in waiting))
        return None

    def _watch(self, until: Callable[[], str]) -> Ending:
        while True:
            if ending := self._look():
                return ending
            if reason := until():
                return Ending(0, reason)
            self._pause("")

    def _look(self) -> Ending | None:
        if self._interruption.count:
            return Ending(0, self._interruption.name)
        for process in self.processes.values():
            if process.returncode is not None:
                process.wait_for_output()
                return Ending(
                    process.spec.exit_code, f"{process.spec.name} {process.end}", list(process.tail)
                )
        return None

    def _stop(self, ending: Ending) -> None:
        with contextlib.suppress(Exception):  # whatever fails here, the processes are stopped
            self._before_stop()
        for stage in reversed(self.stages):
            left = [self.processes[spec.name] for spec in stage if spec.name in self.processes]
            for process in left:
                process.terminate()
            begun = time.monotonic()
            while left := [process for process in left if process.returncode is None]:
                if self._interruption.count > 1:
                    ending.code, ending.cause = KILLED_BY_USER, f"second {self._interruption.name}: killed"
                    return
                for process in left:
                    if time.monotonic() > begun + process.spec.stop_time:
                        process.kill()
                self._pause("stopping " + ", ".join(process.spec.name for process in left))
        for process in self.processes.values():
            process.wait_for_output()
        self._drain()
        self._blame_bad_stops(ending)

    def _blame_bad_stops(self, ending: Ending) -> None:
        for process in self.processes.values():
            spec = process.spec
            # ended by SIGTERM itself: it was still starting, with nothing yet to leave in order
            if ending.code or not (process.killed or process.returncode not in (0, -signal.SIGTERM)):
                continue
            how = (
                f"did not stop within {spec.stop_time:g} s"
                if process.killed
                else f"{process.end} while stopping"
            )
            ending.code, ending.cause, ending.output = (
                spec.exit_code,
                f"{spec.name} {how}",
                list(process.tail),
            )

    def _pause(self, phase: str) -> None:
        self._drain()
        self._on_tick(phase)
        time.sleep(PERIOD)

    def _drain(self) -> None:
        while True:
            try:
                name, line = self._lines.get_nowait()
            except queue.Empty:
                return
            self._on_line(name, line)
