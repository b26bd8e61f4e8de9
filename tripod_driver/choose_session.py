"""From the word that a user gives to the conversations that it means."""

from collections.abc import Sequence
from typing import Final

from tripod_driver.calibration import Calibration
from tripod_driver.framed_session import FramedSession
from tripod_driver.protocol import SERVO_COUNT, WORKSHOP, AngleMapping
from tripod_driver.session import LegacySession, Session

OR: Final = "_or_"
"""Joins the names of protocols that are tried in turn, the next where nobody answers at all."""

PROTOCOLS: Final = (FramedSession.name, *WORKSHOP, f"{FramedSession.name}{OR}legacy")
"""What `choose_sessions` knows."""


def choose_sessions(
    word: str,
    mapping: AngleMapping,
    calibration: Calibration,
    needed: Calibration | None = None,
    start: Sequence[float] | None = None,
) -> list[Session]:
    """Return the conversations for `word`, one of PROTOCOLS, in the order in which they are tried.

    `mapping` and `start` are for the workshop's protocols, see `LegacySession`, `needed` for `FramedSession`. Raises
    ValueError: `word` is none of them, or does not carry so many servos.
    """
    if word not in PROTOCOLS:
        raise ValueError(f"protocol {word!r} is unknown; allowed: {', '.join(PROTOCOLS)}")
    count = len(calibration.servos)
    if calibration.channels and word != FramedSession.name:
        raise ValueError(
            f"protocol {word} carries angles only, but the robot has {', '.join(calibration.channels)}; use protocol "
            "framed, with this project's firmware"
        )
    if count != SERVO_COUNT and word != FramedSession.name:
        raise ValueError(
            f"protocol {word} carries {SERVO_COUNT} angles, but the robot has {count} servos; use protocol framed, "
            "with this project's firmware"
        )

    def session(name: str) -> Session:
        if name in WORKSHOP:
            return LegacySession(WORKSHOP[name](mapping), calibration, start)
        return FramedSession(calibration, needed)

    return [session(name) for name in word.split(OR)]


def common_bounds(sessions: Sequence[Session]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the smallest and largest joint values that packets of all `sessions` can carry, shape (n,) each."""
    lower, upper = zip(*(session.bounds() for session in sessions), strict=True)
    return tuple(map(max, zip(*lower, strict=True))), tuple(map(min, zip(*upper, strict=True)))
