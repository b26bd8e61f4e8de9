"""The terminal: keys without waiting for Enter, one line redrawn in place, restored whatever happens."""

import atexit
import os
import select
import signal
import sys
import termios
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

from tripod_host.stop import before, no_more

PASTE_MARKS_ON, PASTE_MARKS_OFF = "\x1b[?2004h", "\x1b[?2004l"
CLEAR_LINE = "\r\x1b[K"
LFLAG, IFLAG, CC = 3, 0, 6
UNKNOWN_COLUMNS = 80
"""Of a terminal that does not tell, as a serial console."""


class TerminalError(OSError):
    """There is no terminal, or it is gone; the message says what to do."""


class Terminal:
    """Standard input as a source of single keys; as a context manager it is restored at the end.

    Ctrl-C still interrupts; Ctrl-Z, Ctrl-\\, Ctrl-S and Ctrl-Q are keys like others. Leaving the context restores the
    terminal, so does the end of Python without it; a terminal that is gone is let be.
    """

    def __init__(self, fd: int = 0, *, program: str = "teleop") -> None:
        """Raises TerminalError if there is none; nothing is changed before `enter`.

        `fd`: of the terminal; `program`: which needs it, as the message says it.
        """
        try:
            self._saved: list[Any] = termios.tcgetattr(fd)
        except (termios.error, OSError):
            raise TerminalError(
                f"{program} needs a terminal, and standard input is not one; start it by itself in a terminal, "
                "not from a launch file or a pipe"
            ) from None
        self._fd = fd
        self._entered = False
        self._shown = ""
        self._screen = sys.stdout.isatty()

    def enter(self) -> None:
        """Take keys one by one from now on."""
        self._entered = True
        atexit.register(self.restore)
        before(self.restore)
        self._apply()
        signal.signal(
            signal.SIGCONT, lambda *_: self._apply()
        )  # the shell resets the terminal of a stopped job
        self._write(PASTE_MARKS_ON)

    def restore(self) -> None:
        """Give the terminal back as it was; a second call does nothing."""
        if not self._entered:
            return
        self._entered = False
        atexit.unregister(self.restore)
        no_more(self.restore)
        signal.signal(signal.SIGCONT, signal.SIG_DFL)
        try:
            self._write(PASTE_MARKS_OFF + ("\n" if self._shown else ""))
        finally:
            with suppress(termios.error):  # the terminal is gone
                termios.tcsetattr(self._fd, termios.TCSANOW, self._saved)

    def read(self) -> bytes:
        """Return the bytes that are there, none if there are none; raises TerminalError if the terminal is gone."""
        try:
            ready, _, _ = select.select([self._fd], [], [], 0)
            data = os.read(self._fd, 4096) if ready else None
        except OSError as error:
            raise TerminalError(f"the terminal is gone: {error.strerror}") from None
        if data == b"":
            raise TerminalError("the terminal is gone")
        return data or b""

    def wait(self, timeout: float) -> bool:
        """Wait up to `timeout` [s] until there is something to `read`, or the terminal is gone; return whether so."""
        try:
            return bool(select.select([self._fd], [], [], timeout)[0])
        except (OSError, ValueError):
            return True

    def show(self, line: str) -> None:
        """Draw `line` in place of the last one shown, cut where it would wrap; nothing in it commands the terminal."""
        line = "".join(c if c.isprintable() else "?" for c in line)
        if len(line) > self.width:
            line = line[: self.width - 1] + "…"
        if line != self._shown:
            self._write(CLEAR_LINE + line)
            self._shown = line

    def print(self, text: str) -> None:
        """Write lines above the one that is redrawn."""
        self._write(CLEAR_LINE + text.rstrip("\n") + "\n" + self._shown)

    @property
    def width(self) -> int:
        """Characters that fit on a line without wrapping."""
        try:
            columns = os.get_terminal_size(self._fd).columns
        except OSError:
            columns = 0
        return max(1, (columns or UNKNOWN_COLUMNS) - 1)

    def _apply(self) -> None:
        with suppress(termios.error):  # a terminal that is gone is told by `read`
            self._set_raw()

    def _set_raw(self) -> None:
        raw = termios.tcgetattr(self._fd)
        raw[LFLAG] = raw[LFLAG] & ~(termios.ICANON | termios.ECHO | termios.IEXTEN) | termios.ISIG
        raw[IFLAG] &= ~(termios.IXON | termios.IXOFF | termios.ICRNL | termios.INLCR | termios.IGNCR)
        off = bytes([os.fpathconf(self._fd, "PC_VDISABLE")])
        raw[CC][termios.VMIN], raw[CC][termios.VTIME] = 1, 0
        raw[CC][termios.VINTR] = b"\x03"
        raw[CC][termios.VSUSP] = raw[CC][termios.VQUIT] = off
        termios.tcsetattr(self._fd, termios.TCSANOW, raw)

    def _write(self, text: str) -> None:
        """Write to the screen, unless that would wait: a stuck line must not hold up the robot's commands."""
        if not self._screen:
            return
        with suppress(OSError, ValueError):  # the screen is gone or closed
            fd = sys.stdout.fileno()
            if select.select([], [fd], [], 0)[1]:
                os.write(fd, text.encode(errors="replace"))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.restore()
