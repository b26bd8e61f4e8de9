"""Balls that touch balls: they bounce off each other, never pass, and part where their centres are equal."""

import numpy as np
import pytest

from tests.checks import random_rotation
from tests.sim.contact_bodies import balls, step
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.contact.detection import LEAST, Detector
from tripod_sim.contact.response import Law
from tripod_sim.mesh.surfaces import Part, join

MODES = ["lagrange", "penalty"]

DISTANCE, RADIUS = 1e-3, 0.05


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("speed", [0.5, 50.0])
def test_a_ball_hands_its_motion_to_another(response: str, speed: float) -> None:
    """Head on, elastic, of equal masses: the one stops, the other goes on; at 50 m/s a step covers 0.5 m."""
    world = balls(Law(response, 0.0, 1.0, distance=DISTANCE), [[0, 0, 0], [0.3, 0, 0]])
    assert world.rigid
    world.rigid.velocity[0] = [speed, 0, 0]
    for _ in range(max(8, int(0.4 / speed / 0.01))):
        step(world, 0.01)
        assert world.rigid.centre[1, 0] - world.rigid.centre[0, 0] >= 2 * RADIUS
    np.testing.assert_allclose(world.rigid.velocity[:, 0], [0, speed], atol=1e-6 * speed)
    np.testing.assert_allclose(world.rigid.velocity[:, 1:], 0, atol=1e-9 * speed)


@pytest.mark.parametrize("response", MODES)
def test_a_glancing_hit_turns_balls_as_friction_says_and_keeps_momentum(response: str) -> None:
    world = balls(Law(response, 0.3, 0.0, distance=DISTANCE), [[0, 0, 0], [0.2, 0.06, 0.0]])
    assert world.rigid
    world.rigid.velocity[0] = [2.0, 0, 0]
    for _ in range(20):
        step(world, 0.01)
        gap = np.linalg.norm(world.rigid.centre[1] - world.rigid.centre[0]) - 2 * RADIUS
        assert gap > 0
    rigid = world.rigid
    assert rigid.velocity[1, 1] > 0.1
    assert rigid.velocity[0, 1] < -0.1
    np.testing.assert_allclose(rigid.velocity.sum(axis=0), [2, 0, 0], atol=1e-6)
    assert np.abs(rigid.spin[:, 2]).min() > 0.1
    np.testing.assert_allclose(
        rigid.spin[0], rigid.spin[1], rtol=0.05, atol=1e-6
    )  # both are turned the same way


@pytest.mark.parametrize("response", MODES)
def test_a_ball_does_not_pass_a_fixed_one(response: str) -> None:
    world = balls(Law(response, 0.3, 0.0, distance=DISTANCE), [[0, 0, 0], [0.3, 0.001, 0]], still=1)
    assert world.rigid
    world.rigid.velocity[0] = [50.0, 0, 0]
    for _ in range(5):
        step(world, 0.01)
        assert np.linalg.norm(world.rigid.centre[0] - [0.3, 0.001, 0]) > 2 * RADIUS
    assert 0.15 < world.rigid.centre[0, 0] < 0.25  # before the other, not beyond it


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("still", [0, 1])
def test_balls_of_equal_centres_part_slowly(response: str, still: int) -> None:
    world = balls(Law(response, 0.3, 0.0, distance=DISTANCE), [[0.1, 0.2, 0.3], [0.1, 0.2, 0.3]], still=still)
    assert world.rigid
    before = world.positions_now().copy()
    speed = world.SOFT_PART_SPEED if response == "penalty" else world.PART_SPEED
    for _ in range(60 if response == "penalty" else 300):
        step(world, 0.01)
        now = world.positions_now().copy()
        assert np.isfinite(now).all()
        assert np.linalg.norm(now - before, axis=1).max() < 0.01 * speed * 2
        before = now
    assert np.linalg.norm(now[0] - now[1]) > 2 * RADIUS


def test_balls_are_found_wherever_they_are_near() -> None:
    """3,000 pairs of any sizes, centres equal or all but that, moving or fixed, and over a step."""
    rng, found, near, met = np.random.default_rng(6), ContactSet(), 0, 0
    for case in range(3000):
        radii = 10 ** rng.uniform(-4, 0, 2)
        away = random_rotation(rng)[0] * (0.0, 1e-14, 1e-9, 0.5, 1.0, 1.0, 1.5)[case % 7] * radii.sum()
        away *= 1 + (0.0, 1e-12, DISTANCE)[case % 3]
        x = np.array([np.zeros(3), away])
        parts = [Part(x[:1], rigid=True, radius=radii[0]), Part(x[1:], fixed=case % 2 == 0, radius=radii[1])]
        detector = Detector(join(parts)[0], x, DISTANCE, 3 * DISTANCE)
        detector.near(x, found)
        c, gap = found.arrays, float(np.linalg.norm(away)) - radii.sum()
        assert found.count == (gap < 3 * DISTANCE), (case, gap)
        near += found.count
        if found.count:
            assert np.linalg.norm(c.normal[0]) == pytest.approx(1, abs=1e-12)
            assert c.offset[0] == pytest.approx(radii.sum() + DISTANCE, rel=1e-14)
            np.testing.assert_array_equal(c.weight[0], [1, -1, 0, 0])
            if np.linalg.norm(away) > 1e-6:
                np.testing.assert_allclose(c.normal[0], -away / np.linalg.norm(away), atol=1e-9)
        end = x.copy()
        end[0] += (2 * away if case % 2 else random_rotation(rng)[0]) * 10 ** rng.uniform(-1, 1)
        share = detector.met(x, end, found)
        assert 0 <= share <= 1
        met += share < 1
        if gap > 1e-9:
            y = x[0] + np.linspace(0, share, 20)[:, None] * (end[0] - x[0])
            least = (np.linalg.norm(y - x[1], axis=1) - radii.sum()).min()
            assert least >= min(LEAST * DISTANCE, 0.49 * gap) - 1e-12, case
            way = x[0] + np.linspace(0, 1, 2000)[:, None] * (end[0] - x[0])
            passed = (np.linalg.norm(way - x[1], axis=1) < radii.sum()).any()
            assert share < 1 or not passed, case
    assert near > 1500
    assert met > 100
