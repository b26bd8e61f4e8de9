"""The driver without ROS: a link, what may leave on it, and when packets are due. The caller gives the time."""

from collections.abc import Sequence

import numpy as np

from tripod_driver.link import Link, LinkState
from tripod_driver.memory import Memory
from tripod_driver.place import Place
from tripod_driver.safety import PULSE_PERIOD, Safety
from tripod_driver.session import Content

WATCHDOG_SHARE: float = 0.3
"""Part of the board's watchdog time after which an unchanged packet is sent again at the latest: two may be lost."""

PACE: float = 1.01
"""Distance of two changes in periods: clocks of boards are right to half a percent, and no pulse may skip a packet."""

TRIPS: float = 1.5
"""A packet counts as lost when it is not acknowledged after so many times the last round trip, and a period."""

LATEST: float = 0.28
"""It counts as lost at the latest after this time [s], before silence ends the conversation."""

INCIDENT_TIME: float = 10.0
"""What the board did by itself stays in the message for so long [s]: a stream of commands goes on at once."""


class Driver:
    """Carries what `Safety` allows to the board.

    A packet leaves when its numbers change, at most one each `period`, and the last one again after `keep_alive`, or
    sooner if the watchdog of the board is short. Where packets are acknowledged the next change waits for that of the
    last, which is sent again in the meantime: so the board is never further than one packet from what it has told, and
    whoever knows the newest packet knows the place of the servos. `memory` does, also when this process is killed.

    Attributes:
        link: The port and the conversation on it.
        safety: What may be sent.
        memory: The newest packet, for a board that has forgotten it.
        period: Shortest time between two changes [s].
        keep_alive: Longest time between two packets [s].
        wanted: Whether the port should be open; else it is closed on purpose.
        incidents: How often the board did something by itself: a reset, its watchdog.
        incident: The newest of these, for people.
        packets_sent: Packets handed to the port.
        bytes_sent: Their bytes.
    """

    def __init__(
        self,
        link: Link,
        safety: Safety,
        *,
        keep_alive: float = 0.1,
        period: float = PULSE_PERIOD,
        memory: Memory | None = None,
    ) -> None:
        """Begin disconnected and inactive.

        Args:
            link: The port and the conversation on it.
            safety: What may be sent.
            keep_alive: Longest time between two packets [s].
            period: Shortest time between two changes [s].
            memory: See there; None: one that forgets when the process ends.
        """
        self.link, self.safety = link, safety
        self.memory = Memory() if memory is None else memory
        self.incidents, self.incident, self._incident_at = 0, "", float("-inf")
        self.packets_sent, self.bytes_sent = 0, 0
        self.period, self.keep_alive = period, keep_alive
        self.wanted = False
        self._now = float("-inf")
        self._content: Content | None = None
        self._firm: Content | None = None  # the newest that is acknowledged, in this conversation
        self._sent_at = self._due = float("-inf")
        self._sent = (float("nan"),) * len(safety.joints)
        self._place: Place | None = None
        self._homing = False  # the board was told to begin

    @property
    def sent(self) -> tuple[float, ...]:
        """Joint values in the last packet, after rounding [rad, m, Pa], shape (n,); NaN before the first."""
        return self._sent

    @property
    def at_rest(self) -> bool:
        """Whether the servos are where they should be, as far as the board tells."""
        session = self.link.session
        return session.settled and self._content == session.content(self.safety.place) and self.safety.at_rest

    @property
    def place_source(self) -> str:
        """Who said where the servos were when the board became ready; empty if nobody did."""
        return "" if self._place is None else self._place.source

    @property
    def message(self) -> str:
        """What is wrong or odd, or went wrong of late, and what to do about it; empty when all is well."""
        recent = self.incident if self._now < self._incident_at + INCIDENT_TIME else ""
        parts = (self.safety.message, recent, self.link.session.odd)
        return "; ".join(dict.fromkeys(filter(None, parts)))

    def connect(self) -> None:
        """Let `tick` open the port, and open it again whenever it is lost; a fault is forgotten."""
        self.wanted = True
        self.safety.clear()
        if self.link.state is LinkState.FAULT:
            self.link.close()

    def disconnect(self, now: float) -> None:
        """Close the port and give no more angles."""
        self.wanted = False
        self._content = None
        self.safety.deactivate()
        self.link.close()
        self.safety.disconnected(now, self.link.message)

    def tick(self, now: float) -> bool:
        """Do what is due at `now` [s]; return whether a packet was sent. Call it at least at the packet rate."""
        self._now = max(now, self._now)
        self.safety.look(now)
        if not self.wanted or not self._poll(now):
            return False
        if self.safety.homing or self._homing:
            return self._home(now)
        if self.link.session.settled:
            self._firm = self._content
        elif self._content is not None and self.safety.can_move:
            return self._again(self._content if self._firm is None else self._firm, now)
        values = None if self.too_early(now) else self.safety.setpoint(now)
        if values is None:
            return False
        content = self.link.session.content([float(value) for value in values])
        if content == self._content and now + self.period <= self._sent_at + self._patience():
            return False
        if content != self._content:  # a change need not wait for a packet that only keeps the watchdog quiet
            self._due = now + PACE * self.period
        return self._send(content, now)

    def _again(self, content: Content, now: float) -> bool:
        """Take back what is not acknowledged in time, and return whether that was now.

        Serial adapters hold answers back, some for 16 ms and more: what is taken back before its answer can come is
        never firm, and nothing moves. A board that has just lost its power has perhaps not even emitted what it
        acknowledged last, so it must not be sent on from there; the first packet that it takes is that one once more.
        """
        if now < self._sent_at + max(self.period, min(TRIPS * (self.link.session.round_trip or 0.0), LATEST)):
            return False
        if content != self._content:
            self.safety.moved(self.link.session.angles(content))
        self._due = now + PACE * self.period  # the board may have the change only from this one
        return self._send(content, now)

    def _home(self, now: float) -> bool:
        """Let the board look for places that it does not know, as long as that is allowed; return False: no packet.

        It continues only while it is told to, and stops at once where it is told so.
        """
        session = self.link.session
        begin, self._homing = not self._homing, self.safety.homing
        if not self._homing:
            self._say(session.hold(now), now)
        elif begin:
            self._say(session.home(now, begin=True), now)
        elif session.settled and now >= self._sent_at + self._patience():
            self._say(session.home(now, begin=False), now)
            if not session.homing:  # it has given up
                self._homing = False
                self.safety.interrupt(now, session.unplaced)
        return False

    def _say(self, data: bytes, now: float) -> None:
        """Write what is no packet."""
        self._content, self._sent_at = None, now
        if data and not self.link.write(data, now):
            self.safety.disconnected(now, self.link.message)

    def too_early(self, now: float) -> bool:
        """Whether a change that is asked for at `now` [s] has to wait for its turn."""
        return now < self._due

    def turn(self, now: float) -> float:
        """Return how long a change that is asked for at `now` [s] has to wait for its turn [s]."""
        return max(0.0, self._due - now)

    def _send(self, content: Content, now: float) -> bool:
        self._remember(content)
        packet = self.link.session.packet(content, now)
        if not self.link.write(packet, now):
            self.safety.disconnected(now, self.link.message)
            return False
        self._content, self._sent_at, self._sent = content, now, self.link.session.angles(content)
        self.packets_sent += 1
        self.bytes_sent += len(packet)
        return True

    def _patience(self) -> float:
        """Return how long the newest packet is good for [s]."""
        watchdog = self.link.session.watchdog
        return self.keep_alive if watchdog is None else min(self.keep_alive, WATCHDOG_SHARE * watchdog)

    def _poll(self, now: float) -> bool:
        """Converse with the board and tell `safety` how it is; return whether packets may be written."""
        before, state = self.link.state, self.link.poll(now)
        session = self.link.session
        if session.incident:
            self.safety.interrupt(now, session.incident)
            self.incidents, self.incident, self._incident_at = self.incidents + 1, session.incident, now
            session.incident = ""
        match state:
            case LinkState.DISCONNECTED:
                self.safety.disconnected(now, self.link.message)
            case LinkState.CONNECTING:
                self.safety.connecting(now, self.link.message)
            case LinkState.FAULT:
                self.safety.fault(now, self.link.message)
            case LinkState.READY if before is not LinkState.READY:
                self._content = self._firm = None
                self._homing = False
                self._place = self._found()
                self.safety.ready(now, self._place)
        if state is LinkState.READY:
            self.safety.unplaced(session.unplaced)
            self.safety.hold_back(session.held)
            if session.told is not None:
                self._compare(session.told)
        session.told = None
        return state is LinkState.READY

    # the place --------------------------------------------------------------------------------------------------

    def _found(self) -> Place:
        """Return where the joints are now that the board is ready: told by the board, else remembered, else guessed.

        A board that does not tell has its servos where its firmware puts them only if opening the port has reset it.
        """
        session, port = self.link.session, self.link.port
        self.memory.turn_to(port.identity)
        if session.place is not None and (session.acknowledges or port.resets):
            return session.place
        pulses, sure = self.memory.recall()
        channels = session.channel_values
        if pulses is not None and len(pulses) + len(channels) == len(self.safety.joints):
            source = "this is the last angle sent before the board lost its power" if sure else ""
            return Place((*session.angles_of_pulses(pulses), *channels), source)
        if session.place is not None:
            return Place(session.place.angles)
        guessed = self.safety.place
        return Place((*guessed[: len(guessed) - len(channels)], *channels))

    def _remember(self, content: Content) -> None:
        """Write down what leaves now; a first guess only when the board has it."""
        session = self.link.session
        pulses = session.pulses(content)
        if pulses and (self._content is not None or self.place_source):
            self.memory.keep(pulses, sure=session.acknowledges)

    def _compare(self, told: Content) -> None:
        """Go on from what is in force on the board, where that is not what it was sent."""
        session = self.link.session
        values = session.angles(told)
        if self._content is not None and self._near(values, session.angles(self._content)):
            return
        self._content = self._firm = None
        if pulses := session.pulses(told):
            self.memory.keep(pulses)
        self.safety.moved(values)

    def _near(self, values: Sequence[float], others: Sequence[float]) -> bool:
        """Whether one packet could have made the difference of joint values [rad, m, Pa], shape (n,)."""
        allowed = self.safety.longest_step + np.array(self.link.session.rounding)
        return bool((np.abs(np.subtract(values, others)) <= allowed).all())
