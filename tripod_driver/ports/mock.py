"""A port in memory, for demonstrations and tests: it remembers what it was given, and fails on demand."""

from collections import deque
from enum import Enum, auto

from tripod_driver.ports.port import Port, PortError

MEMORY = 65536
"""Bytes that are remembered."""


class Fault(Enum):
    """What can go wrong with a port."""

    SILENT = auto()
    """Bytes are taken and never arrive."""
    LATE = auto()
    """Bytes arrive with the next write."""
    SHORT = auto()
    """Half of a write arrives, and the write fails."""
    CORRUPT = auto()
    """Every third byte arrives with its highest bit flipped."""
    UNPLUGGED = auto()
    """Neither open nor write succeeds."""


class MockPort(Port):
    """A port in memory.

    Attributes:
        fault: What goes wrong now; may be changed at any time.
        opened: How often it was opened.
        is_open: Whether it is open.
    """

    def __init__(self, *, boot_time: float = 0.0) -> None:
        """`boot_time`: see `Port` [s]."""
        self.boot_time = boot_time
        self.fault: Fault | None = None
        self.opened = 0
        self.is_open = False
        self._arrived: deque[int] = deque(maxlen=MEMORY)
        self._late = b""
        self._count = 0

    @property
    def name(self) -> str:
        """The name "mock"."""
        return "mock"

    @property
    def arrived(self) -> bytes:
        """What arrived at the other end; the last MEMORY bytes of it."""
        return bytes(self._arrived)

    def open(self) -> None:
        """Open; raises PortError while unplugged."""
        if self.fault is Fault.UNPLUGGED:
            raise PortError("mock is unplugged")
        self.opened += 1
        self.is_open = True

    def write(self, data: bytes) -> None:
        """Remember `data`, subject to the fault."""
        if not self.is_open:
            raise PortError("mock is not open")
        if self.fault is Fault.UNPLUGGED:
            raise PortError("mock was lost")
        self._arrived.extend(self._late)
        self._late = b""
        if self.fault is Fault.SHORT:
            self._arrived.extend(data[: len(data) // 2])
            raise PortError(f"mock took {len(data) // 2} of {len(data)} bytes")
        if self.fault is Fault.LATE:
            self._late = data
        elif self.fault is Fault.CORRUPT:
            self._arrived.extend(self._corrupted(data))
        elif self.fault is not Fault.SILENT:
            self._arrived.extend(data)

    def close(self) -> None:
        """Close."""
        self.is_open = False

    def _corrupted(self, data: bytes) -> bytes:
        start, self._count = self._count, self._count + len(data)
        return bytes(b ^ 0x80 if (start + i) % 3 == 2 else b for i, b in enumerate(data))
