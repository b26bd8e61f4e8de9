import numpy as np
import pytest

from tripod_ik.target_motion import FASTEST, HOLD, TargetMotion


def feed(motion, path, every=0.02, until=0.4):
    times = np.arange(0.0, until + 1e-9, every)
    for t in times:
        motion.add(path(t), t)
    return times[-1]


def test_a_target_that_moves_evenly_is_met_where_it_will_be():
    motion, path = TargetMotion(0.03), lambda t: np.array([0.1 * t, -0.05 * t, 0.0])
    last = feed(motion, path)
    for age in (0.0, 0.005, 0.019):
        assert motion.at(last + age) == pytest.approx(path(last + age + 0.03), abs=1e-12)


def test_a_circle_is_met_to_second_order():
    def path(t):
        return 0.01 * np.array([np.cos(np.pi * t), np.sin(np.pi * t), 0.0])

    motion = TargetMotion(0.03)
    last = feed(motion, path)
    late = np.linalg.norm(path(last) - path(last + 0.03))
    assert np.linalg.norm(motion.at(last) - path(last + 0.03)) < 0.2 * late


def test_without_lead_the_target_is_followed_as_it_is():
    motion = TargetMotion(0.0)
    last = feed(motion, lambda t: np.array([0.1 * t, 0.0, 0.0]))
    assert motion.at(last + 0.01).tolist() == [0.1 * last, 0.0, 0.0]


@pytest.mark.parametrize("gap", [0.02, 0.5])
def test_a_jump_is_no_speed_and_silence_ends_a_motion(gap):
    motion = TargetMotion(0.03)
    last = feed(motion, lambda t: np.array([0.1 * t, 0.0, 0.0]))
    jump = np.array([0.1, 0.0, 0.0]) + FASTEST * 0.02
    motion.add(jump, last + gap)
    assert motion.at(last + gap + 0.01).tolist() == jump.tolist()
    motion.add(jump, last + gap + 0.02)
    assert motion.at(last + gap + 0.02).tolist() == jump.tolist()
    moving = TargetMotion(0.03)
    last = feed(moving, lambda t: np.array([0.1 * t, 0.0, 0.0]))
    assert moving.at(last + HOLD + 0.01).tolist() == [0.1 * last, 0.0, 0.0]


def test_a_second_target_at_the_same_time_replaces_the_first():
    motion = TargetMotion(0.03)
    motion.add(np.zeros(3), 1.0)
    motion.add(np.ones(3), 1.0)
    assert motion.at(1.0).tolist() == [1.0, 1.0, 1.0]
