"""Levels 12 to 14 of the Y, graded for the effector's position with the compliant clamp, and how they were found."""

import numpy as np
import pytest

from benchmarks.graded_mesh import (
    REFERENCE,
    SHORTEST,
    STEEPEST,
    errors_at_rest,
    poses,
    refined,
    regraded,
    shortest,
)
from tripod_sim.mesh.y_piece import YLevel


def test_graded_levels_err_by_less_than_one_per_cent_at_rest() -> None:
    exact = poses(REFERENCE)[0]
    for element, level, most in (("h8_modes", 12, 590), ("h20", 13, 820), ("h20", 14, 2600)):
        found, unknowns = poses({"mesh.element": element, "mesh.level": level})
        assert unknowns < most
        assert 1e-4 < max(errors_at_rest(found, exact)) < 0.01, (element, level)


def test_errors_are_of_the_largest_distance_and_of_the_move_itself() -> None:
    exact = np.zeros((6, 3))
    exact[3], exact[4] = (0, 0, 4), (0, 0, 2)
    found = exact + np.array([0, 0.04, 0])  # all alike, so the move is right
    assert errors_at_rest(found, exact) == pytest.approx((0.01, 0.0))
    found[4, 1] += 0.02
    assert errors_at_rest(found, exact) == pytest.approx((0.015, 0.01))


def test_one_more_element_keeps_how_much_the_grid_is_graded() -> None:
    level = YLevel(2, 1, 4, 1.5, clamped=3, clamped_grading=1.3)
    for finer in refined(level):
        assert finer.grading ** (finer.along - 1) == pytest.approx(1.5**3)
        assert finer.clamped_grading ** (finer.clamped - 1) == pytest.approx(1.3**2)
    assert len({tuple(vars(finer).values()) for finer in refined(level)}) == 5
    short = YLevel(2, 1, 2, 1.0, clamped=4, clamped_grading=1.25)  # with one more it is too short
    assert all(shortest(finer) >= SHORTEST for finer in refined(short))
    steep = YLevel(2, 1, 2, STEEPEST)
    assert [x.grading for x in regraded(steep)] == pytest.approx([STEEPEST / 1.5])
