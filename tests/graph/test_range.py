"""One range for all: what the driver says narrows the limits of those who command, and of the simulated robot."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.messages import assert_names, raises_naming
from tripod_graph.command import CommandError, CommandLimits
from tripod_graph.range import SILENT, Fence, RangeWatch, cut

OWN = CommandLimits()
LOWER, UPPER, SPEED = (-2.1, -1.5, -1.0), (0.0, 0.9, -0.1), (4.0, 2.0, 9.0)


def test_limits_are_what_both_allow_and_end_with_the_driver() -> None:
    watch = RangeWatch(OWN)
    assert watch.hear(LOWER, UPPER, SPEED, 0.0)
    assert watch.limits.lower == pytest.approx([-2.1, -1.5, -1.0, 0.0])
    assert watch.limits.upper == pytest.approx([0.0, 0.6, -0.1, 0.04])
    assert watch.limits.speed == pytest.approx([4.0, 2.0, 4.0, 0.1])
    assert watch.limits.park == (0.0, 0.0, -0.1, 0.0)
    assert not watch.hear(LOWER, UPPER, SPEED, 1.0)  # told again
    assert not watch.lapse(1.0 + SILENT)
    assert watch.lapse(1.1 + SILENT)
    assert watch.limits is OWN
    assert not watch.lapse(99.0)
    assert watch.hear(LOWER, UPPER, SPEED, 100.0)  # it is back


def test_other_own_limits_are_narrowed_as_the_first_were() -> None:
    watch = RangeWatch(OWN)
    watch.hear(LOWER, UPPER, SPEED, 0.0)
    slow = CommandLimits(angle_speed=0.5, timeout=3.0)
    watch.adopt(slow)
    assert watch.limits.speed == pytest.approx([0.5, 0.5, 0.5, 0.1])
    assert watch.limits.timeout == 3.0
    assert watch.limits.upper == pytest.approx([0.0, 0.6, -0.1, 0.04])
    assert watch.lapse(1.0 + SILENT)
    assert watch.limits is slow


def test_a_driver_that_tells_no_range_changes_nothing() -> None:
    watch = RangeWatch(OWN)
    assert not watch.hear((), (), (), 0.0)
    assert watch.limits is OWN


@pytest.mark.parametrize(
    ("lower", "upper", "speed", "named"),
    [
        ((1.0, -1.0, -1.0), (2.0, 0.0, 0.0), SPEED, ("servo_0", "1 to 2 rad", "4 rad/s", "own limits")),
        ((-1.0,) * 3, (0.0, float("nan"), 0.0), SPEED, ("servo_1", "-1 to nan rad")),
        ((-1.0,) * 3, (0.0,) * 3, (1.0, 1.0, 0.0), ("servo_2", "-1 to 0 rad", "0 rad/s")),
        ((-1.0,) * 2, (0.0,) * 2, (1.0,) * 2, ("2 servos", 3)),
        ((-1.0,) * 2, (0.0,) * 3, (1.0,) * 3, ("2 servos", 3)),
        ((-1.0,) * 3, (0.0,) * 3, (), ("0 servos", 3)),
    ],
)
def test_a_range_that_leaves_nothing_is_refused_and_named(lower, upper, speed, named) -> None:
    with raises_naming(CommandError, *named):
        OWN.within(lower, upper, speed)
    watch = RangeWatch(OWN)
    watch.hear(lower, upper, speed, 0.0)
    assert watch.limits is OWN
    assert_names(watch.notice, *named)


def test_who_is_asked_for_more_is_named() -> None:
    limits = OWN.within(LOWER, UPPER, SPEED)
    assert cut(np.array([-0.1, 0.0, -0.2, 0.0]), limits) == ""
    assert_names(cut(np.array([0.6, 0.0, -0.2, 0.0]), limits), "servo_0", "0.600 rad", "-2.100 to 0.000 rad")


joints = st.tuples(*[st.floats(-2.1, 0.6)] * 3, st.floats(0.0, 0.04))


@given(st.lists(st.tuples(joints, st.booleans(), st.floats(0.0, 0.3)), min_size=1, max_size=30))
def test_a_range_that_comes_and_goes_never_makes_the_joints_jump(asked) -> None:
    fence, narrow = Fence(), OWN.within(LOWER, UPPER, SPEED)
    last, now = None, 0.0
    for wanted, with_driver, gap in asked:
        now += gap
        limits = narrow if with_driver else OWN
        out = fence.nearest(np.array(wanted), limits, now)
        if last is not None:
            assert (np.abs(out - last) <= limits.speed * min(gap, 0.1) + 1e-9).all()
        last = out
    for _ in range(100):
        now += 0.1
        out = fence.nearest(np.array(wanted), narrow, now)
    assert out == pytest.approx(np.clip(wanted, narrow.lower, narrow.upper))
