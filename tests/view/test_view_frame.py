"""What the camera shows, and descriptions of scenes that are refused."""

import json

import numpy as np
import pytest

from tests.view.shown_scene import told
from tripod_view.frame import FIELD, frame, gone, staying, union, widened
from tripod_view.picture import Picture, PictureError, picture_of


@pytest.mark.parametrize(
    "scene",
    ["tripod", "pendulum", "cloth", "stack", "drape_cubes", "silicone", "column", "finger", "incline"],
)
def test_all_bodies_are_in_sight_and_fill_the_view(scene: str) -> None:
    table, _, nodes, *_ = told(scene)
    seen = frame(picture_of(json.dumps(table)), nodes, 0.03)
    assert (nodes >= seen.low - 1e-9).all()
    assert (nodes <= seen.high + 1e-9).all()
    distance = np.linalg.norm(seen.camera - seen.centre)
    ahead = (seen.centre - seen.camera) / distance
    right = np.cross(ahead, [0, 0, 1]) / np.linalg.norm(np.cross(ahead, [0, 0, 1]))
    places = nodes - seen.camera
    aside = np.abs(places @ np.column_stack([right, np.cross(right, ahead)])) / (places @ ahead)[:, None]
    assert 0.25 * np.tan(FIELD / 2) < aside.max() < np.tan(FIELD / 2)  # of a picture as wide as high
    assert seen.floor == seen.low[2]
    assert seen.aim.radius == pytest.approx(distance * np.sin(FIELD / 2))


def test_what_hangs_has_room_to_swing_through() -> None:
    table, _, nodes, *_ = told("pendulum")
    seen = frame(picture_of(json.dumps(table)), nodes, 0.03)
    assert seen.low[0] <= -1.0
    assert seen.low[2] <= -1.0


def test_what_moves_is_shown_wherever_it_has_been_and_followed_where_it_goes_far() -> None:
    box, far = np.array([[0.0, 0, 0], [0.1, 0.1, 0.1]]), np.array([1e3, 0, -1e3])
    seen, along = box, np.array([0.05, 0, 0])
    for k in range(1, 4):
        seen = widened(seen, box + k * along)
    assert seen.tolist() == pytest.approx(np.array([[0.0, 0, 0], [0.25, 0.1, 0.1]]))
    assert widened(seen, box + far).tolist() == (box + far).tolist()
    assert widened(seen, box - 4 * along).tolist() == pytest.approx(
        np.array([[-0.2, 0, 0], [0.25, 0.1, 0.1]])
    )


def test_what_has_fallen_too_far_is_gone() -> None:
    first = np.array([[0.0, 0, 0], [0.1, 0.1, 0.1]])
    assert gone(first, first - [0, 0, 100]) == 0
    assert gone(first, first - [0, 0, 200]) == pytest.approx(200)


def test_bodies_that_left_the_others_are_not_looked_at_unless_all_left() -> None:
    first = np.array([[0.0, 0, 0], [0.3, 0.1, 0.1]])
    here, fallen = (np.array([[0.0, 0, z], [0.1, 0.1, z + 0.1]]) for z in (0.0, -9.0))
    assert staying(first, np.array([here, fallen, here - 5])).tolist() == [True, False, False]
    assert staying(first, np.array([fallen, fallen])).tolist() == [True, True]
    assert union([here, fallen]).tolist() == pytest.approx(np.array([[0.0, 0, -9], [0.1, 0.1, 0.1]]))


def test_without_a_simulator_the_robot_is_shown() -> None:
    seen = frame(Picture(), None, 0.03)
    assert seen.high[0] >= 0.08


@pytest.mark.parametrize(
    "change",
    [
        {"dt": "fast"}, {"parts": 3}, {"parts": [{"name": "x"}]}, {"held": [[0, 1]]}, {"held": [[0, 0, 1e999]]},
        {"servos": {"axis_radius": 1}}, {"maze": {"goal": [1], "start": [0, 0], "holes": [], "height": 0}},
        {"obstacles": [{"vertices": [0, 0, 0], "triangles": [0, 1, 2]}]}, {"effector": 3}, {"accuracy": 1},
        {"effector": {"radius": -1}}, {"accuracy": {"here": float("nan")}}, {"effects": [{"cost": float("inf")}]},
    ],
)  # fmt: skip
def test_a_description_that_cannot_be_is_refused(change: dict) -> None:
    table = told("tripod")[0] | change
    with pytest.raises(PictureError):
        picture_of(json.dumps(table))
    for text in ("", "[]", "{}", "[" * 1000):
        with pytest.raises(PictureError):
            picture_of(text)


def test_a_description_may_come_before_the_mesh() -> None:
    seen = frame(picture_of(json.dumps(told("stack")[0])), None, 0.03)
    assert np.isfinite(seen.camera).all()
