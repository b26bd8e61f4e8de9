"""Asking a port who is there: the firmware, and how long an answer takes. Nothing moves by it."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from tripod_driver.calibration import Calibration
from tripod_driver.framed_session import FramedSession
from tripod_driver.ports.port import Port
from tripod_driver.session import SessionState

PAUSE = 0.001
"""Time between two looks at the port [s]."""


@dataclass(frozen=True)
class Answer:
    """What a port says to a hello.

    Attributes:
        firmware: Version of the firmware; empty if there is no answer, or one that makes it unfit.
        reset: Why the board was reset last, in a word or two; empty if there is no answer.
        round_trip: Time from hello to answer [s].
        message: Why it cannot be driven; empty if it can.
    """

    firmware: str = ""
    reset: str = ""
    round_trip: float = 0.0
    message: str = ""


def ask(
    port: Port,
    *,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Answer:
    """Return what the board at `port` answers to a hello within its time to boot and a second more.

    Opening the port resets most boards; a hello moves no servo, whichever firmware hears it. Raises PortError.
    """
    session = FramedSession(Calibration())
    with port:
        session.begin(clock(), port.boot_time)
        while session.state is SessionState.OPENING:
            session.hear(port.read(), clock())
            if due := session.say(clock()):
                port.write(due)
            sleep(PAUSE)
    return Answer(session.firmware, session.reset, session.round_trip or 0.0, session.message)
