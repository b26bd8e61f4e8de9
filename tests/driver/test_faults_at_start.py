"""What can be at the port before any motion: strangers, boards that must not be driven, boards that wait."""

from dataclasses import replace

import numpy as np
import pytest

from tests.decisions import said
from tests.driver.bench import TICK, Bench, Clock, hello_reply
from tests.messages import assert_names, names
from tripod_driver.calibration import Calibration, ServoCalibration
from tripod_driver.driver import Driver
from tripod_driver.framed import VERSION
from tripod_driver.framed_messages import Hello, HelloReply
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.protocol import HEADER, WORKSHOP
from tripod_driver.safety import State
from tripod_graph.mode import Mode

# before any motion --------------------------------------------------------------------------------------------


class Talker:
    """A device that is no robot: it says something, or repeats what it hears."""

    def __init__(self, text: bytes = b"", *, echo: bool = False) -> None:
        self._text, self._echo, self._heard = text, echo, b""
        self.received = b""

    def restart(self) -> None:
        self._heard = b""

    def write(self, data: bytes) -> None:
        self.received += data
        self._heard += data

    def read(self) -> bytes:
        heard, self._heard = self._heard, b""
        return self._text + (heard if self._echo else b"")


GPS = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"
SENT = "'$GPGGA,123519,4807.038,N'..."
STRANGERS = [
    ("framed", Talker(GPS), (SENT, "answer", "port", "baud", "firmware")),
    ("framed", Talker(echo=True), ("not the robot", "--set port=PATH")),
    ("framed", Talker(), ("no answer", "firmware", "baud", "--set protocol=legacy")),
    ("framed", Talker(b"\x8f\x03\xfe"), ("'\\x8f\\x03\\xfe", "answer")),
    ("legacy", Talker(GPS), (SENT, "workshop's firmware", "baud rate and protocol")),
    ("legacy", Talker(GPS[:5]), ("'$GPGG$GPGG$GPGG$GPGG$GPG'...", "workshop's firmware")),
    ("ascii", Talker(GPS), (SENT, "not an IMU", "baud rate and protocol")),
    ("ascii", Talker(b"\xff\x00"), ("'\\xff\\x00", "not an IMU")),
    ("framed_or_legacy", Talker(GPS), (SENT, "answer")),
]
"""Protocol, device, and what the message names."""


@pytest.mark.parametrize(("protocol", "device", "named"), STRANGERS)
def test_a_port_that_is_no_robot_is_named_and_nothing_but_hellos_reach_it(protocol, device, named) -> None:
    bench = Bench(device, protocol=protocol, boot_time=2.0)
    bench.safety.control_mode(said(Mode.TELEOP, 1.0), 1.0, 100.0)
    told = set()
    for _ in range(800):
        bench.run(TICK, bench.stream)
        told.add(bench.safety.message)
    assert any(names(text, "mock", *named) for text in told), told
    assert bench.safety.state in (State.DISCONNECTED, State.CONNECTING)
    assert bench.sent == []
    assert HEADER not in device.received  # what the workshop's firmware would take for a command
    assert bench.port.opened >= 1


@pytest.mark.parametrize("protocol", WORKSHOP)
def test_a_modem_that_returns_what_it_hears_is_named_after_the_first_of_the_workshops_packets(
    protocol,
) -> None:
    bench = Bench(Talker(echo=True), protocol=protocol)
    bench.safety.control_mode(said(Mode.TELEOP, 1.0), 1.0, 100.0)
    bench.run(0.4, bench.stream)
    assert bench.safety.state is State.DISCONNECTED
    assert_names(bench.safety.message, "mock", "not the robot", "--set port=PATH", "next attempt", "0.5 s")
    assert len(bench.sent) == 1


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"protocol": 1}, ("firmware", "version 1", "driver version 2", "make -C firmware", "tripod flash")),
        ({"protocol": 3}, ("firmware", "version 3", "driver version 2", "program", "flash")),
        ({"servo_count": 2}, ("firmware", "2 servos", "robot has 3", "tripod flash")),
        ({"pulse_max": 20000}, ("servo_0", "2400.0 us", "0 rad", "500 to 2000 us", "calibrate")),
        ({"pulses": (6000, 20000, 20000)}, ("servo_0", "-3.047 rad", "-2.1 to 0 rad", "switch", "calibrate")),
    ],
)
def test_a_board_that_must_not_be_driven_is_a_fault(changed: dict, named: tuple[str, ...]) -> None:
    class Other(MockBoard):
        def _answer(self, message: object):
            if isinstance(message, Hello):
                good = hello_reply(pulse_min=5000, pulse_max=25000)
                return replace(good, **changed)
            return super()._answer(message)

    bench = Bench(Other())
    bench.safety.control_mode(said(Mode.TELEOP, 1.0), 1.0, 100.0)
    bench.run(3.0, bench.stream)
    assert bench.safety.state is State.FAULT
    assert_names(bench.safety.message, "mock", *named, "restart the driver")
    assert (bench.sent, bench.board.history, bench.port.is_open, bench.port.opened) == ([], [], False, 1)


def test_another_version_of_the_protocol_is_a_fault() -> None:
    bench = Bench(MockBoard(version=7)).run(0.5)
    assert bench.safety.state is State.FAULT
    assert_names(bench.safety.message, "mock", "version 7", "driver version 2")
    bench.board.version = VERSION
    bench.run(3.0)
    assert bench.port.opened == 1  # nobody tries again by himself
    bench.driver.connect()  # somebody has flashed it and configured the driver again
    bench.run(0.2)
    assert bench.safety.state is State.HOLDING


def test_a_pulse_that_the_board_refuses_is_a_fault() -> None:
    bench = Bench().moving()
    bench.board.pulse_range = (5000, 20000)  # not what it said
    bench.goto(0.0, -0.5, -0.5)
    bench.run(1.0)
    assert bench.safety.state is State.FAULT
    assert_names(bench.safety.message, "board refuses", "pulse", "servo_0", "tripod flash")


def test_the_board_boots_before_it_is_asked_to_move() -> None:
    class Slow(MockBoard):
        def write(self, data: bytes) -> None:
            if self._clock() - self.opened_at >= 1.5:  # the boot loader swallows what comes before
                super().write(data)

        def restart(self) -> None:
            super().restart()
            self.opened_at = self._clock()

    clock = Clock()
    bench = Bench(Slow(clock), boot_time=2.0)
    bench.clock, clock.now = clock, 100.0
    bench.run(1.4)
    assert bench.safety.state is State.CONNECTING
    assert_names(bench.safety.message, "mock", "open", "3 s", "answer")
    bench.run(0.3)
    assert bench.safety.state is State.HOLDING
    assert bench.sent == []
    assert bench.asked().sent[0][1] == pytest.approx([-0.5] * 3, abs=1e-3)


@pytest.mark.parametrize("silent", [True, False])
def test_only_on_request_and_only_where_nobody_answers_the_workshops_protocol_is_tried(silent: bool) -> None:
    bench = Bench(Talker() if silent else MockBoard(), protocol="framed_or_legacy", boot_time=0.5)
    bench.run(3.0)
    assert bench.link.session.name == ("legacy" if silent else "framed")
    assert bench.safety.state in (State.HOLDING, State.PARKED)
    if silent:
        bench.asked()
        assert bytes([255, 151, 151, 151]) in bench.board.received
        assert bench.port.opened == 1
    only = Bench(Talker(), protocol="framed", boot_time=0.5).run(3.0).asked()
    assert only.sent == []


def test_a_driver_that_takes_over_ramps_from_where_the_board_holds_the_servos() -> None:
    class Kept(MockBoard):
        def restart(self) -> None:
            if not hasattr(self, "pulses"):
                super().restart()

    board = Kept()
    first = Bench(board).moving()
    here = first.sent[-1][1]
    second = Bench(board)  # assumes -0.5
    second.run(0.2)
    assert second.sent[0][1] == pytest.approx(here, abs=2e-3)
    assert here[0] < -0.9


@pytest.mark.parametrize(("watchdog", "gap"), [(500, 0.15), (200, 0.06)])
def test_an_unchanged_packet_is_sent_again_well_before_the_boards_watchdog(watchdog: int, gap: float) -> None:
    class Nervous(MockBoard):
        def _answer(self, message: object):
            answer = super()._answer(message)
            return replace(answer, watchdog=watchdog) if isinstance(answer, HelloReply) else answer

    bench = Bench(Nervous())
    bench.driver = Driver(bench.link, bench.safety, keep_alive=0.4)
    bench.driver.connect()
    bench.run(0.1).asked().run(0.9)
    gaps = np.diff([t for t, _ in bench.sent])
    assert gap - 0.02 <= gaps.min() and gaps.max() <= gap + 1e-9


def test_a_packet_that_is_not_acknowledged_is_sent_again_sooner() -> None:
    bench = Bench()
    bench.driver = Driver(bench.link, bench.safety, keep_alive=0.4)
    bench.driver.connect()
    bench.run(0.1).asked().run(0.4)
    write = bench.board.write
    bench.board.write = lambda data: None  # type: ignore[method-assign]
    count = len(bench.sent)
    while len(bench.sent) == count:
        bench.run(TICK)
    bench.board.write = write  # type: ignore[method-assign]
    bench.run(0.3)
    lost, again = (t for t, _ in bench.sent[count : count + 2])
    assert 0.02 - 1e-9 <= again - lost <= 0.02 + TICK + 1e-9
    assert bench.safety.state is State.HOLDING


def test_packets_leave_at_most_50_times_a_second_however_often_the_driver_is_called() -> None:
    bench = Bench().moving()
    bench.goto(0.0, 0.0, 0.0, time=1.0)
    count = len(bench.sent)
    bench.run(0.8)
    gaps = np.diff([t for t, _ in bench.sent[count:]])
    assert gaps.min() >= 0.015 - 1e-9 and gaps.mean() >= 0.02 - 0.005 / len(gaps)
    assert len(gaps) > 30  # nor much more seldom


def test_at_rest_means_that_the_board_has_the_last_packet() -> None:
    bench = Bench().moving()
    bench.safety.park(bench.clock.now)
    bench.board.read = lambda: b""  # type: ignore[method-assign]  # its answers are lost
    bench.run(0.2)
    assert not bench.driver.at_rest
    bench = Bench().moving()
    bench.safety.park(bench.clock.now)
    while not bench.driver.at_rest:
        bench.run(TICK)
        assert bench.clock.now < 110.0
    assert bench.board.pulses == (24000, 24000, 24000)


def test_calibrated_servos_get_their_own_pulses() -> None:
    mirrored = ServoCalibration(offset=0.0, direction=-1, pulse_range=(600.0, 2300.0), safe_range=(-2.0, 0.0))
    bench = Bench(
        calibration=Calibration(
            (ServoCalibration(), mirrored, ServoCalibration(offset=3.0, safe_range=(-2, 0)))
        )
    )
    bench.run(0.1).asked()
    wanted = [544 + 1856 * (np.pi - 0.5) / np.pi, 600 + 1700 * 0.5 / np.pi, 544 + 1856 * 2.5 / np.pi]
    assert np.array(bench.board.pulses) / 10 == pytest.approx(wanted, abs=0.3)
    assert bench.sent[0][1] == pytest.approx([-0.5] * 3, abs=1e-3)
    legacy = Bench(
        Talker(),
        protocol="legacy",
        calibration=Calibration((ServoCalibration(), mirrored, ServoCalibration())),
    )
    legacy.run(0.05).asked()
    degrees = (np.array(wanted) - 544) / 1856 * 180
    assert legacy.board.received[:4] == bytes(
        [255, round(degrees[0]), 60, round(degrees[0])]
    )  # 38 is below 60


def test_no_hello_holds_the_header_of_the_workshops_packets() -> None:
    bench = Bench(Talker(), boot_time=30.0).run(31.5)
    hellos = bench.board.received.split(b"\0\0")
    assert len(hellos) > 256  # every sequence number was due
    assert HEADER not in bench.board.received
