"""Time-outs count what a process did and what it idled away, not what it had to wait for."""

import os
import subprocess
import sys

from tripod_host.effort import LONGEST, Effort, look


class Watched:
    """A process as the system would tell of it, and a clock."""

    def __init__(self) -> None:
        self.now = self.used = 0.0
        self.active = False
        self.effort = Effort(1, look=lambda _: (self.used, self.active), clock=lambda: self.now)

    def passes(self, time: float, *, used: float = 0.0, active: bool = False) -> None:
        self.now, self.used, self.active = self.now + time, self.used + used, active
        self.effort.again()


def test_time_without_work_is_idle() -> None:
    watched = Watched()
    for _ in range(10):
        watched.passes(0.1)
    assert abs(watched.effort.idle - 1.0) < 1e-9 and watched.effort.busy == 0


def test_work_is_busy_and_not_idle() -> None:
    watched = Watched()
    for _ in range(10):
        watched.passes(0.1, used=0.1, active=True)
    assert watched.effort.idle == 0 and abs(watched.effort.busy - 1.0) < 1e-9


def test_a_process_that_waits_for_a_processor_is_neither() -> None:
    watched = Watched()
    for _ in range(10_000):
        watched.passes(0.1, active=True)
    assert (watched.effort.idle, watched.effort.busy) == (0, 0)


def test_only_what_does_nothing_at_all_is_still() -> None:
    watched = Watched()
    for _ in range(10):
        watched.passes(0.1)
    assert abs(watched.effort.still - 1.0) < 1e-9
    watched.passes(0.1, used=1e-6)
    assert watched.effort.still == 0, "the shortest work counts"
    watched.passes(0.1)
    watched.passes(0.1, active=True)
    assert watched.effort.still == 0, "it would work if it could"


def test_whoever_looks_seldom_does_not_count_what_it_missed() -> None:
    watched = Watched()
    watched.passes(1000.0)
    assert watched.effort.idle == LONGEST


def test_the_system_tells_work_from_sleep() -> None:
    hard = "import sys\nprint(flush=True)\nwhile True: pass"
    with subprocess.Popen([sys.executable, "-c", hard], stdout=subprocess.PIPE) as worker:
        assert worker.stdout is not None
        worker.stdout.readline()
        used, active = look(worker.pid)
        assert active, "it runs, or would if the others let it"
        while look(worker.pid)[0] < used + 0.02:
            pass
        worker.kill()
    sleep = "import sys\nprint(flush=True)\nsys.stdin.read()"
    with subprocess.Popen(
        [sys.executable, "-c", sleep], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as sleeper:
        assert sleeper.stdout is not None
        sleeper.stdout.readline()
        while look(sleeper.pid)[1]:  # until it has come to its reading
            pass
        sleeper.kill()
    assert look(sleeper.pid) == (0.0, False), "what is gone does nothing"
    assert not look(os.getpid())[1], "the thread that asks does not count"
