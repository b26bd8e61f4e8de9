"""Tier 2: the project's driver and the real firmware together, in one virtual time; looked at where the servos are."""

import random
from itertools import pairwise

import pytest

from tests.decisions import SOURCE, said
from tests.firmware.session import PERIOD, is_row_of, pulses_so_far, rows
from tests.firmware.simulated_board import Pulse, SimulatedBoard
from tests.firmware.test_line import send_imu_line
from tests.firmware.test_reset import MCUSR
from tripod_driver.board_checks import reset_told
from tripod_driver.calibration import Calibration
from tripod_driver.choose_session import choose_sessions, common_bounds
from tripod_driver.driver import Driver
from tripod_driver.framed_messages import ResetCause
from tripod_driver.link import Link
from tripod_driver.ports.mock import Fault, MockPort
from tripod_driver.protocol import AngleMapping
from tripod_driver.safety import Safety, State
from tripod_graph.command import CommandLimits
from tripod_graph.mode import Mode
from tripod_graph.names import SERVOS

TICK = 0.005
SPEED = 2.0
START = (-0.5, -0.5, -0.5)
CALIBRATION = Calibration()
US_PER_RAD = (2400 - 544) / 3.141592653589793


class Wire:
    """The board's end of a `MockPort`.

    Attributes:
        resets: Whether opening the port resets the board, as on an Arduino Uno.
        noise: Probability that a byte is damaged, either way.
        pulses: All that the servos got.
    """

    def __init__(self, board: SimulatedBoard) -> None:
        self.board, self.resets, self.noise = board, True, 0.0
        self.pulses: list[Pulse] = []
        self._rng = random.Random(1)

    def restart(self) -> None:
        if self.resets:
            self.reset()

    def reset(self) -> None:
        """Reset the board between two periods, so that no pulse is cut."""
        self.pulses += pulses_so_far(self.board)
        self.board.reset()

    def write(self, data: bytes) -> None:
        self.board.write(self._damaged(data))

    def read(self) -> bytes:
        return self._damaged(self.board.read(self.board.in_waiting))

    def _damaged(self, data: bytes) -> bytes:
        rng = self._rng
        return bytes(rng.randrange(256) if rng.random() < self.noise else byte for byte in data)


class Host:
    """A driver without ROS that runs as long as the board does.

    Attributes:
        pulses: All that the servos got.
        sent: All that the driver asked for [0.1 us].
        times: When it did [s].
    """

    def __init__(self, board: SimulatedBoard, protocol: str = "framed", *, resets: bool = True) -> None:
        self.board, self.wire = board, Wire(board)
        self.wire.resets = resets
        self.pulses = self.wire.pulses
        self.sent: list[tuple[int, ...]] = []
        self.times: list[float] = []
        sessions = choose_sessions(protocol, AngleMapping.ROUNDED, CALIBRATION, start=START)
        self.port = MockPort(self.wire)
        self.link = Link(self.port, *sessions, retry_min=0.2, retry_max=1.0)
        limits = CommandLimits(angle_speed=SPEED, park_after=10.0)
        self.safety = Safety(limits, *common_bounds(sessions), start=START)
        self.driver = Driver(self.link, self.safety)
        self.driver.memory.turn_to(self.port.identity)
        self.driver.memory.keep(sessions[0].pulses(sessions[0].content(START)))
        self.driver.connect()
        self.safety.activate(board.now)
        self.safety.control_mode(said(Mode.TELEOP, board.now), board.now, board.now)

    def run(self, duration: float) -> "Host":
        end = self.board.now + duration
        while self.board.now < end:
            self.board.run(TICK)
            if self.driver.tick(self.board.now):
                self.sent.append(tenths(*self.driver.sent))
                self.times.append(self.board.now)
            self.pulses += self.board.pulses()
        return self

    def goto(self, *angles: float, time: float) -> "Host":
        self.safety.trajectory(SERVOS, [time], [list(angles)], self.board.now, source=SOURCE)
        return self


def tenths(*angles: float) -> tuple[int, ...]:
    return tuple(round(10 * pulse) for pulse in CALIBRATION.pulses(angles))


def assert_limits_and_speed(pulses: list[Pulse], speed: float = SPEED) -> None:
    """Each pulse lies within the servos' range, and none is further from the last than the slew rate allows."""
    for servo in range(3):
        last = None
        for pulse in (p for p in pulses if p.servo == servo):
            assert 544 - 6 <= pulse.width <= 2400 + 6
            if last is not None:
                # the newest command may be up to a driver's period older or younger than the pulse before it told
                time = pulse.start - last.start + 0.03
                assert abs(pulse.width - last.width) <= speed * US_PER_RAD * time + 6
            last = pulse


def test_from_the_hello_to_a_motion_of_the_servos(board) -> None:
    host = Host(board).run(0.5)
    assert host.safety.state is State.HOLDING
    assert host.link.session.firmware.startswith("2.2")
    host.goto(-1.2, -0.9, -0.3, time=0.5).run(1.0)
    assert is_row_of(rows(host.pulses[-30:] + pulses_so_far(board))[-1], tenths(-1.2, -0.9, -0.3))
    assert_limits_and_speed(host.pulses)
    assert is_row_of(tuple(p.width for p in sorted(host.pulses[:3], key=lambda p: p.servo)), tenths(*START))


def test_when_the_driver_is_killed_the_servos_hold_and_then_let_go(board) -> None:
    host = Host(board).run(0.5).goto(-1.5, -1.5, -1.5, time=1.0).run(0.4)
    killed = board.now
    board.vanish()
    board.run(1.5)
    after = board.pulses()
    held = [p for p in after if p.start > killed + 2 * PERIOD]
    assert len({round(p.width) for p in held if p.servo == 0}) == 1
    assert_limits_and_speed(host.pulses + after)
    assert 1.0 - 2 * PERIOD < after[-1].start - killed < 1.0 + 2 * PERIOD


def test_a_driver_that_comes_back_finds_the_servos_where_they_are(board) -> None:
    """Its predecessor was killed, the port is opened without a reset: it starts from the board's own pulses."""
    first = Host(board).run(0.5).goto(-1.5, -1.2, -0.9, time=1.0).run(1.5)
    assert first.safety.state in (State.ACTIVE, State.HOLDING)
    second = Host(board, resets=False).run(0.5).goto(-0.6, -0.6, -0.6, time=1.0).run(1.5)
    assert_limits_and_speed(first.pulses + second.pulses)
    assert is_row_of(rows(second.pulses[-30:] + pulses_so_far(board))[-1], tenths(-0.6, -0.6, -0.6))


def test_a_board_that_resets_in_motion_is_met_again_without_a_jump(board) -> None:
    host = Host(board).run(0.5).goto(-1.5, -1.5, -1.5, time=1.0).run(0.5)
    host.wire.reset()
    host.run(1.0)
    assert host.safety.state is State.HOLDING
    assert "reset" in host.safety.message or host.link.session.diagnostics["board resets"] == 1
    host.goto(-1.0, -1.0, -1.0, time=1.0).run(1.5)
    assert_limits_and_speed(host.pulses)
    assert is_row_of(rows(host.pulses[-30:] + pulses_so_far(board))[-1], tenths(-1.0, -1.0, -1.0))


@pytest.mark.parametrize("cause", ResetCause)
def test_a_reset_in_motion_is_told_with_its_cause(board, cause: ResetCause) -> None:
    host = Host(board).run(0.5).goto(-1.5, -1.5, -1.5, time=1.0).run(0.5)
    host.wire.reset()
    board.set_memory(MCUSR, cause)
    host.run(0.5)
    word, message = reset_told(cause)
    assert (host.driver.message, host.link.session.diagnostics["last reset"]) == (message, word)


def assert_only_what_was_sent(host: Host, pulses: list[Pulse]) -> None:
    """Each pose at the pins is one that the driver sent, in that order; where frames were lost the next catches up."""
    at = 0
    for row in rows(pulses):
        while not is_row_of(row, host.sent[at]):
            at += 1


def assert_sent_at_allowed_speed(host: Host) -> None:
    """After a pause of any length the joints move on as if it had been two periods."""
    for (a, b), (s, t) in zip(pairwise(host.sent), pairwise(host.times), strict=True):
        step = max(abs(x - y) for x, y in zip(a, b, strict=True)) / 10
        assert step <= SPEED * US_PER_RAD * (t - s + TICK) + 0.2


@pytest.mark.parametrize("noise", [0.002, 0.02])
def test_a_bad_line_moves_no_servo_where_it_should_not_be(free_board, noise: float) -> None:
    board = free_board
    host, rng = Host(board).run(0.5), random.Random(3)
    host.wire.noise = noise
    for _ in range(30):
        host.goto(*(rng.uniform(-1.8, -0.1) for _ in SERVOS), time=rng.uniform(0.1, 1.0)).run(0.4)
    pulses = host.pulses + pulses_so_far(board)
    assert len(pulses) > 900
    assert_only_what_was_sent(host, pulses)
    assert_sent_at_allowed_speed(host)


@pytest.mark.parametrize("seed", range(6))
def test_after_any_faults_the_servos_were_only_where_they_were_sent_and_the_watchdog_ends_it(
    free_board, seed
) -> None:
    board = free_board
    host, rng = Host(board).run(0.5), random.Random(seed)
    met = set()
    for _ in range(12):
        fault = rng.choice(
            [None, Fault.SILENT, Fault.LATE, Fault.CORRUPT, Fault.UNPLUGGED, "noise", "reset", "stop"]
        )
        met.add(fault)
        host.port.fault = fault if isinstance(fault, Fault) else None
        host.wire.noise = 0.05 if fault == "noise" else 0.0
        mode = Mode.STOP if fault == "stop" else Mode.TELEOP
        host.safety.control_mode(said(mode, board.now), board.now, board.now)
        if fault == "reset":
            host.wire.reset()
        for _ in range(rng.randrange(1, 5)):
            sent = len(host.sent)
            host.goto(*(rng.uniform(-2.1, 0.5) for _ in SERVOS), time=rng.uniform(0.0, 0.5)).run(0.3)
            if fault == "stop":
                assert len(set(host.sent[sent:])) <= 1, "a command after stop"
    assert len(met) > 3
    host.port.fault, host.wire.noise = None, 0.0
    host.run(3.0)
    killed = board.now
    board.vanish()
    board.run(1.2)
    after = board.pulses()
    assert after == [] or after[-1].start - killed < 1.0 + 2 * PERIOD
    board.run(0.1)
    assert board.pulses() == []
    assert_only_what_was_sent(host, host.pulses + after)
    assert_sent_at_allowed_speed(host)


def test_readings_of_an_imu_reach_the_driver(make_board) -> None:
    board = make_board(IMU_BAUD=9600)
    board.set_pin("B", 0, True)
    board.run(0.010)
    host = Host(board).run(0.5).goto(-1.2, -0.9, -0.3, time=0.5)
    for i in range(10):
        send_imu_line(board, f"{i}.5,-{2 * i}.25,\n".encode())
        host.run(0.02)
    degrees = [(57.29577951308232 * r.roll, 57.29577951308232 * r.pitch) for r in host.link.session.readings]
    assert degrees == [pytest.approx((i + 0.5, -2 * i - 0.25)) for i in range(10)]
    assert_only_what_was_sent(host, host.pulses + pulses_so_far(board))


def test_on_request_the_driver_speaks_legacy_to_it(board) -> None:
    host = Host(board, "legacy").run(0.5).goto(-1.2, -0.9, -0.3, time=0.5).run(1.0)
    degrees = [round(57.29577951308232 * a) + 180 for a in (-1.2, -0.9, -0.3)]
    wanted = tuple(10 * (544 + d * 1856 // 180) for d in degrees)
    assert is_row_of(rows(host.pulses[-30:] + pulses_so_far(board))[-1], wanted)
