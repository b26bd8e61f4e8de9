"""Tasks on the quasi-static Tripod: their Jacobians are the slopes of their errors, and they add up as told."""

from dataclasses import replace

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.scenes import SHARP
from tripod_host.rotations import rotation_matrix
from tripod_ik.errors import IkError
from tripod_ik.inverse import InverseSolver, Outcome
from tripod_ik.limits import AngleLimit
from tripod_ik.model import StaticModel
from tripod_ik.problem import REGULARISATION, build_ik
from tripod_ik.rotation import (
    normal_of,
    roll_pitch,
    tilt_between,
    unit_quaternion,
)
from tripod_ik.tasks import PositionTask, PostureTask, TiltTask, orientation_tasks, total_distance
from tripod_sim import load_scene

OFF = np.array([-1.3, -1.55, -1.7])


@pytest.fixture(scope="module")
def model():
    return StaticModel(load_scene(SHARP, ["mesh.level=1"]))


@pytest.fixture
def home(model):
    saved = model.save()
    yield model
    model.restore(saved)


@pytest.mark.parametrize(
    "task",
    [
        PositionTask([0.002, 0.001, -0.006]),
        TiltTask(normal_of(0.25, -0.2)),
        PostureTask([-1.4, -1.4, -1.6]),
    ],
)
def test_the_jacobian_is_minus_the_slope_of_the_error_where_it_is_zero(home, task):
    """Away from zero the tilt's slope differs by the curvature of the sphere; its square's slope is exact (below)."""
    if isinstance(task, TiltTask):
        task = TiltTask(home.move(OFF).equilibrium_rotation[:, 2])
    state, h = home.move(OFF), 1e-4
    rows = task.rows(state)
    for i, step in enumerate(h * np.eye(3)):
        slope = (task.rows(home.move(OFF + step)).error - task.rows(home.move(OFF - step)).error) / (2 * h)
        assert np.abs(slope).max() > 1e-3
        assert rows.jacobian[:, i] == pytest.approx(-slope, abs=2e-5 * np.abs(rows.jacobian).max())


def test_the_gradient_of_half_the_squared_tilt_is_exact_however_large_the_tilt(home):
    task, h = TiltTask(normal_of(0.9, -1.4)), 1e-4
    rows = task.rows(home.move(OFF))
    assert np.linalg.norm(rows.error) > 1.2
    for i, step in enumerate(h * np.eye(3)):
        ends = [np.sum(task.rows(home.move(OFF + s * step)).error ** 2) / 2 for s in (1, -1)]
        assert -(rows.jacobian.T @ rows.error)[i] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-5)


def test_yaw_of_the_target_does_not_matter_and_of_the_effector_is_left_as_it_is(home):
    state = home.move(OFF)
    turned = rotation_matrix(np.array([0, 0, 1.0])) @ normal_of(0.2, 0.1)  # about z: another tilt
    assert not np.allclose(turned, normal_of(0.2, 0.1))
    R = rotation_matrix(np.array([0.1, -0.2, 0.05]))
    about_itself = rotation_matrix(0.7 * R[:, 2]) @ R
    a, b = (TiltTask(M[:, 2]).rows(state).error for M in (R, about_itself))
    assert a == pytest.approx(b, abs=1e-12)


def test_roll_pitch_and_height_are_reached_together(home):
    task = orientation_tasks(normal_of(0.15, -0.1), -0.006)
    solution = InverseSolver(home, AngleLimit(-2.1, 0.6)).solve(task)
    assert solution.outcome is Outcome.REACHED
    assert roll_pitch(solution.state.equilibrium_rotation[:, 2]) == pytest.approx((0.15, -0.1), abs=1e-6)
    assert solution.state.equilibrium[2] == pytest.approx(-0.006, abs=1e-8)
    assert set(solution.residuals) == {"tilt [rad]", "height [m]"}


def test_tilt_and_position_together_are_a_compromise_that_the_lever_sets(home):
    """Five rows, three angles: what is gained in tilt is lost in position."""
    saved, target, found = home.save(), home.state().equilibrium + np.array([0.004, 0, 0]), []
    for lever in (1e-4, 0.0075, 1.0):
        home.restore(saved)
        tasks = [PositionTask(target), TiltTask([0, 0, 1.0], lever=lever)]
        residuals = InverseSolver(home, AngleLimit(-2.1, 0.6)).solve(tasks).residuals
        found.append((residuals["position [m]"], residuals["tilt [rad]"]))
    position, tilt = np.array(found).T
    assert (np.diff(position) > 1e-5).all()
    assert (np.diff(tilt) < -1e-4).all()
    assert position[0] < 1e-5
    assert tilt[2] < 1e-3


def test_posture_chooses_where_the_task_leaves_a_choice(home):
    """Height alone leaves two of three angles free: the posture takes them, and the height stays."""
    saved = home.save()
    height = PositionTask([0, 0, -0.009], [0, 0, 1.0])
    plain = InverseSolver(home, AngleLimit(-2.1, 0.6)).solve([height]).state.angles
    home.restore(saved)
    wanted = np.array([-1.35, -1.55, -1.65])
    solution = InverseSolver(home, AngleLimit(-2.1, 0.6)).solve([height, PostureTask(wanted)])
    assert np.ptp(plain) < 1e-6  # from a symmetric pose the least change is symmetric
    assert np.abs(solution.state.angles - wanted).max() < 0.1
    assert np.ptp(solution.state.angles) > 0.2
    assert solution.state.equilibrium[2] == pytest.approx(-0.009, abs=2e-5)


@pytest.mark.parametrize("slope", [[0.0, 0.0, 0.0], [0.5, -0.3, 0.8]])
def test_the_program_has_the_cost_that_is_told(home, slope):
    state = replace(home.state(), stability_margin=0.3, stability_margin_slope=np.array(slope))
    tasks = [PositionTask([0.004, 0, -0.006], [1.0, 0.5, 0.0]), TiltTask([0.1, 0.2, 1.0])]
    problem = build_ik(state, tasks)
    rows = [task.rows(state) for task in tasks]
    SJ = np.concatenate([r.weights[:, None] * r.jacobian for r in rows])
    Se = np.concatenate([r.weights * r.error for r in rows])
    mu = sum(r.curvature * np.linalg.norm(r.weights**2 * r.error) for r in rows)
    sigma = np.sum(SJ**2) / 3 + mu
    steep = float(np.linalg.norm(slope)) or 1.0
    along = np.array(slope) / steep
    grows = abs(Se @ SJ @ along) * steep / 0.3
    for step in np.random.default_rng(1).normal(size=(5, 3)):
        cost = np.sum((SJ @ step - Se) ** 2) - Se @ Se + mu * step @ step + grows * (along @ step) ** 2
        told = cost / (2 * sigma) + REGULARISATION / 2 * step @ step
        assert 0.5 * step @ problem.P @ step + problem.q @ step == pytest.approx(told, rel=1e-12)


def test_distances_add_up_in_metres(home):
    tasks = [*orientation_tasks([0, 0, 1.0], 0.0, lever=0.02), PostureTask([0, 0, 0])]
    errors = [np.array([0.3, 0.4]), np.array([9.0, 9.0, 0.01]), np.ones(3)]
    assert total_distance(tasks, errors) == pytest.approx(np.hypot(0.5 * 0.02, 0.01))


def test_without_a_task_there_is_no_problem(home):
    with raises_naming(IkError, "no task"):
        build_ik(home.state(), [])


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: TiltTask([0, 0, 0]), ("normal", "[0.0, 0.0, 0.0]", "direction")),
        (lambda: TiltTask([0, np.nan, 1]), ("normal[1]", "nan")),
        (lambda: TiltTask([0, 0, 1], lever=0.0), ("lever", "0.0 m")),
        (lambda: TiltTask([0, 0, 1], curvature=-1.0), ("curvature", "-1.0 rad/rad²")),
        (lambda: PostureTask([0, 0, 0], weight=np.inf), ("weight", "posture", "inf")),
        (lambda: PostureTask([0, np.inf, 0]), ("posture[1]", "inf")),
        (lambda: unit_quaternion("orientation", np.array([0, 0, 0, 2.0])), ("orientation", "length 2")),
    ],
)
def test_bad_tasks_are_refused(make, named):
    with raises_naming(IkError, *named):
        make()


def test_rotations_agree_with_each_other():
    rng = np.random.default_rng(4)
    for _ in range(20):
        roll, pitch = rng.uniform(-1.4, 1.4, 2)
        assert roll_pitch(normal_of(roll, pitch)) == pytest.approx((roll, pitch))
        start, end = (v / np.linalg.norm(v) for v in rng.standard_normal((2, 3)))
        assert rotation_matrix(tilt_between(start, end)) @ start == pytest.approx(end)
    assert rotation_matrix(tilt_between(start, -start)) @ start == pytest.approx(-start)
    assert not tilt_between(start, start).any()
    roll_first = rotation_matrix([0, 0.3, 0]) @ rotation_matrix([0.2, 0, 0])
    assert normal_of(0.2, 0.3) == pytest.approx(roll_first[:, 2])
