"""From the word that a user gives to the port that it means."""

import time

from tripod_driver.ports.mock import MockPort
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.ports.port import Port
from tripod_driver.ports.pseudo_terminal import PseudoTerminalPort
from tripod_driver.ports.serial_port import AUTO, SerialPort
from tripod_driver.protocol import SERVO_COUNT

CHOICES = "mock, pty, auto, or the path of a device such as /dev/ttyACM0"


def choose_port(
    word: str, *, baud: int, boot_time: float, write_timeout: float, servos: int = SERVO_COUNT
) -> Port:
    """Return the port for `word`: one of CHOICES. The settings are those of a serial port.

    Behind `mock` is a board with so many `servos` that answers in protocol `framed` and is silent in others.

    Raises:
        ValueError: `word` is none of them.
    """
    if word == "mock":
        return MockPort(MockBoard(time.monotonic, servos=servos))
    if word == "pty":
        return PseudoTerminalPort()
    if word == AUTO or word.startswith("/"):
        return SerialPort(word, baud=baud, boot_time=boot_time, write_timeout=write_timeout)
    raise ValueError(f"port {word!r} is unknown; allowed: {CHOICES}")
