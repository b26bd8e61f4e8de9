import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_view.joints import JointError, joint_values
from tripod_view.pose import Pose, PoseError


def test_a_pose_turns_then_moves() -> None:
    quarter = Pose.of((1.0, 2.0, 3.0), (0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)))
    assert quarter.apply(np.array([1.0, 0.0, 0.0])) == pytest.approx([1.0, 3.0, 3.0])


def test_a_quaternion_is_scaled_and_its_sign_chosen() -> None:
    assert Pose.of((0, 0, 0), (0.0, -3.0, 0.0, -4.0)).quaternion == pytest.approx([0.0, 0.6, 0.0, 0.8])


@pytest.mark.parametrize(
    ("position", "quaternion"),
    [
        ((0.0, float("nan"), 0.0), (0, 0, 0, 1)),
        ((0, 0, 0), (0, 0, 0, 0)),
        ((0, 0, 0), (0, 0, float("inf"), 1)),
    ],
)
def test_poses_that_are_none_are_refused(position: tuple, quaternion: tuple) -> None:
    with raises_naming(PoseError, "position", "quaternion", "finite", "not zero"):
        Pose.of(position, quaternion)


def test_huge_quaternions_do_not_overflow() -> None:
    assert Pose.of((0, 0, 0), (0.0, 0.0, 3e200, 4e200)).quaternion == pytest.approx([0.0, 0.0, 0.6, 0.8])


def test_joints_come_in_any_order_and_the_slide_may_miss() -> None:
    assert joint_values(["servo_2", "other", "servo_0", "servo_1"], [3.0, 9.0, 1.0, 2.0]).tolist() == [
        1,
        2,
        3,
        0,
    ]
    assert joint_values(["slide", "servo_0", "servo_1", "servo_2"], [0.02, 1, 2, 3]).tolist() == [
        1,
        2,
        3,
        0.02,
    ]


@pytest.mark.parametrize(
    ("names", "positions", "named"),
    [
        (["servo_0", "servo_2"], [0.0, 0.0], ("'servo_1'", "missing", "servo_0, servo_2")),
        (["slide"], [0.0], ("'servo_0'", "missing", "joints: slide")),
        (["servo_0", "servo_1", "servo_2"], [0.0], ("1 positions", "3 joints")),
        (["servo_0", "servo_1", "servo_2"], [0.0, float("nan"), 0.0], ("'servo_1'", "nan")),
        (["servo_0", "servo_1", "servo_2", "slide"], [0.0, 0.0, 0.0, float("inf")], ("'slide'", "inf")),
        ([], [], ("joints: none",)),
    ],
)
def test_bad_joint_states_are_refused_by_name(
    names: list[str], positions: list[float], named: tuple[str, ...]
) -> None:
    with raises_naming(JointError, *named):
        joint_values(names, positions)
