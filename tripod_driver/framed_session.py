"""A conversation in the `framed` protocol: who is there, what arrived, and what is wrong on the line."""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Final

from tripod_driver.board_checks import (
    FLASH_ADVICE,
    is_failure,
    other_version,
    reset_told,
    why_not,
    why_not_from,
)
from tripod_driver.calibration import Calibration
from tripod_driver.channels import Channels
from tripod_driver.framed import Decoder, encode
from tripod_driver.framed_messages import (
    Acknowledgement,
    BoardState,
    ChannelDescription,
    ChannelStates,
    Error,
    ErrorCode,
    Flags,
    Frame,
    GetChannels,
    Hello,
    HelloReply,
    Hold,
    ImuLine,
    Message,
    OtherVersion,
    Pulses,
    SetChannels,
    SetPulses,
)
from tripod_driver.imu import parse_line
from tripod_driver.place import Place
from tripod_driver.protocol import HEADER
from tripod_driver.session import ECHO, READINGS_MAX, TENTHS, Content, Session, SessionState, shown

HELLO_PERIOD: Final = 0.1
"""Time between two hellos [s]."""

IDLE_PERIOD: Final = 1.0
"""A board that is told nothing else is greeted so often [s]: is it still there?"""

ANSWER_TIME: Final = 1.0
"""A board that has booted answers a hello within this time [s]."""

SILENCE: Final = 0.3
"""A packet that is not acknowledged for so long means that the board is gone [s]."""

RESETS_MAX, RESET_WINDOW = 3, 10.0
"""So many resets in so many seconds mean that the supply of the servos is too weak."""

STRANGERS_MAX, STRANGER_WINDOW = 3, 2.0
"""So many signs of another writer in so many seconds are no accident."""

LOST_MAX, LOSS_WINDOW = 3, 100
"""So many unanswered frames of so many are told."""

PULSE_PERIOD: Final = 0.02
"""From pulse to pulse [s]."""

SLOW, TRIPS_MIN = 0.05, 10
"""Answers that take longer [s], as the quickest of so many in a row did, are told: the next change waits for them."""

HEARD_MAX: Final = 64
"""Bytes of what came before the first frame that are kept for the message."""


class FramedSession(Session):
    """Says hello until it is answered, numbers its packets, and watches that each is acknowledged.

    Only a board of this protocol version, with as many servos as the calibration, a range of pulses that covers it, and
    its channels, becomes ready. A packet is a frame of pulses, if there are servos, else a hello, and one of the
    channels' set-points, if there are channels. After that, silence for `SILENCE` ends the conversation; a reset of the
    board, or its watchdog, is an incident, and so is an earlier reset by its supply or a hung firmware. Unanswered
    frames were lost, they or their answers. What the board heard and was never sent, as its replies tell or a gap
    before a frame whose forerunner it has answered, is someone else's.
    """

    name = "framed"
    baud = 115200
    acknowledges = True

    def __init__(self, calibration: Calibration, needed: Calibration | None = None) -> None:
        """`needed`: what the board must be able to make, if that is not all of `calibration`."""
        super().__init__(calibration)
        self._needed = calibration if needed is None else needed
        self._decoder = Decoder(len(calibration.servos))
        self._sequence = 0
        self._unanswered: deque[tuple[int, float]] = deque()
        self._newest: set[int] = (
            set()
        )  # sequences of the newest packet's frames that are not acknowledged yet
        self._late: set[int] = set()  # hellos sent before the first answer, whose own may still come
        self._answered: int | None = None  # sequence of the newest frame that was answered
        self._hello_due = self._give_up_at = self._said_at = 0.0
        self._heard = bytearray()
        self._echo = self._restarted = False
        self._greeted = False  # the board is the right one; what remains is to ask of its channels
        self._streaming = False  # packets leave one after another
        self._channels = Channels(calibration.channels)
        self._pulses: Pulses | None = None  # of the servos, told last; None: not known
        self._reply: HelloReply | None = None
        self._resets: deque[float] = deque(maxlen=RESETS_MAX)
        self._strangers: deque[float] = deque(maxlen=STRANGERS_MAX)
        self._lost: deque[bool] = deque(maxlen=LOSS_WINDOW)  # of each of the newest frames
        self._trips: deque[float] = deque(maxlen=TRIPS_MIN)
        self._counts = {"frames lost on the line": 0, "board resets": 0, "watchdog of the board": 0}

    def begin(self, now: float, boot_time: float) -> None:
        """Say hello from `now` on, until `ANSWER_TIME` after the board must have booted."""
        self._decoder = Decoder(len(self._calibration.servos))
        self._heard.clear()
        self._lost.clear()
        self._trips.clear()
        self._echo = self._restarted = False
        self._open(now, now + boot_time + ANSWER_TIME)
        self.message = f"waiting up to {boot_time + ANSWER_TIME:g} s for the board's answer"

    def hear(self, data: bytes, now: float) -> None:
        """Take frames; anything else is kept for the message in case that no frame comes."""
        self._heard += data[: HEARD_MAX - len(self._heard)]
        for frame in self._decoder.feed(data):
            if self.state in (SessionState.LOST, SessionState.REFUSED):
                return
            self._take(frame, now)

    def say(self, now: float) -> bytes:
        """Return a hello when one is due; notice silence."""
        if self.state is SessionState.OPENING:
            if now >= self._give_up_at:
                self.state, self.message = SessionState.LOST, self._why_no_answer()
            elif now >= self._hello_due:
                self._hello_due = now + HELLO_PERIOD
                return self._frames([self._channels.question], now) if self._greeted else self._hello(now)
        elif self.state is SessionState.READY:
            if self._unanswered and now - self._unanswered[0][1] > SILENCE:
                self.state = SessionState.LOST
                self.message = f"no acknowledgement for {SILENCE:g} s; check cable and power"
            elif now >= self._said_at + (HELLO_PERIOD if self._unanswered else IDLE_PERIOD):
                self._streaming = False
                hello = self._hello(now)  # numbered before what follows it
                return hello + (self._frames([GetChannels()], now) if self._calibration.channels else b"")
        return b""

    def content(self, values: Sequence[float]) -> Content:
        """Return pulse widths [0.1 us], then set-points [steps, counts]."""
        servos = len(self._calibration.servos)
        pulses = (round(TENTHS * pulse) for pulse in self._calibration.pulses(values[:servos]))
        return (*pulses, *self._calibration.setpoints(values[servos:]))

    def packet(self, content: Content, now: float) -> bytes:
        """Return the frames that set this; their answers are expected within `SILENCE`."""
        servos = len(self._calibration.servos)
        frames: list[Message] = [SetPulses(content[:servos]) if servos else Hello()]
        if self._calibration.channels:
            frames.append(SetChannels(content[servos:]))
        self._streaming = True
        return self._newest_frames(frames, now)

    def angles(self, content: Content) -> tuple[float, ...]:
        """Return the joint values [rad, m, Pa] of this."""
        servos = len(self._calibration.servos)
        return (*self.angles_of_pulses(content[:servos]), *self._calibration.values(content[servos:]))

    def pulses(self, content: Content) -> Content:
        """Return the part of the servos."""
        return content[: len(self._calibration.servos)]

    @property
    def rounding(self) -> tuple[float, ...]:
        """Of a channel, a period at the board's own rate: its replies tell set-points from before that."""
        return (*super().rounding, *self._channels.steps)

    @property
    def channel_values(self) -> tuple[float, ...]:
        """Where the joints are that are no servos [m, Pa]; of a winch that was not homed, as if it were at home."""
        return self._calibration.values(self._channels.setpoints)

    @property
    def unplaced(self) -> str:
        """Which winches were not homed."""
        return self._channels.unplaced

    @property
    def held(self) -> Mapping[int, float]:
        """Where the board holds joints whose cable or hose has failed, by their number."""
        first, values = len(self._calibration.servos), self.channel_values
        return {first + i: values[i] for i in self._channels.held}

    @property
    def homing(self) -> bool:
        """Whether a winch looks for its home switch."""
        return self._channels.homing

    def home(self, now: float, *, begin: bool) -> bytes:
        """Return what homes the winches; the board goes on only while this is repeated."""
        self._streaming = False
        return self._newest_frames(self._channels.to_home(begin=begin), now)

    def hold(self, now: float) -> bytes:
        """Return what stops the winches, and asks where they are."""
        self._streaming = False
        return self._newest_frames([Hold(), GetChannels()], now)

    def bounds(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the safe range: pulses carry all of it."""
        return self._calibration.lower, self._calibration.upper

    @property
    def unheard(self) -> bool:
        """Whether nothing at all has come since `begin`."""
        return not self._heard

    @property
    def settled(self) -> bool:
        """Whether the newest packet was acknowledged."""
        return not self._newest

    @property
    def odd(self) -> str:
        """That frames are lost, and how many; that answers come late."""
        if self.state is not SessionState.READY:
            return ""
        if self._channels.odd:
            return self._channels.odd
        if (lost := sum(self._lost)) >= LOST_MAX:
            return (
                f"{lost} of the last {len(self._lost)} packets were lost on the line; check cable and plugs"
            )
        if len(self._trips) == TRIPS_MIN and (trip := min(self._trips)) > SLOW:
            return (
                f"the board takes {1000.0 * trip:.0f} ms to answer, and each change waits for it: motions are "
                "slow; use another USB port or cable, without a hub"
            )
        return ""

    @property
    def diagnostics(self) -> dict[str, object]:
        """What the board is, and what went wrong on the line."""
        told: dict[str, object] = {"firmware": self.firmware, "last reset": self.reset, **self._counts}
        told |= self._channels.diagnostics
        told["bad frames"] = self._bad_frames
        if self.round_trip is not None:
            told["round trip [ms]"] = f"{1e3 * self.round_trip:.1f}"
        return told

    @property
    def watchdog(self) -> float | None:
        """Silence after which the board holds by itself [s]; None before it has told."""
        return None if self._reply is None else self._reply.watchdog / 1000

    @property
    def pulse_range(self) -> tuple[float, float] | None:
        """Shortest and longest pulse that the board makes [us]; None before it has told."""
        reply = self._reply
        return None if reply is None else (reply.pulse_min / TENTHS, reply.pulse_max / TENTHS)

    @property
    def slew(self) -> float | None:
        """Largest speed of a pulse that the board makes [us/s]; None before it has told."""
        return None if self._reply is None else self._reply.slew / TENTHS / PULSE_PERIOD

    @property
    def _bad_frames(self) -> int:
        return sum(self._decoder.dropped.values())

    # what came ------------------------------------------------------------------------------------------------

    def _take(self, frame: Frame, now: float) -> None:
        match frame.message:
            case HelloReply() as reply:
                self._take_hello(frame.sequence, reply, now)
            case Acknowledgement() as reply:
                self._take_acknowledgement(frame.sequence, reply, now)
            case Error() as error:
                self._take_error(frame.sequence, error, now)
            case ChannelDescription() as told:
                self._take_description(frame.sequence, told, now)
            case ChannelStates() as told:
                self._take_channels(frame.sequence, told, now)
            case OtherVersion(version):
                self._refuse(other_version(version))
            case ImuLine(text):
                reading = parse_line(text.encode("ascii"), now)
                if reading is not None:
                    self.readings = [*self.readings, reading][-READINGS_MAX:]
            case _:
                self._echo = True  # what a host says: the port returns what is written to it

    def _take_hello_again(self, sequence: int, reply: HelloReply, now: float) -> None:
        """Take the answer to a hello that was said to a board that is ready."""
        if sequence in self._late:
            self._late.remove(sequence)
            self._answered = sequence
        elif not self._answers(sequence, now):
            self._suspect(now)
        elif reply.flags & Flags.RESTARTED:
            self._restart(now)
        elif not self._calibration.servos:
            self._take_watchdog(reply.flags)
        elif 0 not in reply.pulses:
            self._hear_servos(reply.pulses)

    def _take_hello(self, sequence: int, reply: HelloReply, now: float) -> None:
        if self.state is SessionState.READY:
            self._take_hello_again(sequence, reply, now)
            return
        if self._greeted or not self._answers(sequence, now):
            return  # of an earlier conversation
        if wrong := why_not(reply, self._needed):
            self._refuse(wrong)
            return
        self.reset, told = reset_told(reply.reset)
        if self._restarted or (reply.flags & Flags.RESTARTED and is_failure(reply.reset)):
            self._restarted = False
            self.incident = told
        self._reply, self._greeted = reply, True
        self.firmware = f"{reply.firmware[0]}.{reply.firmware[1]}"
        self._late = {number for number, _ in self._unanswered}
        self._unanswered.clear()
        if not self._calibration.servos:  # whatever it could drive
            self._decoder.servos = reply.servo_count
        if self._calibration.channels:
            self._hello_due = now  # ask of them
        else:
            self._begin(reply)

    def _begin(self, reply: HelloReply) -> None:
        """All is known: packets may leave."""
        self.place = self._told_place(reply)
        if self.place is not None and (wrong := why_not_from(self.place.angles, self._calibration)):
            self._refuse(wrong)
            return
        self.state, self.message = SessionState.READY, ""

    def _take_description(self, sequence: int, told: ChannelDescription, now: float) -> None:
        if not self._answers(sequence, now) or self.state is not SessionState.OPENING:
            return
        if wrong := self._channels.describe(told):
            self._refuse(wrong)
        self._hello_due = now

    def _take_channels(self, sequence: int, told: ChannelStates, now: float) -> None:
        if not self._answers(sequence, now):
            if self.state is SessionState.READY:
                self._suspect(now)
            return
        if len(told.channels) != len(self._calibration.channels):
            return
        incident = self._channels.hear(told.channels)
        if self.state is SessionState.OPENING and self._reply is not None and self._greeted:
            self._begin(self._reply)
        elif self.state is SessionState.READY:
            self.incident = incident or self.incident
            self._hear_place()

    def _hear_servos(self, pulses: Pulses) -> None:
        """Take the pulses that the board has told to be in force; with a 0 they are not known."""
        self._pulses = pulses if 0 not in pulses else None
        self._hear_place()

    def _hear_place(self) -> None:
        """Tell what is in force, of all joints."""
        pulses = self._pulses if self._calibration.servos else ()
        if pulses is None or self._channels.unplaced:
            self.told = None
        else:
            self.told = (*pulses, *self._channels.setpoints)

    def _take_watchdog(self, flags: Flags) -> None:
        """Note what the board did in silence, unless nothing was to be said."""
        if flags & Flags.WATCHDOG and self._streaming:
            self._counts["watchdog of the board"] += 1
            self.incident = "the board received nothing for the time of its watchdog and let the pressures go"

    def _take_acknowledgement(self, sequence: int, reply: Acknowledgement, now: float) -> None:
        if self.state is not SessionState.READY:
            return
        if self._calibration.servos:
            self._hear_servos(reply.pulses)
        follows = self._answered is not None and sequence == (self._answered + 1) % 256
        if not self._answers(sequence, now):
            self._suspect(now)
            return
        if reply.flags & Flags.RESTARTED:
            self._restart(now)
            return
        if not self._calibration.servos:
            self._take_watchdog(reply.flags)
        elif reply.flags & Flags.WATCHDOG:
            self._counts["watchdog of the board"] += 1
            self.incident = (
                "the board received nothing for the time of its watchdog and switched the servos off"
            )
        if reply.flags & Flags.SEQUENCE_GAP and follows:  # the board heard one more than it was sent
            self._suspect(now)

    def _take_error(self, sequence: int, error: Error, now: float) -> None:
        if error.code is ErrorCode.VERSION:
            self._refuse(other_version(error.detail))
        elif not self._answers(sequence, now):
            self._suspect(now)
        elif error.code is ErrorCode.TYPE and self._calibration.channels and not self._channels.complete:
            self._refuse(
                f"the firmware of the board has no channels, the robot needs {', '.join(self._calibration.channels)}: "
                "build it with WINCH_COUNT and PRESSURE_COUNT"
            )
        elif error.code is ErrorCode.PLACE:  # it was reset, unseen
            self._restart(now)
        elif error.code is ErrorCode.PULSE:
            self._refuse(
                f"the board refuses the pulse of servo_{error.detail} as out of its range; {FLASH_ADVICE}"
            )
        else:
            self._refuse(
                f"the board refuses a message ({error.code.name.lower()} {error.detail}); {FLASH_ADVICE}"
            )

    def _answers(self, sequence: int, now: float) -> bool:
        """Whether `sequence` is of a frame that waits for its answer; those before it wait no longer."""
        sent = next((at for number, at in self._unanswered if number == sequence), None)
        if sent is None:
            return False
        while self._unanswered.popleft()[0] != sequence:
            self._counts["frames lost on the line"] += 1
            self._lost.append(True)
        self._lost.append(False)
        self._answered = sequence
        self._newest.discard(sequence)
        self.round_trip = now - sent
        self._trips.append(self.round_trip)
        return True

    # what it means --------------------------------------------------------------------------------------------

    def _restart(self, now: float) -> None:
        """The board was reset: nothing may be sent before it has answered a new hello."""
        self._counts["board resets"] += 1
        self._resets.append(now)
        if len(self._resets) == RESETS_MAX and now - self._resets[0] < RESET_WINDOW:
            self._refuse(
                f"the board was reset {RESETS_MAX} times within {RESET_WINDOW:g} s: give the servos their own supply"
            )
            return
        self._restarted = True
        self._open(now, now + ANSWER_TIME)
        self.message = "the board was reset"

    def _suspect(self, now: float) -> None:
        self._strangers.append(now)
        if len(self._strangers) == STRANGERS_MAX and now - self._strangers[0] < STRANGER_WINDOW:
            self._refuse("another program also writes to this port; stop it")

    def _told_place(self, reply: HelloReply) -> Place | None:
        servos = len(self._calibration.servos)
        pulses = reply.pulses[:servos]
        self._pulses = None if 0 in pulses else pulses
        if self._pulses is None:
            return None
        emits = servos > 0 and reply.state in (BoardState.ACTIVE, BoardState.HOLDING)
        values = (*self.angles_of_pulses(pulses), *self.channel_values)
        return Place(values, "the board says so", kept=emits or self._channels.kept)

    def _why_no_answer(self) -> str:
        if self._echo:
            return ECHO
        if self._heard:
            return (
                f"the device sends {shown(bytes(self._heard))} and does not answer as the robot: another "
                "port, another baud rate, or another firmware?"
            )
        return (
            "no answer from the board: is it the robot, with the firmware of this project, at this baud "
            "rate? For the firmware of the workshop --set protocol=legacy"
        )

    def _refuse(self, message: str) -> None:
        self.state, self.message = SessionState.REFUSED, message

    # what goes ------------------------------------------------------------------------------------------------

    def _open(self, now: float, give_up_at: float) -> None:
        self.state, self.place, self.told = SessionState.OPENING, None, None
        self._unanswered.clear()
        self._newest, self._answered = set(), None
        self._greeted = self._streaming = False
        self._pulses = None
        self._channels.begin()
        self._hello_due, self._give_up_at = now, give_up_at

    def _hello(self, now: float) -> bytes:
        """Return a hello in which no byte is the header of the workshop's packets: their firmware must not move."""
        while HEADER in (frame := encode(Hello(), sequence := self._next_sequence())):
            pass
        self._unanswered.append((sequence, now))
        self._said_at = now
        return frame

    def _frames(self, messages: Sequence[Message], now: float) -> bytes:
        """Return frames whose answers are expected."""
        out = b""
        for message in messages:
            sequence = self._next_sequence()
            self._unanswered.append((sequence, now))
            out += encode(message, sequence)
        self._said_at = now
        return out

    def _newest_frames(self, messages: Sequence[Message], now: float) -> bytes:
        """Return frames of which it counts whether the board has them."""
        out = self._frames(messages, now)
        sequences = [sequence for sequence, _ in self._unanswered]
        self._newest = set(sequences[len(sequences) - len(messages) :])
        return out

    def _next_sequence(self) -> int:
        self._sequence = (self._sequence + 1) % 256
        self._late.discard(self._sequence)
        return self._sequence
