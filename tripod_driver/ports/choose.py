"""From the word that a user gives to the port that it means."""

import time
from collections.abc import Sequence

from tripod_driver.framed_messages import ChannelKind
from tripod_driver.ports.mock import MockPort
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.ports.port import Port
from tripod_driver.ports.pseudo_terminal import PseudoTerminalPort
from tripod_driver.ports.serial_port import AUTO, SerialPort
from tripod_driver.protocol import SERVO_COUNT

MOCK = "mock"
"""The board in memory."""

CHOICES = "mock, pty, auto, or the path of a device such as /dev/ttyACM0"


def choose_port(
    word: str,
    *,
    baud: int,
    boot_time: float,
    write_timeout: float,
    servos: int = SERVO_COUNT,
    channels: Sequence[ChannelKind] = (),
) -> Port:
    """Return the port for `word`: one of CHOICES. The settings are those of a serial port.

    Behind `mock` is a board with so many `servos`, and these `channels` with all winches at home. It
    answers in protocol `framed` and is silent in others.

    Raises:
        ValueError: `word` is none of them.
    """
    if word == MOCK:
        return MockPort(MockBoard(time.monotonic, servos=servos, channels=channels))
    if word == "pty":
        return PseudoTerminalPort()
    if word == AUTO or word.startswith("/"):
        return SerialPort(word, baud=baud, boot_time=boot_time, write_timeout=write_timeout)
    raise ValueError(f"port {word!r} is unknown; allowed: {CHOICES}")
