"""A port in memory, for demonstrations and tests: it remembers what it was given, and fails on demand."""

from collections import deque
from enum import Enum, auto
from typing import Protocol

from tripod_driver.ports.port import Port, PortError

MEMORY = 65536
"""Bytes that are remembered."""


class Fault(Enum):
    """What can go wrong with a port."""

    SILENT = auto()
    """Bytes are taken and never arrive; nothing comes back."""
    LATE = auto()
    """Bytes arrive with the next write."""
    SHORT = auto()
    """Half of a write arrives, and the write fails."""
    CORRUPT = auto()
    """Every third byte, either way, arrives with its highest bit flipped."""
    UNPLUGGED = auto()
    """Neither open, write nor read succeeds."""


class Board(Protocol):
    """What is at the other end of a port in memory."""

    def restart(self) -> None:
        """The port was opened, which resets a board."""

    def write(self, data: bytes) -> None:
        """Take bytes that arrived."""

    def read(self) -> bytes:
        """Return what the board has sent since the last call."""


class MockPort(Port):
    """A port in memory.

    Attributes:
        board: What answers; None: nobody.
        fault: What goes wrong now; may be changed at any time.
        opened: How often it was opened.
        is_open: Whether it is open.
    """

    def __init__(self, board: Board | None = None, *, boot_time: float = 0.0) -> None:
        """`boot_time`: see `Port` [s]."""
        self.board = board
        self.boot_time = boot_time
        self.fault: Fault | None = None
        self.opened = 0
        self.is_open = False
        self._arrived: deque[int] = deque(maxlen=MEMORY)
        self._late = b""
        self._counts = {"there": 0, "back": 0}

    @property
    def name(self) -> str:
        """The name "mock"."""
        return "mock"

    @property
    def arrived(self) -> bytes:
        """What arrived at the other end; the last MEMORY bytes of it."""
        return bytes(self._arrived)

    def open(self) -> None:
        """Open, which resets the board; raises PortError while unplugged."""
        if self.fault is Fault.UNPLUGGED:
            raise PortError("mock is unplugged")
        self.opened += 1
        self.is_open = True
        self._late = b""
        if self.board is not None:
            self.board.restart()

    def write(self, data: bytes) -> None:
        """Remember `data` and give it to the board, subject to the fault."""
        self._check()
        late, self._late = self._late, b""
        self._arrive(late)
        if self.fault is Fault.SHORT:
            self._arrive(data[: len(data) // 2])
            raise PortError(f"mock took {len(data) // 2} of {len(data)} bytes")
        if self.fault is Fault.LATE:
            self._late = data
        elif self.fault is Fault.CORRUPT:
            self._arrive(self._corrupted(data, "there"))
        elif self.fault is not Fault.SILENT:
            self._arrive(data)

    def read(self) -> bytes:
        """Return what the board answered, subject to the fault."""
        self._check()
        data = b"" if self.board is None else self.board.read()
        if self.fault is Fault.SILENT:
            return b""
        return self._corrupted(data, "back") if self.fault is Fault.CORRUPT else data

    def close(self) -> None:
        """Close."""
        self.is_open = False

    def _check(self) -> None:
        if not self.is_open:
            raise PortError("mock is not open")
        if self.fault is Fault.UNPLUGGED:
            raise PortError("mock was lost")

    def _arrive(self, data: bytes) -> None:
        self._arrived.extend(data)
        if data and self.board is not None:
            self.board.write(data)

    def _corrupted(self, data: bytes, way: str) -> bytes:
        start = self._counts[way]
        self._counts[way] += len(data)
        return bytes(b ^ 0x80 if (start + i) % 3 == 2 else b for i, b in enumerate(data))
