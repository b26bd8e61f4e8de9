from itertools import count, islice

import numpy as np
import pytest
from scipy.optimize import minimize

from tests.ik.plant import SpringRobot
from tests.messages import raises_naming
from tripod_ik import tracker as tracker_module
from tripod_ik import tracker_settings
from tripod_ik.certificate import kkt_residual
from tripod_ik.errors import IkError
from tripod_ik.limits import AngleLimit, StepLimit
from tripod_ik.problem import build_ik
from tripod_ik.rotation import normal_of
from tripod_ik.solver import IkSolver
from tripod_ik.tasks import PositionTask
from tripod_ik.tracker import LONGEST_DT, Activity, Tracker
from tripod_ik.tracker_settings import Goal, TrackerSettings

WORKING = np.full(3, -1.4965)
DT = 0.01  # [s]


TICKS = count()


def follow(robot, tracker, angles, steps, *, delay=0):
    """Close the loop: the robot is at the command of `delay` steps ago; return the steps and the errors at rest [m]."""
    commands, found = [np.array(angles)] * (delay + 1), []
    for tick in islice(TICKS, steps):
        step = tracker.update(robot.state(commands[-1 - delay]), tick * DT)
        assert step.result.ok
        assert step.result.kkt < 1e-6
        commands.append(step.result.command)
        found.append(step)
    errors = [float(np.linalg.norm(step.target - robot.rest(step.result.command))) for step in found]
    return found, errors


@pytest.mark.parametrize(
    "offset", [(0.001, 0.0, 0.0), (-0.002, 0.001, 0.003), (0.001, 0.002, -0.002), (0, 0, 0.006)]
)
def test_relinearised_steps_converge_to_the_target(offset):
    robot, angles = SpringRobot(slide=0.035), WORKING
    task, one = PositionTask(robot.rest(WORKING) + np.array(offset)), IkSolver(3)
    errors = [float(np.linalg.norm(offset))]
    while errors[-1] > 1e-6 and len(errors) < 60:
        result = one.solve(build_ik(robot.state(angles), [task], [AngleLimit(-2.1, 0.6), StepLimit(0.3)]))
        assert result.ok
        assert result.kkt < 1e-6
        angles = result.command
        errors.append(float(np.linalg.norm(task.target - robot.rest(angles))))
    assert errors[-1] < 1e-6
    assert (np.diff(errors) < 0).all()
    assert errors[-1] < 0.1 * errors[-2]  # faster than linear at the end


def test_tracking_a_moving_target_stays_close():
    robot, one = SpringRobot(slide=0.035), Tracker(TrackerSettings())
    centre, angles, errors = robot.rest(WORKING), WORKING, []
    for k in range(300):
        phase = 2 * np.pi * k / 300
        one.target = centre + 0.0015 * np.array([np.sin(phase), np.sin(2 * phase), np.cos(phase) - 1])
        step = one.update(robot.state(angles), k * DT)
        angles = step.result.command
        errors.append(np.linalg.norm(one.target - robot.rest(angles)))
        assert step.activity is Activity.TRACKING
    assert max(errors) < 2e-5  # [m]; the target moves 6e-5 m a step, the rest is of second order


def test_a_damped_step_towards_a_reachable_target_is_on_the_way():
    robot, one = (
        SpringRobot(slide=0.035),
        Tracker(TrackerSettings(angle_speed=300.0, effector_speed=np.inf, step=3.0)),
    )
    one.target = robot.rest(WORKING) + np.array([0.0, 0.0, 0.008])
    steps, errors = follow(robot, one, WORKING, 25)
    assert steps[1].result.residual > 1e-3
    assert steps[1].result.active_limits == ()
    assert {s.activity for s in steps} == {Activity.TRACKING}
    assert errors[-1] < 1e-6


def test_the_first_command_is_the_present_pose_and_without_target_nothing_moves():
    robot, one = SpringRobot(slide=0.035), Tracker(TrackerSettings(torque_max=0.005))
    angles = np.array([-1.3, -1.5, -1.7])
    one.target = np.array([0.02, 0.0, 0.0])
    first = one.update(robot.state(angles), 100.0)
    assert first.result.command.tolist() == angles.tolist()
    assert first.activity is Activity.TRACKING
    one.start()
    one.target = None
    steps, errors = follow(robot, one, angles, 30)
    assert max(np.abs(s.result.command - angles).max() for s in steps) < 1e-9
    assert max(errors) < 1e-9
    assert steps[-1].activity is Activity.TRACKING


def test_the_pose_that_is_kept_is_that_of_rest():
    """A robot that swings about its equilibrium is not asked to stay where it was at one instant of it."""
    robot, one = SpringRobot(slide=0.035), Tracker(TrackerSettings())
    rest = robot.rest(WORKING)
    for k in range(40):
        swing = 1e-3 * np.sin(0.7 * k + 1) * np.array([0.3, -0.2, 1.0])
        step = one.update(robot.state(WORKING, rest + swing), k * DT)
        assert np.abs(step.result.command - WORKING).max() < 5e-3  # 1 mm would be 0.18 rad
        assert step.error == pytest.approx(np.linalg.norm(step.target - rest - swing))


def test_commands_keep_to_the_speed_by_the_time_between_them():
    robot, one = SpringRobot(slide=0.035), Tracker(TrackerSettings(angle_speed=1.0))
    state = robot.state(WORKING)
    one.target = state.equilibrium + np.array([0.0, 0.0, 0.03])
    commands = [one.update(state, t).result.command for t in (5.0, 5.01, 5.03, 5.03, 5.02, 5.04, 6.0)]
    moved = np.abs(np.diff(commands, axis=0)).max(axis=1)
    assert moved == pytest.approx(
        [0.01, 0.02, 0.0, 0.0, 0.01, LONGEST_DT]
    )  # a clock that steps back moves nothing


def test_commands_wait_for_a_robot_that_does_not_follow():
    robot, one = SpringRobot(slide=0.035), Tracker(TrackerSettings(step=0.2))
    state = robot.state(WORKING)
    one.target = state.equilibrium + np.array([0.0, 0.0, 0.03])
    for k in range(60):
        step = one.update(state, k * DT)
    assert np.abs(step.result.command - WORKING).max() == pytest.approx(0.2)
    assert "servo_0 step" in step.result.active_limits


def closest_error(robot, target, settings):
    """Return the distance of the closest pose [m], by a general-purpose optimiser from several starts."""
    bounds = [(settings.angle_min, settings.angle_max)] * 3
    starts = np.random.default_rng(2).uniform(-2.1, -0.6, (6, 3))
    found = [
        minimize(
            lambda a: np.sum((robot.rest(a) - target) ** 2) * 1e4, s, bounds=bounds, options={"ftol": 1e-14}
        )
        for s in starts
    ]
    return min(np.linalg.norm(robot.rest(f.x) - target) for f in found)


@pytest.mark.parametrize("delay", [0, 4])
@pytest.mark.parametrize(
    ("direction", "limits"),
    [
        ((0.0, 0.0, 1.0), (-2.1, 0.6)),
        ((0.0, 0.0, -1.0), (-1.8, 0.6)),  # at -1.887 its arms do not move the effector sideways: a fold
        ((1.0, 0.3, 0.2), (-2.1, 0.6)),
        (
            (0.2, -0.9, 0.5),
            (-3.1, 3.1),
        ),  # no angle limit holds it: the folds of the map itself are the boundary
    ],
)
def test_an_unreachable_target_gives_the_closest_pose_without_jitter(direction, limits, delay):
    robot = SpringRobot(slide=0.035)
    settings = TrackerSettings(angle_min=limits[0], angle_max=limits[1])
    one = Tracker(settings)
    target = robot.rest(WORKING) + 0.1 * np.array(direction) / np.linalg.norm(direction)
    one.target = target
    steps, errors = follow(robot, one, WORKING, 350, delay=delay)
    assert steps[5].activity is Activity.TRACKING  # on the way
    assert steps[-1].activity is Activity.CLOSEST
    assert steps[-1].result.residual > 0.02
    best = closest_error(robot, target, settings)
    assert errors[-1] == pytest.approx(best, abs=2e-5)
    rest = np.array([s.result.command for s in steps[-50:]])
    assert np.abs(np.diff(rest, axis=0)).max() < 1e-4


@pytest.mark.parametrize("guarded", [False, True])
def test_without_damping_the_same_target_makes_the_command_jump_until_folds_are_kept_off(
    monkeypatch, guarded
):
    """What the damping is for, and what the look at folds: without both, nothing holds the command."""
    if not guarded:
        monkeypatch.setattr(tracker_module, "branch", lambda state, tasks: 0.0)
    monkeypatch.setattr(tracker_settings, "PositionTask", lambda t, w: PositionTask(t, w, curvature=0.0))
    robot = SpringRobot(slide=0.035)
    one = Tracker(TrackerSettings(angle_min=-3.1, angle_max=3.1))
    direction = np.array([0.2, -0.9, 0.5])
    one.target = robot.rest(WORKING) + 0.1 * direction / np.linalg.norm(direction)
    steps, _ = follow(robot, one, WORKING, 350)
    moves = np.abs(np.diff([s.result.command for s in steps[-50:]], axis=0)).max()
    if guarded:
        assert moves < 1e-4
        assert steps[-1].activity is Activity.CLOSEST
        assert any("branch" in s.result.active_limits for s in steps[-3:])
    else:
        assert moves > 1e-2


def test_a_jump_of_100_mm_and_back_ends_where_it_began():
    robot, one = SpringRobot(slide=0.035), Tracker(TrackerSettings())
    home = robot.rest(WORKING)
    one.target = home + np.array([0.1, 0.0, 0.0])
    steps, _ = follow(robot, one, WORKING, 60)
    moved = np.abs(np.diff([s.result.command for s in steps], axis=0))
    assert moved.max() <= 3.0 * DT + 1e-12
    assert moved.max() > 0.02
    one.target = home
    _, errors = follow(robot, one, steps[-1].result.command, 200)
    assert errors[-1] < 1e-6


@pytest.mark.parametrize("rate", [20, 100, 500])
def test_the_dynamics_of_the_body_are_not_in_the_loop(rate):
    """A body of 38 Hz that hardly damps, its angles 20 ms behind the command: stable at any rate."""
    robot, one = SpringRobot(slide=0.035), Tracker(TrackerSettings())
    p, v, h = robot.rest(WORKING), np.zeros(3), 5e-4  # [m], [m/s], [s]
    natural = 2 * np.pi * 38
    one.target = p + np.array([0.002, -0.001, 0.002])
    commands, every = [(0.0, WORKING)], round(1 / (rate * h))
    for k in range(round(1.5 / h)):
        now = k * h
        angles = next(c for t, c in reversed(commands) if t <= max(0.0, now - 0.02))
        v += h * (natural**2 * (robot.rest(angles) - p) - 2 * 0.02 * natural * v)
        p = p + h * v
        if k % every == 0:
            step = one.update(robot.state(angles, p), now)
            commands.append((now, step.result.command))
    late = np.array([c for _, c in commands[-5:]])
    assert np.abs(late - late[-1]).max() < 1e-6
    assert np.linalg.norm(robot.rest(late[-1]) - one.target) < 1e-6


def test_torque_is_held_at_its_limit():
    robot = SpringRobot(slide=0.035)
    free, bound = Tracker(TrackerSettings(torque_max=np.inf)), Tracker(TrackerSettings(torque_max=0.018))
    target = robot.rest(WORKING) + np.array([0.0, 0.0, 0.006])
    free.target = bound.target = target
    torques = {}
    for name, one in (("free", free), ("bound", bound)):
        steps, errors = follow(robot, one, WORKING, 150)
        torques[name] = np.abs(robot.state(steps[-1].result.command).efforts)
        if name == "free":
            assert errors[-1] < 1e-6
            assert steps[-1].result.active_limits == ()
        else:
            assert steps[-1].activity is Activity.CLOSEST
            assert set(steps[-1].result.active_limits) == {
                "servo_0 torque",
                "servo_1 torque",
                "servo_2 torque",
            }
    assert torques["free"].min() > 0.0185
    assert torques["bound"] == pytest.approx([0.018] * 3, abs=2e-5)


@pytest.mark.parametrize(
    ("goal", "tilted"), [(Goal.ORIENTATION, True), (Goal.POSE, True), (Goal.POSITION, False)]
)
def test_what_is_missing_of_the_tilt_is_told_apart(goal, tilted):
    robot, one = SpringRobot(slide=0.035), Tracker(TrackerSettings(goal=goal, lever=0.01))
    one.aim(robot.rest(WORKING), normal_of(0.03, -0.04), 0.0)
    first, second = (one.update(robot.state(WORKING), now) for now in (0.0, 0.1))
    angle = np.arccos(normal_of(0.03, -0.04)[2]) if tilted else 0.0
    assert first.tilt_error == second.tilt_error == pytest.approx(angle, abs=1e-9)
    assert first.error == pytest.approx(0.01 * angle, abs=1e-9)
    assert first.tilt_residual == pytest.approx(angle, abs=1e-9)  # no time to move yet
    assert second.tilt_residual < 0.95 * angle if tilted else second.tilt_residual == 0


def test_a_hard_torque_limit_is_kept_exactly_where_a_soft_one_is_passed_a_little():
    robot, least = SpringRobot(slide=0.035), {}
    for hard in (False, True):
        one = Tracker(TrackerSettings(torque_max=0.018, hard=hard))
        one.target = robot.rest(WORKING) + np.array([0, 0, 0.03])
        steps, _ = follow(robot, one, WORKING, 200)
        least[hard] = np.abs(robot.state(steps[-1].result.command).efforts).max() - 0.018
    assert least[False] > 1e-7
    assert abs(least[True]) < 1e-9


def test_the_effector_stays_in_its_box():
    robot = SpringRobot(slide=0.035)
    home, wide = robot.rest(WORKING), np.full(3, 0.1)
    for hard, bound in ((True, 1e-9), (False, 1e-5)):
        high = home + np.array([0.002, 0.1, 0.1])
        one = Tracker(TrackerSettings(box=(tuple(home - wide), tuple(high)), hard=hard))
        one.target = home + np.array([0.004, 0.001, 0.0])
        steps, _ = follow(robot, one, WORKING, 200)
        end = robot.rest(steps[-1].result.command)
        assert end == pytest.approx(home + np.array([0.002, 0.001, 0.0]), abs=bound)
        assert steps[-1].activity is Activity.CLOSEST
        assert steps[-1].result.active_limits == ("effector x",)
        assert max(robot.rest(s.result.command)[0] for s in steps) < home[0] + 0.002 + 1e-5


def test_an_effector_found_outside_of_its_box_is_not_brought_in_and_once_inside_stays_there():
    robot = SpringRobot(slide=0.035)
    home, wide = robot.rest(WORKING), np.full(3, 0.1)
    for hard in (True, False):
        box = (tuple(home - wide), tuple(home + np.array([-0.001, 0.1, 0.1])))
        one = Tracker(TrackerSettings(box=box, hard=hard))
        steps, _ = follow(robot, one, WORKING, 20)
        assert steps[-1].result.command == pytest.approx(WORKING, abs=1e-9)  # beginning moves nothing
        for x, expected in ((0.002, 0.0), (-0.002, -0.002), (0.002, -0.001)):
            one.target = home + np.array([x, 0.0, 0.0])
            steps, _ = follow(robot, one, steps[-1].result.command, 200)
            assert robot.rest(steps[-1].result.command)[0] - home[0] == pytest.approx(expected, abs=1e-5)


def test_a_torque_found_above_the_limit_may_not_grow_and_once_below_not_come_back():
    robot, one = SpringRobot(slide=0.035), Tracker(TrackerSettings(torque_max=0.018))
    angles = np.full(3, -1.3)
    found, rest = np.abs(robot.state(angles).efforts), robot.rest(angles)
    assert found.min() > 0.021
    for lift, expected in ((0.004, found), (-0.006, None), (0.004, np.full(3, 0.018))):
        one.target = rest + np.array([0.0, 0.0, lift])
        steps, _ = follow(robot, one, angles, 150)
        angles = steps[-1].result.command
        torques = np.abs(robot.state(angles).efforts)
        if expected is None:
            assert torques.max() < 0.018
        else:
            assert torques == pytest.approx(expected, abs=2e-5)


def test_an_axis_of_weight_zero_is_free_and_does_not_drift():
    robot, one = SpringRobot(slide=0.035), Tracker(TrackerSettings(weights=(1.0, 1.0, 0.0)))
    one.target = robot.rest(WORKING) + np.array([0.002, 0.001, 0.05])
    steps, _ = follow(robot, one, WORKING, 200)
    reached = robot.rest(steps[-1].result.command)
    assert reached[:2] == pytest.approx(one.target[:2], abs=1e-6)
    assert steps[-1].result.residual < 1e-6
    assert steps[-1].activity is Activity.TRACKING
    commands = np.array([s.result.command for s in steps[-50:]])
    assert np.abs(commands - commands[-1]).max() < 1e-6


def test_a_solver_that_fails_holds_and_recovers(monkeypatch):
    robot, one = SpringRobot(slide=0.035), Tracker(TrackerSettings())
    one.target = robot.rest(WORKING) + np.array([0.003, 0.0, 0.0])
    state = robot.state(WORKING)
    before = [one.update(state, t) for t in (0.0, 0.01)][-1]
    with monkeypatch.context() as patch:
        patch.setattr(
            "tripod_ik.solver.polish",
            lambda problem, x, y, *_: (x * np.nan, y, kkt_residual(problem, x * np.nan, y)),
        )
        patch.setattr("tripod_ik.solver.solve_exactly", lambda problem: (problem.q, problem.l, np.inf))
        failed = one.update(state, 0.02)
    assert failed.activity is Activity.SOLVER_FAILED
    assert failed.result.kkt == np.inf
    assert failed.result.command == pytest.approx(before.result.command, abs=1e-15)
    after = one.update(state, 0.03)
    assert after.activity is Activity.TRACKING
    assert np.abs(after.result.command - before.result.command).max() > 1e-3


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"angle_min": 1.0}, ("low 1.0 rad", "high 0.6 rad")),
        ({"angle_speed": 0.0}, ("speed limit", "0.0 rad/s")),
        ({"step": -1.0}, ("step limit", "-1.0 rad")),
        ({"box": ((0.0, 0.0, 0.0), (0.1, 0.0, 0.1))}, ("effector box", "low [0.0, 0.0, 0.0] m", "high")),
        ({"torque_max": 0.0}, ("torque_max", "0.0 N m")),
        ({"torque_max": float("nan")}, ("torque_max", "nan N m")),
        ({"weights": (0.0, 0.0, 0.0)}, ("weights", "[0.0, 0.0, 0.0]")),
        ({"tolerance": 0.0}, ("tolerance", "0.0 m")),
    ],
)
def test_bad_settings_are_refused(changes, named):
    with raises_naming(IkError, *named):
        TrackerSettings(**changes)


def test_a_target_that_is_no_position_is_refused_and_the_old_one_stays():
    one = Tracker(TrackerSettings())
    one.target = np.array([0.0, 0.0, 0.01])
    with raises_naming(IkError, "target[1]", "nan"):
        one.target = np.array([0.0, np.nan, 0.0])
    assert one.target.tolist() == [0.0, 0.0, 0.01]
