"""Which programs have a device open, as far as this user may see."""

import os
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Holder:
    """A program that has a device open.

    Attributes:
        pid: Its process.
        program: Its name.
    """

    pid: int
    program: str

    def __str__(self) -> str:
        return f"{self.program} (process {self.pid})"


def holders(device: str, proc: Path = Path("/proc")) -> list[Holder]:
    """Return the programs that have `device` open, this one left out; those of other users stay unseen."""
    real = os.path.realpath(device)
    found = []
    for process in sorted(proc.glob("[0-9]*"), key=lambda p: int(p.name)):
        if int(process.name) != os.getpid() and _has_open(process, real):
            found.append(Holder(int(process.name), _name(process)))
    return found


def _has_open(process: Path, real: str) -> bool:
    try:
        return any(_target(link) == real for link in (process / "fd").iterdir())
    except OSError:  # another user's, or it has just ended
        return False


def _target(link: Path) -> str:
    try:
        return str(link.readlink())
    except OSError:
        return ""


def _name(process: Path) -> str:
    try:
        return (process / "comm").read_text().strip()
    except OSError:
        return "a program"
