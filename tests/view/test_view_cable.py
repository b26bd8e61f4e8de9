"""Cables as tubes: where they run, how thick they are, and that films and pages have them."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_sim import Simulation, load_scene
from tripod_study.recording import Recording
from tripod_study.summary.picture import picture
from tripod_view.cable import SIDES, SLACK_RADIUS, TAUT_RADIUS, radius, tube, tube_triangles
from tripod_view.picture import PictureError, picture_of
from tripod_view.player.film import FilmError
from tripod_view.player.of_run import film_of
from tripod_view.player.picture import Painter

MORE = {"changes": [], "accuracy": {}, "effects": []}
STRAIGHT = np.array([[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.0, -0.2]]])


def rings(nodes: np.ndarray) -> np.ndarray:
    return nodes.reshape(len(nodes), -1, SIDES, 3)


def test_a_tube_runs_around_its_points_even_where_two_are_in_one_place() -> None:
    made = rings(tube(STRAIGHT, np.array([0.01])))
    assert np.isfinite(made).all()
    np.testing.assert_allclose(made.mean(axis=2), STRAIGHT, atol=1e-15)
    away = made - STRAIGHT[:, :, None]
    np.testing.assert_allclose(np.linalg.norm(away, axis=3), 0.01)
    np.testing.assert_allclose(away[0, 0, :, 0], 0, atol=1e-15)  # across the line
    np.testing.assert_allclose(away[0, 3, :, 2], 0, atol=1e-15)


def test_a_tube_is_the_surface_between_its_rings() -> None:
    nodes = tube(np.array([[[0.0, 0, 0], [0, 0, 1]]]), np.array([0.1]))[0]
    a, b, c = nodes[tube_triangles(2)].transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert area == pytest.approx(SIDES * 0.1)  # the sides of a hexagon of that radius
    middle = (a + b + c) / 3
    assert (np.cross(b - a, c - a)[:, :2] * middle[:, :2]).sum(axis=1).min() > 0  # facing outward


def test_slack_cables_are_thin() -> None:
    assert radius(0.1, np.array([0.0, 1e-9, 0.2])).tolist() == pytest.approx(
        [0.1 * SLACK_RADIUS, 0.1 * SLACK_RADIUS, 0.1 * TAUT_RADIUS]
    )


def test_the_page_is_told_where_cables_run() -> None:
    simulation = Simulation(load_scene("finger_cable", ["motion=off"]))
    table = json.loads(json.dumps(picture(simulation) | MORE))
    found = picture_of(json.dumps(table))
    assert (found.joints, found.servos, found.disc) == (("left", "right"), None, False)
    simulation.step(np.array([0.01, 0.0, 0.0]))
    for route in found.cables:
        there = simulation.cables(simulation.positions)[route.name]
        np.testing.assert_allclose(route.points(simulation.positions), there, atol=1e-9)
    table["cables"][0]["weights"] = table["cables"][0]["weights"][1:]
    with raises_naming(PictureError, "'left'"):
        picture_of(json.dumps(table))
    del table["cables"], table["joints"]  # as before there were any
    assert (picture_of(json.dumps(table)).cables, picture_of(json.dumps(table)).joints) == ((), ())
    assert picture_of(json.dumps(picture(Simulation(load_scene("tripod"))) | MORE)).disc


def test_a_film_has_cables_and_what_their_actuators_do() -> None:
    simulation = Simulation(load_scene("finger_cable", ["motion=off"]))
    recording = Recording(simulation, 12)
    for k in range(12):
        simulation.step(np.array([0.001 * k, 0.0, 0.0]))
        recording.add(simulation)
    arrays = recording.arrays()
    film = film_of(arrays, np.arange(12))
    bodies = {body.name: body for body in film.bodies}
    assert list(bodies) == ["silicone", "cable left", "cable right"]
    line = rings(bodies["cable left"].positions)
    np.testing.assert_allclose(
        line.mean(axis=2)[-1], simulation.cables(simulation.positions)["left"], atol=1e-12
    )
    thick = np.linalg.norm(line - line.mean(axis=2, keepdims=True), axis=3).max(axis=(1, 2))
    taut = arrays["actuator_efforts"][:, 0] > 1e-6
    assert (taut.any(), taut.all()) == (True, False)
    assert np.array_equal(thick > thick.min() * 1.5, taut)
    curves = {curve.title: curve for curve in film.curves}
    assert (curves["length"].unit, curves["tension"].unit) == ("mm", "N")
    assert curves["length"].names == ("left", "right")
    np.testing.assert_allclose(curves["length"].values[:, 0], np.arange(12.0), atol=1e-9)
    seen = Painter(film, (160, 120)).picture(11)
    hidden = replace(film, bodies=tuple(replace(body, through=False) for body in film.bodies))
    assert (seen != Painter(hidden, (160, 120)).picture(11)).any()  # inside the finger
    with raises_naming(FilmError, "cable_points"):
        film_of(arrays | {"cable_points": np.array([1, 2])})
