"""The demo's script, fed by hand."""

from collections.abc import Callable

import numpy as np
import pytest

from tests.messages import assert_names
from tripod_bringup.demo_session import Action, DemoSession, Heard, Phase, SessionTimes
from tripod_graph.mode import Mode
from tripod_graph.names import WORKING_POSE

PARKED = np.zeros(4)
THERE = np.array(WORKING_POSE)
EFFECTOR = np.array([0.001, 0.002, -0.0085])
DT = 0.02


def play(session: DemoSession, hear: Callable[[float], Heard], seconds: float) -> list[tuple[float, Action]]:
    """Step at 50 Hz from a start that is not zero; return what was published and when."""
    done = []
    for i in range(round(seconds / DT)):
        action = session.step(100.0 + i * DT, hear(i * DT))
        if action != Action():
            done.append((i * DT, action))
    return done


def robot(t: float) -> Heard:
    """A chain that is complete after 1 s and at the working pose after 4 s."""
    return Heard(t >= 1.0, THERE if t >= 4.0 else PARKED, EFFECTOR)


def test_the_script_is_played_in_order() -> None:
    session = DemoSession(SessionTimes(track=2.0))
    done = play(session, robot, 12.0)
    assert session.phase is Phase.DONE and session.finished and not session.failure
    assert done[0] == (pytest.approx(1.0), Action(mode=Mode.TELEOP))
    time, move = done[1]
    assert move == Action(pose=WORKING_POSE, move_time=3.0)
    assert time == pytest.approx(1.3, abs=0.03), "the mode has time to arrive first"
    time, first = done[2]
    assert first.mode is Mode.IK and first.target == tuple(EFFECTOR)
    assert time == pytest.approx(5.3, abs=0.05), "a rest after the motion"
    assert done[-1][1] == Action(mode=Mode.STOP)
    targets = np.array([action.target for _, action in done[2:-1]])
    assert len(targets) == pytest.approx(2.0 / DT, abs=2)
    assert np.linalg.norm(np.diff(targets, axis=0), axis=1).max() < session.target.speed_bound * DT  # type: ignore[union-attr]
    assert np.linalg.norm(targets[-1] - EFFECTOR) > 0.004, "the target did leave the centre"


def test_a_motion_that_ended_on_the_way_is_commanded_again() -> None:
    session = DemoSession(SessionTimes(track=2.0))
    done = play(session, lambda t: Heard(t >= 1.0, THERE if t >= 6.0 else 0.1 * THERE, EFFECTOR), 12.0)
    assert session.phase is Phase.DONE and not session.failure
    moves = [time for time, action in done if action == Action(pose=WORKING_POSE, move_time=3.0)]
    assert moves == [pytest.approx(1.3, abs=0.03), pytest.approx(4.3, abs=0.05)]
    assert done[3][0] == pytest.approx(7.0, abs=0.05), "a rest after the joints arrived at 6.0 s"


def test_a_robot_that_did_not_hear_the_first_command_is_told_again_and_waited_for() -> None:
    session = DemoSession(SessionTimes(track=2.0))

    def deaf(t: float) -> Heard:
        """The simulator is there after 4 s; the robot stands until then, and is there 3 s later."""
        servos = (THERE if t >= 7.4 else 0.5 * THERE if t >= 5.0 else PARKED)[:3]
        return Heard(t >= 1.0, THERE if t >= 4.0 else PARKED, EFFECTOR, servos)

    done = play(session, deaf, 14.0)
    assert session.phase is Phase.DONE and not session.failure
    moves = [time for time, action in done if action == Action(pose=WORKING_POSE, move_time=3.0)]
    assert moves == [pytest.approx(1.3, abs=0.03), pytest.approx(4.3, abs=0.05)]
    assert done[3][0] == pytest.approx(8.3, abs=0.1), "a rest after the second motion"


@pytest.mark.parametrize("robot", [THERE[:3], 0.5 * THERE[:3], np.zeros(0)])
def test_a_robot_that_moved_or_is_not_known_is_not_told_again(robot: np.ndarray) -> None:
    session = DemoSession(SessionTimes(track=2.0))
    there = lambda t: robot if t >= 4.0 else 0.0 * robot  # noqa: E731
    done = play(session, lambda t: Heard(t >= 1.0, THERE if t >= 4.0 else PARKED, EFFECTOR, there(t)), 12.0)
    assert session.phase is Phase.DONE
    assert sum(action == Action(pose=WORKING_POSE, move_time=3.0) for _, action in done) == 1


def test_targets_are_those_of_the_function_that_the_error_is_measured_against() -> None:
    session = DemoSession(SessionTimes(track=None))
    done = play(session, robot, 15.0)
    assert session.phase is Phase.TRACK and session.target is not None and session.track_start is not None
    for time, action in done[2:]:
        expected = session.target(100.0 + time - session.track_start)
        assert np.allclose(action.target, expected, atol=1e-12)  # type: ignore[arg-type]


def test_without_a_limit_the_targets_go_on() -> None:
    session = DemoSession(SessionTimes(track=None))
    play(session, robot, 60.0)
    assert session.phase is Phase.TRACK


def test_a_chain_that_is_never_complete_fails_with_a_stop() -> None:
    session = DemoSession(SessionTimes(link=5.0))
    done = play(session, lambda _t: Heard(True, PARKED), 10.0)  # an effector that is not known
    assert [action for _, action in done] == [Action(mode=Mode.STOP)]
    assert session.phase is Phase.FAILED
    assert_names(session.failure, "chain", "5 s")


@pytest.mark.parametrize("off", [(0.05, 0, 0, 0), (0, -0.05, 0, 0), (0, 0, 0, -0.002)])
def test_joints_that_do_not_arrive_fail_with_their_values(off: tuple[float, ...]) -> None:
    session = DemoSession(SessionTimes())
    done = play(session, lambda _t: Heard(True, THERE + off, EFFECTOR), 20.0)
    assert done[-1][1] == Action(mode=Mode.STOP)
    assert_names(session.failure, "joints", "working pose", *(f"{value:.4f}" for value in THERE + off))
    assert not any(action.target is not None for _, action in done)
