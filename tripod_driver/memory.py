"""The newest pulses that a board was sent, kept through the death of the driver: in a small file for each board.

This project's firmware with power tells by itself where it left the servos. One that lost its power does not, nor does
the workshop's, and the driver that sent the packets may be gone too, by a crash or by `kill -9`. So the pulses of each
packet are written before it leaves: at most 50 lines of 80 bytes a second, over one another and without `fsync`, a few
microseconds each. The kernel keeps them when the process dies. When the machine dies it may not, so a line of an
earlier boot is only a guess. So is one of a packet that no board acknowledges.
"""

import contextlib
import hashlib
import os
import re
import stat
from binascii import crc32
from collections.abc import Mapping
from pathlib import Path
from typing import Final

Pulses = tuple[int, ...]
"""Pulse width of each servo [0.1 us]."""

LINE_SIZE: Final = 80
"""Bytes of the file of a board with three servos; those of more take whole multiples of it."""

LONGEST: Final = 2 * LINE_SIZE
"""Of a file: ten servos."""

BOOT: Final = Path("/proc/sys/kernel/random/boot_id")

_LINE = re.compile(rb"(tripod place 1 (\S+)((?: \d{1,5})+)) ([0-9a-f]{8}) *\n")


class Memory:
    """The pulses of the newest packet to one board at a time.

    Attributes:
        path: The file; None if there is none.
        warning: Why it does not outlive the process, or did not, in one line; empty if all is well.
    """

    def __init__(self, folder: Path | None = None, *, boot: Path = BOOT) -> None:
        """`folder`: of the files; None: nothing outlives the process. `boot`: where to read which boot this is."""
        self.path: Path | None = None
        self.warning = ""
        self._folder, self._boot = folder, _boot(boot)
        self._board: str | None = None
        self._file: int | None = None
        self._size = 0
        self._pulses: Pulses | None = None
        self._sure = False

    def turn_to(self, board: str) -> None:
        """From now on it is about `board`, a name that is the same each time; empty: this one cannot be recognised."""
        if board == self._board:
            return
        self.close()
        self._board = board
        if not board or self._folder is None:
            return
        self.path = self._folder / _file_name(board)
        try:
            self._file = _opened(self.path)
            found = os.pread(self._file, LONGEST + 1, 0)
            self._size = len(found)
            self._recall(found)
        except OSError as error:
            self._give_up(error)

    def recall(self) -> tuple[Pulses | None, bool]:
        """Return the pulses of the newest packet, None if there is none, and whether they surely are the newest."""
        return self._pulses, self._sure

    def keep(self, pulses: Pulses, *, sure: bool = True) -> None:
        """Take the pulses of the packet that leaves next, or that the board has told to be in force.

        `sure`: whether the board acknowledges its packets, so that these are where the servos are.
        """
        if (pulses, sure) == (self._pulses, self._sure):
            return
        self._pulses, self._sure = pulses, sure
        if self._file is None:
            return
        line = _line(self._boot if sure else "", pulses)
        try:
            os.pwrite(self._file, line, 0)
            if len(line) < self._size:  # it was of more servos
                os.ftruncate(self._file, len(line))
            self._size = len(line)
        except OSError as error:
            self._give_up(error)

    def close(self) -> None:
        """Forget which board it is about; the file keeps what it has."""
        if self._file is not None:
            os.close(self._file)
        self._board = self._file = self._pulses = self.path = None
        self._sure, self.warning = False, ""

    def _recall(self, found: bytes) -> None:
        match = _LINE.fullmatch(found) if len(found) % LINE_SIZE == 0 else None
        if match is not None and int(match[4], 16) == crc32(match[1]):
            self._pulses = tuple(int(number) for number in match[3].split())
            self._sure = bool(self._boot) and match[2] == self._boot.encode("ascii")
        elif found:
            self.warning = (
                f"{self.path} is damaged, so the positions of the servos are unknown; it begins with "
                f"{found[:16]!r}. The first motion is slow"
            )
        if match is None and self._file is not None:
            os.ftruncate(self._file, 0)

    def _give_up(self, error: OSError) -> None:
        """Say why there is no file, and leave none behind that is no longer true."""
        if self._file is not None:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, 0)
            os.close(self._file)
        why = error.strerror or error
        self.warning = f"{self.path}: {why}; the positions of the servos will be unknown after a crash"
        self._file = self.path = None


def state_folder(environment: Mapping[str, str]) -> Path | None:
    """Return the folder of the files: in XDG_STATE_HOME, else in ~/.local/state; None if there is no home."""
    given = environment.get("XDG_STATE_HOME", "")
    if given and Path(given).is_absolute():
        return Path(given) / "tripod"
    try:
        return Path.home() / ".local" / "state" / "tripod"
    except RuntimeError:
        return None


def _boot(path: Path) -> str:
    try:
        words = path.read_text("ascii").split()
    except (OSError, ValueError):
        return ""
    return words[0][:36] if words else ""


def _file_name(board: str) -> str:
    """Return a name for any text: the readable part of it, and a digest that tells apart what is equal there."""
    digest = hashlib.sha256(board.encode("utf-8", "surrogateescape")).hexdigest()[:12]
    return f"place-{re.sub(r'[^A-Za-z0-9]+', '-', board).strip('-')[-40:]}-{digest}"


def _line(boot: str, pulses: Pulses) -> bytes:
    numbers = " ".join(map(str, pulses))
    text = f"tripod place 1 {boot or 'unknown'} {numbers}".encode("ascii")
    whole = b"%s %08x" % (text, crc32(text))
    return whole.ljust(-(-(len(whole) + 1) // LINE_SIZE) * LINE_SIZE - 1) + b"\n"


def _opened(path: Path) -> int:
    """Return the opened file, made if it is absent: a regular one of this user's alone. Raises OSError."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    file = os.open(path, flags, 0o600)
    found = os.fstat(file)
    wrong = ""
    if not stat.S_ISREG(found.st_mode):
        wrong = "it is not a regular file"
    elif found.st_uid != os.geteuid():
        wrong = f"it belongs to user {found.st_uid}, not to {os.geteuid()}"
    elif found.st_mode & 0o077 or found.st_nlink != 1:
        wrong = f"its mode is {stat.S_IMODE(found.st_mode):o} with {found.st_nlink} links, not 600 with one"
    if wrong:
        os.close(file)
        raise OSError(f"{wrong}; remove the file")
    return file
