import numpy as np
import pytest

from tests.ik.plant import SpringRobot
from tests.messages import raises_naming
from tripod_ik.errors import IkError
from tripod_ik.limits import AngleLimit, Motion, SpeedLimit, StepLimit, command_box
from tripod_ik.row_limits import TorqueLimit

LIMITS = (AngleLimit(-2.0, 0.5), StepLimit(0.3), SpeedLimit(2.0))


def box(angles, previous, dt=0.05, limits=LIMITS):
    state = SpringRobot().state(np.array(angles))
    return command_box(limits, Motion(state, np.array(previous), dt))


def test_each_side_comes_from_the_narrowest_limit_and_bears_its_name():
    found = box((-1.95, -1.0, 0.0), (-1.95, -1.25, 0.25))
    assert found.low == pytest.approx([-2.0, -1.3, 0.15])
    assert found.high == pytest.approx([-1.85, -1.15, 0.3])
    assert found.low_names == ("servo_0 angle min", "servo_1 step", "servo_2 speed")
    assert found.high_names == ("servo_0 speed", "servo_1 speed", "servo_2 step")


@pytest.mark.parametrize(
    ("angles", "previous", "expected"),
    [
        (
            (-3.0, 0.0, 0.0),
            (-3.0, 0.0, 0.0),
            -2.0,
        ),  # found outside: back to the limit, whatever step and speed say
        (
            (0.0, 0.0, 0.0),
            (1.2, 0.0, 0.0),
            0.3,
        ),  # a command far ahead of the robot: as near to it as the step allows
        ((0.45, 0.0, 0.0), (3.0, 0.0, 0.0), 0.5),  # both: the angle limit outranks the step
    ],
)
def test_where_limits_contradict_each_other_the_first_wins(angles, previous, expected):
    found = box(angles, previous)
    assert found.low[0] == found.high[0] == pytest.approx(expected)


def test_without_limits_all_commands_are_allowed():
    found = box((0, 0, 0), (0, 0, 0), limits=())
    assert np.isneginf(found.low).all()
    assert np.isposinf(found.high).all()
    assert found.low_names == ("", "", "")


def test_limits_may_differ_from_servo_to_servo():
    found = box((0, 0, 0), (0, 0, 0), limits=[AngleLimit(np.array([-1.0, -2.0, -3.0]), 0.5)])
    assert found.low == pytest.approx([-1, -2, -3])
    assert found.high == pytest.approx([0.5] * 3)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: AngleLimit(0.5, 0.5), ("angle limits", "low 0.5 rad", "high 0.5 rad")),
        (lambda: AngleLimit(np.nan, 0.5), ("angle limits", "low nan rad", "high 0.5 rad")),
        (lambda: StepLimit(0.0), ("step limit", "0.0 rad", "positive")),
        (lambda: SpeedLimit(np.nan), ("speed limit", "nan rad/s", "positive")),
        (lambda: TorqueLimit(-0.1), ("torque limit", "-0.1 N m", "positive")),
        (lambda: TorqueLimit(np.inf), ("torque limit", "inf N m", "finite")),
        (lambda: TorqueLimit(0.1, weight=0.0), ("weight", "torque limit", "0.0")),
        (lambda: box((0, 0, 0), (0, 0, 0), limits=[AngleLimit(np.zeros(2), 1.0)]), ("low", "(2,)")),
    ],
)
def test_bad_limits_are_refused(make, named):
    with raises_naming(IkError, *named):
        make()
