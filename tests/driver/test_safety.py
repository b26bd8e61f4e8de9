"""The state machine between commands and servos: no sequence of events gets a forbidden angle past it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.decisions import SOURCE, said
from tests.messages import assert_names, raises_naming
from tripod_driver.place import Place
from tripod_driver.safety import CREEP, PULSE_PERIOD, Safety, State
from tripod_graph.command import CommandError, CommandLimits
from tripod_graph.mode import Mode
from tripod_graph.names import SERVOS

LIMITS = CommandLimits(
    angle_min=-1.8, angle_speed=2.0, timeout=0.3, park=(-0.2, -0.2, -0.2, 0.0), park_after=1.0
)
LOWER, UPPER = (-1.6, -2.1, -1.7), (-0.1, 0.0, 0.2)
START = (-0.5, -0.6, -0.7)
PERIOD = PULSE_PERIOD
TOLD = "the board says so"
AT_START = Place(START, TOLD)


def make(**options) -> Safety:
    return Safety(LIMITS, LOWER, UPPER, start=START, **options)


def ready(safety: Safety, now: float = 0.0, place: Place = AT_START) -> Safety:
    safety.ready(now, place)
    safety.activate(now)
    safety.control_mode(said(Mode.TELEOP, now + 1.0), now + 1.0, now)
    return safety


def run(safety: Safety, begin: float, duration: float) -> np.ndarray:
    times = begin + PERIOD * np.arange(1, round(duration / PERIOD) + 1)
    return np.array([safety.setpoint(t) for t in times])


def goto(safety: Safety, angles, now: float, time: float = 0.0) -> None:
    safety.trajectory(SERVOS, [time], [list(angles)], now, source=SOURCE)


def test_angles_come_out_only_when_the_board_is_ready_and_motion_is_allowed() -> None:
    safety = make()
    assert (safety.state, safety.setpoint(0.0)) == (State.DISCONNECTED, None)
    safety.activate(0.0)
    assert (safety.state, safety.setpoint(0.1)) == (State.DISCONNECTED, None)
    safety.connecting(0.2, "port is open")
    assert (safety.state, safety.message, safety.setpoint(0.2)) == (State.CONNECTING, "port is open", None)
    safety.ready(0.3, Place(START, TOLD))
    assert (safety.state, safety.message) == (State.HOLDING, "")
    assert safety.setpoint(30.0) is None  # nothing was asked for, and nothing parks unasked
    safety.control_mode(said(Mode.TELEOP, 1.0), 1.0, 30.0)
    goto(safety, [-1.0] * 3, 30.0)
    assert safety.setpoint(30.0) == pytest.approx(START)
    safety.deactivate()
    assert (safety.state, safety.setpoint(30.1)) == (State.READY, None)


def test_what_the_board_holds_on_its_behalf_goes_on_being_held_and_is_parked_after_silence() -> None:
    safety = make()
    safety.activate(0.0)
    safety.ready(0.0, Place((-1.2, -1.3, -1.4), TOLD, kept=True))
    way = run(safety, 0.0, 0.9)
    assert way == pytest.approx(np.tile([-1.2, -1.3, -1.4], (len(way), 1)))
    assert run(safety, 0.9, 1.0)[-1] == pytest.approx([-0.2] * 3)


def test_a_long_lease_lets_a_trajectory_end_and_then_the_robot_parks() -> None:
    """docs/robot.md: the operator has a lease of 600 s and is never heard of again."""
    safety = ready(make())
    hold = [-1.0] * 3
    safety.trajectory(SERVOS, [1.0, 300.0], [hold, hold], 0.0, source=SOURCE)
    way = run(safety, 0.0, 300.0)
    assert way[-1] == pytest.approx(hold)
    assert safety.state is State.ACTIVE
    run(safety, 300.0, LIMITS.timeout + LIMITS.park_after - 0.1)
    assert safety.state is State.HOLDING
    parked = run(safety, 300.0 + LIMITS.timeout + LIMITS.park_after - 0.1, 1.0)
    assert (safety.state, safety.authority.lost) == (State.PARKED, "")
    assert parked[-1] == pytest.approx([-0.2] * 3)


def test_a_fault_ends_all_motion_until_somebody_has_looked() -> None:
    safety = ready(make())
    goto(safety, [-1.0] * 3, 0.0)
    assert safety.setpoint(0.02) is not None
    safety.fault(0.04, "wrong firmware")
    for event in (
        lambda t: safety.ready(t, Place(START, TOLD)),
        lambda t: safety.disconnected(t, "x"),
        lambda t: safety.connecting(t, "x"),
        safety.activate,
    ):
        event(0.06)
        assert (safety.state, safety.message, safety.setpoint(0.06)) == (State.FAULT, "wrong firmware", None)
    goto(safety, [-1.0] * 3, 0.08)
    assert safety.setpoint(0.1) is None
    safety.clear()
    safety.ready(0.2, Place(START, TOLD))
    assert safety.state is State.HOLDING


def test_every_servo_stays_within_its_own_safe_range() -> None:
    safety = ready(make())
    goto(safety, [-1.8] * 3, 0.0, 0.5)
    assert run(safety, 0.0, 0.7)[-1] == pytest.approx([-1.6, -1.8, -1.7])
    assert_names(safety.message, "servo_0", "-1.800 rad", "-1.600 to -0.100 rad", "nearest")
    goto(safety, [0.6] * 3, 0.7, 1.3)
    assert run(safety, 0.7, 1.4)[-1] == pytest.approx([-0.1, 0.0, 0.2])


def test_a_trajectory_begins_where_the_servos_are_not_where_they_were_asked_to_be() -> None:
    safety = ready(make())
    goto(safety, [0.5] * 3, 0.0, 0.5)
    held = run(safety, 0.0, 0.7)[-1]
    assert held == pytest.approx([-0.1, 0.0, 0.2])
    goto(safety, [-0.6] * 3, 0.7, 1.0)
    way = run(safety, 0.7, 0.5)
    assert way[-1] == pytest.approx((held - 0.6) / 2)


def test_a_goal_that_is_stopped_is_told_of_that_and_of_nothing_that_was_before() -> None:
    safety = ready(make())
    goto(safety, [0.5] * 3, 0.0, 0.5)
    run(safety, 0.0, 0.7)
    safety.control_mode(said(Mode.STOP, 1.7), 1.7, 0.7)
    motion = safety.motion(0.7)
    assert motion.trajectory is None
    assert_names(motion.why, "STOP", SOURCE)
    assert motion.why != safety.message
    assert_names(safety.message, "servo_0", "-1.600 to -0.100 rad")


def test_a_servo_that_may_be_sent_nothing_is_refused_at_the_start() -> None:
    with raises_naming(
        CommandError, "servo_1", "1 to 2 rad", "angle_min -1.8", f"angle_max {LIMITS.angle_max:g} rad"
    ):
        Safety(LIMITS, (-1.6, 1.0, -1.7), (0.0, 2.0, 0.0))


def test_the_ramp_begins_where_the_board_says_that_the_servos_are() -> None:
    safety = ready(make())
    safety.disconnected(1.0, "unplugged")
    safety.ready(2.0, Place((-1.2, -1.3, -1.4), TOLD))
    goto(safety, [-0.5] * 3, 2.0)
    assert safety.setpoint(2.0) == pytest.approx([-1.2, -1.3, -1.4])
    steps = np.diff(run(safety, 2.0, 0.8), axis=0)
    assert np.abs(steps).max() == pytest.approx(2.0 * PERIOD)


def test_from_outside_of_the_limits_it_ramps_in_instead_of_jumping() -> None:
    outside = (-2.0, -0.6, 0.5)  # servo 0 below -1.6, servo 2 above 0.2
    safety = ready(make(), place=Place(outside, TOLD))
    goto(safety, [-1.5, -0.6, 0.1], 0.0)
    way = np.vstack([outside, run(safety, 0.0, 0.1)])
    safety.control_mode(said(Mode.STOP, 2.0), 2.0, 0.1)
    stopped = run(safety, 0.1, 0.5)
    assert stopped == pytest.approx(np.tile(way[-1], (len(stopped), 1)))  # where it is, outside or not
    safety.control_mode(said(Mode.TELEOP, 3.0), 3.0, 0.6)
    goto(safety, [-1.8, -0.6, 0.6], 0.6)
    way = np.vstack([way, run(safety, 0.6, 0.4)])
    assert np.abs(np.diff(way, axis=0)).max() <= 2.0 * PERIOD + 1e-12
    assert way[-1] == pytest.approx([-1.6, -0.6, 0.2])


def test_where_nobody_knows_the_place_it_says_so_and_creeps_to_the_first_pose() -> None:
    safety = ready(make(), place=Place((-1.0, -1.0, -1.0)))
    assert not safety.place_known
    assert_names(safety.message, "unknown", "servos", "20 degrees a second")
    for k in range(100):  # a stream, as of inverse kinematics
        goto(safety, [-0.6, -1.1, -1.0], PERIOD * k, 0.1)
        run(safety, PERIOD * k, PERIOD)
        assert np.abs(np.subtract(safety.place, -1.0)).max() <= CREEP * PERIOD * k + 1e-9
        assert safety.place_known == (safety.place[0] > -0.6 - np.radians(0.5))
    assert (safety.place_known, safety.message) == (True, "")
    goto(safety, [-1.4, -1.1, -1.0], 2.0)
    steps = np.diff(run(safety, 2.0, 0.4)[:, 0])
    assert np.abs(steps).max() == pytest.approx(2.0 * PERIOD)


def test_what_somebody_else_moved_goes_on_from_there() -> None:
    safety = ready(make())
    goto(safety, [-0.5] * 3, 0.0)
    run(safety, 0.0, 0.1)
    safety.moved([-1.2, -1.2, -1.2])
    goto(safety, [-0.5] * 3, 0.1)
    way = run(safety, 0.1, 0.5)
    assert way[0] == pytest.approx([-1.2] * 3)
    assert np.abs(np.diff(way, axis=0)).max() == pytest.approx(2.0 * PERIOD)


def test_an_interruption_holds_is_told_and_ends_with_the_next_command() -> None:
    safety = ready(make())
    goto(safety, [-1.5] * 3, 0.0, 1.0)
    before = run(safety, 0.0, 0.4)[-1]
    safety.interrupt(0.4, "the board was reset")
    assert run(safety, 0.4, 0.2) == pytest.approx(np.tile(before, (10, 1)))
    assert (safety.state, safety.message) == (State.HOLDING, "the board was reset")
    goto(safety, [-1.5] * 3, 0.6, 1.0)
    assert (safety.state, safety.message) == (State.ACTIVE, "")


def test_what_interrupts_no_motion_is_no_trouble() -> None:
    safety = ready(make())
    safety.interrupt(0.1, "the watchdog of the board")  # as after every pause in which nothing was sent
    assert (safety.state, safety.message) == (State.HOLDING, "")


# whatever happens ---------------------------------------------------------------------------------------------

angle = st.floats(-1.8, 0.6)
board_angle = st.tuples(st.floats(-1.6, -0.1), st.floats(-1.8, 0.0), st.floats(-1.7, 0.2))
event = st.one_of(
    st.tuples(st.just("goto"), st.tuples(angle, angle, angle, st.floats(0.0, 1.0))),
    st.tuples(st.just("bad"), st.sampled_from([math.nan, math.inf, -5.0])),
    st.tuples(st.just("mode"), st.sampled_from(Mode)),
    st.tuples(st.just("ready"), st.builds(Place, board_angle, st.sampled_from([TOLD, ""]), st.booleans())),
    st.tuples(
        st.sampled_from(
            [
                "halt",
                "activate",
                "deactivate",
                "park",
                "interrupt",
                "disconnected",
                "connecting",
                "fault",
                "clear",
            ]
        ),
        st.none(),
    ),
    st.tuples(st.just("wait"), st.floats(0.001, 3.0)),
)


class Watch:
    """Feeds events to a Safety and checks each angle that comes out."""

    def __init__(self) -> None:
        self.safety, self.now = make(), 0.0
        self.last: np.ndarray | None = None
        self.last_at = 0.0
        self.silent_at = float("-inf")  # when the newest command counts as over
        self.stopped_at: float | None = None
        self.held: np.ndarray | None = None

    def do(self, kind: str, value) -> None:
        safety, now = self.safety, self.now
        if kind == "goto":
            followed = safety.listens and safety.authority.mode is not Mode.STOP and self.stopped_at is None
            goto(safety, value[:3], now, value[3])
            if followed:
                self.silent_at = now + value[3] + LIMITS.timeout
        elif kind == "bad":
            with pytest.raises(CommandError):
                goto(safety, [value] * 3, now)
        elif kind == "mode":
            before = safety.authority.mode
            safety.control_mode(said(value, now), now, now)
            if value is not before:
                self.stopped_at = self.held = None
                self.silent_at = float("-inf")
        elif kind == "ready":
            known = safety.state
            safety.ready(now, value)
            if known in (State.DISCONNECTED, State.CONNECTING):
                self.last, self.held = np.array(value.angles), None
        elif kind in ("interrupt", "disconnected", "connecting", "fault"):
            getattr(safety, kind)(now, "for a test")
        elif kind in ("halt", "activate", "park"):
            getattr(safety, kind)(now)
            if kind != "activate":
                self.stopped_at, self.held = now, None
        elif kind in ("deactivate", "clear"):
            getattr(safety, kind)()

    def tick(self) -> None:
        out = self.safety.setpoint(self.now)
        state = self.safety.state
        assert (out is not None) == self.safety.can_move
        assert not self.safety.can_move or state in (State.ACTIVE, State.HOLDING, State.PARKED)
        if out is None:
            return
        assert (out >= np.maximum(LOWER, LIMITS.angle_min) - 1e-9).all()
        assert (out <= np.minimum(UPPER, LIMITS.angle_max) + 1e-9).all()
        if self.last is not None:
            allowed = LIMITS.angle_speed * (self.now - self.last_at)
            assert np.abs(out - self.last).max() <= allowed + 1e-9
        if self.now > self.silent_at + 1e-9:
            assert state is not State.ACTIVE, "the watchdog did not fire"
        stopped = self.stopped_at is not None or self.safety.authority.mode is Mode.STOP
        if stopped:
            assert state is not State.ACTIVE, "a command after a stop"
            if state is State.HOLDING:
                assert self.held is None or np.allclose(out, self.held, rtol=0, atol=1e-9), (
                    "motion after a stop"
                )
                self.held = out
        if state is not State.HOLDING or not stopped:
            self.held = None
        self.last, self.last_at = out, self.now


@given(st.lists(event, max_size=25), st.lists(st.floats(0.0, 0.5), min_size=30, max_size=30))
def test_limits_slew_rate_watchdog_and_stop_hold_in_every_sequence_of_events(events, gaps) -> None:
    watch = Watch()
    for kind, value in (("activate", None), ("ready", Place(START, TOLD)), ("mode", Mode.TELEOP), *events):
        watch.do(kind, value)
        for gap in [0.0, PERIOD, gaps[len(kind) % 30], *([value] if kind == "wait" else [])]:
            watch.now += gap
            watch.tick()
    watch.safety.clear()
    watch.do("ready", Place(watch.safety.place, TOLD))
    watch.do("activate", None)
    for mode in (Mode.STOP, Mode.TELEOP):
        watch.now += 3.0  # so that the next is a decision of its own
        watch.do("mode", mode)
    watch.do("goto", (-1.0, -1.0, -1.0, 0.0))
    for _ in range(400):
        watch.now += PERIOD
        watch.tick()
    assert watch.safety.state is State.PARKED
    assert watch.last == pytest.approx([-0.2] * 3)


def test_other_slew_rates_and_times_hold_from_when_they_are_adopted() -> None:
    safety = ready(make())
    goto(safety, [-1.5, -1.6, -1.7], 0.0, time=0.1)
    way = run(safety, 0.0, 0.2)
    assert np.abs(np.diff(way, axis=0)).max() == pytest.approx(2.0 * PERIOD)
    safety.adopt(replace(LIMITS, angle_speed=0.5, timeout=2.0, park_after=4.0))
    assert safety.range.speed[:3] == pytest.approx([0.5] * 3)
    assert safety.range.lower[:3] == pytest.approx([-1.6, -1.8, -1.7])  # the angles are those of before
    goto(safety, [-1.5, -1.6, -1.7], 0.2, time=0.1)
    way = run(safety, 0.2, 0.6)
    assert np.abs(np.diff(way, axis=0)).max() == pytest.approx(0.5 * PERIOD)
    assert safety.state is State.ACTIVE  # silent for longer than the first time-out
    run(safety, 0.8, 4.0)
    assert safety.state is State.HOLDING
    run(safety, 4.8, 2.0)
    assert safety.state is State.PARKED


def test_adopting_other_limits_does_not_end_parking() -> None:
    safety = ready(make())
    goto(safety, [-1.5, -1.6, -1.7], 0.0, time=0.1)
    run(safety, 0.0, 1.0)
    safety.park(1.0)
    safety.adopt(replace(LIMITS, angle_speed=1.0))
    run(safety, 1.0, 2.0)
    assert safety.state is State.PARKED
    assert safety.at_rest
    safety.halt(3.0)  # which ends it
    assert run(safety, 3.0, 0.5) == pytest.approx(np.tile([-0.2] * 3, (25, 1)), abs=1e-9)
    assert safety.state is State.HOLDING


def test_a_motion_is_as_slow_as_the_clock_by_which_it_passes_and_safety_is_not() -> None:
    slow, plain = ready(make()), ready(make())
    slow.moment = lambda now: 0.25 * now
    for safety in (slow, plain):
        goto(safety, [-1.5] * 3, 0.0, time=1.0)
    quarter, whole = run(slow, 0.0, 2.0), run(plain, 0.0, 0.5)
    np.testing.assert_allclose(quarter[-1], whole[-1], atol=0.02)
    slow.control_mode(said(Mode.STOP, 2.0), 2.0, 2.0)
    held = run(slow, 2.0, 0.5)
    assert (held == held[0]).all()


def test_a_motion_by_a_fast_clock_keeps_the_slew_rate_of_the_servos() -> None:
    safety = ready(make())
    safety.moment = lambda now: 8.0 * now
    goto(safety, [-1.5] * 3, 0.0, time=4.0)
    way = np.vstack([START, run(safety, 0.0, 1.0)])
    assert np.abs(np.diff(way, axis=0)).max() <= LIMITS.angle_speed * PERIOD + 1e-9
    assert way.min() < -1.2  # on its way as fast as it may
