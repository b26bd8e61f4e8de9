"""A port kept usable, and the conversation on it: opened, begun, and opened again after a loss."""

from enum import Enum

from tripod_driver.ports.port import Port, PortError
from tripod_driver.session import Session, SessionState


class LinkState(Enum):
    """How far the link is."""

    DISCONNECTED = "disconnected"
    CONNECTING = "connecting"
    READY = "ready"
    FAULT = "fault"


class Link:
    """Keeps a port usable; the caller gives the time and calls `poll` at a regular rate.

    A port that cannot be opened, or is lost, or whose board does not answer, is tried again after `retry_min`, then
    after twice as long each time up to `retry_max`; the first packet that leaves ends that growth. A board that must
    not be driven is a fault: the port is closed, for other programs to use, and stays so until `close`.
    Where nobody answers, a port whose opening resets no board stays open between attempts, and so keeps its name.

    Attributes:
        port: The port.
        session: The conversation on it: the first of those given or, where the board says no word to that, the next.
        state: How far the link is.
        message: Why it is not ready; empty when it is.
        error: Why the servos could not be reached the last time; empty when they were.
    """

    def __init__(
        self, port: Port, session: Session, *others: Session, retry_min: float, retry_max: float
    ) -> None:
        """`others`: to be tried after `session`; `retry_min`, `retry_max`: bounds of the time between attempts [s]."""
        self.port, self.session = port, session
        self._sessions = (session, *others)
        self.state = LinkState.DISCONNECTED
        self.message, self.error = "the port is not open yet", ""
        self._opened = 0
        self._retry_min, self._retry_max = retry_min, retry_max
        self._delay = retry_min
        self._next_attempt = float("-inf")

    @property
    def reconnects(self) -> int:
        """How often the port was opened again."""
        return max(0, self._opened - 1)

    def poll(self, now: float) -> LinkState:
        """Do what is due at `now` [s] and return the state."""
        if self.state is LinkState.DISCONNECTED and now >= self._next_attempt:
            self._attempt(now)
        if self.state in (LinkState.CONNECTING, LinkState.READY):
            self._converse(now)
        return self.state

    def write(self, packet: bytes, now: float) -> bool:
        """Write a packet to the port; on failure give it up, to be tried again later, and return False."""
        try:
            self.port.write(packet)
        except PortError as error:
            self._fail(str(error), now)
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
            self._fail(str(error), now)
            return
        self._opened += 1
        self.state = LinkState.CONNECTING
        self.session = self._sessions[0]
        self.session.begin(now, self.port.boot_time)

    def _converse(self, now: float) -> None:
        session, name = self.session, self.port.name
        try:
            session.hear(self.port.read(), now)
            if due := session.say(now):
                self.port.write(due)
        except PortError as error:
            self._fail(str(error), now)
            return
        match session.state:
            case SessionState.READY:
                self.state, self.message, self.error = LinkState.READY, "", ""
            case SessionState.OPENING:
                self.state, self.message = LinkState.CONNECTING, f"{name} is open; {session.message}"
            case SessionState.LOST if session.unheard and session is not self._sessions[-1]:
                self.session = self._sessions[self._sessions.index(session) + 1]
                self.session.begin(now, 0.0)  # the board has booted by now
            case SessionState.LOST:
                self._fail(f"{name}: {session.message}", now, close=self.port.resets)
            case SessionState.REFUSED:
                self.port.close()
                self.state, self.error = LinkState.FAULT, f"{name}: {session.message}"
                self.message = f"{self.error}; then restart the driver"

    def _fail(self, why: str, now: float, *, close: bool = True) -> None:
        if close:
            self.port.close()
        self._next_attempt = now + self._delay
        self.state = LinkState.DISCONNECTED
        self.message, self.error = f"{why}; next attempt after {self._delay:g} s", why
        self._delay = min(2 * self._delay, self._retry_max)
