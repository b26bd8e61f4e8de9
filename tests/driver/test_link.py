"""A link opens its port, waits for the board, and tries again ever more seldom."""

import contextlib
import os

from tests.messages import assert_names
from tripod_driver.calibration import Calibration
from tripod_driver.framed_session import FramedSession
from tripod_driver.link import Link as AnyLink
from tripod_driver.link import LinkState
from tripod_driver.ports.mock import Fault, MockPort
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.ports.pseudo_terminal import PseudoTerminalPort
from tripod_driver.protocol import LegacyProtocol
from tripod_driver.session import LegacySession


def Link(port: MockPort, *, retry_min: float, retry_max: float) -> AnyLink:
    return AnyLink(
        port, LegacySession(LegacyProtocol(), Calibration()), retry_min=retry_min, retry_max=retry_max
    )


def test_a_board_gets_its_time_to_boot() -> None:
    port = MockPort(boot_time=2.0)
    link = Link(port, retry_min=0.5, retry_max=5.0)
    assert link.state is LinkState.DISCONNECTED
    assert link.poll(10.0) is LinkState.CONNECTING
    assert_names(link.message, "mock", "open", "2 s")
    assert link.poll(11.99) is LinkState.CONNECTING
    assert link.poll(12.0) is LinkState.READY
    assert (link.message, link.reconnects) == ("", 0)


def test_attempts_become_seldom_up_to_a_limit_and_frequent_again_after_a_write() -> None:
    port = MockPort()
    port.fault = Fault.UNPLUGGED
    link = Link(port, retry_min=0.5, retry_max=3.0)
    attempts = []

    def opened() -> None:
        attempts.append(now)
        MockPort.open(port)

    port.open = opened  # type: ignore[method-assign]
    now = 0.0
    for tick in range(1200):
        now = tick / 100
        assert link.poll(now) is LinkState.DISCONNECTED
    assert attempts == [0.0, 0.5, 1.5, 3.5, 6.5, 9.5]
    assert_names(link.message, "mock", "unplugged", "next attempt", "3 s")
    port.fault, now = None, 12.5
    assert link.poll(now) is LinkState.READY
    assert link.write(b"x", now)
    port.fault, now = Fault.UNPLUGGED, 13.0
    assert not link.write(b"x", now)
    assert link.state is LinkState.DISCONNECTED
    assert_names(link.message, "mock", "lost", "next attempt", "0.5 s")
    port.fault, now = None, 13.4
    assert link.poll(now) is LinkState.DISCONNECTED
    now = 13.5
    assert link.poll(now) is LinkState.READY
    assert link.reconnects == 1


def test_a_port_that_opens_but_takes_nothing_is_tried_ever_more_seldom() -> None:
    port = MockPort()
    port.fault = Fault.SHORT
    link = Link(port, retry_min=0.5, retry_max=4.0)
    failures = []
    for tick in range(2000):
        if link.poll(tick / 100) is LinkState.READY:
            assert not link.write(b"data", tick / 100)
            failures.append(tick / 100)
    assert failures == [0.0, 0.5, 1.5, 3.5, 7.5, 11.5, 15.5, 19.5]


def test_a_lost_port_is_closed_before_it_is_opened_again() -> None:
    port = MockPort()
    link = Link(port, retry_min=0.5, retry_max=4.0)
    link.poll(0.0)
    port.fault = Fault.SHORT
    link.write(b"data", 0.1)
    assert not port.is_open


def test_closing_ends_the_link_until_it_is_polled_again() -> None:
    port = MockPort()
    link = Link(port, retry_min=0.5, retry_max=4.0)
    link.poll(0.0)
    link.close()
    assert not port.is_open
    assert link.state is LinkState.DISCONNECTED
    assert_names(link.message, "port", "closed")
    assert link.poll(0.1) is LinkState.READY


def test_a_pseudo_terminal_keeps_its_name_while_nobody_answers_and_answers_count_when_they_come() -> None:
    port = PseudoTerminalPort()
    link = AnyLink(port, FramedSession(Calibration()), retry_min=0.5, retry_max=1.0)
    states, names = set(), set()
    for tick in range(605):  # and some hellos wait in the terminal then
        states.add(link.poll(tick / 100))
        names.add(port.name)
    assert states == {LinkState.CONNECTING, LinkState.DISCONNECTED}
    assert len(names) == 1 and names != {"pty"}
    other, board = os.open(port.name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK), MockBoard()
    try:
        for tick in range(605, 1200):
            with contextlib.suppress(BlockingIOError):
                board.write(os.read(other, 4096))
            os.write(other, board.read())
            if link.poll(tick / 100) is LinkState.READY:
                break
        for tick in range(1200, 1400):
            with contextlib.suppress(BlockingIOError):
                board.write(os.read(other, 4096))
            os.write(other, board.read())
            assert link.poll(tick / 100) is LinkState.READY, link.message
    finally:
        os.close(other)
        link.close()
    assert port.name == "pty"


def test_a_port_whose_opening_resets_a_board_is_opened_again_where_nobody_answers() -> None:
    port = MockPort()
    link = AnyLink(port, FramedSession(Calibration()), retry_min=0.5, retry_max=1.0)
    for tick in range(600):
        link.poll(tick / 100)
    assert port.opened > 2 and link.reconnects == port.opened - 1
