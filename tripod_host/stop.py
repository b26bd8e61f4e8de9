"""How a process ends when it is asked to, by Ctrl-C, SIGTERM or the loss of its terminal (SIGHUP).

There are two ways, and a program is in one of them from its first line on:

- It ends at once, by the signal itself, as a program in C would: a shell shows 130, 143 or 129. No exception is raised
  in the midst of whatever runs, so there is no traceback. Where something has to be done first (to restore a terminal,
  to remove a half-written file), that is an act registered by `first`, and those numbers are the exit code.
- Between the `with` of `taken` signals are only counted, and the program leaves in order when it looks at the count.
"""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import FrameType
from typing import Final

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

Act = Callable[[], object]
"""Something to do before the process ends; an int that it returns is the exit code, which else tells the signal."""


@dataclass
class Asked:
    """How often the process was asked to stop.

    Signals that come together count as one: `make` passes on what the terminal has already sent to everybody.

    Attributes:
        together: Signals closer than this are one [s].
        count: How often.
        name: By what the last time, for people.
    """

    together: float = 0.5
    count: int = 0
    name: str = ""
    _last: float = float("-inf")

    def once_more(self, number: int) -> None:
        """Count the signal `number`."""
        now = time.monotonic()
        if now > self._last + self.together:
            self.count += 1
            self._last = now
        self.name = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name


class _Process:
    """What this process does with signals.

    Attributes:
        ours: Whether it is a program of the suite, which `end_at_once` began; else signals are left alone.
        acts: To do before it ends at once, the newest first.
        asked: Where signals are counted; None where they end it.
    """

    ours = False
    acts: list[Act] = []  # noqa: RUF012 - there is one process
    asked: Asked | None = None


def end_at_once() -> None:
    """Make each of the signals end this process by itself; the first line of every program, before its imports.

    It also lets through those that the launcher has kept back until now.
    """
    _Process.ours = True
    _install()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)


@contextmanager
def first(act: Act) -> Iterator[None]:
    """Do `act` before a signal ends the process, as long as the block runs. It must be short, and may come anywhere."""
    before(act)
    try:
        yield
    finally:
        no_more(act)


def before(act: Act) -> None:
    """Do `act` before a signal ends the process, until `no_more`."""
    _Process.acts.append(act)
    _install()


def no_more(act: Act) -> None:
    """Forget an act."""
    if act in _Process.acts:
        _Process.acts.remove(act)
    _install()


@contextmanager
def taken(*, last: bool = False) -> Iterator[Asked]:
    """Count signals instead of ending by them, as long as the block runs; in the main thread. May be nested.

    Where it is the `last` that the program does, and was asked to stop, a signal that comes later changes nothing: it
    has stopped, and only Python has to go.
    """
    if _Process.asked is not None:
        yield _Process.asked
        return
    kept = {number: signal.getsignal(number) for number in SIGNALS}
    asked = _Process.asked = Asked()
    for number in _heeded():
        signal.signal(number, lambda number, _: asked.once_more(number))
    try:
        yield asked
    finally:
        _Process.asked = None
        if last and asked.count:
            _Process.ours = False  # nobody sets handlers any more
            for number in _heeded():  # handlers that are functions Python itself takes away at its end
                signal.signal(number, signal.SIG_IGN)
        else:
            for number, handler in kept.items():
                if handler is not None:  # set by C code
                    signal.signal(number, handler)
            _install()


def _heeded() -> list[signal.Signals]:
    """Return the signals that count: SIGHUP does not under nohup."""
    return [n for n in SIGNALS if n is not signal.SIGHUP or signal.getsignal(n) is not signal.SIG_IGN]


def _install() -> None:
    """Set the handlers for a process that signals end: none at all where there is nothing to do before."""
    main = threading.current_thread() is threading.main_thread()
    if not (_Process.ours and main) or _Process.asked is not None:
        return
    for number in _heeded():
        signal.signal(number, _end if _Process.acts else signal.SIG_DFL)


def _end(number: int, _frame: FrameType | None) -> None:
    """Do the acts, then end by the signal; one that comes later, in the midst of the acts, ends it there."""
    _Process.ours = False  # from here on nobody else sets handlers
    asked = Asked()
    asked.once_more(number)

    def again(number: int, _frame: FrameType | None) -> None:
        asked.once_more(number)
        if asked.count > 1:
            os._exit(128 + number)

    for n in _heeded():
        signal.signal(n, again)
    code = 128 + number
    for act in (*reversed(_Process.acts), sys.stdout.flush):
        with suppress(Exception):  # it may find anything half done
            found = act()
            code = found if type(found) is int else code
    os._exit(code)
