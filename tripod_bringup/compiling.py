"""Tells that the simulator's loops are being compiled for this machine, which takes up to a minute the first time."""

import gc
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

PATIENCE = 0.5
"""How long one waits for a compiler without being told [s]."""


@contextmanager
def compiling_told(command: str, say: Callable[[str], None] | None = None) -> Iterator[None]:
    """Tell which loops are compiled while the block runs, as soon as that has taken PATIENCE.

    `say` is given a text for each, "" after the last; without it one line goes to standard error. Nothing is told where
    the compiled loops are all in Numba's cache, which keeps them for this version of the code.
    """
    from numba.core import event  # noqa: PLC0415 - only where something may be compiled

    note = Note(command, say)

    class Listener(event.Listener):
        def on_start(self, found: Any) -> None:
            note.loop(found.data["dispatcher"].py_func.__name__)

        def on_end(self, found: Any) -> None:
            pass

    with event.install_listener("numba:compile", Listener()), garbage_left():
        try:
            yield
        finally:
            if say:
                say("")


@contextmanager
def garbage_left() -> Iterator[None]:
    """Collect no garbage while a loop is compiled: much is made there, none is found, and to look for it takes long."""
    from numba.core import event  # noqa: PLC0415 - only where something may be compiled

    was_enabled: list[bool] = []  # of the loops that are being compiled, each within the one before

    class Listener(event.Listener):
        def on_start(self, found: Any) -> None:
            was_enabled.append(gc.isenabled())
            gc.disable()

        def on_end(self, found: Any) -> None:
            if was_enabled and was_enabled.pop():  # one that began before has not been noted
                gc.enable()

    with event.install_listener("numba:compile", Listener()):
        yield


class Note:
    """What is said of loops that are compiled."""

    def __init__(self, command: str, say: Callable[[str], None] | None) -> None:
        self._command, self._say = command, say
        self._began: float | None = None
        self._count, self._said = 0, False

    def loop(self, name: str) -> None:
        """Note that a loop is compiled from now on."""
        now = time.monotonic()
        self._began = now if self._began is None else self._began
        self._count += 1
        if now - self._began < PATIENCE:
            return
        if self._say:
            self._say(f"compiling for this machine, once: loop {self._count}, {name}")
        elif not self._said:
            words = "compiling the loops of this scene for this machine, once; up to a minute"
            print(f"{self._command}: {words}", file=sys.stderr, flush=True)
        self._said = True
