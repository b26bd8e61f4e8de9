"""Everything that goes wrong in motion between computer and board: each ends in a safe state, with its message."""

import random

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.decisions import said
from tests.driver.bench import LIMITS, START, TICK, Bench
from tests.messages import assert_names, names
from tripod_driver.driver import INCIDENT_TIME
from tripod_driver.framed import encode
from tripod_driver.framed_messages import BoardState, ResetCause, SetPulses
from tripod_driver.framed_session import SLOW
from tripod_driver.ports.mock import Fault
from tripod_driver.ports.mock_board import STEP, MockBoard
from tripod_driver.safety import State
from tripod_graph.mode import Mode

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
    hold_back(bench, 0.6)


def hold_back(bench: Bench, delay: float) -> None:
    """Let all that the board says arrive later by `delay` [s]."""
    queue: list[tuple[float, bytes]] = []
    read = bench.board.read

    def late() -> bytes:
        queue.append((bench.clock.now + delay, read()))
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


UNANSWERED = ("acknowledgement", "0.3 s", "cable", "power")

IN_MOTION = [
    (unplug, ("lost",)),
    (fall_silent, UNANSWERED),
    (answer_late, UNANSWERED),
    (cut_short, ("7 of 14 bytes",)),
    (talk_nonsense, UNANSWERED),
    (garble, UNANSWERED),
    (take_other_baud, UNANSWERED),
]
"""Faults, and what the message of each names."""


@pytest.mark.parametrize(("fault", "named"), IN_MOTION, ids=[fault.__name__ for fault, _ in IN_MOTION])
def test_a_fault_in_motion_disconnects_says_why_and_the_next_motion_ramps(
    fault, named: tuple[str, ...]
) -> None:
    bench = Bench().moving()
    fault(bench)
    before = len(bench.sent)
    for _ in range(200):
        bench.run(TICK, bench.stream)
        if bench.safety.state is State.DISCONNECTED:
            break
    assert bench.safety.state is State.DISCONNECTED
    assert_names(bench.safety.message, "mock", *named, "next attempt", "0.5 s")
    assert (
        bench.clock.now < 100.0 + 0.6 + 0.1 + 0.3 + 2 * TICK
    )  # the next keep-alive is not acknowledged in time
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
    assert len(bench.sent) == sent  # nothing before a command: the servos have let go
    bench.run(0.5, bench.stream)
    assert bench.sent[sent][1] == pytest.approx(last, abs=2.0 * 0.02)  # from where they were, to a period
    angles = np.array([a for _, a in bench.sent])
    assert np.abs(np.diff(angles, axis=0)).max() <= 2.0 * 0.02 + 1e-3


def test_a_reset_in_motion_holds_says_so_and_greets_the_board_anew() -> None:
    bench = Bench().moving()
    here = bench.sent[-1][1]
    bench.board.restart()
    bench.run(0.1)
    assert bench.safety.state is State.HOLDING
    assert_names(bench.driver.message, "board", "reset", "button", "port")
    assert State.CONNECTING in bench.states[-3:]
    bench.run(0.8)
    assert bench.sent[-1][1] == pytest.approx(here, abs=0.05)  # it neither went on nor jumped
    assert bench.link.session.diagnostics["board resets"] == 1
    bench.goto(-1.0, -1.0, -1.0)
    assert bench.safety.message == ""


@pytest.mark.parametrize(
    ("cause", "named"),
    [
        (ResetCause.BROWN_OUT, ("reset", "supply", "of their own")),
        (ResetCause.BROWN_OUT | ResetCause.EXTERNAL, ("reset", "supply", "of their own")),
        (ResetCause.WATCHDOG, ("reset", "watchdog", "firmware")),
    ],
    ids=str,
)
def test_a_failure_of_the_board_stays_in_the_message_while_commands_stream(
    cause: ResetCause, named: tuple[str, ...]
) -> None:
    bench = Bench().moving()
    bench.board.cause = cause
    bench.board.restart()
    began = bench.clock.now
    while bench.clock.now < began + INCIDENT_TIME - 0.5:
        bench.run(0.1, bench.stream)
        if bench.clock.now > began + 0.3:
            assert bench.safety.state is State.ACTIVE
            assert_names(bench.driver.message, *named)
    assert bench.driver.incidents == 1
    bench.run(1.0, bench.stream)
    assert bench.driver.message == ""


def test_a_brown_out_at_rest_is_told_too() -> None:
    bench = Bench().run(0.2)
    bench.safety.deactivate()
    bench.board.cause = ResetCause.BROWN_OUT
    bench.board.restart()
    bench.run(1.5)
    assert_names(bench.driver.message, "reset", "supply")


@pytest.mark.parametrize(
    ("cause", "told"),
    [
        (ResetCause.BROWN_OUT, 1),
        (ResetCause.WATCHDOG, 1),
        (ResetCause.POWER_ON | ResetCause.BROWN_OUT, 0),  # just switched on: the supply rises
        (ResetCause.POWER_ON, 0),
        (ResetCause.EXTERNAL, 0),  # by the opening of the port
    ],
    ids=str,
)
def test_of_resets_before_the_first_answer_those_are_told_that_are_failures(
    cause: ResetCause, told: int
) -> None:
    board = MockBoard()
    board.cause = cause
    assert Bench(board).run(0.5).driver.incidents == told


def test_a_reset_at_rest_is_noticed_by_the_next_hello() -> None:
    bench = Bench()
    bench.run(0.2)
    bench.safety.deactivate()
    bench.run(1.5)
    assert bench.safety.state is State.READY
    bench.board.restart()
    bench.run(1.5)
    assert bench.link.session.diagnostics["board resets"] == 1
    assert bench.states[-2:] == [State.CONNECTING, State.READY]


def test_a_board_that_resets_again_and_again_is_a_fault() -> None:
    bench = Bench().moving()
    for _ in range(3):
        bench.board.restart()
        bench.run(0.3, bench.stream)
    assert bench.safety.state is State.FAULT
    assert_names(bench.safety.message, "mock", "reset 3 times", "10 s", "supply", "restart the driver")
    assert not bench.port.is_open


def test_two_writers_are_a_fault() -> None:
    bench = Bench().moving()
    other = Foreigner(bench)
    for _ in range(40):
        other()
        bench.run(0.02, bench.stream)
    assert bench.safety.state is State.FAULT
    assert_names(bench.safety.message, "mock", "another program", "stop", "restart the driver")
    sent = len(bench.sent)
    bench.run(2.0, bench.stream)
    assert len(bench.sent) == sent


def test_the_watchdog_of_the_board_interrupts_the_motion() -> None:
    bench = Bench().moving()
    bench.clock.now += 0.8  # the computer stalled
    bench.run(0.05)
    assert bench.safety.state is State.HOLDING
    assert_names(bench.safety.message, "board", "watchdog")
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
    assert bench.lost_frames > 10


def lose(bench: Bench, there: float, back: float) -> None:
    """Lose these shares of the packets and of the answers, whole."""
    chance = random.Random(3)
    write, read = bench.board.write, bench.board.read

    def lossy_write(data: bytes) -> None:
        if chance.random() >= there:
            write(data)

    def lossy_read() -> bytes:
        answer = read()
        return answer if chance.random() >= back else b""

    bench.board.write, bench.board.read = lossy_write, lossy_read  # type: ignore[method-assign]


@pytest.mark.parametrize(("there", "back"), [(0.05, 0.0), (0.0, 0.05), (0.3, 0.0), (0.0, 0.3), (0.3, 0.3)])
def test_a_line_that_loses_whole_frames_is_told_as_that_and_the_motion_goes_on(there, back) -> None:
    bench = Bench().moving()
    lose(bench, there, back)
    session, frames = bench.link.session, len(bench.sent)
    assert session.odd == ""
    bench.run(30.0, bench.stream)
    assert (bench.safety.state, bench.link.reconnects) == (State.ACTIVE, 0)
    lost = (1.0 - (1.0 - there) * (1.0 - back)) * (len(bench.sent) - frames)
    assert bench.lost_frames == pytest.approx(lost, rel=0.5)
    count = int(session.odd.split()[0])  # of the last 100
    assert 0 < count < 100
    assert_names(session.odd, count, "100 packets", "cable", "plugs")


@pytest.mark.parametrize("delay", [0.016, 0.03, 0.1, 0.15, 0.2, 0.25])
def test_servos_move_however_late_the_board_answers(delay: float) -> None:
    bench = Bench()
    hold_back(bench, delay)
    bench.run(2 * delay)
    bench.asked().run(10 * delay)
    for _ in range(40):
        bench.goto(-0.8, -0.7, -0.6)
        bench.run(0.1)
    assert bench.sent[-1][1] == pytest.approx((-0.8, -0.7, -0.6), abs=1e-3)
    assert bench.safety.state is State.ACTIVE
    assert names(bench.driver.message, "to answer", "ms") == (delay > SLOW)


def test_a_loss_is_told_by_the_status() -> None:
    messages = pytest.importorskip("tripod_driver.messages")
    bench = Bench().moving()
    assert messages.status_message(bench.driver).message == ""
    lose(bench, 0.2, 0.0)
    bench.run(2.0, bench.stream)
    assert_names(messages.status_message(bench.driver).message, "packets", "cable", "plugs")
    bench.safety.halt(bench.clock.now)
    assert (
        messages.status_message(bench.driver).message == f"{bench.safety.message}; {bench.link.session.odd}"
    )


def test_at_rest_one_greeting_that_is_lost_ends_nothing() -> None:
    bench = Bench().moving()
    bench.safety.deactivate()
    lose(bench, 0.1, 0.0)
    bench.run(60.0)
    assert (bench.safety.state, bench.link.reconnects) == (State.READY, 0)
    assert bench.lost_frames > 2


def test_a_second_writer_is_found_on_a_line_that_loses_frames() -> None:
    bench = Bench().moving()
    lose(bench, 0.2, 0.0)
    other = Foreigner(bench)
    for _ in range(100):
        other()
        bench.run(0.02, bench.stream)
    assert bench.safety.state is State.FAULT
    assert_names(bench.safety.message, "another program")


def test_a_second_writer_that_takes_the_answers_to_its_own_frames_is_found() -> None:
    bench = Bench().moving()
    other = Foreigner(bench)
    for _ in range(10):
        other()
        bench.board.read()
        bench.run(0.1, bench.stream)
    assert bench.safety.state is State.FAULT


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


@example([("park", None), ("mode", Mode.STOP)])
@given(st.lists(event, max_size=12))
def test_whatever_the_port_does_angles_stay_within_range_and_slew_rate_and_silence_is_noticed(events) -> None:
    bench = Bench()
    bench.safety.control_mode(said(Mode.TELEOP, 1.0), 1.0, 100.0)
    bench.run(0.1)
    bench.goto(*START)
    bench.run(0.1)
    foreign = Foreigner(bench)
    for kind, value in events:
        now, running = bench.clock.now, bench.safety.authority.mode
        if kind == "goto":
            bench.goto(*value[:3], time=value[3])
        elif kind == "mode":
            bench.safety.control_mode(said(value, now), now, now)
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
        if kind == "halt" or (kind == "mode" and value is Mode.STOP and running is not Mode.STOP):
            count = len(bench.sent)
            bench.run(0.1, bench.stream)
            after = np.array([bench.link.session.content(a) for _, a in bench.sent[count:]])
            assert after.size == 0 or np.ptp(after, axis=0).max() <= STEP, "a command after stop"
        bench.run(value if kind == "wait" else 0.05)
    if bench.safety.can_move:
        bench.port.fault = Fault.SILENT
        bench.run(0.6)
        assert bench.safety.state in (State.DISCONNECTED, State.CONNECTING), "silence was not noticed"
    count = len(bench.sent)
    bench.port.fault = Fault.UNPLUGGED
    bench.run(1.0)
    assert len(bench.sent) == count
    assert bench.board.state in (BoardState.IDLE, BoardState.RELEASED), "the watchdog did not fire"
    angles = np.array([a for _, a in bench.sent])
    slack = 2e-4  # pulses are rounded to 0.1 us
    assert ((angles >= -2.1 - slack) & (angles <= 0.0 + slack)).all()
    jumps = [np.abs(np.subtract(pulses, 15000)).max() for pulses in bench.board.history]
    assert not jumps or max(jumps) < 15000
    if not any(kind == "reset" or kind == "foreign" for kind, _ in events):
        assert np.abs(np.diff(angles, axis=0)).max(initial=0.0) <= 2.0 * 0.02 + 2 * slack
