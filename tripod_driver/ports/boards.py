"""Which serial port is the board: known USB identities, and messages that list what is there."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from serial.tools.list_ports import comports

from tripod_driver.ports.port import PortError

BOARDS: Final[dict[tuple[int, int], str]] = {
    (0x2341, 0x0001): "Arduino Uno",
    (0x2341, 0x0043): "Arduino Uno",
    (0x2341, 0x0243): "Arduino Uno",
    (0x2A03, 0x0043): "Arduino Uno",
    (0x2341, 0x0069): "Arduino Uno R4 Minima",
    (0x2341, 0x1002): "Arduino Uno R4 WiFi",
    (0x2341, 0x0010): "Arduino Mega 2560",
    (0x2341, 0x0042): "Arduino Mega 2560",
    (0x2A03, 0x0042): "Arduino Mega 2560",
    (0x2341, 0x8036): "Arduino Leonardo",
    (0x2341, 0x8037): "Arduino Micro",
    (0x2341, 0x0058): "Arduino Nano Every",
    (0x1A86, 0x7523): "CH340",
    (0x1A86, 0x5523): "CH341",
    (0x1A86, 0x55D4): "CH9102",
    (0x0403, 0x6001): "FTDI FT232R",
    (0x0403, 0x6015): "FTDI FT231X",
    (0x10C4, 0xEA60): "CP210x",
    (0x067B, 0x2303): "PL2303",
}
"""Vendor and product identity of the boards and USB bridges that the robot is built with."""

WITHOUT_RESET: Final = frozenset({(0x2341, 0x0069), (0x2341, 0x1002), (0x2341, 0x8036), (0x2341, 0x8037)})
"""Those of them that have no reset line from USB: they run on when their port is opened."""

BY_ID: Final = Path("/dev/serial/by-id")


@dataclass(frozen=True)
class FoundPort:
    """A serial port of this machine.

    Attributes:
        device: Path of the device.
        vid: USB vendor identity, None if the port is not on USB.
        pid: USB product identity.
        product: What the device says that it is.
        by_id: Path that stays the same after a replug, empty if there is none.
        serial_number: What tells this USB device from others of its kind, empty if nothing does.
    """

    device: str
    vid: int | None = None
    pid: int | None = None
    product: str = ""
    by_id: str = ""
    serial_number: str = ""

    @property
    def identity(self) -> str:
        """What tells the board from others: its USB identity or, without a number in it, the name of the port too."""
        usb = "" if self.vid is None else f"{self.vid:04X}:{self.pid or 0:04X}"
        return f"{usb}:{self.serial_number}" if usb and self.serial_number else f"{usb}:{self.device}"

    @property
    def has_reset_line(self) -> bool:
        """Whether DTR, which rises when the port is opened, resets the board, as on an Uno or a Nano."""
        return self.vid is not None and (self.vid, self.pid) not in WITHOUT_RESET

    @property
    def board(self) -> str:
        """The known board, empty if it is none."""
        return BOARDS.get((self.vid, self.pid), "") if self.vid is not None and self.pid is not None else ""

    def __str__(self) -> str:
        if self.vid is None:
            return f"{self.device} (not USB)"
        words = [f"{self.vid:04X}:{self.pid or 0:04X}", self.board or self.product, self.by_id]
        return f"{self.device} ({', '.join(w for w in words if w)})"


def serial_ports(by_id: Path = BY_ID) -> list[FoundPort]:
    """Return the serial ports of this machine, by device name."""
    links = {str(link.resolve()): str(link) for link in sorted(by_id.glob("*"))}
    return [
        FoundPort(p.device, p.vid, p.pid, p.product or "", links.get(p.device, ""), p.serial_number or "")
        for p in sorted(comports(), key=lambda p: p.device)
    ]


def find_board(ports: Sequence[FoundPort], option: str = "--set port=PATH") -> FoundPort:
    """Return the only port with a known board; raise PortError, listing what there is, if it is not one.

    `option`: what names a port, as the message says it.
    """
    boards = [p for p in ports if p.board]
    if len(boards) == 1:
        return boards[0]
    if boards:
        raise PortError(f"{len(boards)} boards found: {listing(boards)}; choose one with {option}")
    raise PortError(f"no board found; serial ports: {listing(ports)}; plug it in or give {option}")


def listing(ports: Sequence[FoundPort]) -> str:
    """Return the ports in one line."""
    return "; ".join(map(str, ports)) or "none"
