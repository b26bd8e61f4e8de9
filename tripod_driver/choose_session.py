"""From the word that a user gives to the conversations that it means."""

from collections.abc import Sequence
from typing import Final

from tripod_driver.calibration import Calibration
from tripod_driver.framed_session import FramedSession
from tripod_driver.protocol import AngleMapping, AsciiProtocol, LegacyProtocol
from tripod_driver.session import LegacySession, Session

PROTOCOLS: Final = ("framed", "legacy", "ascii", "framed_or_legacy")
"""What `choose_sessions` knows; the last tries the first, then the second where nobody answers at all."""


def choose_sessions(
    word: str,
    mapping: AngleMapping,
    calibration: Calibration,
    needed: Calibration | None = None,
    start: Sequence[float] | None = None,
) -> list[Session]:
    """Return the conversations for `word`, one of PROTOCOLS, in the order in which they are tried.

    `mapping` and `start` are for the workshop's protocols, see `LegacySession`, `needed` for `FramedSession`. Raises
    ValueError: `word` is none of them.
    """
    match word:
        case "framed":
            return [FramedSession(calibration, needed)]
        case "legacy":
            return [LegacySession(LegacyProtocol(mapping), calibration, start)]
        case "ascii":
            return [LegacySession(AsciiProtocol(mapping), calibration, start)]
        case "framed_or_legacy":
            return [
                FramedSession(calibration, needed),
                LegacySession(LegacyProtocol(mapping), calibration, start),
            ]
    raise ValueError(f"protocol {word!r} is unknown; allowed: {', '.join(PROTOCOLS)}")


def common_bounds(sessions: Sequence[Session]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the smallest and largest angles [rad] that packets of all `sessions` can carry, shape (s,) each."""
    lower, upper = zip(*(session.bounds() for session in sessions), strict=True)
    return tuple(map(max, zip(*lower, strict=True))), tuple(map(min, zip(*upper, strict=True)))
