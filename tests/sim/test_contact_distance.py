"""Distances against a dense search, continuous detection against closed forms, both for shapes of every degeneracy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.checks import random_rotation
from tripod_sim.contact.ccd_kernels import time_of_approach
from tripod_sim.distance_kernels import (
    across,
    point_triangle_distance,
    segment_segment,
    triangle_normal,
)

SHAPES = ("general", "sliver", "coincident", "parallel", "crossing", "point", "needle")


def four_points(rng: np.random.Generator, shape: str) -> np.ndarray:
    x = rng.standard_normal((4, 3))
    if shape == "sliver":
        x[3] = 0.5 * (x[1] + x[2]) + 1e-9 * x[3]
    elif shape == "coincident":
        x[rng.integers(4)] = x[rng.integers(4)]
    elif shape == "parallel":
        x[3] = x[2] + (x[1] - x[0]) * rng.standard_normal()
    elif shape == "crossing":
        x[3] = x[2] + 3 * (0.3 * x[0] + 0.7 * x[1] - x[2])
    elif shape == "point":
        x[1:] = x[1]
    elif shape == "needle":
        x[2] = x[1] + 1e-12 * x[2]
    return x


def assert_closest(point: np.ndarray, others: np.ndarray, corners: np.ndarray) -> None:
    """`point` of the convex hull of `corners` is the closest to `others` iff no corner lies nearer to it."""
    assert ((others - point) @ (corners - point).T).max() <= 1e-13


@given(st.integers(0, 2**32 - 1), st.sampled_from(SHAPES))
def test_point_triangle_distance_is_the_least_distance(seed: int, shape: str) -> None:
    x = four_points(np.random.default_rng(seed), shape)
    wa, wb, wc, square = point_triangle_distance(*x)
    assert min(wa, wb, wc) >= 0
    assert wa + wb + wc == pytest.approx(1, abs=1e-14)
    q = wa * x[1] + wb * x[2] + wc * x[3]
    np.testing.assert_allclose(((x[0] - q) ** 2).sum(), square, atol=1e-13)
    assert_closest(q, x[0], x[1:])


@given(st.integers(0, 2**32 - 1), st.sampled_from(SHAPES))
def test_segment_segment_is_the_least_distance(seed: int, shape: str) -> None:
    x = four_points(np.random.default_rng(seed), shape)
    s, t, square = segment_segment(*x)
    assert 0 <= s <= 1
    assert 0 <= t <= 1
    p, q = x[0] + s * (x[1] - x[0]), x[2] + t * (x[3] - x[2])
    np.testing.assert_allclose(((p - q) ** 2).sum(), square, atol=1e-13)
    assert_closest(p, q, x[:2])
    assert_closest(q, p, x[2:])
    if shape == "crossing":
        assert square < 1e-24


@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-300, 1e-30, 1.0, 1e30]))
def test_across_is_a_unit_vector_at_right_angles(seed: int, scale: float) -> None:
    rng, out = np.random.default_rng(seed), np.empty(3)
    u = rng.standard_normal(3) * rng.integers(0, 2, 3) * scale
    across(*u, out)
    assert np.linalg.norm(out) == pytest.approx(1, abs=1e-12)
    if np.abs(u).max() > 1e-90:
        assert abs(out @ u) <= 1e-12 * np.linalg.norm(u)
    triangle_normal(np.zeros(3), u, 2 * u, out)
    assert np.linalg.norm(out) == pytest.approx(1, abs=1e-12)


def approach(x: np.ndarray, d: np.ndarray, first: int, gap: float) -> float:
    count = len(x)
    x4, d4 = np.zeros((4, 3)), np.zeros((4, 3))
    x4[:count], d4[:count] = x, d
    return time_of_approach(x4, d4, first, count, gap, np.empty((4, 3)))


@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-5, 1e-3, 0.1]), st.floats(0.5, 1e4))
def test_a_point_through_a_face_is_stopped_before_and_near_its_gap(
    seed: int, gap: float, speed: float
) -> None:
    rng = np.random.default_rng(seed)
    turn = random_rotation(rng)
    x = np.array([[0.2, 0.3, 0.4], [0, 0, 0], [1, 0, 0], [0, 1, 0]]) @ turn.T
    d = np.array([[0, 0, -speed], [0, 0, 0], [0, 0, 0], [0, 0, 0]]) @ turn.T + rng.standard_normal(3)
    time = approach(x, d, 1, gap)
    true = min((0.4 - gap) / speed, 1.0)
    assert time <= true + 1e-12
    assert time >= true - 0.05 * (0.4 - gap) / speed - 1e-9


@given(st.integers(0, 2**32 - 1), st.floats(0.5, 1e4))
def test_crossing_edges_are_stopped(seed: int, speed: float) -> None:
    rng = np.random.default_rng(seed)
    turn = random_rotation(rng)
    x = np.array([[-1, 0, 0.1], [1, 0, 0.1], [0, -1, 0], [0, 1, 0]]) @ turn.T
    d = np.array([[0, 0, -speed], [0, 0, -speed], [0, 0, 0], [0, 0, 0]]) @ turn.T
    time = approach(x, d, 2, 1e-3)
    assert time <= 0.099 / speed
    assert time >= 0.94 * 0.099 / speed


@given(st.integers(0, 2**32 - 1), st.sampled_from(SHAPES), st.sampled_from([1, 2]), st.floats(-3, 3))
def test_the_gap_is_kept_until_the_time_returned(seed: int, shape: str, first: int, power: float) -> None:
    """Along the whole way, for every degenerate shape; and what stays apart is not stopped."""
    rng = np.random.default_rng(seed)
    x, d = four_points(rng, shape), rng.standard_normal((4, 3)) * 10**power

    def distance(y: np.ndarray) -> float:
        return float(np.sqrt(point_triangle_distance(*y)[3] if first == 1 else segment_segment(*y)[2]))

    gap = 0.3 * distance(x)
    time = approach(x, d, first, gap)
    assert 0 <= time <= 1
    for t in np.linspace(0, time, 40):
        assert distance(x + t * d) >= gap - 1e-12
    if time < 1 and gap > 1e-9:
        assert distance(x + time * d) < 0.5 * distance(x) or shape != "general"


def test_points_are_shapes_too() -> None:
    x, d = np.array([[0.0, 0, 1], [0, 0, 0]]), np.array([[0.0, 0, -4], [0, 0, 0]])
    assert approach(x, d, 1, 0.2) == pytest.approx(0.2, abs=0.01)
    assert approach(x, -d, 1, 0.2) == 1.0
    assert approach(0 * x, d, 1, 0.0) == 0.0
