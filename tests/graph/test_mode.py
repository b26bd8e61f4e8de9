"""The newest decision of any operator is in force, whatever the order of arrival."""

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tripod_graph.mode import Mode, ModeTracker


def test_it_begins_stopped_and_reports_changes_only() -> None:
    tracker = ModeTracker()
    assert tracker.mode is Mode.STOP
    assert not tracker.update(0, 1.0)
    assert tracker.update(2, 2.0)
    assert not tracker.update(2, 3.0)
    assert not tracker.update(1, 2.5)  # decided before the newest
    assert tracker.mode is Mode.IK


def test_a_word_without_a_stamp_is_taken_at_once_and_outlived_by_the_next_decision() -> None:
    tracker = ModeTracker()
    tracker.update(2, 100.0)
    assert tracker.update(0, 0.0)
    assert tracker.mode is Mode.STOP
    assert not tracker.update(1, 99.0)
    assert tracker.update(1, 100.5)


def test_unknown_mode_is_refused_with_the_modes_that_exist() -> None:
    tracker = ModeTracker()
    tracker.update(1, 1.0)
    message = "control mode 7 is unknown; modes: 0 STOP, 1 TELEOP, 2 IK, 3 REPLAY"
    with pytest.raises(ValueError, match=message):
        tracker.update(7, 2.0)
    assert (tracker.mode, tracker.stamp) == (Mode.TELEOP, 1.0)


def test_a_stamp_that_is_no_number_decides_nothing() -> None:
    tracker = ModeTracker()
    assert not tracker.update(1, math.nan)
    assert tracker.update(2, 1.0)
    assert not tracker.update(1, math.nan)
    assert tracker.mode is Mode.IK


@settings(deadline=None)  # a busy machine is no failure
@given(st.lists(st.sampled_from(list(Mode)), min_size=1, max_size=4))
def test_any_order_of_arrival_ends_in_the_newest_decision(modes) -> None:
    decisions = list(zip(modes, range(1, len(modes) + 1), strict=True))
    for order in itertools.permutations(decisions):
        tracker = ModeTracker()
        for mode, stamp in order:
            tracker.update(mode, float(stamp))
        assert tracker.mode is modes[-1]
