"""Points of a study in processes of their own: one thread for the numerics, a limit on time, and a crash is a record.

Run as a program it measures what comes in: one JSON object a line, `{"module": ..., "settings": {...}}`, on standard
input, one record a line on standard output. It ends when its input does, so it does not outlive whoever started it.
"""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Mapping
from functools import partial
from importlib import import_module
from typing import Any

from tripod_host.parent import die_with_parent
from tripod_host.program import SINGLE
from tripod_host.stop import end_at_once


class Worker:
    """A process that measures points, started when it is needed and again after it was stopped."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self._lock, self._ended = threading.Lock(), False

    def measure(self, module: str, settings: Mapping[str, Any], limit: float) -> dict[str, Any]:
        """Return the record of a point; `time limit` or `crashed` if the process gave none within `limit` [s]."""
        with self._lock:
            if self._ended:
                return lost("crashed", "stopped")
            process = self._started()
        assert process.stdin
        assert process.stdout
        late = threading.Event()

        def give_up() -> None:
            late.set()
            process.kill()

        timer = threading.Timer(limit, give_up)
        timer.start()
        try:
            process.stdin.write(json.dumps({"module": module, "settings": dict(settings)}) + "\n")
            process.stdin.flush()
            line = process.stdout.readline()
        except (OSError, ValueError):  # a pipe that is broken, or closed
            line = ""
        finally:
            timer.cancel()
        if line.endswith("\n"):
            record: dict[str, Any] = json.loads(line)
            return record
        self.stop()
        if late.is_set():
            return lost("time limit", f"stopped after {limit:g} s, the time limit")
        return lost("crashed", f"the process ended with code {process.returncode}")

    def _started(self) -> "subprocess.Popen[str]":
        if self._process is None or self._process.poll() is not None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tripod_bringup.study_worker", str(os.getpid())],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                env={**os.environ, **dict.fromkeys((*SINGLE, "NUMBA_NUM_THREADS"), "1")},
                start_new_session=True,  # Ctrl-C is for whoever started it
            )
        return self._process

    def end(self) -> None:
        """Kill the process from another thread, for good; a point that it measures is lost."""
        with self._lock:
            self._ended = True
            if self._process:
                self._process.kill()
                self._process.wait()

    def stop(self) -> None:
        """End the process; the next point starts a new one."""
        if self._process is None:
            return
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe:
                try:
                    pipe.close()
                except OSError:  # what was still to be written has nowhere to go
                    continue


class Workers:
    """One worker for each thread that asks."""

    def __init__(self) -> None:
        self._local = threading.local()
        self._all: list[Worker] = []
        self._ended = threading.Event()

    def measure(self, module: str, settings: Mapping[str, Any], limit: float) -> dict[str, Any]:
        """Return the record of a point, measured in the process that belongs to this thread."""
        worker: Worker | None = getattr(self._local, "worker", None)
        if worker is None:
            worker = self._local.worker = Worker()
            self._all.append(worker)
        if self._ended.is_set():
            worker.end()
        return worker.measure(module, settings, limit)

    def end(self) -> None:
        """End all processes, for good."""
        self._ended.set()
        for worker in list(self._all):
            worker.end()


_here = Workers()


def measure_point(module: str, settings: Mapping[str, Any], limit: float) -> dict[str, Any]:
    """Return the record of a point: what a cluster calls on its machines."""
    return _here.measure(module, settings, limit)


def lost(status: str, message: str) -> dict[str, Any]:
    """Return the record of a point that gave none."""
    return {"status": status, "message": message, "observed": {}, "cpu": [], "amount": 1.0}


def _task(module: str, settings: Mapping[str, Any]) -> Any:
    """Measure a point; importing the module is part of it, so that what goes wrong there is a record, too."""
    return import_module(module).task(settings)


def main() -> None:
    """Measure the points that come in, until there are no more, or whoever asks for them is gone."""
    end_at_once()
    die_with_parent(int(sys.argv[1]))
    from tripod_study.fingerprint import fingerprint  # noqa: PLC0415 - the parent needs none of it
    from tripod_study.task import outcome  # noqa: PLC0415

    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever prints must not look like a record
    for line in sys.stdin:
        asked = json.loads(line)
        code = fingerprint(asked["module"])
        record = {**outcome(partial(_task, asked["module"]), asked["settings"]), "code": code}
        answers.write(json.dumps(record) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
