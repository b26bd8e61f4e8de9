"""A pseudo-terminal: the stream of packets for another program to read."""

import contextlib
import fcntl
import os
import struct
import termios
import time
import tty
from typing import Final

from tripod_driver.ports.port import Port, PortError

LINGER_TIME: Final = 0.2
"""How long closing waits for a reader to take the last bytes [s]."""

READ_MAX: Final = 4096
"""Bytes that one call of `read` returns at most."""


class PseudoTerminalPort(Port):
    """A pair of terminals: packets written here are read from the device `name`, and answers may be written there.

    Without a reader nothing blocks: when the kernel's buffer is full, what is old in it is dropped.
    """

    resets = False  # it has no line for that, and opened again it would have another name

    def __init__(self) -> None:
        self._ends: tuple[int, int] | None = None

    @property
    def name(self) -> str:
        """The device to read from while open, else "pty"."""
        return "pty" if self._ends is None else os.ttyname(self._ends[1])

    def open(self) -> None:
        """Make the pair, raw: bytes pass unchanged. While it is open, only forget what nobody has read."""
        if self._ends is not None:
            with contextlib.suppress(termios.error):
                self._forget(*self._ends)
            return
        try:
            near, far = os.openpty()
        except OSError as error:
            raise PortError(f"no pseudo-terminal can be opened: {error}") from error
        tty.setraw(far)  # the far end stays open here, so that readers may come and go
        os.set_blocking(near, False)
        self._ends = near, far

    def write(self, data: bytes) -> None:
        """Write `data`, in place of what nobody has read if there is no room."""
        if self._ends is None:
            raise PortError("the pseudo-terminal is not open")
        near, far = self._ends
        try:
            if self._written(near, data) < len(data):
                self._forget(near, far)
                self._written(near, data)
        except (OSError, termios.error) as error:
            raise PortError(f"pseudo-terminal {self.name} was lost: {error}") from error

    def read(self) -> bytes:
        """Return what the other program has written."""
        if self._ends is None:
            raise PortError("the pseudo-terminal is not open")
        try:
            return os.read(self._ends[0], READ_MAX)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise PortError(f"pseudo-terminal {self.name} was lost: {error}") from error

    def close(self) -> None:
        """Wait up to LINGER_TIME for a reader to take the last bytes, and remove the pair."""
        if self._ends is None:
            return
        (near, far), self._ends = self._ends, None
        with contextlib.suppress(OSError):
            deadline = time.monotonic() + LINGER_TIME
            time.sleep(0.01)  # the kernel hands the bytes over by a worker
            while unread(far) and time.monotonic() < deadline:
                time.sleep(0.005)
        for end in (near, far):
            with contextlib.suppress(OSError):
                os.close(end)

    @staticmethod
    def _forget(near: int, far: int) -> None:
        termios.tcflush(near, termios.TCOFLUSH)
        termios.tcflush(far, termios.TCIFLUSH)

    @staticmethod
    def _written(end: int, data: bytes) -> int:
        try:
            return os.write(end, data)
        except BlockingIOError:
            return 0


def unread(end: int) -> int:
    """Return how many bytes wait to be read from the terminal `end`."""
    return int(struct.unpack("i", fcntl.ioctl(end, termios.FIONREAD, b"\0" * 4))[0])
