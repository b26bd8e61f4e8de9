"""What `tripod reach` and `tripod ik --target` compute."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from tests.messages import raises_naming
from tests.scenes import FIVE_LEGS, SHARP
from tripod_bringup.ik_command import solution_rows
from tripod_ik import reach as module
from tripod_ik.errors import IkError
from tripod_ik.model import StaticModel
from tripod_ik.reach import Reach, columns, default_range, reach
from tripod_ik.solve_once import solve_once
from tripod_ik.tracker_settings import Goal
from tripod_sim import load_scene

COARSE = ["mesh.level=1"]


@pytest.fixture(scope="module")
def found():
    model = StaticModel(load_scene(SHARP, COARSE))
    done = []
    low, high = default_range(model)
    result = reach(model, low, high, count=3, torque_max=0.13, progress=done.append)
    return model, result, done


def test_every_pose_of_the_stretched_range_is_found_once(found):
    _, result, done = found
    assert result.tried == 27
    assert len(result.table) + result.folded + result.snapped + result.failed == 27
    assert len(result.table) > 20
    assert result.table.shape[1] == len(columns(3)) == 14
    assert result.servos == 3
    assert result.samples == 0
    assert len(np.unique(result.table[:, :3].round(6), axis=0)) == len(result.table)
    assert done == sorted(done)
    assert 0 < done[0] < done[-1] == 1.0


def test_a_row_is_what_the_model_has_at_its_angles(found):
    _, result, _ = found
    for row in result.table[:4]:
        state = StaticModel(load_scene(SHARP, COARSE), angles=row[:3]).state()
        normal = state.equilibrium_rotation[:, 2]
        assert row[3:6] == pytest.approx(state.equilibrium, abs=1e-7)
        assert row[8] == pytest.approx(np.arccos(normal[2]), abs=1e-5)
        assert np.hypot(np.sin(row[6]), np.sin(row[7]) * np.cos(row[6])) == pytest.approx(
            np.sin(row[8]), abs=1e-6
        )
        assert row[9:12] == pytest.approx(state.efforts, abs=1e-6)
        assert row[12] == pytest.approx(0.13 - np.abs(row[9:12]).max())
        assert row[13] == pytest.approx(np.linalg.svd(state.jacobian[:3])[1].min(), abs=1e-6)


def test_layers_hold_what_the_torque_allows(found):
    _, result, _ = found
    assert 0 < len(result.bearable) < len(result.table)
    layers = result.layers(3)
    assert sum(layer.poses for layer in layers) == len(result.bearable)
    assert all(layer.margin[0] >= 0 for layer in layers)
    assert all(layer.radius <= layer.farthest for layer in layers)
    assert all(layer.tilt <= layer.steepest for layer in layers)
    assert layers[0].low == pytest.approx(result.bearable[:, 5].min())
    assert layers[-1].high == pytest.approx(result.bearable[:, 5].max())
    assert max(layer.radius for layer in layers) > 5e-3
    heavy = result.table.copy()
    heavy[:, 12] = -1.0
    assert Reach(heavy, 0, 27, 0, 0, 0).layers() == []


def test_the_flood_ends_at_folds():
    """Beyond about -0.3 rad the strips hang slack and det(J) changes its sign."""
    model = StaticModel(load_scene(SHARP, COARSE))
    model.move(np.full(3, -0.6))
    result = reach(model, -0.6, 0.2, count=2, torque_max=1.0)
    assert result.folded + result.snapped > 0
    assert len(result.table) + result.folded + result.snapped + result.failed == result.tried <= 8
    assert not (result.table[:, :3] == 0.2).all(axis=1).any()


def test_the_error_of_the_mesh_is_that_of_the_branch_that_the_answer_is_on():
    """Brought there from the undeformed body, the richer mesh comes to an equilibrium 15 mm away."""
    result = solve_once(
        load_scene(SHARP, ["clamp.stiffness=1.4e10", "mesh_error={}"]), [0.01, -0.005, 0.006], slide=0.035
    )
    fine = StaticModel(load_scene(SHARP, ["clamp.stiffness=1.4e10", "mesh.element=h20", "mesh.level=8"]))
    there = fine.follow(np.array(result["angles"])).equilibrium - result["position"]
    assert np.linalg.norm(there) < 3e-4
    assert result["mesh_error"]["effector"] == pytest.approx(there.tolist(), abs=2e-5)


def test_samples_of_three_servos_fill_what_a_grid_finds(found):
    """The same branch: no sample lies farther from the poses of a dense grid than these do from each other."""
    model, *_ = found
    model.go_home()
    low, high = default_range(model)
    grid = reach(model, low, high, count=7, torque_max=0.13)
    model.go_home()
    sampled = reach(model, low, high, samples=200, torque_max=0.13)
    assert sampled.samples == 200
    assert sampled.tried == 200 + 8 + 1
    assert len(sampled.table) > 190
    spacing = KDTree(grid.position).query(grid.position, k=2)[0][:, 1].max()
    assert KDTree(grid.position).query(sampled.position)[0].max() < spacing
    for row in sampled.table[:3]:
        state = StaticModel(load_scene(SHARP, COARSE), angles=row[:3]).state()
        assert row[3:6] == pytest.approx(state.equilibrium, abs=1e-7)
    model.go_home()
    again = reach(model, low, high, samples=200, torque_max=0.13)
    np.testing.assert_array_equal(again.angles, sampled.angles)


@pytest.mark.parametrize(
    ("count", "tried", "samples"),
    [
        (1, 11, 0),
        (2, 121, 0),
        (4, 16, 0),
        (5, 40 + 32 + 1, 40),
        pytest.param(6, 40 + 64 + 1, 40, marks=pytest.mark.slow),
    ],
)
def test_robots_of_other_numbers_of_servos_have_a_workspace(count, tried, samples):
    legs = {1: 3, 2: 4}.get(count, count)
    model = StaticModel(load_scene(FIVE_LEGS, [f"mesh.legs={legs}", f"servos.count={count}"]))
    low, high = default_range(model)
    density = {"count": 2} if count == 4 else {"samples": 40} if count > 4 else {}
    result = reach(model, low, high, torque_max=0.3, **density)
    assert (result.servos, result.samples) == (count, samples)
    assert len(result.table) + result.folded + result.snapped + result.failed == result.tried == tried
    assert len(result.table) > 0.8 * tried
    assert result.table.shape[1] == len(columns(count)) == 2 * count + 8
    model.go_home()
    row = result.table[int(np.abs(result.angles - model.home).sum(axis=1).argmin())]
    state = model.move(row[:count])
    assert row[count : count + 3] == pytest.approx(state.equilibrium, abs=1e-7)
    assert row[count + 6 : -2] == pytest.approx(state.efforts, abs=1e-6)
    assert row[-2] == pytest.approx(0.3 - np.abs(row[count + 6 : -2]).max())
    assert 0 < result.spacing < 0.02
    assert sum(layer.poses for layer in result.layers()) == len(result.bearable) > 0


def test_beyond_four_servos_poses_are_sampled_by_default(monkeypatch):
    monkeypatch.setattr(module, "SAMPLES", 6)
    model = StaticModel(load_scene(FIVE_LEGS))
    result = reach(model, -1.7, -1.3, torque_max=0.3)
    assert (result.samples, result.tried) == (6, 6 + 32 + 1)


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"low": -1.0, "high": -1.0}, ("-1 to -1 rad", "3 steps")),
        ({"count": 1}, ("-2 to -0.6 rad", "1 steps")),
        ({"count": None, "samples": 0}, ("0 samples", "-2 to -0.6 rad")),
        ({"count": 3, "samples": 5}, ("count is 3", "samples is 5")),
        ({"low": -1.0}, ("start", "[-1.4, -1.4, -1.4] rad", "between -1 and -0.6 rad")),
        ({"torque_max": 0.0}, ("torque limit", "0 N m")),
        ({"torque_max": np.nan}, ("torque limit", "nan N m")),
    ],
)
def test_bad_grids_are_refused(found, values, named):
    model, *_ = found
    model.move(np.full(3, -1.4))
    given = {"low": -2.0, "high": -0.6, "count": 3, "torque_max": 0.17} | values
    with raises_naming(IkError, *named):
        reach(model, given.pop("low"), given.pop("high"), **given)


def test_once_gives_angles_torques_and_what_is_missing():
    scene = load_scene(SHARP, COARSE)
    result = solve_once(scene, [0.004, -0.002, -0.006], slide=0.035)
    assert result["reached"]
    assert result["position"] == pytest.approx([0.004, -0.002, -0.006], abs=1e-7)
    assert result["residuals"] == pytest.approx({"position [m]": 0.0}, abs=1e-7)
    assert result["kkt"] < 1e-6
    model = StaticModel(scene, 0.035, result["angles"])
    assert result["torques"] == pytest.approx(model.state().efforts.tolist(), abs=1e-6)

    tilted = solve_once(scene, [0, 0, 0.006], tilt=(0.2, -0.1), goal=Goal.ORIENTATION, slide=0.035)
    assert (tilted["roll"], tilted["pitch"]) == pytest.approx((0.2, -0.1), abs=1e-5)

    box = (np.array([-0.1, -0.1, -0.1]), np.array([0.003, 0.1, 0.1]))
    bound = solve_once(scene, [0.01, 0, -0.006], slide=0.035, torque_max=0.17, box=box, hard=True)
    assert not bound["reached"]
    assert bound["active_limits"] == ["effector x"]
    assert bound["position"][0] == pytest.approx(0.003, abs=1e-7)


def test_a_goal_may_be_given_as_its_word_and_no_other_word():
    scene, target = load_scene(SHARP, COARSE), [0.004, -0.002, -0.006]
    result = solve_once(scene, target, goal="position", tilt=(0.2, 0.0), slide=0.035)
    assert list(result["residuals"]) == ["position [m]"]
    with raises_naming(IkError, "goal", "'positon'", "position, orientation, pose"):
        solve_once(scene, target, goal="positon", slide=0.035)


def test_an_answer_tells_the_error_of_its_mesh_where_that_is_asked_for():
    words = [*COARSE, "clamp.stiffness=1.4e10", "mesh_error={}"]
    result = solve_once(load_scene(SHARP, words), [0.004, -0.002, -0.006], slide=0.035)
    fine = load_scene(SHARP, ["clamp.stiffness=1.4e10", "mesh.element=h20", "mesh.level=8"])
    there = StaticModel(fine, 0.035, result["angles"]).simulation.state.centres[0] - result["position"]
    assert result["mesh_error"]["effector"] == pytest.approx(there.tolist(), abs=2e-5)
    assert result["mesh_error"]["distance"] > 1e-4
    row = dict(solution_rows(result))["error"]
    assert row == f"mesh {1e3 * result['mesh_error']['distance']:.2g} mm (estimated)"
    assert "mesh_error" not in solve_once(load_scene(SHARP, COARSE), [0.004, -0.002, -0.006], slide=0.035)


def test_without_a_start_the_model_begins_as_near_to_the_working_pose_as_the_servos_may_go():
    model = StaticModel(load_scene(SHARP, [*COARSE, "servos.angle_min=-1.2"]))
    np.testing.assert_allclose(model.simulation.state.joints, [-1.2, -1.2, -1.2, 0.035])


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"target": [0, np.nan, 0]}, ("target[1]", "nan")),
        ({"target": [0, 35, 0]}, ("target y", "35 m", "-0.2236 to 0.2236 m", "millimetres", "35mm")),
        ({"target": [0, 0, -0.3]}, ("target z", "-0.3 m", "-0.2319 to 0.2154 m")),
        ({"tilt": (0.1,)}, ("tilt", "(1,)")),
        ({"torque_max": -1.0}, ("torque_max", "-1.0 N m")),
        ({"start": [0, 0]}, ("start", "(2,)")),
        ({"start": [0, 0, 9.0]}, ("servo_2", "9 rad", "-2.1 to 0.6 rad")),
        ({"slide": 0.5}, ("slide", "0.5 m", "0 to 0.04 m")),
        ({"tolerance": 0.0}, ("tolerance", "0.0 m")),
    ],
)
def test_bad_questions_are_refused(values, named):
    given = {"target": [0, 0, 0], "slide": 0.035} | values
    with raises_naming(IkError, *named):
        solve_once(load_scene(SHARP, COARSE), given.pop("target"), **given)
