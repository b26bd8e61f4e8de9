"""A real serial port, by path or found by the USB identity of the board."""

import contextlib
import errno
import grp
import termios
import time
from pathlib import Path
from typing import Final

import serial

from tripod_driver.ports.boards import FoundPort, find_board, listing, serial_ports
from tripod_driver.ports.holders import holders
from tripod_driver.ports.port import Port, PortError

AUTO: Final = "auto"
"""In place of a path: the one port with a known board."""

DRAIN_TIME: Final = 0.2
"""How long closing waits for the last bytes to leave [s]; the kernel itself would wait up to 30 s."""

READ_MAX: Final = 4096
"""Bytes that one call of `read` returns at most: a board that babbles must not hold up the rest."""


class SerialPort(Port):
    """A serial port, held exclusively.

    Opening raises DTR, which resets an Arduino: the boot loader swallows what arrives in `boot_time`. The board runs on
    where DTR is up already, since another program has the port open or none let it fall (`stty -hupcl`), where no line
    leads from it to the board's reset, or where the user says so by a `boot_time` of 0.
    """

    resets = False

    def __init__(
        self, path: str, *, baud: int = 115200, boot_time: float = 2.0, write_timeout: float = 0.05
    ) -> None:
        """Keep the settings; nothing is opened yet.

        Args:
            path: Device, or `AUTO`.
            baud: Bits a second.
            boot_time: See `Port` [s].
            write_timeout: A port that takes no bytes for so long is lost [s].
        """
        self.boot_time = boot_time
        self._path, self._baud, self._write_timeout = path, baud, write_timeout
        self._serial: serial.Serial | None = None

    @property
    def name(self) -> str:
        """The device while open, else what was asked for."""
        return self._path if self._serial is None else str(self._serial.port)

    @property
    def identity(self) -> str:
        """The USB identity of the board or, of what is no port of this machine, the device as long as it exists."""
        if self._serial is None:
            return ""
        if found := self._found():
            return found.identity
        device = Path(self.name).resolve()
        try:
            return f"{device}@{device.stat().st_ctime_ns}"  # a pseudo-terminal: the next one may have the same name
        except OSError:
            return ""

    def open(self) -> None:
        """Open the port; raise PortError with the reason and the remedy."""
        self.close()
        path = find_board(serial_ports()).device if self._path == AUTO else self._path
        try:
            self._serial = serial.Serial(
                path, self._baud, timeout=0, write_timeout=self._write_timeout, exclusive=True
            )
        except (OSError, ValueError, termios.error) as error:  # SerialException is an OSError
            raise PortError(reason_not_opened(path, error)) from error
        self.resets = self._has_raised_reset_line()

    def _has_raised_reset_line(self) -> bool:
        """Return whether DTR has risen as the port was opened, and resets the board."""
        found = self._found()
        if self._serial is None or self.boot_time == 0 or found is None or not found.has_reset_line:
            return False
        try:
            fell = bool(
                termios.tcgetattr(self._serial.fd)[2] & termios.HUPCL
            )  # when the port was closed last
        except termios.error:
            return False
        return fell and not holders(self.name)

    def _found(self) -> FoundPort | None:
        """Return what is known of the open device; None if it is no port of this machine."""
        device = str(Path(self.name).resolve())
        return next((port for port in serial_ports() if port.device == device), None)

    def write(self, data: bytes) -> None:
        """Hand over all of `data`; raise PortError if the port does not take it in time or is gone."""
        if self._serial is None:
            raise PortError(f"{self._path} is not open")
        try:
            self._serial.write(data)
        except serial.SerialTimeoutException as error:
            message = (
                f"{self.name} accepted no data for {self._write_timeout:g} s; is the board running? Check "
                "cable and power"
            )
            raise PortError(message) from error
        except (OSError, termios.error) as error:
            raise PortError(f"{self.name} was lost ({error}); check cable and power") from error

    def read(self) -> bytes:
        """Return what has come, at most READ_MAX bytes of it; raise PortError if the port is gone."""
        if self._serial is None:
            raise PortError(f"{self._path} is not open")
        try:
            return bytes(self._serial.read(READ_MAX))
        except (OSError, TypeError, termios.error) as error:  # TypeError: pyserial of a port closed under it
            raise PortError(f"{self.name} was lost ({error}); check cable and power") from error

    def close(self) -> None:
        """Let the last bytes leave within DRAIN_TIME and release the port."""
        if self._serial is None:
            return
        port, self._serial = self._serial, None
        with contextlib.suppress(OSError, termios.error):
            deadline = time.monotonic() + DRAIN_TIME
            while port.out_waiting:
                if time.monotonic() > deadline:
                    port.reset_output_buffer()
                    break
                time.sleep(0.001)
        with contextlib.suppress(OSError, termios.error):
            port.close()


def reason_not_opened(path: str, error: Exception) -> str:
    """Return why `path` could not be opened and what to do about it."""
    inner = error.__context__  # pyserial puts into words what the system says of a setting
    number = inner.args[0] if isinstance(inner, termios.error) else getattr(error, "errno", None)
    if number in (errno.ENOTTY, errno.EISDIR):
        return f"{path} is not a serial port; serial ports: {listing(serial_ports())}"
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return f"{path} does not exist; serial ports: {listing(serial_ports())}"
    if number in (errno.EACCES, errno.EPERM):
        group = group_of(path)
        return f"no permission to open {path}; run: sudo usermod -aG {group} $USER, then log out and in again"
    if number in (errno.EAGAIN, errno.EBUSY):
        who = ", ".join(map(str, holders(path))) or "another program"
        return f"{path} is in use by {who}; stop that program"
    return f"{path} cannot be used as a serial port: {error}"


def group_of(path: str) -> str:
    """Return the group that may open the device: usually `dialout`."""
    try:
        name = grp.getgrgid(Path(path).stat().st_gid).gr_name
    except (OSError, KeyError):
        return "dialout"
    return "dialout" if name == "root" else name
