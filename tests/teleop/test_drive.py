"""Set-points from keys: silence means stop, limits hold, motions arrive in proportion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tripod_graph.command import CommandLimits
from tripod_graph.names import WORKING_POSE
from tripod_teleop.drive import LONGEST_STEP, PEAK, Drive, smooth
from tripod_teleop.keys import Move

LIMITS = CommandLimits()
SPEED, HOLD, POSE_TIME, PERIOD = 0.5, 0.2, 3.0, 0.05


def drive_at(*joints: float) -> Drive:
    drive = Drive(LIMITS, speed=SPEED, hold=HOLD, pose_time=POSE_TIME)
    drive.start(joints)
    return drive


def run(
    drive: Drive, end: float, presses: dict[float, Move] | None = None, *, period: float = PERIOD
) -> np.ndarray:
    """Return the set-points at every period from 0 to `end` [s]; a press comes just before its set-point."""
    waiting = sorted((presses or {}).items())
    points = []
    for now in np.arange(0.0, end + 1e-9, period):
        while waiting and waiting[0][0] <= now:
            at, move = waiting.pop(0)
            drive.press(move, at)
        points.append(drive.setpoint(now))
    return np.array(points)


@pytest.mark.parametrize(("servo", "sign"), [(s, d) for s in range(3) for d in (1, -1)])
def test_one_press_moves_one_servo_by_speed_times_hold(servo: int, sign: int) -> None:
    points = run(drive_at(-0.5, -0.6, -0.7, 0.01), 1.0, {0.11: Move(servo, sign)})
    expected = np.array([-0.5, -0.6, -0.7, 0.01])
    assert points[0] == pytest.approx(expected)
    expected[servo] += sign * SPEED * HOLD
    assert points[-1] == pytest.approx(expected, abs=1e-12)
    assert np.abs(np.diff(points[:, servo])).max() <= SPEED * PERIOD + 1e-12


def test_a_key_held_down_moves_steadily_and_silence_stops_it() -> None:
    repeats = {0.5 + 0.04 * i: Move(0, -1) for i in range(26)}  # repeats from 0.5 s to 1.5 s
    points = run(drive_at(0, 0, 0), 3.0, {0.0: Move(0, -1), **repeats})
    end = -SPEED * (HOLD + 1.0 + HOLD)
    assert points[-1][0] == pytest.approx(end, abs=1e-9)
    steps = np.diff(points[:, 0])
    assert steps[11:30] == pytest.approx(-SPEED * PERIOD)
    assert steps[36:] == pytest.approx(0.0)


def test_the_other_direction_wins_at_once() -> None:
    points = run(drive_at(0, 0, 0), 1.0, {0.0: Move(1, 1), 0.1: Move(1, -1)})
    assert points[2:6, 1] == pytest.approx([0.05, 0.025, 0.0, -0.025])
    assert points[-1][1] == pytest.approx(0.05 - SPEED * HOLD)


def test_two_servos_move_at_once() -> None:
    points = run(drive_at(0, 0, 0), 1.0, {0.0: Move(0, 1), 0.05: Move(2, -1)})
    assert points[-1] == pytest.approx([0.1, 0.0, -0.1])


def test_it_tells_which_key_counts() -> None:
    drive = drive_at(0, 0, 0)
    drive.press(Move(0, 1), 1.0)
    assert drive.is_pressed(Move(0, 1), 1.0 + 0.9 * HOLD)
    assert not drive.is_pressed(Move(0, 1), 1.0 + 1.1 * HOLD)
    assert not drive.is_pressed(Move(0, -1), 1.0)
    assert not drive.is_pressed(Move(1, 1), 1.0)


def test_a_caller_that_stalls_does_not_jump() -> None:
    drive = Drive(LIMITS, speed=SPEED, hold=1.0, pose_time=POSE_TIME)
    drive.start((0.0, 0.0, 0.0))
    drive.press(Move(0, 1), 0.0)
    assert drive.setpoint(0.05)[0] == pytest.approx(SPEED * 0.05)
    assert drive.setpoint(0.95)[0] == pytest.approx(SPEED * (0.05 + LONGEST_STEP))


@given(
    start=st.tuples(*[st.floats(-2.1, 0.6)] * 3, st.floats(0.0, 0.04)),
    presses=st.lists(st.tuples(st.floats(0, 20), st.integers(0, 2), st.sampled_from([1, -1])), max_size=200),
    slide=st.booleans(),
)
def test_set_points_stay_within_limits_and_speed(start, presses, slide: bool) -> None:
    drive = drive_at(*(start if slide else start[:3]))
    points = run(drive, 20.0, {t: Move(s, d) for t, s, d in presses})
    assert points.shape[1] == (4 if slide else 3)
    assert LIMITS.inside(points if slide else np.c_[points, np.zeros(len(points))]).all()
    assert np.abs(np.diff(points[:, :3], axis=0)).max() <= SPEED * PERIOD + 1e-9


def test_a_start_outside_the_limits_begins_at_the_limit() -> None:
    assert drive_at(-2.2, 0.7, 0.0, 0.05).setpoint(0.0) == pytest.approx([-2.1, 0.6, 0.0, 0.04])


# motions to a pose -----------------------------------------------------------------------------------------


def test_the_working_pose_is_reached_in_proportion_in_its_time() -> None:
    start = np.array([0.0, -0.5, 0.3, 0.01])
    drive = drive_at(*start)
    drive.go("working pose", WORKING_POSE, 0.0)
    points = run(drive, POSE_TIME + 1.0)
    arrived = round(POSE_TIME / PERIOD)
    assert points[arrived:] == pytest.approx(np.tile(WORKING_POSE, (len(points) - arrived, 1)))
    done = (points - start) / (np.array(WORKING_POSE) - start)
    assert np.ptp(done, axis=1).max() < 1e-9
    assert (np.diff(done[:, 0]) >= -1e-12).all()
    assert done[arrived // 2, 0] == pytest.approx(0.5)
    assert drive.motion == ""


def test_a_motion_slower_than_its_time_when_the_servos_could_not_follow() -> None:
    limits = CommandLimits(angle_speed=0.5, slide_speed=0.1)
    drive = Drive(limits, speed=SPEED, hold=HOLD, pose_time=POSE_TIME)
    drive.start((0.0, 0.0, 0.0, 0.0))
    drive.go("working pose", WORKING_POSE, 0.0)
    points = run(drive, 8.0, period=0.01)
    speeds = np.abs(np.diff(points, axis=0)) / 0.01
    assert speeds[:, :3].max() == pytest.approx(0.5, rel=1e-3)
    arrived = np.argmax((points == np.array(WORKING_POSE)).all(axis=1)) * 0.01
    assert arrived == pytest.approx(PEAK * 1.4965 / 0.5, abs=0.02)


def test_without_a_slide_the_pose_is_that_of_the_angles() -> None:
    drive = drive_at(0, 0, 0)
    drive.go("working pose", WORKING_POSE, 0.0)
    assert run(drive, 4.0)[-1] == pytest.approx(WORKING_POSE[:3])


def test_a_key_ends_a_motion_where_it_is() -> None:
    drive = drive_at(0, 0, 0, 0)
    drive.go("working pose", WORKING_POSE, 0.0)
    points = run(drive, 4.0, {1.5: Move(0, 1)})
    half = np.array(WORKING_POSE) * smooth(1.5 / POSE_TIME)
    assert points[-1] == pytest.approx(half + np.array([SPEED * HOLD, 0, 0, 0]), abs=1e-9)


def test_smooth_is_at_rest_at_both_ends() -> None:
    assert (smooth(-1), smooth(0), smooth(0.5), smooth(1), smooth(2)) == (0, 0, 0.5, 1, 1)
    assert smooth(1e-4) == pytest.approx(3e-8, rel=1e-3)
    assert (smooth(0.5 + 1e-6) - smooth(0.5 - 1e-6)) / 2e-6 == pytest.approx(PEAK)


# set-points ahead of the clock, as the node sends them -----------------------------------------------------------


def followed(drive: Drive, presses: dict[float, Move], end: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and the joints of a follower: each set-point is reached a period later, when the next comes."""
    begin = goal = (0.0, drive.joints.copy())
    times, joints, due = np.arange(0.0, end, 0.001), [], 0.0
    waiting = sorted(presses.items())
    for now in times:

        def here(t: float, begin=begin, goal=goal) -> np.ndarray:
            share = min(1.0, (t - begin[0]) / max(goal[0] - begin[0], 1e-12))
            return begin[1] + share * (goal[1] - begin[1])

        pressed = bool(waiting) and waiting[0][0] <= now + 1e-9
        if pressed:
            drive.press(waiting.pop(0)[1], now)
        joints.append(here(now))
        if pressed or now >= due - 1e-9:
            begin, goal, due = (now, here(now)), (now + PERIOD, drive.setpoint(now, PERIOD)), now + PERIOD
    return times, np.array(joints)


@pytest.mark.parametrize("phase", [0.0, 0.001, 0.013, 0.049])
def test_followers_move_with_the_key_from_its_press_on_without_lag_or_pause(phase: float) -> None:
    first, second = 0.4 + phase, 0.5 + phase
    drive = drive_at(-1.0, -1.0, -1.0)
    times, joints = followed(drive, {first: Move(0, 1), second: Move(2, -1)}, 1.0)
    assert joints[:, 0] == pytest.approx(-1.0 + SPEED * np.clip(times - first, 0.0, HOLD), abs=1e-3)
    assert joints[:, 1] == pytest.approx(-1.0)
    assert joints[:, 2] == pytest.approx(-1.0 - SPEED * np.clip(times - second, 0.0, HOLD), abs=1e-3)
    assert joints[-1] == pytest.approx([-1.0 + SPEED * HOLD, -1.0, -1.0 - SPEED * HOLD], abs=1e-12)


@pytest.mark.parametrize("phase", [0.0, 0.013, 0.049])
def test_followers_answer_the_same_key_again_as_fast_as_the_first_time(phase: float) -> None:
    again = 0.4 + phase
    times, joints = followed(drive_at(-1.0, -1.0, -1.0), {0.1: Move(0, 1), again: Move(0, 1)}, 0.8)
    wanted = -1.0 + SPEED * (np.clip(times - 0.1, 0.0, HOLD) + np.clip(times - again, 0.0, HOLD))
    assert joints[:, 0] == pytest.approx(wanted, abs=1e-3)


@pytest.mark.parametrize("after", [0.007, 0.05, 0.081, 0.149])
def test_followers_turn_where_they_are_when_the_other_key_is_pressed(after: float) -> None:
    times, joints = followed(drive_at(0.0, 0.0, 0.0), {0.1: Move(0, -1), 0.1 + after: Move(0, 1)}, 0.6)
    wanted = -SPEED * np.clip(times - 0.1, 0.0, after) + SPEED * np.clip(times - 0.1 - after, 0.0, HOLD)
    assert joints[:, 0] == pytest.approx(wanted, abs=1.5e-3)


def test_a_set_point_ahead_of_the_clock_is_not_moved_twice() -> None:
    drive = drive_at(-1.0, -1.0, -1.0)
    drive.press(Move(0, +1), 5.0)
    first = drive.setpoint(5.0, 0.02)[0]
    assert first == pytest.approx(-1.0 + SPEED * 0.02)
    assert drive.setpoint(5.01)[0] == first
    assert drive.setpoint(5.03)[0] == pytest.approx(-1.0 + SPEED * 0.03)
    assert drive.setpoint(5.10, 0.02)[0] == pytest.approx(-1.0 + SPEED * 0.12)
