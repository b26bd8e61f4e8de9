"""Wakes the node when keys come: an executor waits for messages and timers, not for a terminal."""

import threading
from collections.abc import Callable

from tripod_teleop.terminal import Terminal

PATIENCE = 0.1
"""Longest time that the thread needs to notice its end [s]."""


class KeyWaiter:
    """A thread that calls `wake` when keys wait to be read, once until they are `taken`. It reads none itself."""

    def __init__(self, terminal: Terminal, wake: Callable[[], None]) -> None:
        """`wake` is called from the thread."""
        self._terminal, self._wake = terminal, wake
        self._taken, self._ended = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="keys", daemon=True)

    def start(self) -> None:
        """Begin to wait."""
        self._thread.start()

    def taken(self) -> None:
        """The keys were read: wait for the next."""
        self._taken.set()

    def stop(self) -> None:
        """End the thread; `wake` is not called any more when this returns."""
        self._ended.set()
        self._taken.set()
        if self._thread.is_alive():
            self._thread.join(10 * PATIENCE)

    def _run(self) -> None:
        while not self._ended.is_set():
            if self._terminal.wait(PATIENCE) and not self._ended.is_set():
                self._taken.clear()
                self._wake()
                self._taken.wait(PATIENCE)
