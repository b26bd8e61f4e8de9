"""Who is in charge: by table, by property, through steps of the clock, and for operators and commands that vanish."""

import itertools
import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.messages import assert_names, raises_naming
from tripod_graph.mode import (
    LEASE,
    LONGEST_LEASE,
    LONGEST_NAME,
    NONE,
    PAUSE,
    REMEMBERED,
    RETURN,
    SILENCE,
    STRAGGLERS,
    Decision,
    Mode,
    ModeTracker,
)

HOUR = 3600.0
OTHERS = [Mode.TELEOP, Mode.IK, Mode.REPLAY]
any_stamp = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([0.0, -1.0, 2.0**31 - 1, 1e18, math.nan, math.inf, -math.inf]),
)


def heard(tracker: ModeTracker, *decisions: Decision, wall: float = 1000.0, now: float = 0.0) -> ModeTracker:
    for decision in decisions:
        tracker.hear(decision, wall, now)
    return tracker


def test_it_begins_stopped_and_tells_of_what_comes_into_force() -> None:
    tracker = ModeTracker()
    assert tracker.mode is Mode.STOP
    assert tracker.hear(Decision(2, "a", 990.0), 1000.0, 0.0)
    assert not tracker.hear(Decision(2, "a", 990.0), 1000.2, 0.2)  # a repetition
    assert not tracker.hear(Decision(1, "b", 989.0), 1000.3, 0.3)  # decided before
    assert tracker.hear(Decision(1, "b", 991.0), 1000.4, 0.4)
    assert (tracker.mode, tracker.source, tracker.stamp) == (Mode.TELEOP, "b", 991.0)


# STOP ---------------------------------------------------------------------------------------------------------


@given(
    before=st.lists(st.tuples(st.sampled_from(OTHERS), st.sampled_from("abc"), any_stamp), max_size=5),
    stamp=any_stamp,
    source=st.sampled_from(["", "a", "z"]),
    lease=st.floats(allow_nan=True),
)
@example([(Mode.TELEOP, "b", 0.0), (Mode.TELEOP, "a", 1.0)], 0.0, "a", 0.0)  # a's first decision was ignored
@example([(Mode.TELEOP, "a", 0.0), (Mode.IK, "a", -1.0)], -2.0, "a", 0.0)
def test_stop_is_obeyed_whatever_was_stamped_before_and_whatever_its_own_stamp(
    before, stamp, source, lease
) -> None:
    tracker = ModeTracker()
    for k, (mode, who, when) in enumerate(before):
        tracker.hear(Decision(mode, who, when), 1000.0 + 0.1 * k, 0.1 * k)
    tracker.hear(Decision(0, source, stamp, lease), 1001.0, 1.0)
    assert tracker.mode is Mode.STOP
    last = {who: (mode, who, when) for mode, who, when in before}
    for k in range(50):  # those who have not heard it yet go on repeating
        for mode, who, when in last.values():
            tracker.hear(Decision(mode, who, when), 1001.0 + 0.1 * k, 1.0 + 0.1 * k)
        assert tracker.mode is Mode.STOP


@pytest.mark.parametrize("stamp", [0.0, 500.0, 999.99, 1000.5, 1000.0 + HOUR, math.nan])
@pytest.mark.parametrize("ahead", [0.0, 0.9, HOUR, 1e9])
def test_after_a_stop_a_new_decision_is_obeyed_whatever_was_stamped_before(stamp, ahead) -> None:
    tracker = heard(ModeTracker(), Decision(1, "a", 1000.0 + ahead), Decision(0, "b", stamp))
    assert tracker.hear(Decision(1, "b", 1000.5), 1000.5, 0.5)
    assert tracker.mode is Mode.TELEOP


def test_a_program_that_stamps_each_repetition_anew_does_not_undo_a_stop() -> None:
    tracker = ModeTracker()
    for k in range(10):
        tracker.hear(Decision(1, "naive", 1000 + 0.1 * k), 1000 + 0.1 * k, 0.1 * k)
    tracker.hear(Decision(0, "naive", 1000.95), 1000.95, 0.95)  # be it its own
    for k in range(10, 100):
        assert not tracker.hear(Decision(1, "naive", 1000 + 0.1 * k), 1000 + 0.1 * k, 0.1 * k)
    assert tracker.mode is Mode.STOP
    assert_names(tracker.ignored.last, "TELEOP by naive", "STOP by naive")
    quiet = 9.9 + PAUSE + 0.1
    assert tracker.hear(Decision(1, "naive", 1000 + quiet), 1000 + quiet, quiet)


def test_an_operator_that_decides_the_same_twice_may_change_its_mind_and_back_at_once() -> None:
    tracker = ModeTracker()
    for k, mode in enumerate((1, 1, 2, 1, 2)):  # the second press of the same key has a stamp of its own
        tracker.hear(Decision(mode, "keys", 1000 + 0.1 * k), 1000 + 0.1 * k, 0.1 * k)
        assert tracker.mode is Mode(mode)
    assert not tracker.hear(Decision(1, "keys", 1000.3), 1000.5, 0.5)  # under way when it changed
    assert tracker.mode is Mode.IK


def test_what_is_not_stamped_can_be_stopped_too_and_typed_again_later() -> None:
    tracker = heard(ModeTracker(), Decision(1, "me"), Decision(0, "me"))
    for k in range(20):
        assert not tracker.hear(Decision(1, "me"), 1000.0, 0.2 * k)
    assert tracker.mode is Mode.STOP
    assert tracker.hear(Decision(1, "me"), 1000.0, 4.0 + PAUSE)


def test_stop_said_again_stops_what_has_begun_meanwhile_but_a_stream_of_it_is_one() -> None:
    tracker = ModeTracker()
    assert tracker.hear(Decision(0, "button", 1000.0), 1000.0, 0.0)
    assert not any(tracker.hear(Decision(0, "button", 1000 + 0.1 * k), 1000.0, 0.1 * k) for k in range(100))
    assert tracker.hear(Decision(0, "button", 1020.0), 1020.0, 20.0)
    assert tracker.hear(Decision(0, "another"), 1020.0, 20.1)


# order --------------------------------------------------------------------------------------------------------


@given(st.lists(st.sampled_from(OTHERS), min_size=1, max_size=4))
def test_any_order_of_arrival_ends_in_the_newest_decision(modes) -> None:
    decisions = [Decision(mode, f"operator {k}", 10.0 + k) for k, mode in enumerate(modes)]
    for order in itertools.permutations(decisions):
        tracker = heard(ModeTracker(), *order, wall=100.0)
        assert tracker.mode is modes[-1]


@pytest.mark.parametrize("ahead", [1.5, HOUR, 2.0**31])
def test_a_stamp_ahead_of_the_receiver_counts_as_now(ahead: float) -> None:
    tracker = heard(ModeTracker(), Decision(1, "skewed", 1000.0 + ahead))
    assert tracker.mode is Mode.TELEOP
    assert tracker.hear(Decision(2, "right", 1000.01), 1000.01, 0.01)
    assert tracker.mode is Mode.IK


@given(
    steps=st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=6),
    modes=st.lists(st.sampled_from(OTHERS), min_size=7, max_size=7),
)
def test_steps_of_the_clock_leave_nobody_deaf(steps, modes) -> None:
    """Operators and receiver share a clock that is set between decisions."""
    tracker, offset = ModeTracker(), 1e9
    for k, (step, mode) in enumerate(zip([0.0, *steps], modes, strict=False)):
        offset += step
        now = 10.0 * k
        stamp = offset + now
        assert tracker.hear(Decision(mode, f"operator {k}", stamp), offset + now + 0.01, now + 0.01)
        assert tracker.mode is mode
        for i in range(1, 40):  # its repetitions keep their stamp
            assert not tracker.hear(Decision(mode, f"operator {k}", stamp), offset + now, now + 0.2 * i)
    assert tracker.ignored.count == 0


def test_a_step_back_while_a_decision_is_in_force_leaves_its_repetitions_in_force() -> None:
    tracker = heard(ModeTracker(), Decision(1, "a", 1000.0))
    for k in range(1, 50):
        tracker.hear(Decision(1, "a", 1000.0), 1000.0 - HOUR + 0.2 * k, 0.2 * k)
        assert tracker.mode is Mode.TELEOP
    assert tracker.hear(Decision(2, "b", 1010.0 - HOUR), 1010.0 - HOUR, 10.0)


def test_what_is_ignored_is_counted_and_named_with_what_is_in_force() -> None:
    tracker = heard(ModeTracker(), Decision(2, "page", 999.0), Decision(1, "late", 998.0))
    assert tracker.ignored.count == 1
    assert_names(tracker.ignored.last, "TELEOP by late", "998.000 s", "older", "IK by page", "999.000 s")
    assert list(tracker.notices(0.1)) == [tracker.ignored.last]
    assert not list(tracker.notices(2.5))
    assert not tracker.hear(Decision(1, "late", math.nan), 1000.0, 0.0)
    assert tracker.mode is Mode.IK


def test_repetitions_under_way_when_they_are_overruled_are_not_worth_a_word() -> None:
    tracker = heard(ModeTracker(), Decision(1, "a", 990.0), Decision(2, "b", 995.0))
    tracker.hear(Decision(1, "a", 990.0), 1000.0, STRAGGLERS)
    assert tracker.ignored.count == 0
    tracker.hear(Decision(1, "a", 990.0), 1001.0, STRAGGLERS + 0.1)
    assert tracker.ignored.count == 1
    assert tracker.mode is Mode.IK


@pytest.mark.parametrize(
    ("decision", "named"),
    [
        (Decision(7, "a", 1.0), ("control mode 7", "0 STOP, 1 TELEOP, 2 IK, 3 REPLAY")),
        (Decision(1, "", 1.0), ("TELEOP", "source", "only STOP")),
        (Decision(1, "a", 1.0, -1.0), ("lease", "'a'", "-1 s", "0 (meaning 1) to 600 s")),
        (Decision(1, "a", 1.0, LONGEST_LEASE + 1), ("lease", "'a'", "601 s")),
        (Decision(1, "a", 1.0, math.nan), ("lease", "'a'", "nan s")),
        (Decision(1, "a" * (LONGEST_NAME + 1)), ("source", "301 characters", 300)),
    ],
)
def test_what_cannot_be_in_force_is_refused_and_changes_nothing(
    decision: Decision, named: tuple[object, ...]
) -> None:
    tracker = heard(ModeTracker(), Decision(1, "x", 0.5))
    with raises_naming(ValueError, *named):
        tracker.hear(decision, 1000.0, 0.0)
    assert (tracker.mode, tracker.source) == (Mode.TELEOP, "x")


def test_a_stop_and_a_command_of_a_name_without_end_do_not_fill_each_status_with_it() -> None:
    tracker = heard(ModeTracker(), Decision(1, "x", 0.5))
    assert tracker.admits("y" * 10**6, 0.0)
    assert tracker.hear(Decision(0, "z" * 10**6), 1000.0, 0.0)
    assert tracker.mode is Mode.STOP
    assert tracker.admits("y" * 10**6, 0.0)
    told = (
        tracker.source,
        tracker.in_force,
        tracker.ignored_commands.last,
        *tracker.ignored_commands.sources,
    )
    assert max(len(text) for text in told) < 2 * LONGEST_NAME


def test_memory_is_bounded() -> None:
    tracker = ModeTracker()
    for k in range(1000):
        tracker.hear(Decision(1, f"source {k}"), 1000.0, float(k))
        tracker.admits(f"stranger {k}", float(k))
    assert max(len(tracker.ignored_commands.sources), len(tracker._overruled)) <= 64


def test_an_operator_whose_clock_is_far_behind_can_stop_and_go_on() -> None:
    tracker = ModeTracker()
    for k, mode in enumerate([1, 0, 2, 0, 1]):
        now = 0.01 * k
        assert tracker.hear(Decision(mode, "no clock", 1.0 + k), 1e9, now)
        assert tracker.mode == mode


# signs of life ------------------------------------------------------------------------------------------------


def test_a_silent_operator_is_lost_after_its_lease() -> None:
    tracker = heard(ModeTracker(), Decision(1, "a", 990.0))
    assert not tracker.lapse(LEASE)
    assert tracker.lapse(LEASE + 0.01)
    assert (tracker.mode, tracker.lost) == (Mode.STOP, "a")
    assert_names(next(tracker.notices(2.0)), "operator 'a'", "silent", "park pose")
    assert not tracker.lapse(LEASE + 0.02)


def test_an_operator_that_returns_soon_goes_on_and_later_has_to_decide_anew() -> None:
    tracker = heard(ModeTracker(), Decision(1, "a", 990.0))
    assert tracker.lapse(1.5)
    assert tracker.hear(Decision(1, "a", 990.0), 1002.0, 2.0)
    assert (tracker.mode, tracker.lost) == (Mode.TELEOP, "")
    late = 2.0 + LEASE + RETURN + 0.1
    assert tracker.lapse(late)
    assert not tracker.hear(Decision(1, "a", 990.0), 1000.0 + late, late)
    assert (tracker.mode, tracker.lost) == (Mode.STOP, "a")
    assert_names(tracker.ignored.last, "TELEOP by a", "990.000 s", "silent", "new stamp")
    assert tracker.hear(Decision(1, "a", 1000.0 + late), 1000.0 + late, late)
    assert (tracker.mode, tracker.lost) == (Mode.TELEOP, "")


def test_a_lease_says_how_long_an_operator_may_be_gone() -> None:
    tracker = heard(ModeTracker(), Decision(1, "leaves", 990.0, lease=30.0))
    assert not tracker.lapse(30.0)
    assert tracker.lapse(30.1)


def test_who_leaves_ends_only_what_it_decided() -> None:
    tracker = heard(ModeTracker(), Decision(1, "a", 990.0))
    assert not tracker.hear(Decision(NONE, "b"), 1000.0, 0.1)
    assert tracker.mode is Mode.TELEOP
    assert tracker.hear(Decision(NONE, "a"), 1000.0, 0.2)
    assert (tracker.mode, tracker.lost) == (Mode.STOP, "")
    assert not tracker.hear(Decision(NONE, "a"), 1000.0, 0.3)


# commands -----------------------------------------------------------------------------------------------------


def test_only_the_operator_in_charge_is_obeyed_and_others_are_named() -> None:
    tracker = ModeTracker()
    assert_names(tracker.admits("a", 0.0), "control mode", "STOP", "'a'")
    heard(tracker, Decision(1, "a", 990.0))
    assert tracker.admits("a", 0.1) == ""
    assert_names(tracker.admits("b", 0.2), "'b'", "ignored", "'a' is in charge")
    assert_names(tracker.admits("", 0.3), "no name", "header.frame_id", "'a' is in charge")
    assert tracker.ignored_commands.count == 3
    assert dict(tracker.ignored_commands.sources) == {"a": 1, "b": 1, "": 1}
    assert next(tracker.notices(0.4)) == tracker.ignored_commands.last


def test_in_mode_ik_one_inverse_kinematics_is_obeyed_the_same_one_by_all() -> None:
    sent = ["/ik#b", "/teleop#1", "/ik#a", "/ik#b", "operator"] * 5
    for first in range(5):
        tracker = heard(ModeTracker(), Decision(2, "operator", 990.0))
        obeyed = [source for k, source in enumerate(sent[first:]) if not tracker.admits(source, 0.01 * k)]
        assert set(obeyed[obeyed.index("/ik#a") :]) == {"/ik#a"}
    later = 0.2 + SILENCE + 0.1
    assert tracker.admits("/ik#b", later) == ""  # the other has fallen silent


def test_nobody_is_obeyed_once_the_operator_is_lost() -> None:
    tracker = heard(ModeTracker(), Decision(2, "operator", 990.0))
    assert tracker.admits("/ik#a", 0.1) == ""
    tracker.lapse(1.2)
    assert tracker.admits("/ik#a", 1.3) != ""


def test_a_crowd_of_others_does_not_make_a_repeated_decision_newer_than_the_stop() -> None:
    tracker = ModeTracker()
    tracker.hear(Decision(Mode.TELEOP, "b", 995.0), 1000.0, 0.0)
    for k in range(5):
        for n in range(REMEMBERED // 2):
            tracker.hear(Decision(Mode.IK, f"c{k}.{n}", 1.0), 1000.0, 0.1)
        tracker.hear(Decision(Mode.TELEOP, "a", 990.0), 1000.0, 0.1)
    tracker.hear(Decision(Mode.STOP, "a"), 1000.0, 0.2)
    for n in range(3 * REMEMBERED):
        tracker.hear(Decision(Mode.IK, f"d{n}", 1.0), 1000.0, 0.3)
    tracker.hear(Decision(Mode.TELEOP, "a", 990.0), 1000.0, 0.4)
    assert tracker.mode is Mode.STOP
