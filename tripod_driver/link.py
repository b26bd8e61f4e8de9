"""A port kept usable: opened, given time to boot, and opened again after a loss."""

from enum import Enum

from tripod_driver.ports.port import Port, PortError


class LinkState(Enum):
    """How far the link is."""

    DISCONNECTED = "disconnected"
    CONNECTING = "connecting"
    READY = "ready"


class Link:
    """Keeps a port usable; the caller gives the time and calls `poll` at a regular rate.

    A port that cannot be opened, or is lost, is tried again after `retry_min`, then after twice as long each
    time up to `retry_max`; the first write that succeeds ends that growth.

    Attributes:
        port: The port.
        state: How far the link is.
        message: Why it is not ready; empty when it is.
    """

    def __init__(self, port: Port, *, retry_min: float, retry_max: float) -> None:
        """`retry_min`, `retry_max`: shortest and longest time between two attempts [s]."""
        self.port = port
        self.state = LinkState.DISCONNECTED
        self.message = "the port was not opened yet"
        self._opened = 0
        self._retry_min, self._retry_max = retry_min, retry_max
        self._delay = retry_min
        self._next_attempt = float("-inf")
        self._ready_at = 0.0

    @property
    def reconnects(self) -> int:
        """How often the port was opened again."""
        return max(0, self._opened - 1)

    def poll(self, now: float) -> LinkState:
        """Do what is due at `now` [s] and return the state."""
        if self.state is LinkState.DISCONNECTED and now >= self._next_attempt:
            self._attempt(now)
        if self.state is LinkState.CONNECTING and now >= self._ready_at:
            self.state, self.message = LinkState.READY, ""
        return self.state

    def write(self, data: bytes, now: float) -> bool:
        """Write to the port; on failure give it up, to be tried again later, and return False."""
        try:
            self.port.write(data)
        except PortError as error:
            self._fail(error, now)
            return False
        self._delay = self._retry_min
        return True

    def close(self) -> None:
        """Close the port; the next `poll` would open it again."""
        self.port.close()
        self.state, self.message = LinkState.DISCONNECTED, "the port is closed"
        self._next_attempt, self._delay = float("-inf"), self._retry_min

    def _attempt(self, now: float) -> None:
        try:
            self.port.open()
        except PortError as error:
            self._fail(error, now)
            return
        self._opened += 1
        self._ready_at = now + self.port.boot_time
        self.state = LinkState.CONNECTING
        self.message = f"{self.port.name} is open; the board starts within {self.port.boot_time:g} s"

    def _fail(self, error: PortError, now: float) -> None:
        self.port.close()
        self._next_attempt = now + self._delay
        self.state = LinkState.DISCONNECTED
        self.message = f"{error}; next attempt after {self._delay:g} s"
        self._delay = min(2 * self._delay, self._retry_max)
