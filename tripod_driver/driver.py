"""The driver without ROS: a link, what may leave on it, and when packets are due. The caller gives the time."""

from tripod_driver.link import Link, LinkState
from tripod_driver.safety import Safety
from tripod_driver.session import Content
from tripod_graph.names import SERVOS

RESEND: float = 0.1
"""A packet that is not acknowledged is sent again after this time [s], where packets are acknowledged."""

WATCHDOG_SHARE: float = 0.3
"""Part of the board's watchdog time after which an unchanged packet is sent again at the latest: two may be lost."""

JITTER: float = 0.125
"""A packet may leave so much too early, in periods, if the one before it was as much too late."""


class Driver:
    """Carries what `Safety` allows to the board.

    A packet leaves when its numbers change, at most one each `period`, and the last one again after `keep_alive`, or
    sooner if the watchdog of the board is short or the packet was not acknowledged.

    Attributes:
        link: The port and the conversation on it.
        safety: What may be sent.
        packets_sent: Packets handed to the port.
        bytes_sent: Their bytes.
    """

    def __init__(self, link: Link, safety: Safety, *, keep_alive: float = 0.1, period: float = 0.02) -> None:
        """Begin disconnected and inactive.

        Args:
            link: The port and the conversation on it.
            safety: What may be sent.
            keep_alive: Longest time between two packets [s].
            period: Shortest time between two changes, on average [s].
        """
        self.link, self.safety = link, safety
        self.packets_sent, self.bytes_sent = 0, 0
        self._period, self._keep_alive = period, keep_alive
        self._connected = False
        self._wanted: Content | None = None
        self._content: Content | None = None
        self._sent_at = self._due = float("-inf")
        self._sent = (float("nan"),) * len(SERVOS)

    @property
    def sent(self) -> tuple[float, ...]:
        """Angles in the last packet, after rounding [rad], shape (3,); NaN before the first."""
        return self._sent

    @property
    def at_rest(self) -> bool:
        """Whether the servos are where they should be, as far as the board tells."""
        arrived = self._content is not None and self._content == self._wanted and self.link.session.settled
        return arrived and self.safety.at_rest

    def connect(self) -> None:
        """Let `tick` open the port, and open it again whenever it is lost; a fault is forgotten."""
        self._connected = True
        self.safety.clear()
        if self.link.state is LinkState.FAULT:
            self.link.close()

    def disconnect(self, now: float) -> None:
        """Close the port and give no more angles."""
        self._connected = False
        self._content = None
        self.safety.deactivate()
        self.link.close()
        self.safety.disconnected(now, self.link.message)

    def tick(self, now: float) -> bool:
        """Do what is due at `now` [s]; return whether a packet was sent. Call it at least at the packet rate."""
        if not self._connected or not self._poll(now):
            return False
        angles = self.safety.setpoint(now)
        if angles is None:
            return False
        content = self._wanted = self.link.session.content([float(angle) for angle in angles])
        if now < self._due:
            return False
        changed = content != self._content
        if not changed and now + self._period <= self._sent_at + self._patience():
            return False
        packet = self.link.session.packet(content, now)
        if not self.link.write(packet, now):
            self.safety.disconnected(now, self.link.message)
            return False
        self._content, self._sent_at, self._sent = content, now, self.link.session.angles(content)
        if changed:  # nothing new has to wait for a packet that only keeps the board's watchdog quiet
            self._due = max(self._due, now - JITTER * self._period) + self._period
        self.packets_sent += 1
        self.bytes_sent += len(packet)
        return True

    def _patience(self) -> float:
        """Return how long the newest packet is good for [s]."""
        session = self.link.session
        longest = self._keep_alive if session.settled else min(RESEND, self._keep_alive)
        return longest if session.watchdog is None else min(longest, WATCHDOG_SHARE * session.watchdog)

    def _poll(self, now: float) -> bool:
        """Converse with the board and tell `safety` how it is; return whether packets may be written."""
        before, state = self.link.state, self.link.poll(now)
        session = self.link.session
        if session.interruption:
            self.safety.interrupt(now, session.interruption)
            session.interruption = ""
        match state:
            case LinkState.DISCONNECTED:
                self.safety.disconnected(now, self.link.message)
            case LinkState.CONNECTING:
                self.safety.connecting(now, self.link.message)
            case LinkState.FAULT:
                self.safety.fault(now, self.link.message)
            case LinkState.READY if before is not LinkState.READY:
                self._content = None
                self.safety.ready(now, session.position)
        return state is LinkState.READY
