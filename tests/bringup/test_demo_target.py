"""The demo's target: where it begins, how smooth it is, what it never exceeds."""

import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_bringup.demo_target import DemoTarget, smooth_step

CENTRE = (0.001, -0.002, -0.008)
TARGET = DemoTarget(CENTRE)


def test_it_is_at_rest_in_the_centre_until_it_begins() -> None:
    assert np.array_equal(TARGET(0.0), CENTRE)
    assert np.array_equal(TARGET(-5.0), CENTRE)


def test_after_the_blend_it_is_on_the_circle_and_rises_and_falls_by_the_height() -> None:
    t = np.linspace(TARGET.blend, TARGET.blend + 24.0, 2401)
    offset = np.array([TARGET(s) for s in t]) - CENTRE
    assert np.hypot(offset[:, 0], offset[:, 1]) == pytest.approx(0.010, rel=1e-12)
    assert offset[:, 2].max() == pytest.approx(0.005, rel=1e-4)
    assert offset[:, 2].min() == pytest.approx(-0.001, rel=1e-4)


def test_a_period_later_it_is_at_the_same_place_of_the_circle() -> None:
    first, later = np.array(TARGET(12.0)), np.array(TARGET(12.0 + TARGET.period))
    assert first[:2] == pytest.approx(later[:2], abs=1e-15)
    quarter = TARGET(12.0 + TARGET.period / 4)
    assert np.linalg.norm(np.array(quarter[:2]) - first[:2]) == pytest.approx(0.010 * np.sqrt(2))


def test_speed_and_acceleration_have_no_jump() -> None:
    h = 1e-3  # [s]
    t = np.arange(-0.1, 10.0, h)
    position = np.array([TARGET(s) for s in t])
    velocity = np.diff(position, axis=0) / h
    acceleration = np.diff(velocity, axis=0) / h
    speed = np.linalg.norm(velocity, axis=1)
    assert 0.005 < speed.max() <= TARGET.speed_bound
    # the third derivative of the blend is at most 60 / blend³, the circle's far below
    jerk = np.abs(np.diff(acceleration, axis=0)).max() / h
    assert jerk < 3 * 60 / TARGET.blend**3 * TARGET.radius
    assert np.linalg.norm(acceleration[0]) == 0.0


def test_the_smooth_step_has_the_largest_slope_that_the_bound_uses() -> None:
    u = np.linspace(-0.5, 1.5, 20001)
    s = np.array([smooth_step(v) for v in u])
    assert s[0] == 0.0 and s[-1] == 1.0 and smooth_step(0.5) == 0.5
    assert np.diff(s).min() >= 0
    assert (np.diff(s) / np.diff(u)).max() == pytest.approx(1.875, rel=1e-4)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"period": 0.0}, ("period", "0.0 s", "positive")),
        ({"blend": -1.0}, ("blend", "-1.0 s", "positive")),
        ({"radius": float("nan")}, ("radius", "nan", "finite")),
        ({"centre": (0.0, float("inf"), 0.0)}, ("centre", "inf", "finite")),
    ],
)
def test_nonsense_is_refused_by_name(change: dict[str, float], named: tuple[str, ...]) -> None:
    with raises_naming(ValueError, *named):
        DemoTarget(**{"centre": CENTRE, **change})  # type: ignore[arg-type]
