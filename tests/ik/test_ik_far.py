"""Targets far out of reach: the search ends soon, at the closest pose, and says what keeps it off."""

import numpy as np
import pytest

from tripod_ik.inverse import InverseSolver, Outcome
from tripod_ik.limits import AngleLimit
from tripod_ik.model import StaticModel
from tripod_ik.row_limits import TorqueLimit
from tripod_ik.solve_once import solve_once
from tripod_ik.tasks import PositionTask
from tripod_sim import load_scene

COARSE = ["mesh.element=h8_modes", "mesh.level=1"]
SLIDE = 0.035


def solver(*limits: TorqueLimit) -> InverseSolver:
    return InverseSolver(StaticModel(load_scene("tripod", COARSE), SLIDE), AngleLimit(-2.1, 0.6), (), limits)


def test_a_search_that_no_step_betters_by_much_ends() -> None:
    """Close to the end of the equilibria each step is shortened again; 64 programs come no closer."""
    found = solver().solve([PositionTask(np.array([0.03, 0.0, -0.006]))], everywhere=True)
    assert found.outcome is Outcome.CLOSEST
    assert found.residual < 17.7e-3
    assert found.iterations < 30


def test_a_program_without_a_solution_is_tried_in_shorter_steps() -> None:
    found = solver(TorqueLimit(0.06, hard=True)).solve(
        [PositionTask(np.array([0.008, 0.0, -0.005]))], everywhere=True
    )
    assert found.outcome is Outcome.CLOSEST
    assert found.active_limits == ("servo_0 torque",)
    assert found.passed < 1e-6
    assert found.residual < 1.2e-3


@pytest.mark.slow
def test_another_way_round_is_looked_for_where_no_limit_keeps_a_target_off() -> None:
    """The straight search ends 23.8 mm off, hardly closer than the working pose."""
    found = solve_once(load_scene("tripod", COARSE), [0.0, 0.025, 0.0], slide=SLIDE)
    assert found["outcome"] == Outcome.CLOSEST
    assert found["error"] < 3e-3
