"""Start processes in stages, keep watch, stop them in the reverse order; knows nothing of what they do."""

import contextlib
import queue
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from tripod_bringup.process import ProcessSpec, SupervisedProcess
from tripod_host.stop import Asked, taken

KILLED_BY_USER = 130
LONG_START = 5.0
"""Processor time after which the screen shows how much a start has taken [s]."""
PERIOD = 0.1
"""Between two looks at the children [s]."""
FROZEN = 5.0
"""Time after which a process that is to stop and does nothing at all is given up [s]: who waits for a disk or a servo
looks for it several times a second."""


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
            on_tick: Called every `PERIOD` with the phase: "waiting for NAME to start", "" or "stopping NAME".
            before_stop: Called once before the first process is asked to stop.
        """
        self.stages = [list(stage) for stage in stages if stage]
        self.processes: dict[str, SupervisedProcess] = {}
        self._lines: queue.SimpleQueue[tuple[str, str]] = queue.SimpleQueue()
        self._on_line, self._on_tick, self._before_stop = on_line, on_tick, before_stop
        self._asked = Asked()

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
            raise RuntimeError("a supervisor must run in the main thread, the only one that receives signals")
        with taken() as self._asked:
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
                    if self.processes[spec.name].effort.again().idle > spec.start_time:
                        cause = f"{spec.name} did not start: nothing happened for {spec.start_time:g} s"
                        return Ending(spec.exit_code, cause, list(self.processes[spec.name].tail))
                self._pause("waiting for " + ", ".join(map(self._work, waiting)) + " to start")
        return None

    def _watch(self, until: Callable[[], str]) -> Ending:
        while True:
            if ending := self._look():
                return ending
            if reason := until():
                return Ending(0, reason)
            self._pause("")

    def _look(self) -> Ending | None:
        if self._asked.count:
            return Ending(0, self._asked.name)
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
            while left := [process for process in left if process.returncode is None]:
                if self._asked.count > 1:
                    ending.code, ending.cause = KILLED_BY_USER, f"second {self._asked.name}: killed"
                    return
                for process in left:
                    effort = process.effort.again()
                    if effort.still > FROZEN:
                        process.kill(f"did not respond for {FROZEN:g} s while stopping")
                    elif effort.busy + effort.idle > process.spec.stop_time:
                        process.kill(f"did not stop within {process.spec.stop_time:g} s")
                self._pause("stopping " + ", ".join(process.spec.name for process in left))
        for process in self.processes.values():
            process.wait_for_output()
        self._drain()
        self._blame_bad_stops(ending)

    def _blame_bad_stops(self, ending: Ending) -> None:
        for process in self.processes.values():
            if ending.code or process.left_in_order:
                continue
            how = process.killed or f"{process.end} while stopping"
            ending.code, ending.cause = process.spec.exit_code, f"{process.spec.name} {how}"
            ending.output = list(process.tail)

    def _work(self, spec: ProcessSpec) -> str:
        """Return the name of a process, with the time that it has worked on its start where that is long."""
        busy = self.processes[spec.name].effort.busy
        return spec.name if busy < LONG_START else f"{spec.name} ({busy:.0f} s of work)"

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
