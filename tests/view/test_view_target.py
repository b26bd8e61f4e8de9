"""Who moves the handle, and what of the browser's input is taken."""

import numpy as np
import pytest

from tripod_view.target import TargetError, TargetHandle

BROWSER, OTHER = 1, 2


def handle() -> TargetHandle:
    return TargetHandle((-0.02, -0.02, -0.03), (0.02, 0.02, 0.015))


def test_it_rides_on_the_effector_until_somebody_sets_a_target() -> None:
    h = handle()
    assert h.position is None
    assert h.ride(np.array([0.0, 0.0, -0.001]))
    assert not h.ride(np.array([0.0, 0.0, -0.001]))
    assert h.hear(np.array([0.01, 0.0, 0.0]))
    assert not h.ride(np.array([0.0, 0.0, -0.002]))
    assert h.position.tolist() == [0.01, 0.0, 0.0]
    h.release()
    assert h.ride(np.array([0.0, 0.0, -0.002]))


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
    assert h.drag(BROWSER, asked).tolist() == taken
    assert h.position.tolist() == taken


@pytest.mark.parametrize(
    "sent", [[np.nan, 0, 0], [0, np.inf, 0], [0, 0], [[0, 0, 0]], "abc", None, [0, 0, None], [1, 2, 3, 4]]
)
def test_what_is_not_three_finite_numbers_moves_nothing(sent: object) -> None:
    h = handle()
    h.ride(np.zeros(3))
    with pytest.raises(TargetError, match="dragged target"):
        h.drag(BROWSER, sent)
    assert h.position.tolist() == [0, 0, 0]
    assert not h.set


def test_a_drag_shuts_others_out_until_every_hand_is_off() -> None:
    h = handle()
    h.grab(BROWSER)
    h.drag(BROWSER, [0.01, 0.0, 0.0])
    h.grab(OTHER)
    assert not h.hear(np.array([0.0, 0.01, 0.0]))
    h.drop(BROWSER)
    assert not h.hear(np.array([0.0, 0.01, 0.0]))
    h.drop(OTHER)
    h.drop(OTHER)
    assert h.hear(np.array([0.0, 0.01, 0.0]))


def test_a_target_of_somebody_else_may_lie_outside_the_box() -> None:
    h = handle()
    h.hear(np.array([0.1, 0.0, 0.0]))
    assert h.position.tolist() == [0.1, 0.0, 0.0]


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        ((0, 0, 0), (1, 1, 0), "target_low"),
        ((0, 0), (1, 1, 1), "target_low"),
        ((0, 0, 0), (1, float("nan"), 1), "target_high"),
    ],
)
def test_a_box_that_is_none_is_refused_by_name(low: tuple, high: tuple, words: str) -> None:
    with pytest.raises(TargetError, match=words):
        TargetHandle(low, high)
