"""Commands that do not make a body swing: later by half the mean's time, on the same way, never faster."""

import numpy as np
import pytest

from tests.ik.plant import SpringRobot
from tripod_ik.model import linear_state
from tripod_ik.smoothing import Smoothing
from tripod_ik.tracker import SMOOTH, Tracker
from tripod_ik.tracker_settings import TrackerSettings
from tripod_sim import Simulation, load_scene

DT, OVER, SPEED = 0.01, 0.1, 3.0


def sent(wanted, over=OVER, smoothing=None, begin=0.0):
    smoothing = smoothing or Smoothing()
    return np.array([smoothing.command(c, begin + k * DT, over, SPEED) for k, c in enumerate(wanted)])


def test_a_jump_of_speed_becomes_an_even_acceleration_and_a_constant_speed_half_the_time_late():
    times = np.arange(0.0, 0.5, DT)
    wanted = np.column_stack([2.0 * times, -times])
    out = sent(wanted)
    speeds = np.diff(out[:, 0]) / DT
    assert np.diff(speeds[:9]) == pytest.approx(2.0 * DT / OVER, abs=1e-9)
    assert speeds[10:] == pytest.approx(2.0, abs=1e-9)
    late = wanted[20:, 0] - out[20:, 0]
    assert late == pytest.approx(2.0 * (OVER - DT) / 2, abs=1e-9)
    assert out[:, 1] == pytest.approx(-out[:, 0] / 2, abs=1e-12)
    assert sent([wanted[-1]] * 20)[-1] == pytest.approx(wanted[-1], abs=0)


def test_it_goes_round_corners_as_the_wanted_commands_do_and_is_there_in_the_time_of_the_mean():
    there = np.array([[0.02 * k, 0.0] for k in range(8)])
    wanted = np.vstack([there, *[there[-1] + [0.0, 0.03 * k] for k in range(1, 8)], *[[0.14, 0.21]] * 10])
    out = sent(wanted)
    on_the_way = np.minimum(np.abs(out[:, 1]), np.abs(out[:, 0] - 0.14))
    assert on_the_way.max() < 1e-12
    assert np.linalg.norm(out - [0.14, 0.0], axis=1).min() < 0.03
    assert out[14 + 9] == pytest.approx([0.14, 0.21], abs=1e-12)
    assert (np.diff(out, axis=0) >= 0).all()


def test_without_time_it_catches_up_no_faster_than_servos_go_and_then_sends_what_is_wanted():
    smoothing = Smoothing()
    wanted = np.array([[2.5 * k * DT] for k in range(60)])
    sent(wanted[:30], smoothing=smoothing)
    out = np.array([smoothing.command(c, (30 + k) * DT, 0.0, SPEED) for k, c in enumerate(wanted[30:])])
    assert np.diff(out[:, 0]).max() <= SPEED * DT + 1e-12
    assert out[-1] == pytest.approx(wanted[-1], abs=1e-12)
    assert out[0, 0] < wanted[30, 0] - 0.05  # not at once


def test_a_way_that_is_cut_is_not_gone_to_its_end():
    smoothing = Smoothing()
    assert smoothing.cut() is None
    out = sent(np.array([[0.03 * k] for k in range(10)]), smoothing=smoothing)
    assert smoothing.cut() == pytest.approx(out[-1])
    back = sent([out[-1] - 0.01 * k for k in range(1, 30)], smoothing=smoothing, begin=10 * DT)
    assert (np.diff(back[:, 0]) < 0).all()
    assert back[0, 0] < out[-1, 0]


def test_a_tracker_smooths_the_way_to_a_target_that_stands_still_and_leads_one_that_moves_by_a_period():
    def late(goals, smooth, ahead=0):
        robot, one, now = SpringRobot(slide=0.035), Tracker(TrackerSettings(), smooth=smooth), 0.0
        angles = np.full(3, -1.4965)
        home, off = robot.rest(angles), []
        for k, goal in enumerate(goals):
            one.aim(home + goal, None, now)
            angles = one.update(robot.state(angles), now).result.command
            now += 0.02
            off.append(np.linalg.norm(robot.rest(angles) - home - goals[min(k + ahead, len(goals) - 1)]))
        return np.array(off)

    still = [np.array([0.002, 0.0, 0.0])] * 40
    at_once, smooth = late(still, 0.0), late(still, SMOOTH)
    assert at_once[9] < 1e-5
    assert 2e-4 < smooth[9] < 1.5e-3
    assert smooth[-1] < 1e-5
    moving = [np.array([0.002 * np.sin(0.1 * k), 0.0, 0.0]) for k in range(80)]
    assert late(moving, 0.0)[30:-1].max() < 1e-4
    assert late(moving, SMOOTH, ahead=1)[30:-1].max() < 1e-4
    assert late(moving, SMOOTH)[30:-1].max() > 1.5e-4


def test_a_body_that_hardly_damps_its_swings_hardly_begins_to():
    """A step of 5 mm at 50 Hz by the trapezoidal rule: the effector swings less than half as far."""

    def swing(smooth):
        simulation = Simulation(load_scene("tripod", ["inertia.scheme=tr_bdf2", "dt=0.002"]))
        home, joints, farthest = simulation.state.centres[0].copy(), simulation.state.joints.copy(), 0.0
        tracker = Tracker(TrackerSettings(), smooth=smooth)
        tracker.aim(home + np.array([0.0, 0.004, -0.002]), None, 0.0)
        for step in range(300):
            if step % 10 == 0:
                state = linear_state(simulation.compliance())
                farthest = max(farthest, float(np.linalg.norm(state.equilibrium_offset[:3])))
                command = tracker.update(state, 0.002 * step).result.command
            joints[:3] += (command - joints[:3]) / (10 - step % 10)
            simulation.step(joints)
        assert np.linalg.norm(state.equilibrium - tracker.target) < 1e-5
        return farthest

    assert swing(SMOOTH) < 0.5 * swing(0.0)
