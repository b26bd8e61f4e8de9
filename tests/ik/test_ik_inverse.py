"""Solving to the end on the quasi-static Tripod: reached, closest, on the branch, independent of the way."""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.ik.search import Limits, Search
from tests.messages import assert_names, raises_naming
from tests.scenes import SHARP
from tripod_ik.errors import IkError
from tripod_ik.inverse import InverseSolver, Outcome
from tripod_ik.limits import AngleLimit
from tripod_ik.model import StaticModel
from tripod_ik.rotation import normal_of, roll_pitch
from tripod_ik.row_limits import EffectorBox, TorqueLimit
from tripod_ik.tasks import PositionTask, orientation_tasks
from tripod_sim import SceneError, StepError, load_scene

WORKING = np.full(3, -1.4965)
ANY = AngleLimit(-2.1, 0.6)
NARROW = AngleLimit(-1.9, -1.1)


@pytest.fixture(scope="module")
def shared():
    return StaticModel(load_scene(SHARP, ["mesh.level=1"]))


@pytest.fixture
def model(shared):
    saved = shared.save()
    yield shared
    shared.restore(saved)


def sample(model, count, seed, low=-2.1, high=-0.6):
    """Return angles and the positions that they reach."""
    saved, found = model.save(), []
    for angles in np.random.default_rng(seed).uniform(low, high, (count, 3)):
        model.restore(saved)
        found.append((angles, model.move(angles).equilibrium.copy()))
    model.restore(saved)
    return found


def test_targets_over_the_reachable_set_are_reached(model):
    """The full set, of 500, is in benchmarks/ik_reach.py."""
    saved, solver, errors = model.save(), InverseSolver(model, ANY), []
    for angles, position in sample(model, 15, seed=1):
        model.restore(saved)
        solution = solver.solve([PositionTask(position)])
        assert solution.outcome is Outcome.REACHED
        assert solution.kkt < 1e-6
        assert solution.active_limits == ()
        assert solution.state.angles == pytest.approx(
            angles, abs=1e-5
        )  # on the branch there is but one answer
        errors.append(np.linalg.norm(model.state().equilibrium - position))
    assert max(errors) < 1e-7


def closest(model, target, bounds):
    """Return the least distance [m] that a general-purpose optimiser finds from several starts."""
    saved, best = model.save(), np.inf
    low, high = bounds
    for start in [(low + high) / 2, *np.random.default_rng(3).uniform(low, high, (3, 3))]:
        model.restore(saved)
        found = least_squares(
            lambda a: 1e3 * (model.move(a).equilibrium - target),
            np.broadcast_to(start, 3),
            lambda a: 1e3 * model.move(a).jacobian[:3],
            bounds=bounds,
        )
        best = min(best, 1e-3 * np.linalg.norm(found.fun))
    return best


def test_where_angle_limits_are_active_the_closest_pose_is_that_of_a_search_everywhere(model):
    saved, solver, limited = model.save(), InverseSolver(model, NARROW), 0
    targets = [position for _, position in sample(model, 4, seed=2)]
    targets += [np.array([0.04, 0, 0]), np.array([0.01, -0.02, -0.04]), np.array([0, 0, 0.1])]
    for target in targets:
        model.restore(saved)
        solution = solver.solve([PositionTask(target)])
        angles = solution.state.angles
        error = np.linalg.norm(solution.state.equilibrium - target)
        assert error == pytest.approx(closest(model, target, (-1.9, -1.1)), abs=2e-6)
        assert (angles >= -1.9).all()
        assert (angles <= -1.1).all()
        limited += solution.outcome is Outcome.CLOSEST
        assert bool(solution.active_limits) == (solution.outcome is Outcome.CLOSEST)
        assert solution.kkt < 1e-6
        assert solution.step < 1e-7
    assert limited > 4


def test_the_way_does_not_matter(model):
    saved, target = model.save(), np.array([0.004, -0.003, -0.007])
    ends = []
    for detour in (WORKING, [-0.8, -1.2, -1.9], [-2.0, -2.0, -1.0], [-1.0, -1.0, -1.0]):
        model.restore(saved)
        model.move(np.array(detour))
        ends.append(InverseSolver(model, ANY).solve([PositionTask(target)]).state.angles)
    assert np.ptp(ends, axis=0).max() < 1e-6


def test_the_present_pose_as_target_moves_nothing(model):
    for angles in ([-1.3, -1.6, -0.9], [-0.2, 0.1, -0.4]):
        here = model.move(np.array(angles))
        solution = InverseSolver(model, ANY).solve([PositionTask(here.equilibrium)])
        assert solution.outcome is Outcome.REACHED
        assert solution.state.angles == pytest.approx(angles, abs=1e-9)


def test_it_stays_on_the_branch_unless_asked(model):
    """The same position of the effector, arms outward and arms up: det(J) has another sign there."""
    up = model.move(np.full(3, 0.2))
    assert np.linalg.det(up.jacobian[:3]) < 0
    target = up.equilibrium + np.array([0, 0, -0.003])
    here = InverseSolver(model, ANY).solve([PositionTask(target)])
    assert here.outcome is Outcome.REACHED
    assert np.linalg.det(here.state.jacobian[:3]) < 0
    model.move(np.full(3, -0.6))
    there = InverseSolver(model, ANY).solve([PositionTask(target)])
    assert there.outcome is Outcome.REACHED
    assert np.linalg.det(there.state.jacobian[:3]) > 0
    assert there.state.angles.max() < here.state.angles.min() - 0.2

    model.move(np.full(3, -0.45))
    saved, beyond = model.save(), [PositionTask([0.002, 0.0, 0.036])]  # above the fold
    for any_branch, side in ((False, 1), (True, -1)):
        model.restore(saved)
        kept = InverseSolver(model, ANY, any_branch=any_branch).solve(beyond)
        assert kept.outcome is Outcome.CLOSEST
        assert np.sign(np.linalg.det(kept.state.jacobian[:3])) == side


def test_it_converges_without_damping_too_since_a_step_that_is_worse_is_taken_back(model):
    saved, ends = model.save(), []
    for curvature in (0.0, 0.03):
        model.restore(saved)
        solution = InverseSolver(model, ANY).solve([PositionTask([0.04, 0.0, 0.0], curvature=curvature)])
        assert solution.outcome is Outcome.CLOSEST
        ends.append(solution.residual)
    assert ends[0] == pytest.approx(ends[1], abs=1e-4)


def test_tilts_are_reached_where_there_is_room_for_them(model):
    """Lower down, a tilt towards a strip meets the smallest angle or a fold: `tripod reach` shows where."""
    saved, height = model.save(), 0.005
    for roll, pitch in ((0.3, 0.0), (-0.3, 0.0), (0.0, 0.3), (0.0, -0.3), (0.2, -0.2)):
        model.restore(saved)
        solution = InverseSolver(model, ANY).solve(orientation_tasks(normal_of(roll, pitch), height))
        assert solution.outcome is Outcome.REACHED
        found = roll_pitch(solution.state.equilibrium_rotation[:, 2])
        assert found == pytest.approx((roll, pitch), abs=1e-5)


def test_torques_and_box_limit_the_pose(model):
    target = [PositionTask(model.state().equilibrium)]
    assert np.abs(model.state().efforts).min() > 0.14  # the most that the symmetric poses need
    model.move(np.full(3, -1.8))
    saved = model.save()
    for hard in (False, True):
        model.restore(saved)
        bound = InverseSolver(model, ANY, row_limits=[TorqueLimit(0.13, hard=hard)]).solve(target)
        assert bound.outcome is Outcome.CLOSEST
        assert np.abs(bound.state.efforts) == pytest.approx([0.13] * 3, abs=1e-7 if hard else 1e-3)
        assert set(bound.active_limits) == {f"servo_{i} torque" for i in range(3)}
        assert bound.residual > 3e-3
    model.restore(saved)
    box = EffectorBox([-0.1, -0.1, -0.1], [0.005, 0.1, 0.1], hard=True)
    target = [PositionTask([0.012, 0.0, -0.01])]
    boxed = InverseSolver(model, ANY, row_limits=[box]).solve(target)
    assert boxed.state.equilibrium[0] == pytest.approx(0.005, abs=1e-8)
    assert boxed.active_limits == ("effector x",)


@pytest.fixture(scope="module")
def everywhere():
    """A model of its own: the search leaves it anywhere."""
    return Search(StaticModel(load_scene(SHARP, ["mesh.level=1"])), *(-1.9, -1.1), count=5)


BOX = (np.array([-0.006, -0.005, -0.012]), np.array([0.005, 0.006, -0.004]))
WEAK = Limits(torque=0.135)
TARGETS = np.random.default_rng(5).uniform([-0.012, -0.012, -0.02], [0.012, 0.012, 0.006], (8, 3))


@pytest.fixture(scope="module")
def solved(everywhere):
    """A function that tells, for limits and start, what to solve with, where to begin, and the best of each target."""
    model = everywhere.model

    @cache
    def solve(limits, start):
        rows = [TorqueLimit(limits.torque, hard=True)] if np.isfinite(limits.torque) else []
        rows += [EffectorBox(limits.low, limits.high, hard=True)] if np.isfinite(limits.low).all() else []
        solver, found = InverseSolver(model, NARROW, row_limits=rows), []
        model.move(np.array(start))
        home = model.save()
        for target in TARGETS:
            model.restore(home)
            found.append(solver.solve([PositionTask(target)], everywhere=True))
        return solver, home, found

    return solve


@pytest.mark.parametrize(
    ("limits", "start"),
    [
        pytest.param(Limits(low=BOX[0], high=BOX[1]), (-1.5, -1.5, -1.5), marks=pytest.mark.slow),
        pytest.param(WEAK, (-1.1, -1.1, -1.1), marks=pytest.mark.slow),
        (Limits(0.14, *BOX), (-1.1, -1.7, -1.3)),
    ],
)
def test_where_torque_or_box_is_active_the_pose_is_the_closest_within_the_limits(
    everywhere, solved, limits, start
):
    """More of them, with several seeds, are in benchmarks/ik_reach.py."""
    active = 0
    for target, solution in zip(TARGETS, solved(limits, start)[2], strict=True):
        assert solution.kkt < 1e-6
        assert solution.passed < 1e-6
        assert limits.room(solution.state)[0].min() > -2e-6  # of 10 mm and of 0.1 N m
        found = np.linalg.norm(solution.state.equilibrium - target)
        assert found == pytest.approx(solution.residual, abs=1e-9)
        active += any("torque" in name or "effector" in name for name in solution.active_limits)
        least = everywhere.closest(target, limits)[0]
        assert found < least + 5e-5
        assert found > least - 5e-6  # nor is the search worse
    assert active > 1


@pytest.mark.slow
def test_where_a_torque_limit_parts_the_poses_the_closest_is_beyond_the_gap(everywhere, solved):
    """From where the search begins no way leads there that keeps to the limit; only a search everywhere finds it."""
    model, parted = everywhere.model, 0
    solver, home, found = solved(WEAK, (-1.1, -1.1, -1.1))
    for target, best in zip(TARGETS, found, strict=True):
        model.restore(home)
        near = solver.solve([PositionTask(target)])
        assert best.residual <= near.residual + 1e-9
        if best.residual < near.residual - 5e-5:
            parted += 1
            way = np.linspace(near.state.angles, best.state.angles, 12)[1:-1]
            assert min(WEAK.room(model.move(a))[0].min() for a in way) < -1e-3
    assert parted


def test_a_search_everywhere_leaves_a_corner_of_the_angle_limits_that_is_not_the_best():
    """The target is 65 mm out of reach; the corner that the search from home ends in is 0.13 mm worse than the best."""
    model, target = StaticModel(load_scene(SHARP)), [-0.0458489, -0.0234071, -0.0590514]
    solver, home = InverseSolver(model, NARROW), model.save()
    near = solver.solve([PositionTask(target)])
    model.restore(home)
    best = solver.solve([PositionTask(target)], everywhere=True)
    assert best.outcome is Outcome.CLOSEST
    assert best.residual < near.residual - 1e-4
    assert best.state.angles == pytest.approx([-1.1, -1.9, -1.9], abs=1e-9)


def test_without_time_or_iterations_it_says_so(model):
    task = [PositionTask([0.012, 0.0, -0.004])]
    for solver, limits, named in (
        (InverseSolver(model, ANY, max_iterations=2), {}, ("2 iterations", "rad")),
        (InverseSolver(model, ANY), {"time_limit": 0.0}, ("time limit", "0 s", "1 iterations")),
    ):
        solution = solver.solve(task, **limits)
        assert solution.outcome is Outcome.UNFINISHED
        assert_names(solution.reason, *named)
        assert solution.residual > 1e-4


def test_a_pose_that_the_model_refuses_leaves_it_where_it_was(model):
    before = model.state()
    with raises_naming(SceneError, "servo_2", "3 rad", "-2.1 to 0.6 rad"):
        model.move(np.array([-1.4, -1.4, 3.0]))
    assert model.angles == pytest.approx(WORKING)
    assert model.state().effector == pytest.approx(before.effector, abs=1e-15)


@pytest.mark.parametrize("angles", [[-1.4, -1.4], np.full((3, 1), -1.4), [-1.4, -1.4, np.nan], "none"])
def test_angles_that_are_none_of_the_model_are_refused(model, angles):
    for way in (model.move, model.follow):
        with pytest.raises(IkError, match="angles"):
            way(angles)
    assert model.angles == pytest.approx(WORKING, abs=1e-15)


def test_a_pose_without_compliance_leaves_the_model_where_it_was(model, monkeypatch):
    before = model.state().effector.copy()

    def singular():
        raise StepError("at rest is singular")

    with monkeypatch.context() as patch:
        patch.setattr(model.simulation, "compliance", singular)
        with pytest.raises(StepError, match="singular"):
            model.move(WORKING + 0.1)
    assert model.angles == pytest.approx(WORKING, abs=1e-15)
    assert model.state().effector == pytest.approx(before, abs=1e-15)


def test_a_scene_without_servos_has_no_inverse():
    with raises_naming(IkError, "'silicone'", "no servos", "no effector"):
        StaticModel(load_scene("silicone"))
