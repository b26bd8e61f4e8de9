"""Everything that goes wrong between computer and board: each ends in a safe state, with its message."""

import random
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tripod_driver.calibration import Calibration, ServoCalibration
from tripod_driver.choose_session import choose_sessions, common_bounds
from tripod_driver.driver import Driver
from tripod_driver.framed import encode
from tripod_driver.framed_messages import BoardState, Flags, Hello, HelloReply, SetPulses
from tripod_driver.link import Link
from tripod_driver.ports.mock import Fault, MockPort
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.protocol import HEADER, AngleMapping
from tripod_driver.safety import Safety, State
from tripod_graph.command import CommandLimits
from tripod_graph.mode import Mode
from tripod_graph.names import SERVOS

TICK = 0.005
LIMITS = CommandLimits(angle_speed=2.0, park_after=1.0)
CALIBRATION = Calibration()


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class Bench:
    """The whole driver without ROS, a board in memory, and a clock."""

    def __init__(
        self,
        board: object | None = None,
        *,
        protocol: str = "framed",
        calibration: Calibration = CALIBRATION,
        boot_time: float = 0.0,
    ) -> None:
        self.clock = Clock()
        self.board = MockBoard(self.clock) if board is None else board
        self.port = MockPort(self.board, boot_time=boot_time)
        sessions = choose_sessions(protocol, AngleMapping.ROUNDED, calibration)
        self.link = Link(self.port, *sessions, retry_min=0.5, retry_max=2.0)
        self.safety = Safety(LIMITS, *common_bounds(sessions), start=[-0.5] * 3)
        self.driver = Driver(self.link, self.safety)
        self.sent: list[tuple[float, tuple[float, ...]]] = []
        self.states: list[State] = []
        self.driver.connect()
        self.safety.activate(self.clock.now)

    def run(self, duration: float, command: Callable[[], None] | None = None) -> "Bench":
        for k in range(round(duration / TICK)):
            self.clock.now += TICK
            if command is not None and k % 4 == 0:
                command()
            if self.driver.tick(self.clock.now):
                self.sent.append((self.clock.now, self.driver.sent))
            if not self.states or self.states[-1] is not self.safety.state:
                self.states.append(self.safety.state)
        return self

    def goto(self, *angles: float, time: float = 0.0) -> None:
        self.safety.trajectory(SERVOS, [time], [list(angles)], self.clock.now)

    def moving(self) -> "Bench":
        """Bring it into motion towards -1.5 rad, half way there."""
        self.safety.control_mode(Mode.IK, self.clock.now, self.clock.now)
        self.run(0.1)
        self.goto(-1.5, -1.5, -1.5, time=1.0)
        self.run(0.5)
        assert self.safety.state is State.ACTIVE
        return self

    def stream(self) -> None:
        self.goto(-1.5, -1.5, -1.5, time=0.05)


# in motion ----------------------------------------------------------------------------------------------------


class Foreigner:
    """Another program that sends to the same board."""

    def __init__(self, bench: Bench) -> None:
        self.bench, self.sequence = bench, 100

    def __call__(self) -> None:
        self.sequence = (self.sequence + 1) % 256
        self.bench.board.write(encode(SetPulses((15000, 15000, 15000)), self.sequence))


def unplug(bench: Bench) -> None:
    bench.port.fault = Fault.UNPLUGGED


def fall_silent(bench: Bench) -> None:
    bench.port.fault = Fault.SILENT


def answer_late(bench: Bench) -> None:
    queue: list[tuple[float, bytes]] = []
    read = bench.board.read

    def late() -> bytes:
        queue.append((bench.clock.now + 0.6, read()))
        due = b"".join(data for at, data in queue if at <= bench.clock.now)
        queue[:] = [(at, data) for at, data in queue if at > bench.clock.now]
        return due

    bench.board.read = late  # type: ignore[method-assign]


def cut_short(bench: Bench) -> None:
    bench.port.fault = Fault.SHORT


def talk_nonsense(bench: Bench) -> None:
    noise = random.Random(1)
    bench.board.read = lambda: noise.randbytes(7)  # type: ignore[method-assign]


def garble(bench: Bench) -> None:
    bench.port.fault = Fault.CORRUPT


def take_other_baud(bench: Bench) -> None:
    """What both ends hear when the other has another baud: nothing that makes sense."""
    noise = random.Random(2)
    bench.board.write = lambda data: None  # type: ignore[method-assign]
    bench.board.read = lambda: noise.randbytes(1)  # type: ignore[method-assign]


IN_MOTION = [
    (unplug, "mock was lost; next attempt after 0.5 s"),
    (fall_silent, "mock: no acknowledgement for 0.3 s; check cable and power; next attempt after 0.5 s"),
    (answer_late, "mock: no acknowledgement for 0.3 s; check cable and power; next attempt after 0.5 s"),
    (cut_short, "mock took 7 of 14 bytes; next attempt after 0.5 s"),
    (talk_nonsense, "mock: no acknowledgement for 0.3 s; check cable and power; next attempt after 0.5 s"),
    (garble, "mock: no acknowledgement for 0.3 s; check cable and power; next attempt after 0.5 s"),
    (take_other_baud, "mock: no acknowledgement for 0.3 s; check cable and power; next attempt after 0.5 s"),
]


@pytest.mark.parametrize(("fault", "message"), IN_MOTION, ids=[fault.__name__ for fault, _ in IN_MOTION])
def test_a_fault_in_motion_disconnects_says_why_and_the_next_motion_ramps(fault, message: str) -> None:
    bench = Bench().moving()
    fault(bench)
    before = len(bench.sent)
    for _ in range(200):
        bench.run(TICK, bench.stream)
        if bench.safety.state is State.DISCONNECTED:
            break
    assert bench.safety.state is State.DISCONNECTED
    assert bench.safety.message == message
    assert bench.clock.now < 100.0 + 0.6 + 0.35  # within the time of silence
    assert not bench.port.is_open
    sent = len(bench.sent)
    assert sent - before <= 16  # nothing but what was on its way
    bench.run(0.4, bench.stream)  # commands go on; nobody hears them
    assert len(bench.sent) == sent
    last = bench.sent[-1][1]
    bench.port.fault = None
    bench.board.__dict__.pop("read", None)
    bench.board.__dict__.pop("write", None)
    bench.run(3.0)
    assert State.CONNECTING in bench.states
    assert bench.safety.state in (State.HOLDING, State.PARKED)
    assert bench.sent[sent][1] == pytest.approx(last, abs=2.0 * 0.02)  # from where they were, to a period
    times = np.array([t for t, _ in bench.sent])
    angles = np.array([a for _, a in bench.sent])
    assert (np.abs(np.diff(angles, axis=0)).max(axis=1) <= 2.0 * np.diff(times) + 1e-3).all()


def test_a_reset_in_motion_holds_says_so_and_greets_the_board_anew() -> None:
    bench = Bench().moving()
    here = bench.sent[-1][1]
    bench.board.restart()
    bench.run(0.1)
    assert bench.safety.state is State.HOLDING
    assert bench.safety.message == "the board was reset; check its supply and cable"
    assert State.CONNECTING in bench.states[-3:]
    bench.run(0.8)
    assert bench.sent[-1][1] == pytest.approx(here, abs=0.05)  # it neither went on nor jumped
    assert bench.link.session.diagnostics["board resets"] == 1
    bench.goto(-1.0, -1.0, -1.0)
    assert bench.safety.message == ""


def test_a_board_that_resets_again_and_again_is_a_fault() -> None:
    bench = Bench().moving()
    for _ in range(3):
        bench.board.restart()
        bench.run(0.3, bench.stream)
    assert bench.safety.state is State.FAULT
    assert bench.safety.message == (
        "mock: the board was reset 3 times within 10 s: give the servos their own supply; then restart the driver"
    )
    assert not bench.port.is_open


def test_two_writers_are_a_fault() -> None:
    bench = Bench().moving()
    other = Foreigner(bench)
    for _ in range(40):
        other()
        bench.run(0.02, bench.stream)
    assert bench.safety.state is State.FAULT
    assert (
        bench.safety.message
        == "mock: another program writes to this port too; stop that one; then restart the driver"
    )
    sent = len(bench.sent)
    bench.run(2.0, bench.stream)
    assert len(bench.sent) == sent


def test_the_watchdog_of_the_board_interrupts_the_motion() -> None:
    bench = Bench().moving()
    bench.clock.now += 0.8  # the computer stalled
    bench.run(0.05)
    assert bench.safety.state is State.HOLDING
    assert bench.safety.message == "the board heard nothing for its watchdog's time and let go"
    assert np.diff([a[0] for _, a in bench.sent[-4:]]).min() >= -2.0 * (0.04 + 0.02) - 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_two_per_cent_of_noise_neither_moves_a_servo_wrongly_nor_stops_the_motion(seed: int) -> None:
    bench = Bench()
    noise = random.Random(seed)
    write, read = bench.board.write, bench.board.read

    def noisy(data: bytes) -> bytes:
        return bytes(noise.randrange(256) if noise.random() < 0.02 else byte for byte in data)

    bench.moving()
    bench.board.write = lambda data: write(noisy(data))  # type: ignore[method-assign]
    bench.board.read = lambda: noisy(read())  # type: ignore[method-assign]
    count = len(bench.board.history)
    rng = np.random.default_rng(seed)
    goals: list[list[float]] = []

    def command() -> None:
        goals.append(list(rng.uniform(-1.5, 0.0, 3)))
        bench.goto(*goals[-1], time=0.1)

    told = {tuple(5 * round(t / 5) for t in bench.link.session.content(angles)) for _, angles in bench.sent}
    bench.run(12.0, command)
    told |= {tuple(5 * round(t / 5) for t in bench.link.session.content(angles)) for _, angles in bench.sent}
    assert len(bench.board.history) - count > 400
    assert set(bench.board.history) <= told
    assert bench.link.reconnects == 0
    assert bench.link.session.diagnostics["frames lost on the line"] > 10


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
STRANGERS = [
    (
        "framed",
        Talker(GPS),
        "mock: it sends '$GPGGA,123519,4807.038,N'... and no answer to a hello: not the robot's port",
    ),
    (
        "framed",
        Talker(echo=True),
        "mock: the port returns what is written to it and is no robot; choose another with",
    ),
    (
        "framed",
        Talker(),
        "mock: no answer to a hello: is this the robot, with this project's firmware, at this baud?",
    ),
    ("framed", Talker(b"\x8f\x03\xfe"), "mock: it sends '\\\\x8f\\x03\\\\xfe"),
    (
        "legacy",
        Talker(GPS),
        "mock: it sends '$GPGGA,123519,4807.038,N'... and the workshop's firmware is silent",
    ),
    (
        "legacy",
        Talker(GPS[:5]),
        "mock: it sends '$GPGG$GPGG$GPGG$GPGG$GPG'... and the workshop's firmware is silent",
    ),
    (
        "ascii",
        Talker(GPS),
        "mock: it sends '$GPGGA,123519,4807.038,N'... and that is no IMU: is this the right port",
    ),
    ("ascii", Talker(b"\xff\x00"), "mock: it sends '\\\\xff\\x00"),
    (
        "framed_or_legacy",
        Talker(GPS),
        "mock: it sends '$GPGGA,123519,4807.038,N'... and no answer to a hello",
    ),
]


@pytest.mark.parametrize(("protocol", "device", "message"), STRANGERS)
def test_a_port_that_is_no_robot_is_named_and_nothing_but_hellos_reach_it(protocol, device, message) -> None:
    bench = Bench(device, protocol=protocol, boot_time=2.0)
    bench.safety.control_mode(Mode.IK, 1.0, 100.0)
    told = set()
    for _ in range(800):
        bench.run(TICK, bench.stream)
        told.add(bench.safety.message)
    assert any(text.startswith(message) for text in told), told
    assert bench.safety.state in (State.DISCONNECTED, State.CONNECTING)
    assert bench.sent == []
    assert HEADER not in device.received  # what the workshop's firmware would take for a command
    assert bench.port.opened >= 1


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            {"protocol": 2},
            "its firmware speaks version 2 of the protocol, this driver 1; bring it up to date: make -C",
        ),
        ({"servo_count": 2}, "its firmware drives 2 servos, the robot has 3; bring it up to date"),
        ({"pulse_max": 20000}, "servo_0 needs 2400.0 us at 0 rad, the board makes 500 to 2000 us; calibrate"),
        (
            {"pulses": (6000, 20000, 20000)},
            "servo_0 stands at -3.047 rad, its safe range is -2.1 to 0 rad: switch",
        ),
    ],
)
def test_a_board_that_must_not_be_driven_is_a_fault(changed: dict, message: str) -> None:
    class Other(MockBoard):
        def _answer(self, message: object):
            if isinstance(message, Hello):
                good = HelloReply((1, 0), 1, 3, 5000, 25000, 500, BoardState.IDLE, Flags(0), (0, 0, 0))
                return replace(good, **changed)
            return super()._answer(message)

    bench = Bench(Other())
    bench.safety.control_mode(Mode.IK, 1.0, 100.0)
    bench.run(3.0, bench.stream)
    assert bench.safety.state is State.FAULT
    assert bench.safety.message.startswith(f"mock: {message}")
    assert bench.safety.message.endswith("; then restart the driver")
    assert (bench.sent, bench.board.history, bench.port.is_open, bench.port.opened) == ([], [], False, 1)


def test_another_version_of_the_protocol_is_a_fault() -> None:
    bench = Bench(MockBoard(version=7)).run(0.5)
    assert bench.safety.state is State.FAULT
    assert bench.safety.message.startswith(
        "mock: its firmware speaks version 7 of the protocol, this driver 1"
    )
    bench.board.version = 1
    bench.run(3.0)
    assert bench.port.opened == 1  # nobody tries again by himself
    bench.driver.connect()  # somebody has flashed it and configured the driver anew
    bench.run(0.2)
    assert bench.safety.state is State.HOLDING


def test_a_pulse_that_the_board_refuses_is_a_fault() -> None:
    bench = Bench().moving()
    bench.board.pulse_range = (5000, 20000)  # not what it said
    bench.goto(0.0, -0.5, -0.5)
    bench.run(1.0)
    assert bench.safety.state is State.FAULT
    assert "the board refuses the pulse of servo_0 as out of its range" in bench.safety.message


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
    assert bench.safety.message == "mock is open; waiting up to 3 s for the board's answer"
    bench.run(0.3)
    assert bench.safety.state is State.HOLDING
    assert bench.sent[0][1] == pytest.approx([-0.5] * 3, abs=1e-3)


@pytest.mark.parametrize("silent", [True, False])
def test_only_on_request_and_only_where_nobody_answers_the_workshops_protocol_is_tried(silent: bool) -> None:
    bench = Bench(Talker() if silent else MockBoard(), protocol="framed_or_legacy", boot_time=0.5)
    bench.run(3.0)
    assert bench.link.session.name == ("legacy" if silent else "framed")
    assert bench.safety.state in (State.HOLDING, State.PARKED)
    if silent:
        assert bytes([255, 151, 151, 151]) in bench.board.received
        assert bench.port.opened == 1
    only = Bench(Talker(), protocol="framed", boot_time=0.5).run(3.0)
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
    bench.run(1.0)
    gaps = np.diff([t for t, _ in bench.sent])
    assert gap - 0.02 <= gaps.min() and gaps.max() <= gap + 1e-9


def test_a_packet_that_is_not_acknowledged_is_sent_again_sooner() -> None:
    bench = Bench()
    bench.driver = Driver(bench.link, bench.safety, keep_alive=0.4)
    bench.driver.connect()
    bench.run(0.5)
    write = bench.board.write
    bench.board.write = lambda data: None  # type: ignore[method-assign]
    count = len(bench.sent)
    while len(bench.sent) == count:
        bench.run(TICK)
    bench.board.write = write  # type: ignore[method-assign]
    bench.run(0.3)
    lost, again = (t for t, _ in bench.sent[count : count + 2])
    assert 0.07 <= again - lost <= 0.1 + 1e-9
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
    bench.run(0.1)
    wanted = [544 + 1856 * (np.pi - 0.5) / np.pi, 600 + 1700 * 0.5 / np.pi, 544 + 1856 * 2.5 / np.pi]
    assert np.array(bench.board.pulses) / 10 == pytest.approx(wanted, abs=0.3)
    assert bench.sent[0][1] == pytest.approx([-0.5] * 3, abs=1e-3)
    legacy = Bench(
        Talker(),
        protocol="legacy",
        calibration=Calibration((ServoCalibration(), mirrored, ServoCalibration())),
    )
    legacy.run(0.05)
    degrees = (np.array(wanted) - 544) / 1856 * 180
    assert legacy.board.received[:4] == bytes(
        [255, round(degrees[0]), 60, round(degrees[0])]
    )  # 38 is below 60


# whatever happens ---------------------------------------------------------------------------------------------

angle = st.floats(LIMITS.angle_min, LIMITS.angle_max)
event = st.one_of(
    st.tuples(st.just("goto"), st.tuples(angle, angle, angle, st.floats(0.0, 1.0))),
    st.tuples(st.just("mode"), st.sampled_from(Mode)),
    st.tuples(st.just("fault"), st.none() | st.sampled_from(Fault)),
    st.tuples(
        st.sampled_from(["halt", "deactivate", "activate", "park", "reset", "foreign", "stall"]), st.none()
    ),
    st.tuples(st.just("wait"), st.floats(0.02, 1.5)),
)


@settings(max_examples=200)
@given(st.lists(event, max_size=12))
def test_whatever_the_port_does_angles_stay_within_range_and_slew_rate_and_silence_is_noticed(events) -> None:
    bench = Bench()
    bench.safety.control_mode(Mode.IK, 1.0, 100.0)
    bench.run(0.1)
    foreign = Foreigner(bench)
    for kind, value in events:
        now = bench.clock.now
        if kind == "goto":
            bench.goto(*value[:3], time=value[3])
        elif kind == "mode":
            bench.safety.control_mode(value, now, now)
        elif kind == "fault":
            bench.port.fault = value
        elif kind == "reset":
            bench.board.restart()
        elif kind == "foreign":
            foreign()
        elif kind == "stall":
            bench.clock.now += 0.7
        elif kind == "deactivate":
            bench.safety.deactivate()
        elif kind != "wait":
            getattr(bench.safety, kind)(now)
        bench.run(value if kind == "wait" else 0.05)
    if bench.safety.can_move:
        bench.port.fault = Fault.SILENT
        bench.run(0.6)
        assert bench.safety.state in (State.DISCONNECTED, State.CONNECTING), "silence was not noticed"
    count = len(bench.sent)
    bench.port.fault = Fault.UNPLUGGED
    bench.run(0.5)
    assert len(bench.sent) == count
    angles = np.array([a for _, a in bench.sent])
    times = np.array([t for t, _ in bench.sent])
    slack = 2e-4  # pulses are rounded to 0.1 us
    assert ((angles >= -2.1 - slack) & (angles <= 0.0 + slack)).all()
    jumps = [np.abs(np.subtract(pulses, 15000)).max() for pulses in bench.board.history]
    assert not jumps or max(jumps) < 15000
    if not any(kind == "reset" or kind == "foreign" for kind, _ in events):
        assert (np.abs(np.diff(angles, axis=0)).max(axis=1) <= 2.0 * np.diff(times) + 2 * slack).all()


def test_no_hello_holds_the_header_of_the_workshops_packets() -> None:
    bench = Bench(Talker(), boot_time=30.0).run(31.5)
    hellos = bench.board.received.split(b"\0\0")
    assert len(hellos) > 256  # every sequence number was due
    assert HEADER not in bench.board.received
