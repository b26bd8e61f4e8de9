"""What the camera shows, and descriptions of scenes that are refused."""

import json

import numpy as np
import pytest

from tests.view.shown_scene import told
from tripod_view.frame import FIELD, frame
from tripod_view.picture import Picture, PictureError, picture_of
from tripod_view.scene import squares


@pytest.mark.parametrize("scene", ["tripod", "pendulum", "cloth", "stack", "drape_cubes", "silicone"])
def test_all_bodies_are_in_sight_and_fill_the_view(scene: str) -> None:
    table, _, nodes, _ = told(scene)
    seen = frame(picture_of(json.dumps(table)), nodes, 0.03)
    assert (nodes >= seen.low - 1e-9).all()
    assert (nodes <= seen.high + 1e-9).all()
    distance = np.linalg.norm(seen.camera - seen.centre)
    directions = (nodes - seen.camera) / np.linalg.norm(nodes - seen.camera, axis=1)[:, None]
    angles = np.arccos(directions @ (seen.centre - seen.camera) / distance)
    assert angles.max() < 1.1 * FIELD / 2
    assert angles.max() > 0.25 * FIELD / 2
    assert seen.floor == seen.low[2]
    assert seen.cell < seen.radius < 20 * seen.cell + 1e-9


def test_what_hangs_has_room_to_swing_through() -> None:
    table, _, nodes, _ = told("pendulum")
    seen = frame(picture_of(json.dumps(table)), nodes, 0.03)
    assert seen.low[0] <= -1.0
    assert seen.low[2] <= -1.0


def test_without_a_simulator_the_robot_is_shown() -> None:
    seen = frame(Picture(), None, 0.03)
    assert seen.high[0] >= 0.08
    assert squares(seen.cell) == "10 mm"


@pytest.mark.parametrize(
    "change",
    [
        {"dt": "fast"}, {"parts": 3}, {"parts": [{"name": "x"}]}, {"held": [[0, 1]]}, {"held": [[0, 0, 1e999]]},
        {"servos": {"axis_radius": 1}}, {"maze": {"goal": [1], "start": [0, 0], "holes": [], "height": 0}},
        {"obstacles": [{"vertices": [0, 0, 0], "triangles": [0, 1, 2]}]}, {"effector": 3}, {"accuracy": 1},
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
