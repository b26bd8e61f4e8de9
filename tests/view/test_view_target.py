"""Who moves the handle, and what of the browser's input is taken."""

import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_view.pose import Pose
from tripod_view.target import TargetError, TargetHandle

BROWSER, OTHER = 1, 2
STRAIGHT = (0.0, 0.0, 0.0, 1.0)


def at(x: float, y: float, z: float) -> Pose:
    return Pose.of((x, y, z), (0.0, 0.0, 0.0, 1.0))


def handle() -> TargetHandle:
    return TargetHandle((-0.02, -0.02, -0.03), (0.02, 0.02, 0.015))


def test_it_rides_on_the_effector_until_somebody_sets_a_target() -> None:
    h = handle()
    assert h.position is None
    assert h.ride(at(0.0, 0.0, -0.001))
    assert not h.ride(at(0.0, 0.0, -0.001))
    assert h.hear(at(0.01, 0.0, 0.0))
    assert not h.ride(at(0.0, 0.0, -0.002))
    assert h.position.tolist() == [0.01, 0.0, 0.0]
    h.release()
    assert h.ride(at(0.0, 0.0, -0.002))


@pytest.mark.parametrize(
    ("asked", "taken"),
    [
        ([0.01, -0.005, 0.002], [0.01, -0.005, 0.002]),
        ([1.0, -1.0, -9e9], [0.02, -0.02, -0.03]),
        ([0.0, 0.0, 0.5], [0.0, 0.0, 0.015]),
    ],
)
def test_a_drag_is_clamped_to_the_box(asked: list[float], taken: list[float]) -> None:
    h = handle()
    assert h.drag(BROWSER, asked, STRAIGHT).position.tolist() == taken
    assert h.position.tolist() == taken


@pytest.mark.parametrize(
    "sent", [[np.nan, 0, 0], [0, np.inf, 0], [0, 0], [[0, 0, 0]], "abc", None, [0, 0, None], [1, 2, 3, 4]]
)
def test_what_is_not_three_finite_numbers_moves_nothing(sent: object) -> None:
    h = handle()
    h.ride(at(0.0, 0.0, 0.0))
    with raises_naming(TargetError, "dragged target"):
        h.drag(BROWSER, sent, STRAIGHT)
    assert h.position.tolist() == [0, 0, 0]
    assert not h.set


def test_a_drag_shuts_others_out_until_every_hand_is_off() -> None:
    h = handle()
    h.grab(BROWSER)
    h.drag(BROWSER, [0.01, 0.0, 0.0], STRAIGHT)
    h.grab(OTHER)
    assert not h.hear(at(0.0, 0.01, 0.0))
    h.drop(BROWSER)
    assert not h.hear(at(0.0, 0.01, 0.0))
    h.drop(OTHER)
    h.drop(OTHER)
    assert h.hear(at(0.0, 0.01, 0.0))


def test_a_target_of_somebody_else_may_lie_outside_the_box() -> None:
    h = handle()
    h.hear(at(0.1, 0.0, 0.0))
    assert h.position.tolist() == [0.1, 0.0, 0.0]


@pytest.mark.parametrize(
    ("low", "high", "field"),
    [
        ((0, 0, 0), (1, 1, 0), "target_low"),
        ((0, 0), (1, 1, 1), "target_low"),
        ((0, 0, 0), (1, float("nan"), 1), "target_high"),
    ],
)
def test_a_box_that_is_none_is_refused_by_name(low: tuple, high: tuple, field: str) -> None:
    with raises_naming(TargetError, field):
        TargetHandle(low, high)


def test_a_drag_turns_the_target_and_what_is_no_rotation_is_refused() -> None:
    h = handle()
    pose = h.drag(BROWSER, [0.0, 0.0, 0.0], (0.0, 0.6, 0.0, 0.8))
    assert pose.quaternion.tolist() == pytest.approx([0.0, 0.6, 0.0, 0.8])
    assert h.quaternion.tolist() == pytest.approx([0.0, 0.6, 0.0, 0.8])
    for sent in ((0, 0, 0, 0), (1, 0, 0), (np.nan, 0, 0, 1), None, "turn"):
        with raises_naming(TargetError, "dragged target", "turned", "four numbers"):
            h.drag(BROWSER, [0.01, 0.0, 0.0], sent)
    assert h.position.tolist() == [0, 0, 0]
