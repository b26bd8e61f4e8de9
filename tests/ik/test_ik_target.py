import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_ik.errors import IkError
from tripod_ik.target import TargetBox
from tripod_ik.tasks import PositionTask

BOX = TargetBox([-0.1, -0.1, -0.05], [0.1, 0.1, 0.02])
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def test_a_target_in_the_box_is_taken_as_it_is():
    position, normal = BOX.check("world", (0.01, -0.1, 0.02), UPRIGHT)
    assert position.tolist() == [0.01, -0.1, 0.02]
    assert normal.tolist() == [0, 0, 1]
    tilted = BOX.check("world", (0.0, 0.0, 0.0), (np.sin(0.1), 0.0, 0.0, np.cos(0.1)))[1]
    assert tilted == pytest.approx([0, -np.sin(0.2), np.cos(0.2)])
    assert BOX.check("world", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))[1].tolist() == [0, 0, 1]


@pytest.mark.parametrize(
    ("frame", "position", "orientation", "named"),
    [
        ("base_link", (0, 0, 0), UPRIGHT, ("frame 'base_link'", "'world'")),
        ("", (0, 0, 0), UPRIGHT, ("frame ''", "'world'")),
        ("world", (0, np.nan, 0), UPRIGHT, ("target position[1]", "nan")),
        ("world", (np.inf, 0, 0), UPRIGHT, ("target position[0]", "inf")),
        ("world", (0, 0, 0), (0, 0, np.nan, 1), ("target orientation[2]", "nan")),
        ("world", (0, 0, 0), (0, 0, 0, 0.5), ("target orientation", "length 0.5", "unit quaternion")),
        ("world", (0, 0, 0.0201), UPRIGHT, ("target z", "0.0201 m", "-0.05 to 0.02 m")),
        ("world", (0, -8.25, 0), UPRIGHT, ("target y", "-8.25 m", "-0.1 to 0.1 m")),
    ],
)
def test_bad_targets_are_refused_with_the_reason(frame, position, orientation, named):
    with raises_naming(IkError, *named):
        BOX.check(frame, position, orientation)


def test_a_box_without_inside_is_refused():
    with raises_naming(IkError, "target_low [0.0, 0.0, 0.0] m", "target_high [1.0, 0.0, 1.0] m"):
        TargetBox([0, 0, 0], [1, 0, 1])
    with raises_naming(IkError, "target_high", "(2,)"):
        TargetBox([0, 0, 0], [1, 1])


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"target": [0, 0]}, ("target", "(2,)")),
        ({"weights": [1, -1, 1]}, ("weights", "[1.0, -1.0, 1.0]", "negative")),
        ({"weights": [0, 0, 0]}, ("weights", "[0.0, 0.0, 0.0]", "one must be positive")),
        ({"curvature": -0.1}, ("curvature", -0.1)),
        ({"curvature": np.nan}, ("curvature", "nan")),
    ],
)
def test_bad_tasks_are_refused(changes, named):
    with raises_naming(IkError, *named):
        PositionTask(**({"target": [0, 0, 0]} | changes))
