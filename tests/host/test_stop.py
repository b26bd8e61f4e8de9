"""How a program ends by a signal: at once and without a traceback, or in order where it looks."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tripod_host.effort import look

ROOT = Path(__file__).parents[2]
SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
USER = "import os, signal, sys\nfrom tripod_host import stop\n"
HEAD = USER + "stop.end_at_once()\n"
DEADLINE = 60.0  # [s], for a loaded machine


def clock(reading: str) -> str:
    """Return the line that gives a program a clock of its own instead of that of the machine."""
    return f"import itertools, types; stop.time = types.SimpleNamespace(monotonic={reading})\n"


FAST, STILL = clock("itertools.count().__next__"), clock("lambda: 0.0")
"""Clocks: whose signals are a second apart, or come at the same moment."""


def run(program: str, head: str = HEAD, **more: object) -> subprocess.CompletedProcess[str]:
    """Run a program that has ended the import of what it needs, and sends signals to itself."""
    words = [sys.executable, "-c", head + program]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False, **more)  # type: ignore[call-overload]


@pytest.mark.parametrize("number", SIGNALS)
def test_a_program_with_nothing_to_leave_ends_by_the_signal(number: signal.Signals) -> None:
    done = run(f"os.kill(os.getpid(), {number:d})\nprint('went on')")
    assert (done.returncode, done.stdout, done.stderr) == (-number, "", "")


def test_it_ends_within_a_long_computation_too() -> None:
    """Python runs its own handlers only between two of its instructions."""
    words = [sys.executable, "-c", f"{HEAD}print(flush=True)\nsum(range(10**12))"]
    with subprocess.Popen(
        words, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as program:
        program.stdout.readline()
        begun, end = look(program.pid)[0], time.monotonic() + DEADLINE
        while look(program.pid)[0] < begun + 0.05:  # until it is in the midst of the sum
            assert time.monotonic() < end
            time.sleep(0.01)
        program.send_signal(signal.SIGINT)
        _, errors = program.communicate(timeout=DEADLINE)
    assert (program.returncode, errors) == (-signal.SIGINT, "")


@pytest.mark.parametrize("number", SIGNALS)
def test_what_has_to_be_done_first_is_done_newest_first(number: signal.Signals) -> None:
    program = f"""
stop.before(lambda: print("first"))
stop.before(lambda: 1 / 0)
stop.before(lambda: print("last"))
with stop.first(lambda: print("left before")): pass
os.kill(os.getpid(), {number:d})
while True: pass
"""
    done = run(program)
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "last\nfirst\n", "")


def test_an_act_may_decide_the_exit_code() -> None:
    done = run(
        "stop.before(lambda: True)\nstop.before(lambda: 7)\nos.kill(os.getpid(), 15)\nwhile True: pass"
    )
    assert done.returncode == 7


def test_a_second_signal_ends_an_act_that_does_not() -> None:
    program = """
def hang():
    os.kill(os.getpid(), 15)
    while True: pass
stop.before(hang)
os.kill(os.getpid(), 2)
while True: pass
"""
    done = run(FAST + program, timeout=DEADLINE)
    assert (done.returncode, done.stderr) == (143, "")


def test_signals_are_counted_where_they_are_taken() -> None:
    program = """
with stop.taken() as asked, stop.taken() as same:
    assert same is asked
    os.kill(os.getpid(), 15)
    os.kill(os.getpid(), 2)
    print(asked.count, asked.name, flush=True)
os.kill(os.getpid(), 2)
"""
    for time_between, count in ((STILL, 1), (FAST, 2)):  # those that come together are one
        done = run(time_between + program)
        assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, f"{count} Ctrl-C\n", "")


@pytest.mark.parametrize("number", SIGNALS)
def test_after_the_last_that_a_program_does_a_signal_changes_nothing(number: signal.Signals) -> None:
    program = f"""
import threading
class Late:  # in the midst of Python's own end, which takes handlers away that are functions
    def __del__(self, kill=os.kill, pid=os.getpid()):
        kill(pid, {number:d})
with stop.taken(last=True) as asked:
    os.kill(os.getpid(), 2)
os.kill(os.getpid(), {number:d})
with stop.first(lambda: None):
    os.kill(os.getpid(), {number:d})
os.kill(os.getpid(), {number:d})
threading.late = Late()
print(asked.count)
"""
    done = run(program)
    assert (done.returncode, done.stdout, done.stderr) == (0, "1\n", "")
    program = "with stop.taken(last=True): pass\nos.kill(os.getpid(), 15)"  # nobody had asked it to stop
    assert run(program).returncode == -signal.SIGTERM


def test_nohup_is_obeyed() -> None:
    program = (
        "os.kill(os.getpid(), 1)\nwith stop.taken() as asked: os.kill(os.getpid(), 1)\nprint(asked.count)"
    )
    done = run(program, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    assert (done.returncode, done.stdout) == (0, "0\n")


def test_a_signal_held_back_by_the_launcher_is_let_through() -> None:
    def hold() -> None:
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        os.kill(os.getpid(), signal.SIGINT)

    done = run("print('went on')", preexec_fn=hold)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


def test_the_program_of_a_user_keeps_its_own_handlers() -> None:
    """In a process of its own: a test before may have imported a program of the suite."""
    program = """
def handlers(): return [signal.getsignal(number) for number in stop.SIGNALS]
before = handlers()
with stop.first(lambda: None): print(handlers() == before)
with stop.taken(): print(signal.getsignal(signal.SIGTERM) in before)
print(handlers() == before)
"""
    done = run(program, USER)
    assert (done.returncode, done.stdout, done.stderr) == (0, "True\nFalse\nTrue\n", "")
