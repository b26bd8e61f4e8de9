"""`tripod flash`: write the firmware to the board, by avrdude."""

import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from tripod_driver.ports.boards import find_board, serial_ports
from tripod_driver.ports.holders import holders
from tripod_driver.ports.port import PortError
from tripod_driver.ports.serial_port import AUTO

FIRMWARE: Final = Path(__file__).resolve().parents[1] / "firmware"
INSTALL: Final = "avrdude is not installed; to install: sudo apt-get install avrdude"
BAD_ARGUMENTS: Final = 2


class FlashError(Exception):
    """The firmware cannot be written; the message says why and what to do."""


def firmware_file(given: Path | None) -> Path:
    """Return the file to write: the one `given`, else what `make -C firmware` makes. Raises FlashError."""
    file = FIRMWARE / "build" / "tripod.hex" if given is None else given
    if not file.is_file():
        where = (
            f"make -C {FIRMWARE}" if FIRMWARE.is_dir() else "make -C firmware, in a checkout of the project"
        )
        raise FlashError(f"no firmware file {file}; build it: {where}")
    if file.suffix not in (".hex", ".elf"):
        raise FlashError(f"firmware {file} must be a .hex or .elf file")
    return file


def flash_arguments(avrdude: str, file: Path, port: str, baud: int) -> list[str]:
    """Return the command line that writes `file` to an ATmega328P with Arduino's boot loader, and verifies it."""
    form = "e" if file.suffix == ".elf" else "i"
    return [avrdude, "-p", "atmega328p", "-c", "arduino", "-P", port, "-b", str(baud), "-D",
            "-U", f"flash:w:{file}:{form}"]  # fmt: skip


def find_port(word: str) -> str:
    """Return the device for `word`, a path or `auto`. Raises FlashError, also where another program has it open."""
    try:
        device = find_board(serial_ports(), "--port PATH").device if word == AUTO else word
    except PortError as error:
        raise FlashError(str(error)) from None
    if not Path(device).exists():
        raise FlashError(f"{device} does not exist; `tripod doctor` lists the ports")
    if holding := holders(device):
        raise FlashError(f"{device} is in use by {', '.join(map(str, holding))}; stop that program first")
    return device


def flash_command(
    port: str,
    file: Path | None,
    *,
    baud: int,
    dry_run: bool = False,
    which: Callable[[str], str | None] = shutil.which,
    run: Callable[[Sequence[str]], int] = subprocess.call,
) -> int:
    """Write the firmware and return the exit code: 0, 2 where something is missing, else that of avrdude."""
    try:
        avrdude = which("avrdude")
        if avrdude is None:
            raise FlashError(INSTALL)
        command = flash_arguments(avrdude, firmware_file(file), find_port(port), baud)
    except FlashError as error:
        print(f"tripod flash: {error}", file=sys.stderr)
        return BAD_ARGUMENTS
    print(" ".join(command), flush=True)
    if dry_run:
        return 0
    code = run(command)
    if code:
        advice = (
            "an old boot loader (many Nanos) needs --baud 57600" if baud != 57600 else "try without --baud"
        )
        print(f"tripod flash: avrdude failed with code {code}; {advice}", file=sys.stderr)
    else:
        print("written; `tripod doctor --ask` shows which firmware answers")
    return code
