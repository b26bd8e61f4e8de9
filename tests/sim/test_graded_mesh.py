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
from tripod_sim import Simulation, load_scene
from tripod_sim.mesh.y_piece import LEVELS, YLevel


def test_graded_levels_err_by_little_at_rest() -> None:
    exact = poses(REFERENCE)[0]
    for element, level, size, error in (
        ("h8_modes", 12, 474, 0.0125),
        ("h20", 13, 816, 0.01),
        ("h20", 14, 2589, 0.01),
    ):
        found, unknowns = poses({"mesh.element": element, "mesh.level": level})
        assert unknowns == size
        assert 1e-4 < max(errors_at_rest(found, exact)) < error, (element, level)


@pytest.mark.parametrize("pose", [(-2.1, -1.0, -1.0), (-1.9, -1.9, -1.9), (-1.0, -2.1, -2.1)])
def test_no_element_buckles_in_the_clamp(pose: tuple[float, float, float]) -> None:
    """Elements half as long as thick do: where the clamp's edge is pressed their tangent becomes indefinite, Newton's
    method takes a hundred iterations and finds a saddle, and the effector stands up to 5 mm off.
    """
    work = np.array([-1.4965, -1.4965, -1.4965, 0.035])
    ends = []
    for mesh in (("mesh.element=h8_modes", "mesh.level=12"), ("mesh.element=h20", "mesh.level=13")):
        simulation = Simulation(load_scene("tripod", ["inertia=off", "damping=off", *mesh]))
        for share in np.linspace(0.2, 1.0, 5):
            simulation.step(share * work)
        for share in np.linspace(0.05, 1.0, 20):
            report = simulation.step(np.array([*(work[:3] + share * (np.array(pose) - work[:3])), work[3]]))
            assert report.iterations < 20
        ends.append(simulation.state.centres[0].copy())
    assert np.linalg.norm(ends[1] - ends[0]) < 2.5e-4


def test_the_graded_levels_keep_the_lengths_of_the_search() -> None:
    for element, level in (("h8_modes", 12), ("h20", 13), ("h20", 14)):
        assert shortest(LEVELS[level]) >= SHORTEST[element]


def test_errors_are_of_the_largest_distance_and_of_the_move_itself() -> None:
    exact = np.zeros((6, 3))
    exact[3], exact[4] = (0, 0, 4), (0, 0, 2)
    found = exact + np.array([0, 0.04, 0])  # all alike, so the move is right
    assert errors_at_rest(found, exact) == pytest.approx((0.01, 0.0))
    found[4, 1] += 0.02
    assert errors_at_rest(found, exact) == pytest.approx((0.015, 0.01))


def test_one_more_element_keeps_how_much_the_grid_is_graded() -> None:
    level = YLevel(2, 1, 4, 1.5, clamped=3, clamped_grading=1.3)
    for finer in refined("h20", level):
        assert finer.grading ** (finer.along - 1) == pytest.approx(1.5**3)
        assert finer.clamped_grading ** (finer.clamped - 1) == pytest.approx(1.3**2)
    assert len({tuple(vars(finer).values()) for finer in refined("h20", level)}) == 5
    short = YLevel(2, 1, 2, 1.0, clamped=4, clamped_grading=1.25)  # with one more it is too short
    assert all(shortest(finer) >= SHORTEST["h20"] for finer in refined("h20", short))
    assert len(list(refined("h8_modes", short))) == 0  # it is too short as it is
    steep = YLevel(2, 1, 2, STEEPEST)
    assert [x.grading for x in regraded("h20", steep)] == pytest.approx([STEEPEST / 1.5])
