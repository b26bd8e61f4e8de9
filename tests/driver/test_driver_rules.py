"""What may reach the servos, and when: the driver against a port in memory, with time given by the test."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.decisions import SOURCE, said
from tests.messages import assert_names, raises_naming
from tripod_driver.calibration import Calibration
from tripod_driver.driver import Driver
from tripod_driver.link import Link
from tripod_driver.ports.mock import Fault, MockPort
from tripod_driver.protocol import RESOLUTION, AngleMapping, LegacyDecoder, LegacyProtocol
from tripod_driver.safety import Safety, State
from tripod_driver.session import LegacySession
from tripod_graph.command import CommandError, CommandLimits
from tripod_graph.mode import Decision, Mode
from tripod_graph.names import SERVOS, SLIDE

PERIOD = 0.02
LIMITS = CommandLimits(angle_speed=2.0, park=(-0.2, -0.2, -0.2, 0.0), park_after=1.0)
PROTOCOL = LegacyProtocol()


class Bench:
    """A driver on a mock port, and a clock."""

    def __init__(
        self, *, boot_time: float = 0.0, start=(-0.5, -0.5, -0.5), active: bool = True, **options
    ) -> None:
        self.now = 100.0
        self.port = MockPort(boot_time=boot_time)
        session = LegacySession(LegacyProtocol(), Calibration(), start)
        link = Link(self.port, session, retry_min=0.5, retry_max=2.0)
        self.safety = Safety(LIMITS, *session.bounds(), start=start)
        self.driver = Driver(link, self.safety, period=0.975 * PERIOD, **options)  # a change at each tick
        if active:
            self.driver.connect()
            self.safety.activate(self.now)
            self.driver.tick(self.now)

    def run(self, duration: float) -> list[tuple[float, bytes]]:
        """Tick for `duration` [s]; return time and bytes of every packet that arrived."""
        sent = []
        for _ in range(round(duration / PERIOD)):
            self.now += PERIOD
            before = len(self.port.arrived)
            count = self.driver.packets_sent
            if self.driver.tick(self.now):
                sent.append((self.now, self.port.arrived[before:]))
            assert self.driver.packets_sent - count <= 1
        return sent

    def goto(self, *angles: float, time: float = 0.0) -> None:
        self.safety.trajectory(SERVOS, [time], [list(angles)], self.now, source=SOURCE)

    def mode(self, mode: Mode) -> None:
        self.hear(said(mode, self.now))

    def hear(self, decision: Decision) -> None:
        self.safety.control_mode(decision, self.now, self.now)

    @property
    def angles(self) -> tuple[float, ...]:
        return PROTOCOL.decode(self.port.arrived[-4:])


def test_nothing_is_opened_or_sent_before_it_is_allowed() -> None:
    bench = Bench(active=False)
    assert bench.run(1.0) == []
    assert (bench.port.opened, bench.safety.state) == (0, State.DISCONNECTED)
    assert all(math.isnan(angle) for angle in bench.driver.sent)
    bench.driver.connect()
    assert bench.run(1.0) == []
    assert (bench.port.opened, bench.safety.state) == (1, State.READY)
    bench.mode(Mode.TELEOP)
    bench.goto(-1.0, -1.0, -1.0)
    assert_names(bench.safety.message, "not active", "ignored")
    bench.safety.activate(bench.now)
    assert bench.run(3.0) == []  # what was asked before does not count, and nothing parks unasked
    assert bench.safety.state is State.HOLDING
    bench.goto(-0.6, -0.6, -0.6)
    packets = bench.run(0.5)
    assert packets[0][1] == PROTOCOL.encode([-0.5] * 3)
    assert bench.angles == pytest.approx([-0.6] * 3, abs=RESOLUTION + 1e-9)


@pytest.mark.parametrize(
    ("start", "first"), [((-0.5, -0.6, -0.7), [-0.5, -0.6, -0.7]), (None, [math.radians(93 - 180)] * 3)]
)
def test_nothing_is_sent_before_a_command_and_then_first_the_place_of_the_firmwares_start(
    start, first
) -> None:
    bench = Bench(boot_time=1.0, start=start)
    bench.mode(Mode.TELEOP)
    assert bench.run(0.98) == []
    assert bench.safety.state is State.CONNECTING
    assert bench.run(10.0) == []
    assert bench.safety.state is State.HOLDING
    assert bench.safety.place == pytest.approx(first, abs=RESOLUTION)
    bench.goto(-1.0, -1.0, -1.0)
    assert bench.run(PERIOD)[0][1] == PROTOCOL.encode(first)  # of the library: 93 degrees, 1502 us


def test_changes_are_sent_at_once_and_the_same_bytes_only_as_keep_alive() -> None:
    bench = Bench(keep_alive=0.1)
    bench.mode(Mode.TELEOP)
    bench.goto(-0.5, -0.5, -0.5)
    still = bench.run(0.5)
    assert 5 <= len(still) <= 7
    assert {packet for _, packet in still} == {PROTOCOL.encode([-0.5] * 3)}
    assert np.diff([100.0, *(t for t, _ in still), bench.now]).max() <= 0.1 + 1e-9
    bench.goto(-0.5, -0.6, -0.5)
    moving = bench.run(0.04)  # 2 rad/s: a degree passes in 9 ms
    assert len(moving) == 2
    assert bench.driver.bytes_sent == 4 * bench.driver.packets_sent == len(bench.port.arrived)


def test_a_change_does_not_wait_for_a_packet_that_was_only_a_keep_alive() -> None:
    bench = Bench(keep_alive=0.1)
    bench.mode(Mode.TELEOP)
    bench.goto(-0.5, -0.5, -0.5)
    bench.run(2 * PERIOD)
    while not bench.run(PERIOD):  # until one has just left
        pass
    bench.goto(-0.5, -0.6, -0.5)
    bench.now += 0.5 * PERIOD
    assert bench.driver.tick(bench.now), "2 rad/s: a degree passes in 9 ms, and half a period is 10 ms"
    bench.goto(-0.5, -0.9, -0.5)
    bench.now += 0.5 * PERIOD
    assert not bench.driver.tick(bench.now), "changes keep their distance"


def test_packets_carry_the_commanded_angles() -> None:
    bench = Bench()
    bench.mode(Mode.TELEOP)
    bench.safety.trajectory(
        (SLIDE, "servo_2", "servo_1", "servo_0"),
        [0.5, 1.0],
        [[0.0, -0.7, -0.6, -0.5], [0.01, -0.9, -0.8, -0.7]],
        100.0,
        source=SOURCE,
    )
    bench.run(0.5)
    assert bench.angles == pytest.approx([-0.5, -0.6, -0.7], abs=RESOLUTION + 1e-9)
    bench.run(0.5)
    assert bench.angles == pytest.approx([-0.7, -0.8, -0.9], abs=RESOLUTION + 1e-9)
    assert bench.safety.commanded == pytest.approx([-0.7, -0.8, -0.9])
    assert bench.driver.sent == bench.angles
    assert bench.safety.message == ""
    assert bench.safety.state is State.ACTIVE


def test_an_angle_that_the_protocol_cannot_carry_is_said_to_be_clamped() -> None:
    bench = Bench()
    bench.mode(Mode.TELEOP)
    bench.goto(-0.5, 0.3, -0.5, time=0.5)
    bench.run(0.5)
    assert bench.port.arrived[-4:] == bytes([255, 151, 180, 151])
    assert_names(bench.safety.message, "servo_1", "0.300 rad", "-2.100 to 0.000 rad", "nearest")


def test_silence_holds_then_parks() -> None:
    bench = Bench()
    bench.mode(Mode.TELEOP)
    bench.goto(-1.0, -1.0, -1.0, time=0.4)
    bench.run(0.9)  # silent 0.5 s after the last point
    assert bench.safety.state is State.ACTIVE
    bench.run(0.96)
    assert bench.safety.state is State.HOLDING
    assert bench.angles == pytest.approx([-1.0] * 3, abs=RESOLUTION + 1e-9)
    bench.run(1.0)
    assert bench.safety.state is State.PARKED
    assert bench.port.arrived[-4:] == PROTOCOL.encode([-0.2] * 3)


@pytest.mark.parametrize("stop", ["mode", "service"])
def test_stop_holds_at_once_and_ignores_commands(stop: str) -> None:
    bench = Bench()
    bench.mode(Mode.TELEOP)
    bench.goto(-1.5, -1.5, -1.5, time=1.0)
    bench.run(0.5)
    last = bench.port.arrived[-4:]
    if stop == "mode":
        bench.mode(Mode.STOP)
    else:
        bench.safety.halt(bench.now)
    bench.goto(-1.0, -1.0, -1.0)
    bench.run(0.9)
    assert bench.safety.state is State.HOLDING
    assert {packet for _, packet in bench.run(0.06)} <= {last}
    assert bench.port.arrived[-4:] == last
    assert_names(
        bench.safety.message, *(("STOP", repr(SOURCE)) if stop == "mode" else ("service", "control mode"))
    )
    assert bench.safety.rejected == 0  # they were no mistakes
    bench.mode(Mode.REPLAY)
    assert bench.safety.message == ""
    bench.goto(-1.2, -1.2, -1.2, time=0.4)
    bench.run(0.44)
    assert bench.angles == pytest.approx([-1.2] * 3, abs=RESOLUTION + 1e-9)


def test_stop_also_interrupts_the_way_to_the_park_position() -> None:
    bench = Bench(start=(-1.5, -1.5, -1.5))
    bench.mode(Mode.TELEOP)
    bench.goto(-1.5, -1.5, -1.5)
    bench.run(1.8)  # silent after 0.5 s, held for 1 s, then 0.3 s of the 0.65 s to the park position
    assert bench.safety.state is State.PARKED
    bench.mode(Mode.STOP)
    last = bench.port.arrived[-4:]
    bench.run(0.9)
    assert bench.port.arrived[-4:] == last != PROTOCOL.encode([-0.2] * 3)
    bench.run(0.6)
    assert bench.port.arrived[-4:] == PROTOCOL.encode([-0.2] * 3)


def test_the_same_mode_again_does_not_undo_a_stop_by_service() -> None:
    bench = Bench()
    bench.mode(Mode.TELEOP)
    bench.goto(-0.5, -0.5, -0.5)
    bench.run(0.1)
    bench.safety.halt(bench.now)
    bench.mode(Mode.TELEOP)
    bench.goto(-1.0, -1.0, -1.0)
    bench.run(0.2)
    assert bench.angles == pytest.approx([-0.5] * 3, abs=RESOLUTION)


@pytest.mark.parametrize("looked", [True, False])
def test_an_operator_that_was_lost_and_is_back_does_not_undo_a_stop_by_service(looked: bool) -> None:
    bench = Bench()
    teleop = Decision(Mode.TELEOP, SOURCE, bench.now)
    bench.hear(teleop)
    bench.goto(-0.5, -0.5, -0.5)
    bench.run(0.1)
    bench.safety.halt(bench.now)
    if looked:
        bench.run(1.5)
        assert bench.safety.authority.lost == SOURCE
    else:  # the computer stood still
        bench.now += 1.5
    bench.hear(teleop)
    bench.goto(-1.0, -1.0, -1.0)
    bench.run(0.3)
    assert min(bench.angles) >= -0.5 - RESOLUTION  # held, or parked
    assert_names(bench.safety.message, "service")
    bench.hear(Decision(Mode.STOP, "another"))
    bench.hear(replace(teleop, stamp=bench.now))  # decided again
    bench.goto(-1.0, -1.0, -1.0)
    bench.run(0.6)
    assert bench.angles == pytest.approx([-1.0] * 3, abs=RESOLUTION)


def test_a_new_source_does_not_inherit_the_motion_of_the_old_one() -> None:
    bench = Bench()
    bench.mode(Mode.REPLAY)
    bench.goto(-2.0, -2.0, -2.0, time=10.0)
    bench.run(1.0)
    bench.mode(Mode.TELEOP)
    last = bench.port.arrived[-4:]
    bench.run(0.5)
    assert bench.port.arrived[-4:] == last
    assert bench.safety.state is State.HOLDING


def test_bad_commands_are_named_whether_motion_is_allowed_or_not() -> None:
    bench = Bench()
    bad = (SERVOS, [0.0], [[math.nan, 0.0, 0.0]])
    wrong = ("point 0", "servo_0", "nan rad", "-2.1 to 0.6 rad")
    with raises_naming(CommandError, *wrong):
        bench.safety.trajectory(*bad, bench.now, source=SOURCE)
    bench.mode(Mode.TELEOP)
    bench.run(0.1)
    with raises_naming(CommandError, *wrong):
        bench.safety.trajectory(*bad, bench.now, source=SOURCE)
    with raises_naming(ValueError, "control mode 9", "0 STOP"):
        bench.safety.control_mode(said(9, bench.now), bench.now, bench.now)
    assert bench.safety.authority.mode is Mode.TELEOP


def test_a_lost_port_is_opened_again_and_the_next_command_ramps() -> None:
    bench = Bench()
    bench.mode(Mode.TELEOP)
    bench.goto(-1.5, -1.5, -1.5, time=1.0)
    bench.run(0.5)
    count = bench.driver.packets_sent
    bench.port.fault = Fault.UNPLUGGED
    bench.run(0.3)
    assert bench.safety.state is State.DISCONNECTED
    assert_names(bench.safety.message, "mock", "lost", "0.5 s")
    bench.goto(-1.8, -1.8, -1.8)  # nobody hears it
    bench.run(0.5)
    assert_names(bench.safety.message, "mock", "unplugged", "1 s")
    assert bench.driver.packets_sent == count
    bench.port.fault = None
    assert bench.run(1.5) == []  # what was asked before the loss is forgotten
    assert bench.driver.link.reconnects == 1
    bench.goto(-1.3, -1.3, -1.3)
    ramp = [PROTOCOL.decode(packet) for _, packet in bench.run(0.5)]
    assert ramp[0] == pytest.approx([-0.5] * 3, abs=RESOLUTION)  # where its firmware has put them by now
    steps = np.abs(np.diff(ramp, axis=0))
    assert steps.max() <= 2.0 * PERIOD + 2 * RESOLUTION
    assert ramp[-1] == pytest.approx([-1.3] * 3, abs=RESOLUTION + 1e-9)


@pytest.mark.parametrize("fault", [Fault.SILENT, Fault.LATE, Fault.CORRUPT])
def test_a_fault_that_nobody_can_see_does_not_stop_the_stream(fault: Fault) -> None:
    bench = Bench()
    bench.mode(Mode.TELEOP)
    bench.run(0.1)
    bench.port.fault = fault
    bench.goto(-0.7, -0.7, -0.7, time=0.2)
    bench.run(0.3)
    assert bench.safety.state is State.ACTIVE
    bench.port.fault = None
    bench.run(0.2)
    found = LegacyDecoder().feed(bench.port.arrived)
    assert found[-1] == pytest.approx([-0.7] * 3, abs=RESOLUTION + 1e-9)


def test_a_write_cut_short_reopens_the_port_and_the_stream_recovers() -> None:
    bench = Bench()
    bench.mode(Mode.TELEOP)
    bench.goto(-0.5, -0.5, -0.5)
    bench.run(0.1)
    bench.port.fault = Fault.SHORT
    bench.run(0.2)
    assert bench.safety.state is State.DISCONNECTED
    assert_names(bench.safety.message, "mock", "2 of 4 bytes", "0.5 s")
    bench.port.fault = None
    bench.run(0.6)
    bench.goto(-0.5, -0.5, -0.5)
    bench.run(0.1)
    decoder = LegacyDecoder()
    assert decoder.feed(bench.port.arrived)[-1] == pytest.approx([-0.5] * 3, abs=RESOLUTION)
    assert decoder.skipped == 2


def test_deactivation_holds_and_sends_nothing_more() -> None:
    bench = Bench()
    bench.mode(Mode.TELEOP)
    bench.goto(-1.5, -1.5, -1.5, time=1.0)
    bench.run(0.5)
    last = bench.angles
    bench.safety.deactivate()
    assert bench.run(3.0) == []
    assert bench.safety.state is State.READY
    bench.safety.activate(bench.now)
    assert bench.run(5.0) == []  # neither the old trajectory nor the park position
    bench.goto(-1.5, -1.5, -1.5, time=1.0)
    bench.run(PERIOD)
    assert bench.angles == pytest.approx(last, abs=2.0 * PERIOD + RESOLUTION)


def test_parking_ramps_to_the_park_position_and_ignores_commands() -> None:
    bench = Bench()
    bench.mode(Mode.TELEOP)
    bench.goto(-1.0, -0.6, -1.0, time=0.5)
    bench.run(0.5)
    bench.safety.park(bench.now)
    assert not bench.driver.at_rest
    bench.goto(-2.0, -2.0, -2.0)
    packets = bench.run(0.44)  # 0.8 rad at 2 rad/s, and a tick
    assert bench.driver.at_rest
    assert packets[-1][1] == PROTOCOL.encode([-0.2] * 3)
    steps = np.diff([PROTOCOL.decode(packet) for _, packet in packets], axis=0)
    assert np.abs(steps).max() <= 2.0 * PERIOD + 2 * RESOLUTION
    assert bench.safety.state is State.PARKED


def test_disconnecting_closes_the_port_and_keeps_it_closed() -> None:
    bench = Bench()
    bench.run(0.1)
    bench.driver.disconnect(bench.now)
    assert bench.run(1.0) == []
    assert (bench.port.is_open, bench.port.opened) == (False, 1)
    assert_names(bench.safety.message, "port", "closed")


def test_a_stalled_executor_moves_no_further_than_one_pulse_may() -> None:
    bench = Bench()
    bench.mode(Mode.TELEOP)
    bench.goto(-0.5, -0.5, -0.5)
    bench.run(0.1)
    bench.goto(-2.0, -2.0, -2.0)
    bench.now += 0.4
    bench.driver.tick(bench.now)
    assert bench.angles == pytest.approx([-0.54] * 3, abs=RESOLUTION + 1e-9)  # 2 rad/s in 0.02 s
    bench.safety.park(bench.now)
    bench.now += 0.4
    bench.driver.tick(bench.now)
    assert bench.angles == pytest.approx([-0.5] * 3, abs=RESOLUTION + 1e-9)


def test_tutorial_bytes_are_those_of_the_workshop() -> None:
    port = MockPort()
    session = LegacySession(LegacyProtocol(AngleMapping.TUTORIAL), Calibration(), [-0.5, -1.0, -1.5])
    safety = Safety(CommandLimits(), *session.bounds())
    driver = Driver(Link(port, session, retry_min=1, retry_max=1), safety)
    driver.connect()
    safety.activate(0.0)
    safety.control_mode(said(Mode.TELEOP, 1.0), 1.0, 0.0)
    driver.tick(0.0)
    safety.trajectory(SERVOS, [0.0], [[0.0, 0.0, 0.0]], 0.0, source=SOURCE)
    driver.tick(0.0)
    assert port.arrived == bytes(
        [255, 150, 121, 93]
    )  # floor(-28.6) + 179, floor(-57.3) + 179, floor(-85.9) + 179


angle = st.floats(LIMITS.angle_min, LIMITS.angle_max)
event = st.one_of(
    st.tuples(st.just("goto"), st.tuples(angle, angle, angle, st.floats(0.0, 1.0))),
    st.tuples(st.just("mode"), st.sampled_from(Mode)),
    st.tuples(st.just("fault"), st.none() | st.sampled_from([Fault.SHORT, Fault.UNPLUGGED])),
    st.tuples(
        st.sampled_from(["halt", "deactivate", "activate", "disconnect", "connect", "park"]), st.none()
    ),
    st.tuples(st.just("wait"), st.floats(0.02, 1.0)),
)


@given(st.lists(event, max_size=15))
def test_whatever_happens_the_servos_see_neither_a_jump_nor_an_impossible_byte(events) -> None:
    bench = Bench()
    steps, place = [], np.full(3, -0.5)

    def run(duration: float) -> None:
        nonlocal place
        for _ in range(round(duration / PERIOD)):
            opened = bench.port.opened
            packets = bench.run(PERIOD)
            if bench.port.opened > opened:
                place = np.full(3, -0.5)  # the board has started
            for _, packet in packets:
                steps.append(np.abs(PROTOCOL.decode(packet) - place).max())
                place = np.array(PROTOCOL.decode(packet))

    bench.mode(Mode.TELEOP)
    for kind, value in (("goto", (-0.5, -0.5, -0.5, 0.0)), *events):
        if kind == "goto":
            bench.goto(*value[:3], time=value[3])
        elif kind == "mode":
            bench.mode(value)
        elif kind == "fault":
            bench.port.fault = value
        elif kind in ("halt", "activate", "park"):
            getattr(bench.safety, kind)(bench.now)
        elif kind == "deactivate":
            bench.safety.deactivate()
        elif kind == "disconnect":
            bench.driver.disconnect(bench.now)
        elif kind == "connect":
            bench.driver.connect()
        run(value if kind == "wait" else PERIOD)
    bench.port.fault = None
    bench.driver.connect()
    bench.safety.activate(bench.now)
    for mode in (Mode.STOP, Mode.TELEOP):
        run(3.0)  # so that the next is a decision of its own
        bench.mode(mode)
    bench.goto(-1.0, -1.0, -1.0)
    run(5.0)
    assert max(steps) <= 2.0 * PERIOD + 2 * RESOLUTION + 1e-9
    assert bench.port.arrived[-4:] == PROTOCOL.encode([-0.2] * 3)  # in the end it parks
