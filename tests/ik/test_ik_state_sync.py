"""The simulated servos go to the robot's, and the robot nowhere unasked."""

import numpy as np
import pytest

from tripod_ik.state_sync import LEAP, NEAR, PATIENCE, StateSync

HERE, START = np.array([-1.0, -0.9, -1.1]), np.zeros(3)


def test_where_both_are_at_the_same_place_there_is_nothing_to_wait_for() -> None:
    joining = StateSync()
    assert joining.place(HERE, HERE + 0.9 * NEAR, 0.0) is None
    for k in range(1, 100):  # what one does to its load later is no reason
        assert joining.place(HERE + 0.01 * k, HERE, 0.02 * k) is None


def test_at_first_the_simulated_go_to_the_robot() -> None:
    joining = StateSync()
    for k in range(11):
        told = joining.place(0.1 * k * HERE, HERE, 0.02 * k)
        assert told is None if k == 10 else told == pytest.approx(HERE)


def test_a_simulator_that_begins_anew_is_brought_back() -> None:
    joining = StateSync()
    assert joining.place(HERE, HERE, 0.0) is None
    assert joining.place(START, HERE, 0.02) == pytest.approx(HERE)
    assert joining.place(START, HERE, 0.04) == pytest.approx(HERE)  # it stands still at first
    assert joining.place(HERE, HERE, 0.10) is None


def test_fast_servos_and_late_states_are_no_new_beginning() -> None:
    joining = StateSync()
    assert joining.place(HERE, HERE, 0.0) is None
    assert joining.place(HERE + 0.9 * LEAP, HERE + 0.5, 0.02) is None
    assert joining.place(HERE + 0.9 * LEAP + 0.9, HERE + 2.0, 0.12) is None  # 9 rad/s, seen late


def test_it_waits_no_longer_than_simulated_servos_may_take() -> None:
    joining = StateSync()
    assert joining.place(START, HERE, 0.0) is not None
    assert joining.place(START, HERE, PATIENCE - 0.01) is not None
    assert joining.place(START, HERE, PATIENCE) is None
    assert joining.place(START, HERE, PATIENCE + 1.0) is None


@pytest.mark.parametrize("robot", [None, np.zeros(4)])
def test_without_a_driver_of_these_servos_there_is_nobody_to_join(robot: np.ndarray | None) -> None:
    assert StateSync().place(HERE, robot, 0.0) is None


def test_after_a_pause_it_looks_again() -> None:
    joining = StateSync()
    assert joining.place(HERE, HERE, 0.0) is None
    joining.begin()
    assert joining.place(HERE, HERE + 0.3, 0.02) == pytest.approx(HERE + 0.3)
