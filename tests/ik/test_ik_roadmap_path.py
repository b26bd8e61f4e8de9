"""The quickest ways over a grid: how long they take, and which steps of several servos are ways at all."""

from dataclasses import replace

import numpy as np
import pytest

from tests.ik.plant import SpringRobot
from tests.scenes import SHARP
from tripod_ik.model import StaticModel
from tripod_ik.path_follower import steps_of
from tripod_ik.roadmap import SPACING, Roadmap
from tripod_ik.roadmap_path import LEAST, SPEED, TURN, RoadmapPaths, quickest, time_of
from tripod_ik.snap_through import HURRY
from tripod_sim import load_scene

SLIDE = 0.035
STEPS = 60
SQUARE = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]
WORKING = np.full(3, -1.4965)


def square(**changed):
    """Return states at the corners of a square of the grid, those of `changed` replaced."""
    robot = SpringRobot(slide=SLIDE)
    states = [
        replace(
            robot.state(WORKING + SPACING * np.array(cell)),
            stability_margin=1.0,
            stability_margin_slope=np.zeros(3),
        )
        for cell in SQUARE
    ]
    for number, values in changed.items():
        k = int(number[1:])
        states[k] = replace(states[k], **values)
    return states


def test_servos_turn_at_once_where_any_order_leads_to_the_same_pose():
    states, both = square(), [{1, 2}, {0, 3}, {0, 3}, {1, 2}]
    assert RoadmapPaths(states, SQUARE, both).ways(0, range(4)).to(3) == [0, 3]
    torn = [{1, 2}, {0, 3}, {0}, {1}]
    assert RoadmapPaths(states, SQUARE, torn).ways(0, range(4)).to(3) == [0, 1, 3]


def test_servos_do_not_turn_at_once_where_the_effector_does_not_move_as_its_jacobians_say():
    states = square()
    far = square(_3={"effector": states[3].effector + 0.01})
    both = [{1, 2}, {0, 3}, {0, 3}, {1, 2}]
    assert len(RoadmapPaths(far, SQUARE, both).ways(0, range(4)).to(3)) == 3


def test_a_pose_without_a_way_to_it_is_infinitely_far():
    ways = RoadmapPaths(square(), SQUARE, [{1}, {0}, {3}, {2}]).ways(0, range(4))
    assert ways.time(1) < 1.0
    assert ways.time(3) == np.inf


def test_what_is_slowest_says_how_long_a_way_takes():
    start, end = square()[0], square()[3]
    moved = float(np.linalg.norm(end.equilibrium - start.equilibrium))
    assert time_of([start, end]) == pytest.approx(max(SPACING / TURN, moved / SPEED), abs=1e-6)
    assert quickest(start, end) == pytest.approx(time_of([start, end]), abs=1e-6)
    far = replace(
        end, effector=end.effector + (start.equilibrium - end.equilibrium) + np.array([0.03, 0.0, 0.0])
    )
    assert time_of([start, far]) == pytest.approx(0.03 / SPEED)
    soft = replace(end, stability_margin=0.1)
    left = [(rho / LEAST) ** 2 - 1 for rho in (1.0, 0.1)]
    assert time_of([start, soft]) == pytest.approx(HURRY * np.log(left[0] / left[1]), abs=1e-6)
    assert quickest(start, soft) < time_of([start, soft])


@pytest.mark.parametrize(("move", "fall"), [(3.0, 0.5), (10.0, 0.9), (2.0, 0.1), (1.5, 1.4)])
def test_towards_a_fold_the_effector_keeps_its_speed(move, fall):
    """On the first of so many steps, ∫ move / √(1 - t fall) dt is 1: that of one step."""
    t = np.linspace(0.0, 1.0 / steps_of(move, fall), 20001)
    assert np.trapezoid(move / np.sqrt(1 - t * fall), t) == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(("move", "fall", "steps"), [(2.0, -0.4, 2.0), (1.0, 0.0, 1.0), (0.0, 0.5, 0.0)])
def test_where_the_body_does_not_get_softer_a_way_is_as_long_as_its_jacobian_says(move, fall, steps):
    assert steps_of(move, fall) == steps


@pytest.fixture(scope="module")
def flat():
    model = StaticModel(load_scene(SHARP), SLIDE)
    return Roadmap(model, model.home - 0.6, model.home + 0.6)


def test_steps_of_several_servos_do_not_snap(flat):
    """Every one of a sample is followed by the model, which stops before a snap, and ends where the grid says."""
    numbers, rng = sorted(flat.within(0.012)), np.random.default_rng(14)
    cells = np.array([pose.cell for pose in flat.poses])
    pairs = flat.roads.steps()
    pairs = pairs[
        np.isin(pairs, numbers).all(axis=1) & (np.abs(np.diff(cells[pairs], axis=1)[:, 0]).sum(axis=1) > 1)
    ]
    assert len(pairs) > 1000
    for a, b in rng.choice(pairs, STEPS):
        here, there = flat.poses[a], flat.poses[b]
        flat.model.restore(here.saved)
        state = flat.model.follow(there.state.angles)
        assert np.abs(state.equilibrium - there.state.equilibrium).max() < 1e-4, (here.cell, there.cell)
