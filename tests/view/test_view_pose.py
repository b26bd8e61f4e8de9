import numpy as np
import pytest

from tests.messages import raises_naming
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
