"""What every port can do."""

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self


class PortError(OSError):
    """A port that cannot be opened or that was lost; the message names it and says what to do."""


class Port(ABC):
    """A way for bytes to the servos and back. `with port:` opens it and closes it whatever happens inside.

    Attributes:
        boot_time: Time after opening in which the board may lose bytes [s].
        resets: Whether opening it has reset the board, as far as the port can tell. Then opening it again may help
            where nobody answers.
    """

    boot_time: float = 0.0
    resets: bool = True

    @property
    @abstractmethod
    def name(self) -> str:
        """The device while open, else what was asked for."""

    @property
    def identity(self) -> str:
        """What tells this board from others while open, the same after a replug; empty if nothing does."""
        return ""

    @abstractmethod
    def open(self) -> None:
        """Open the port, without waiting for the board to boot; raise PortError if that fails."""

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Hand over all of `data`, or raise PortError within a short time: the port is then lost."""

    @abstractmethod
    def read(self) -> bytes:
        """Return what has come from the board since the last call, at once; raise PortError if the port is lost."""

    @abstractmethod
    def close(self) -> None:
        """Let what was written leave, within a bounded time, and release the port; never raises."""

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
