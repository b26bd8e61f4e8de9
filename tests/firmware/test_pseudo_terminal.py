"""Tier 3: the real firmware behind a pseudo-terminal, spoken to through pyserial as a real board is. No times here."""

import time
from collections.abc import Iterator

import pytest
import serial

from tests.firmware.session import is_row_of, rows
from tests.firmware.terminal_board import TerminalBoard
from tripod_driver.framed import (
    Acknowledgement,
    BoardState,
    Decoder,
    Flags,
    Hello,
    HelloReply,
    Message,
    SetPulses,
    encode,
)
from tripod_driver.protocol import LegacyProtocol

DEADLINE = 60.0
"""For a loaded machine [s]; nothing here waits so long unless it fails."""


@pytest.fixture
def port(terminal: TerminalBoard) -> Iterator[serial.Serial]:
    with serial.Serial(terminal.path, 115200, timeout=0.05) as port:
        yield port


def ask(port: serial.Serial, message: Message, sequence: int) -> Message:
    """Send again until answered: a board that was just reset does not hear the first bytes."""
    decoder, end = Decoder(), time.monotonic() + DEADLINE
    while time.monotonic() < end:
        port.write(encode(message, sequence))
        for frame in decoder.feed(port.read(64)):
            if frame.sequence == sequence:
                return frame.message
    raise AssertionError(f"no answer to {message}")


def until(condition) -> None:
    end = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_hello_pulses_and_a_host_that_falls_silent(port, terminal) -> None:
    hello = ask(port, Hello(), 0)
    assert isinstance(hello, HelloReply)
    assert (hello.state, hello.servo_count, hello.watchdog) == (BoardState.IDLE, 3, 500)
    done = ask(port, SetPulses((11000, 15000, 19000)), 1)
    assert done == Acknowledgement(BoardState.ACTIVE, Flags(0), (11000, 15000, 19000), 0)
    until(lambda: ask(port, Hello(), 2).state is BoardState.RELEASED)
    for sequence in range(3, 13):  # each takes some milliseconds: the last period ends
        ask(port, Hello(), sequence)
    widths = rows(terminal.pulses())
    assert len(widths) >= 48
    assert all(is_row_of(row, (11000, 15000, 19000)) for row in widths)


def test_legacy_packets_move_the_servos_and_a_reset_stops_them(port, terminal) -> None:
    port.write(LegacyProtocol().encode([-0.5, -1.0, -1.5]) * 3)
    until(lambda: len(terminal.pulses()) > 9)
    degrees = LegacyProtocol().encode([-0.5, -1.0, -1.5])[1:]
    [row, *_] = rows(terminal.pulses()[:9])
    assert is_row_of(row, tuple(10 * (544 + d * 1856 // 180) for d in degrees))
    terminal.reset()
    assert ask(port, Hello(), 0).state is BoardState.IDLE
