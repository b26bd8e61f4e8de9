"""A simulated board at a pseudo-terminal, for programs that open a port; its virtual time follows the clock."""

import os
import select
import threading
import time
import tty

from tests.firmware.simulated_board import Pulse, SimulatedBoard

LOOK = 0.001
"""Time between two looks at the line [s]."""

CATCH_UP = 0.02
"""The board runs no further than this at once [s]: on a busy machine its time is late, and no byte waits long."""

TAKE = 0.1
"""Time between two looks at the pulses [s, virtual]: the simulator keeps few."""


class TerminalBoard:
    """Passes bytes between a pseudo-terminal and a simulated board whose time goes on while its thread runs.

    Attributes:
        path: What a program opens.
        heard: What the program has written so far.
        heard_at: The board's time when the last of it came [s].
    """

    def __init__(self, board: SimulatedBoard) -> None:
        self._board, self._lock, self._stop = board, threading.Lock(), threading.Event()
        self._pulses: list[Pulse] = []
        self.heard, self.heard_at = b"", 0.0
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        self.path = os.ttyname(self._theirs)
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    @property
    def now(self) -> float:
        """The board's time [s]."""
        with self._lock:
            return self._board.now

    def close(self) -> None:
        """Stop the board and remove the pseudo-terminal."""
        self._stop.set()
        self._thread.join()
        os.close(self._ours)
        os.close(self._theirs)

    def pulses(self) -> list[Pulse]:
        """Return all pulses so far."""
        with self._lock:
            self._pulses += self._board.pulses()
            return list(self._pulses)

    def reset(self) -> None:
        """Press the reset button."""
        with self._lock:
            self._board.reset()
            self._pulses += self._board.pulses()

    def _serve(self) -> None:
        last, taken = time.monotonic(), 0.0
        while not self._stop.is_set():
            readable, _, _ = select.select([self._ours], [], [], LOOK)
            last, before = time.monotonic(), last
            with self._lock:
                if readable:
                    data = os.read(self._ours, 256)
                    self._board.write(data)
                    self.heard, self.heard_at = self.heard + data, self._board.now
                self._board.run(min(last - before, CATCH_UP))
                if count := self._board.in_waiting:
                    os.write(self._ours, self._board.read(count))
                if self._board.now > taken + TAKE:
                    taken = self._board.now
                    self._pulses += self._board.pulses()
