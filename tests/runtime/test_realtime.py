"""The physics thread: its pace on a clock of the test, pause, step, reset, and what it does when a step fails."""

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_runtime import realtime
from tripod_runtime.realtime import LATE, Activity, RealTime, Snapshot
from tripod_sim import Simulation, StepError, load_scene
from tripod_sim.integrators.report import StepReport
from tripod_sim.simulation import Energies

DEADLINE = 60.0
"""For a loaded machine [s]; nothing here waits so long unless it fails."""


class FakeSimulation:
    """Three nodes that move by the command; `during` is called in the middle of each step with its number."""

    def __init__(self, dt: float = 1e-3, during: Callable[[int], None] = lambda step: None) -> None:
        self.scene = SimpleNamespace(dt=dt)
        self.during = during
        self.effector, self.report = None, StepReport()
        self.ball, self.ball_event, self.left_out = None, "", tuple[int, ...]()
        self.efforts, self.pushed = np.zeros(3), False
        self.state = SimpleNamespace(positions=np.zeros((3, 3)), joints=np.zeros(4), step=0, time=0.0)
        self.singular = False
        self.renewed = 0

    @property
    def positions(self) -> np.ndarray:
        return self.state.positions

    def step(self, joints: np.ndarray | None) -> StepReport:
        self.during(self.state.step + 1)
        self.state.joints[:] = 0 if joints is None else joints
        self.state.positions += 1 + self.state.joints[:3]
        self.state.step += 1
        self.state.time += self.scene.dt
        self.report = StepReport(iterations=self.state.step)
        return self.report

    def renew(self) -> None:
        self.renewed += 1

    def reset(self) -> None:
        self.state.positions[:] = 0
        self.state.joints[:] = 0
        self.state.step, self.state.time = 0, 0.0

    def energies(self) -> Energies:
        return Energies(0.0, 0.0, 0.0)

    def compliance(self) -> Any:
        if self.singular:
            raise StepError("at rest is singular")
        return SimpleNamespace(step=self.state.step)


@pytest.fixture
def start() -> Iterator[Callable[..., RealTime]]:
    """Start threads with a simulation; none outlives the test."""
    started: list[RealTime] = []

    def run(simulation: Any, command: Callable[[float], Any] = lambda now: None, **options: Any) -> RealTime:
        started.append(RealTime(simulation, command, **options))
        started[-1].start()
        return started[-1]

    yield run
    for physics in started:
        physics.stop(DEADLINE)
        assert not physics.is_alive()


def wait(condition: Callable[[], Any], what: str) -> None:
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(1e-3)


class FakeClock:
    """Stands for the module `time`: it moves when someone sleeps or works."""

    def __init__(self) -> None:
        self.now, self.cpu = 1000.0, 7.0
        self.slept: list[float] = []

    def monotonic(self) -> float:
        return self.now

    perf_counter = monotonic

    def thread_time(self) -> float:
        return self.cpu

    def time_ns(self) -> int:
        return round(self.now * 1e9)

    def sleep(self, duration: float) -> None:
        assert duration > 0
        self.slept.append(duration)
        self.now += duration


class Pace:
    """One run of the loop on a fake clock: when each step began, and what the thread says of its speed.

    A step takes `cost` of its number on the wall, and `share` of that on a processor.
    """

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        dt: float,
        count: int,
        cost: Callable[[int], float],
        *,
        share: float = 1.0,
        rate: float = 1.0,
    ) -> None:
        clock, self.began = FakeClock(), list[float]()
        monkeypatch.setattr(realtime, "clock", clock)

        def during(step: int) -> None:
            self.began.append(clock.now - 1000.0)
            clock.now += cost(step)
            clock.cpu += share * cost(step)
            if step == count:
                physics.stop()

        physics = RealTime(FakeSimulation(dt, during), lambda now: None, rate=rate, stamp=clock.time_ns)
        physics.run()  # in this thread
        self.physics, self.speed, self.slept, self.end = (
            physics,
            physics.speed(),
            clock.slept,
            clock.now - 1000.0,
        )
        self.stamp = physics.latest.stamp


def test_steps_begin_on_the_grid_of_dt(monkeypatch: pytest.MonkeyPatch) -> None:
    pace = Pace(monkeypatch, 0.01, 300, lambda step: 0.004)
    assert pace.began == pytest.approx(0.01 * np.arange(300), abs=1e-9)
    assert pace.slept == pytest.approx([0.006] * 300, abs=1e-9)
    assert pace.speed.real_time_factor == pytest.approx(1, abs=1e-6)
    assert pace.speed.median == pytest.approx(0.004)
    assert pace.speed.p99 == pytest.approx(0.004)
    assert pace.speed.missed == 0
    assert pace.stamp == pytest.approx((1000 + 2.994) * 1e9, abs=1e3)


def test_a_short_delay_is_made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    pace = Pace(monkeypatch, 0.01, 100, lambda step: 0.09 if step == 50 else 0.001)
    assert pace.speed.missed == 0
    assert pace.began[50:57] == pytest.approx(0.49 + 0.09 + 0.001 * np.arange(7))  # as fast as it goes
    assert pace.began[70:] == pytest.approx(0.01 * np.arange(70, 100), abs=1e-9)
    assert pace.speed.p99 > 0.001 == pytest.approx(pace.speed.median)


def test_after_a_long_delay_periods_are_skipped_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    pace = Pace(monkeypatch, 0.01, 100, lambda step: 0.5 if step == 50 else 0.001)
    assert pace.speed.missed == pytest.approx(49, abs=1)  # 0.5 s less the period of its own
    skipped = 0.01 * pace.speed.missed
    assert pace.began[60:] == pytest.approx(skipped + 0.01 * np.arange(60, 100), abs=1e-9)


@pytest.mark.parametrize("share", [2.0, 3.7, 30.0])
def test_a_simulation_slower_than_time_skips_what_it_cannot_make(
    monkeypatch: pytest.MonkeyPatch, share: float
) -> None:
    """Every period is either stepped or counted as missed, but for the delay that it may still make up."""
    pace = Pace(monkeypatch, 0.01, 400, lambda step: 0.01 * share)
    assert not pace.slept
    behind = pace.end / 0.01 - 400 - pace.speed.missed
    assert 0 <= behind <= LATE / 0.01 + share
    assert pace.speed.missed > 0
    assert pace.speed.real_time_factor == pytest.approx(1 / share, rel=1e-6)


def test_steps_longer_than_the_window_still_have_a_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Pace(monkeypatch, 0.01, 5, lambda step: 4.0).speed.real_time_factor == pytest.approx(0.0025)


@pytest.mark.parametrize(
    ("cost", "share", "load", "factor"),
    [
        (0.004, 1.0, 0.4, 1.0),  # in time
        (0.02, 1.0, 2.0, 0.5),  # the steps themselves take too long
        (0.02, 0.15, 0.3, 0.5),  # they wait for a processor
        (4.0, 0.5, 200.0, 0.0025),  # longer than the window
    ],
)
def test_the_load_of_a_core_tells_slow_steps_from_a_busy_machine(
    monkeypatch: pytest.MonkeyPatch, cost: float, share: float, load: float, factor: float
) -> None:
    speed = Pace(monkeypatch, 0.01, 300 if cost < 1 else 3, lambda step: cost, share=share).speed
    assert speed.load == pytest.approx(load)
    assert speed.real_time_factor == pytest.approx(factor)
    assert speed.behind == (factor < 1)


def test_who_is_paused_is_not_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    pace = Pace(monkeypatch, 0.01, 300, lambda step: 0.02)
    assert pace.speed.behind
    pace.physics.pause(True, 0.0)
    assert pace.physics.speed().real_time_factor == pytest.approx(0.5), "over the last second"
    assert not pace.physics.speed().behind


def test_a_replay_is_not_behind_where_it_is_as_slow_as_it_should(monkeypatch: pytest.MonkeyPatch) -> None:
    pace = Pace(monkeypatch, 0.01, 300, lambda step: 0.004, rate=0.5)
    assert pace.speed.real_time_factor == pytest.approx(0.5)
    assert not pace.speed.behind
    assert Pace(monkeypatch, 0.01, 300, lambda step: 0.03, rate=0.5).speed.behind


@pytest.mark.parametrize(
    "act", [lambda physics: physics.pause(False), lambda physics: physics.request_reset(0.0)]
)
def test_the_time_of_a_pause_or_a_reset_is_no_lack_of_speed(
    monkeypatch: pytest.MonkeyPatch, act: Callable[[RealTime], object]
) -> None:
    clock, made = FakeClock(), itertools.count(1)
    monkeypatch.setattr(realtime, "clock", clock)

    def during(_: int) -> None:
        count = next(made)
        clock.now += 0.004
        if count == 250:
            clock.now += 0.5
            act(physics)
        if count == 270:
            physics.stop()

    physics = RealTime(FakeSimulation(0.01, during), lambda now: None)
    physics.run()
    # the first of the 20 steps since then may come one period early; with the half second it would be 0.5
    assert 1 - 1e-6 <= physics.speed().real_time_factor <= 20 / 19 + 1e-6


def test_before_the_second_step_there_is_no_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Pace(monkeypatch, 0.01, 1, lambda step: 0.001).speed == realtime.Speed(0.0, 0.0, 0.0, 0)


def test_every_step_follows_the_command_and_gives_a_snapshot(start) -> None:
    times: list[float] = []
    seen: list[Snapshot] = []
    began = time.time_ns()

    def command(now: float) -> np.ndarray:
        times.append(now)
        return np.array([len(times), 0, 0, 0.0])

    physics = start(FakeSimulation(), command, on_snapshot=seen.append)
    wait(lambda: len(seen) >= 20, "20 steps")
    physics.stop()
    for k, snapshot in enumerate(seen[:20], start=1):
        assert snapshot.step == k
        assert snapshot.time == pytest.approx(k * 1e-3)
        assert snapshot.joints.tolist() == [k, 0, 0, 0]
        assert snapshot.report.iterations == k
        assert snapshot.positions[0].tolist() == [
            k + k * (k + 1) / 2,
            k,
            k,
        ]  # a copy: later steps left it alone
    assert times == sorted(times)
    assert physics.latest is seen[-1]
    stamps = [s.stamp for s in seen]
    assert stamps == sorted(stamps)
    assert began <= stamps[0] <= stamps[-1] <= time.time_ns()


def test_while_paused_nothing_moves_but_single_steps(start) -> None:
    physics = start(FakeSimulation())
    wait(lambda: physics.latest.step > 3, "steps")
    assert not physics.request_steps()  # not paused
    physics.pause(True, DEADLINE)
    assert physics.activity is Activity.PAUSED
    first = physics.latest.step
    for k in range(50):
        assert physics.latest.step == first + k
        assert physics.request_steps(1, DEADLINE)
    for _ in range(2):  # the thread wakes up, and has gone on when it wakes up again
        awake = threading.Event()
        physics.between_steps(lambda _, awake=awake: awake.set())
        assert awake.wait(DEADLINE)
    assert physics.latest.step == first + 50
    physics.pause(False)
    wait(lambda: physics.latest.step > first + 60, "more steps")
    assert physics.activity is Activity.RUNNING


def test_pause_returns_when_the_step_at_hand_is_done(start) -> None:
    within, go_on = threading.Event(), threading.Event()

    def during(step: int) -> None:
        if step == 3:
            within.set()
            go_on.wait(DEADLINE)

    physics = start(FakeSimulation(during=during))
    assert within.wait(DEADLINE)
    pausing = threading.Thread(target=physics.pause, args=(True, DEADLINE))
    pausing.start()
    pausing.join(0.05)
    assert pausing.is_alive()
    assert physics.latest.step == 2
    go_on.set()
    pausing.join(DEADLINE)
    assert not pausing.is_alive()
    assert physics.latest.step == 3
    assert physics.request_steps(1, DEADLINE)
    assert physics.latest.step == 4


def test_a_step_that_takes_too_long_is_reported_as_not_made(start) -> None:
    go_on = threading.Event()
    simulation = FakeSimulation()
    physics = start(simulation)
    physics.pause(True, DEADLINE)
    before = physics.latest.step
    simulation.during = lambda step: go_on.wait(DEADLINE)
    assert not physics.request_steps(1, 0.01)
    assert physics.latest.step == before
    go_on.set()


def test_many_steps_are_made_as_fast_as_they_go_and_those_that_take_too_long_are_not(start) -> None:
    physics = start(FakeSimulation())
    assert physics.request_steps(5) == 0  # not paused
    physics.pause(True, DEADLINE)
    before = physics.latest.step
    assert physics.request_steps(500, DEADLINE) == 500
    assert physics.latest.step == before + 500
    patience = (0.05, 1.0, DEADLINE)  # a busy machine makes none in a short time
    made = next(filter(None, (physics.request_steps(10**9, limit) for limit in patience)), 0)
    assert 0 < made < 10**9
    assert physics.latest.step == before + 500 + made
    physics.pause(True, DEADLINE)
    assert physics.latest.step == before + 500 + made


def test_steps_end_where_one_fails(start) -> None:
    failure = StepError("element 3 is inverted")

    def during(step: int) -> None:
        if step == 8:
            raise failure

    physics = start(FakeSimulation())
    physics.pause(True, DEADLINE)
    physics.request_reset(DEADLINE)
    physics._simulation.during = during
    assert physics.request_steps(100, DEADLINE) == 7
    assert physics.failure == str(failure)


def test_a_request_of_a_thread_that_does_not_run_is_not_met() -> None:
    physics = RealTime(FakeSimulation(), lambda now: None)
    physics.stop()
    assert not physics.request_reset(0.01)
    physics.pause(True, DEADLINE)
    assert not physics.request_steps(1, 0.01)


def bits(snapshot: Snapshot) -> tuple[Any, ...]:
    """Return all of a snapshot that the physics determines."""
    pose = snapshot.effector
    arrays = (snapshot.positions, snapshot.joints, snapshot.efforts, pose.position, pose.quaternion)
    return (
        snapshot.step,
        snapshot.time,
        repr(snapshot.report),
        snapshot.energies,
        *(a.tobytes() for a in arrays),
    )


def test_reset_returns_to_the_bits_of_the_start_and_the_same_motion_follows(start) -> None:
    """Also when a compliance was computed in one of the two and not in the other."""
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1", "servos.angles=[-0.2, -0.3, 0.1]"]))
    resets: list[int] = []

    def command(_: float) -> np.ndarray:
        s = simulation.state.step
        return np.array([-0.2 - 0.02 * s, -0.3, 0.1 * np.cos(s), 5e-4 * s])

    physics = start(
        simulation, command, compliance_period=0.01, on_reset=lambda: resets.append(simulation.state.step)
    )
    motions = []
    physics.pause(True, DEADLINE)
    for wanted in (False, True, False):
        physics.want_compliance = wanted
        assert physics.request_reset(DEADLINE)
        assert physics.activity is Activity.PAUSED
        motion = [physics.latest]
        for _ in range(12):
            assert physics.request_steps(1, DEADLINE)
            motion.append(physics.latest)
        assert [s.compliance is not None for s in motion] == [
            wanted and k % 2 == 0 and k > 0 for k in range(13)
        ]
        motions.append([bits(s) for s in motion])
    assert motions[0] == motions[1] == motions[2]
    assert len(set(motions[0])) == 13
    assert resets == [0, 0, 0]


def test_reset_while_running_begins_again(start) -> None:
    seen: list[int] = []
    physics = start(
        FakeSimulation(), on_snapshot=lambda s: seen.append(s.step), on_reset=lambda: seen.append(0)
    )
    wait(lambda: len(seen) > 20, "steps")
    assert physics.request_reset(DEADLINE)
    wait(lambda: 0 in seen and len(seen) > seen.index(0) + 20, "steps after the reset")
    again = seen[seen.index(0) :]
    assert again[:20] == list(range(20))
    assert physics.activity is Activity.RUNNING


class BrokenError(Exception):
    pass


@pytest.mark.parametrize(
    ("error", "failure"),
    [
        (StepError("step 6 at 0.005 s cannot be saved"), "step 6 at 0.005 s cannot be saved"),
        (ValueError("servo 0: angle 9 rad"), "servo 0: angle 9 rad"),
        (BrokenError("a defect"), "BrokenError: a defect"),
    ],
)
@pytest.mark.parametrize("place", ["step", "command"])
def test_a_failure_keeps_the_last_good_state_until_a_reset(
    start, error: Exception, failure: str, place
) -> None:
    broken = True
    count = 0

    def break_at(step: int) -> None:
        if broken and step == 6:
            raise error

    def command(_: float) -> None:
        nonlocal count
        count += 1
        if place == "command":
            break_at(count)

    simulation = FakeSimulation(during=break_at if place == "step" else lambda step: None)
    physics = start(simulation, command)
    wait(lambda: physics.activity is Activity.FAILED, "the failure")
    assert physics.failure == failure
    assert physics.latest.step == 5
    assert physics.latest.positions[0].tolist() == [5, 5, 5]
    for paused in (True, False):
        physics.pause(paused)
        assert physics.activity is Activity.FAILED
    assert not physics.request_steps()
    assert physics.latest.step == 5
    assert physics.is_alive()

    assert physics.request_reset(DEADLINE)  # what is broken breaks again
    wait(lambda: physics.activity is Activity.FAILED or place == "command", "the second failure")
    broken = False
    assert physics.request_reset(DEADLINE)
    assert physics.failure == ""
    wait(lambda: physics.latest.step > 10, "steps after the reset")
    assert physics.activity is Activity.RUNNING


def test_a_failing_single_step_says_so(start) -> None:
    def during(step: int) -> None:
        if physics.activity is Activity.PAUSED:
            raise StepError("crushed")

    simulation = FakeSimulation()
    physics = start(simulation)
    physics.pause(True, DEADLINE)
    before = physics.latest.step
    simulation.during = during
    assert not physics.request_steps(1, DEADLINE)
    assert physics.activity is Activity.FAILED
    assert physics.failure == "crushed"
    assert physics.latest.step == before


def test_a_failing_listener_stops_the_physics_visibly(start) -> None:
    def listen(snapshot: Snapshot) -> None:
        raise BrokenError(snapshot.step)

    physics = start(FakeSimulation(), on_snapshot=listen)
    wait(lambda: physics.activity is Activity.FAILED, "the failure")
    assert physics.failure == "BrokenError: 1"


def test_compliances_come_at_their_period_while_wanted(start) -> None:
    seen: list[Snapshot] = []
    simulation = FakeSimulation()
    simulation.left_out = (1,)
    physics = start(simulation, compliance_period=0.004, on_snapshot=seen.append)
    physics.pause(True, DEADLINE)
    for wanted, singular in ((False, False), (True, False), (True, True)):
        physics.want_compliance, simulation.singular = wanted, singular
        seen.clear()
        for _ in range(12):
            assert physics.request_steps(1, DEADLINE)
        due = [s for s in seen if s.step % 4 == 0]
        assert len(seen) == 12
        assert len(due) == 3
        given = [s.step for s in seen if s.compliance is not None]
        assert given == ([s.step for s in due] if wanted and not singular else [])
        assert all(s.compliance.step == s.step for s in seen if s.compliance)
        assert {s.left_out for s in seen} == {(1,) if wanted else ()}


@pytest.mark.parametrize("state", ["running", "paused", "failed", "not started"])
def test_stop_ends_the_thread_in_any_state(state: str) -> None:
    simulation = FakeSimulation()
    physics = RealTime(simulation, lambda now: None)
    if state != "not started":
        physics.start()
        wait(lambda: physics.latest.step > 2, "steps")
    if state == "paused":
        physics.pause(True, DEADLINE)
    if state == "failed":
        simulation.step = lambda joints: 1 / 0  # type: ignore[method-assign]
        wait(lambda: physics.activity is Activity.FAILED, "the failure")
    physics.stop(DEADLINE)
    assert not physics.is_alive()


def test_requests_from_many_threads_all_count(start) -> None:
    """No request is lost and none is served twice, whatever the thread is doing when it comes."""
    physics = start(FakeSimulation(during=lambda step: time.sleep(5e-4)))
    physics.pause(True, DEADLINE)
    first = physics.latest.step
    askers = [
        threading.Thread(target=lambda: [physics.request_steps(1, DEADLINE) for _ in range(50)])
        for _ in range(4)
    ]
    for asker in askers:
        asker.start()
    for asker in askers:
        asker.join(DEADLINE)
    assert physics.latest.step == first + 200


def test_the_time_between_steps_is_used_for_what_the_next_one_would_begin_with(
    start: Callable[..., RealTime],
) -> None:
    seen: list[tuple[int, int]] = []
    simulation = FakeSimulation(during=lambda step: seen.append((step, simulation.renewed)))
    physics = start(simulation)
    wait(lambda: len(seen) > 20, "steps")
    physics.pause(True, DEADLINE)
    assert all(renewed == step - 1 for step, renewed in seen)
