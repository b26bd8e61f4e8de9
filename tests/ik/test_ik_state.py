import numpy as np
import pytest

from tests.ik.plant import SpringRobot
from tests.messages import raises_naming
from tripod_graph.names import SERVOS
from tripod_ik.errors import IkError
from tripod_ik.state import LinearState

POSES = [(0.0, (-0.3, -0.8, 0.2)), (0.035, (-1.4965, -1.4965, -1.4965)), (0.035, (-1.0, -1.7, -1.4))]


def fields(**changes):
    state = SpringRobot(slide=0.035).state(np.full(3, -1.4965))
    values = {name: getattr(state, name) for name in LinearState.__dataclass_fields__}
    return values | changes


@pytest.mark.parametrize(("slide", "angles"), POSES)
def test_jacobian_and_stiffness_are_the_slopes_of_equilibrium_and_torques(slide, angles):
    robot, angles, h = (
        SpringRobot(slide=slide),
        np.array(angles),
        1e-5,
    )  # [rad]; the error of the slope is of order h²
    state = robot.state(angles)
    for i, step in enumerate(h * np.eye(3)):
        ahead, behind = robot.state(angles + step), robot.state(angles - step)
        slope = (ahead.effector - behind.effector) / (2 * h)
        assert np.abs(slope).max() > 1e-3
        assert state.jacobian[:3, i] == pytest.approx(slope, abs=1e-9)
        assert state.jacobian[3:, i] == pytest.approx(robot.C[:, i], abs=1e-9)
        assert state.stiffness[:, i] == pytest.approx((ahead.efforts - behind.efforts) / (2 * h), abs=1e-8)


def test_the_equilibrium_offset_leads_to_the_equilibrium():
    robot = SpringRobot(slide=0.035)
    angles = np.full(3, -1.4965)
    rest = robot.rest(angles)
    off = np.array([2e-4, -1e-4, 3e-4])
    state = robot.state(angles, rest + off)
    assert state.equilibrium == pytest.approx(
        rest, abs=2e-6
    )  # one Newton step; the second order is 20 |off|²


def test_as_it_is_the_response_is_the_same_and_rests_where_the_effector_is():
    robot, angles = SpringRobot(slide=0.035), np.full(3, -1.4965)
    state = robot.state(angles, robot.rest(angles) + 1e-3)
    assert np.abs(state.equilibrium - state.effector).max() > 5e-4
    here = state.as_it_is()
    assert np.array_equal(here.equilibrium, state.effector)
    assert np.array_equal(here.jacobian, state.jacobian)
    assert np.abs(state.equilibrium - state.effector).max() > 5e-4


def test_a_body_that_is_unstable_at_fixed_torques_still_has_its_jacobian():
    state = SpringRobot(slide=0.035).state(np.full(3, -1.4965))
    assert np.linalg.eigvalsh(state.W[6:, 6:]).max() < 0
    assert np.linalg.svd(state.jacobian[:3])[1].min() > 1e-3


def test_a_direction_without_compliance_is_left_alone():
    W = np.zeros((9, 9))
    W[6, 6], W[7, 7], W[0, 6], W[6, 0] = 2.0, 4.0, 0.1, 0.1
    W[8, 8] = 1e-14  # what rounding leaves
    state = LinearState(**fields(W=W))
    assert state.stiffness == pytest.approx(np.diag([0.5, 0.25, 0.0]))
    assert state.jacobian[0] == pytest.approx([0.05, 0.0, 0.0])
    still = LinearState(**fields(W=np.zeros((9, 9))))
    assert not still.stiffness.any()
    assert not still.jacobian.any()


def test_arrays_are_copied_and_read_only():
    angles = np.full(3, -1.0)
    state = LinearState(**fields(angles=angles))
    angles[0] = 5.0
    assert state.angles[0] == -1.0
    with pytest.raises(ValueError, match="read-only"):
        state.W[0, 0] = 1.0


def with_entry(name, index, value):
    array = np.array(fields()[name])
    array[index] = value
    return {name: array}


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        (with_entry("angles", 1, np.nan), ("angles[1]", "nan", "finite")),
        (with_entry("efforts", 2, np.inf), ("efforts[2]", "inf")),
        (with_entry("effector", 0, -np.inf), ("effector[0]", "-inf")),
        (with_entry("equilibrium_offset", 5, np.nan), ("equilibrium_offset[5]", "nan")),
        (with_entry("W", (8, 3), np.nan), ("W[8, 3]", "nan")),
        (with_entry("W", (8, 8), 1e200), ("W[8, 8]", "1e+200", "finite", "below 1e+09")),
        (with_entry("W", (8, 3), 1e3), ("W", "transpose", 1003.49, 1000)),
        ({"rotation": [0, 0, 0, 0]}, ("rotation", "length 0", "unit quaternion")),
        ({"angles": [0.0, 0.0]}, ("angles", "(2,)", "(3,)")),
        ({"efforts": "abc"}, ("efforts", "numbers")),
        ({"W": np.eye(6)}, ("W", "(6, 6)", "(9, 9)")),
        ({"joint_names": ("a", "a", "b")}, ("joint names", "['a', 'a', 'b']", "each once")),
        ({"joint_names": ()}, ("joint names", "[]", "at least one")),
    ],
)
def test_bad_fields_are_refused_by_name(changes, named):
    with raises_naming(IkError, *named):
        LinearState(**fields(**changes))


def test_the_fields_that_the_bad_ones_replace_are_good():
    assert LinearState(**fields()).joint_names == SERVOS
