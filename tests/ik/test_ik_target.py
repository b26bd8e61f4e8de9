import numpy as np
import pytest

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
    ("frame", "position", "orientation", "message"),
    [
        ("base_link", (0, 0, 0), UPRIGHT, "frame 'base_link'; it must be 'world'"),
        ("", (0, 0, 0), UPRIGHT, "frame ''"),
        ("world", (0, np.nan, 0), UPRIGHT, r"target position\[1\] is nan"),
        ("world", (np.inf, 0, 0), UPRIGHT, r"target position\[0\] is inf"),
        ("world", (0, 0, 0), (0, 0, np.nan, 1), r"target orientation\[2\] is nan"),
        (
            "world",
            (0, 0, 0),
            (0, 0, 0, 0.5),
            "target orientation has length 0.5; it must be a unit quaternion",
        ),
        ("world", (0, 0, 0.0201), UPRIGHT, "target z is 0.0201 m; allowed is -0.05 to 0.02 m"),
        ("world", (0, -8.25, 0), UPRIGHT, "target y is -8.25 m"),
    ],
)
def test_bad_targets_are_refused_with_the_reason(frame, position, orientation, message):
    with pytest.raises(IkError, match=message):
        BOX.check(frame, position, orientation)


def test_a_box_without_inside_is_refused():
    with pytest.raises(IkError, match=r"target_low .* must be below target_high"):
        TargetBox([0, 0, 0], [1, 0, 1])
    with pytest.raises(IkError, match=r"target_high has shape \(2,\)"):
        TargetBox([0, 0, 0], [1, 1])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"target": [0, 0]}, "target has shape"),
        ({"weights": [1, -1, 1]}, "not negative"),
        ({"weights": [0, 0, 0]}, "at least one positive"),
        ({"curvature": -0.1}, "curvature is -0.1"),
        ({"curvature": np.nan}, "curvature is nan"),
    ],
)
def test_bad_tasks_are_refused(changes, message):
    with pytest.raises(IkError, match=message):
        PositionTask(**({"target": [0, 0, 0]} | changes))
