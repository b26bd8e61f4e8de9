"""Near a snap of the body: inverse kinematics stays on its branch, as near as it gets, and comes back.

The flat piece, servos at 0 and not slid in, snaps up where the effector is to go 8 mm towards a servo.
"""

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_ik.inverse import InverseSolver, Outcome
from tripod_ik.limits import AngleLimit
from tripod_ik.model import linear_state
from tripod_ik.snap_through import BARRIER, LEAST_MARGIN, SnapThroughLimit, firm_enough
from tripod_ik.tasks import PositionTask
from tripod_ik.tracker import Activity, Tracker
from tripod_ik.tracker_settings import TrackerSettings
from tripod_sim import Simulation, load_scene, stability_margin

DT = 0.02  # [s]


def towards(servo: int, radius: float) -> np.ndarray:
    angle = 2 * np.pi / 3 * servo
    return radius * np.array([np.cos(angle), np.sin(angle), 0.0])


def test_a_snap_is_near_for_whoever_runs_a_scene_where_a_branch_ends():
    assert stability_margin.NEAR == LEAST_MARGIN


@pytest.mark.parametrize("radius", [0.008, 0.01])
def test_an_unreachable_goal_is_neared_without_a_snap_and_left_again(flat, radius):
    home, tracker, ends = flat.state().equilibrium, Tracker(TrackerSettings()), []
    now = 0.0
    for servo in range(3):
        for goal, ticks in ((home + towards(servo, radius), 60), (home, 50)):
            tracker.aim(goal, None, now)
            for _ in range(ticks):
                before = flat.state()
                step = tracker.update(before, now)
                after = flat.move(step.result.command)
                turn = after.angles - before.angles
                foretold = 0.5 * (before.jacobian[:3] + after.jacobian[:3]) @ turn
                assert (
                    np.linalg.norm(after.equilibrium - before.equilibrium - foretold) < 2e-4
                )  # [m]: no snap
                assert after.stability_margin > 0.8 * LEAST_MARGIN
                now += DT
            if goal is not home:
                ends.append(after.angles[[servo, (servo + 1) % 3, (servo + 2) % 3]])
                assert step.activity is Activity.CLOSEST
                assert "snap" in step.result.active_limits
                assert np.linalg.norm(after.equilibrium - goal) < 1e-3
        assert np.linalg.norm(after.equilibrium - home) < 1e-5  # back within a second
    assert np.ptp(ends, axis=0).max() < 1e-3  # 0.02 mm of the effector


def test_commands_that_come_in_jumps_do_not_carry_the_body_over_a_snap():
    """As in the graph: 50 Hz, the servos as fast as they may. The body swings by 1.5 mm about where it would rest."""
    simulation = Simulation(load_scene(SHARP))
    home, tracker, dt = simulation.state.centres[0].copy(), Tracker(TrackerSettings()), simulation.scene.dt
    joints, off = simulation.state.joints.copy(), []
    for k, angle in enumerate((0.0, np.pi / 6)):  # out of reach, and within
        goal = home + 0.01 * np.array([np.cos(angle), np.sin(angle), 0.0])
        tracker.aim(goal, None, 1.2 * k)
        for step in range(round(1.2 / dt)):
            if step % round(DT / dt) == 0:
                state = linear_state(simulation.compliance())
                command = tracker.update(state, 1.2 * k + step * dt).result.command
            joints[:3] += np.clip(command - joints[:3], -4.0 * dt, 4.0 * dt)
            simulation.step(joints)
        off.append(np.linalg.norm(simulation.state.centres[0] - goal))
    assert 1e-4 < off[0] < 1e-3
    assert off[1] < 1e-5  # 6.4 mm off, beyond the snap, without a limit that knows of the swing


def test_the_more_a_body_swings_the_firmer_it_has_to_stay():
    assert firm_enough(0.0) == 0.0
    assert firm_enough(BARRIER) == pytest.approx(1.0)
    assert firm_enough(BARRIER / 8) == pytest.approx(1 / 4)


def test_a_moving_body_does_not_snap_either():
    simulation = Simulation(load_scene(SHARP))
    home, tracker, dt = simulation.state.centres[0].copy(), Tracker(TrackerSettings()), simulation.scene.dt
    last, slide = home, float(simulation.state.joints[3])
    for k in range(400):
        goal = home + towards(0, 0.01 if k < 200 else 0.0)
        tracker.aim(goal, None, k * dt)
        step = tracker.update(linear_state(simulation.compliance()), k * dt)
        simulation.step(np.append(step.result.command, slide))
        here = simulation.state.centres[0].copy()
        assert np.linalg.norm(here - last) / dt < 0.15  # [m/s]: a snap moves it at 0.23 to 0.5
        last = here
        if k == 199:
            assert np.linalg.norm(here - goal) < 1.05e-3
    assert np.linalg.norm(here - home) < 2e-5


def test_one_solution_is_near_the_snap_too_mirrored_for_mirrored_goals_and_takes_few_programs(flat):
    home, counts = flat.state().equilibrium, []
    solver = InverseSolver(flat, AngleLimit(-2.1, 0.6), progress=lambda count, _: counts.append(count))
    found = {}
    for name, (x, y) in {"towards": (0.01, 0.0), "left": (0.0086, 0.005), "right": (0.0086, -0.005)}.items():
        flat.go_home()
        counts.clear()
        solution = solver.solve([PositionTask(home + np.array([x, y, 0.0]))], everywhere=True)
        assert counts == list(range(1, solution.iterations + 1))
        assert solution.iterations < 150
        found[name] = solution
    assert found["towards"].outcome is Outcome.CLOSEST
    assert found["towards"].residual < 1e-3
    assert found["towards"].state.stability_margin > LEAST_MARGIN - 1e-4
    for name in ("left", "right"):
        assert found[name].outcome is Outcome.REACHED
    left, right = found["left"].state.angles, found["right"].state.angles
    assert left == pytest.approx(right[[0, 2, 1]], abs=1e-6)


def test_the_limit_grants_a_share_of_what_is_left(flat):
    flat.follow(np.array([-0.24, 0.12, 0.12]))
    state = flat.state()
    rows = SnapThroughLimit(share=0.25).rows(state)
    left = state.stability_margin**2 - LEAST_MARGIN**2
    assert rows.low == pytest.approx([-0.25 * left])
    assert rows.matrix[0] == pytest.approx(2 * state.stability_margin * state.stability_margin_slope)
    beyond = SnapThroughLimit(least=0.2, share=0.25).rows(state)
    assert beyond.low == pytest.approx([0.2**2 - state.stability_margin**2])  # all of it, where it is beyond
    flat.go_home()
