"""Where the arms stand, worked out by hand, and signs."""

import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_view.arm import ArmGeometry, arm_pose, carriage_pose, clamp_corners, stands

GEOMETRY = ArmGeometry()
STANDS = stands(3, GEOMETRY)
CORNERS = clamp_corners(STANDS[0], GEOMETRY)


def clamp_centre(arm: int, angle: float, slide: float = 0.0) -> np.ndarray:
    """Return the middle of the clamped end in `world` [m]."""
    return arm_pose(STANDS[arm], angle, slide).apply(CORNERS).reshape(-1, 3).mean(axis=0)


def test_at_angle_zero_the_clamp_holds_the_end_of_the_flat_strip() -> None:
    corners = arm_pose(STANDS[0], 0.0, 0.0).apply(CORNERS).reshape(-1, 3)
    assert corners.min(axis=0) == pytest.approx([0.045, -0.015, -0.0025])
    assert corners.max(axis=0) == pytest.approx([0.055, 0.015, 0.0025])


def test_a_quarter_turn_down_tips_the_clamp_outward_and_down() -> None:
    # From the axis at (60, -28.85) mm the centre of the clamp is at (-10, 28.85); turned by 90 degrees outward it is
    # at (28.85, 10).
    assert clamp_centre(0, -np.pi / 2) == pytest.approx([0.08885, 0.0, -0.01885], abs=1e-12)


def test_a_positive_angle_lifts_the_strip_and_pulls_it_inward() -> None:
    x, _, z = clamp_centre(0, 0.3)
    assert x == pytest.approx(0.060 - 0.010 * np.cos(0.3) - 0.02885 * np.sin(0.3))
    assert z == pytest.approx(-0.02885 - 0.010 * np.sin(0.3) + 0.02885 * np.cos(0.3))
    assert x < 0.05


def test_the_slide_moves_the_axis_inward() -> None:
    assert carriage_pose(STANDS[0], 0.035).position == pytest.approx([0.025, 0.0, -0.02885])
    assert clamp_centre(0, -1.4965, 0.035)[0] == pytest.approx(clamp_centre(0, -1.4965)[0] - 0.035)


@pytest.mark.parametrize("arm", [1, 2])
def test_arms_stand_at_multiples_of_120_degrees_counter_clockwise(arm: int) -> None:
    c, s = np.cos(2 * np.pi * arm / 3), np.sin(2 * np.pi * arm / 3)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    for angle, slide in ((0.0, 0.0), (-0.7, 0.01), (-2.1, 0.035), (0.6, 0.0)):
        first = arm_pose(STANDS[0], angle, slide).apply(CORNERS)
        assert arm_pose(STANDS[arm], angle, slide).apply(CORNERS) == pytest.approx(first @ turn.T, abs=1e-12)


@pytest.mark.parametrize("angle", [-2.1, -np.pi / 2, 0.0, 0.6])
@pytest.mark.parametrize("arm", [0, 1, 2])
def test_quaternions_are_unit_with_w_not_negative(arm: int, angle: float) -> None:
    q = arm_pose(STANDS[arm], angle, 0.0).quaternion
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-12)
    assert q[3] >= 0


@pytest.mark.parametrize(
    ("dimensions", "named"),
    [
        ({"axis_radius": 0.0}, ("axis_radius", "0.0", "positive")),
        ({"thickness": float("nan")}, ("thickness", "nan", "finite")),
        ({"clamp_inner": 0.06}, ("clamp_inner 0.06 m", "clamp_outer 0.055 m")),
    ],
)
def test_impossible_dimensions_are_refused_by_name(
    dimensions: dict[str, float], named: tuple[str, ...]
) -> None:
    with raises_naming(ValueError, *named):
        ArmGeometry(**dimensions)
