"""The driver's action on a real port: goals followed, refused, cancelled and interrupted; parameters that change."""

import math

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("control_msgs", reason="the interfaces are not built: run `make setup`")

from tests.decisions import SOURCE
from tests.driver.operator import near
from tests.goals import Goals, goal
from tests.messages import assert_names
from tripod_driver.protocol import RESOLUTION
from tripod_graph import names
from tripod_graph.mode import Mode

pytestmark = pytest.mark.ros

LEGACY = ("protocol:=legacy", "boot_time:=0", "start:=[0.0,0.0,0.0]", "timeout:=2.0")
THERE = (-0.5236, -0.3491, -0.1745)
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6


@pytest.fixture
def goals(board, client, operator, start_driver) -> Goals:
    """A client of the action of a driver whose board is ready."""
    start_driver(f"port:={board.path}", *LEGACY, "joint_states:=true")
    operator.ready()
    operator.mode(Mode.STOP)
    client.wait(lambda: operator.status.authority.mode == Mode.STOP, "STOP")
    return Goals(client.node, "robot/follow_joint_trajectory", client.wait)


def decide(operator, client, mode: Mode) -> None:
    operator.mode(mode)
    client.wait(lambda: operator.status.authority.mode == mode, mode.name)


def test_a_goal_is_refused_in_the_wrong_mode_and_followed_in_the_right_one(
    goals, board, client, operator
) -> None:
    from sensor_msgs.msg import JointState

    told: list[JointState] = []
    client.node.create_subscription(JointState, names.JOINT_STATES, told.append, 10)
    ended = goals.end(goals.send(goal(THERE, seconds=0.3, source=SOURCE)))
    assert ended[:2] == (ABORTED, -1)
    assert_names(ended[2], "STOP", "ignored")
    assert board.packets == []
    decide(operator, client, Mode.TELEOP)
    slide = (*names.SERVOS, names.SLIDE)
    handle = goals.send(goal((*THERE, 0.01), seconds=0.3, source=SOURCE, joints=slide))
    assert goals.end(handle) == (SUCCEEDED, 0, "")
    client.wait(lambda: near(board.packets[-1], THERE), "the last packet")
    assert goals.feedback[-1].joint_names == list(names.SERVOS)  # the real robot has no slide
    client.wait(lambda: told, "joint_states")
    assert list(told[0].name) == list(names.SERVOS)
    ended = goals.end(goals.send(goal((math.nan, 0.0, 0.0), seconds=0.3, source=SOURCE)))
    assert ended[:2] == (ABORTED, -1)
    assert_names(ended[2], "point 0", "servo_0", "nan rad", "-2.1 to 0.6 rad")
    client.wait(lambda: operator.status.rejected_commands == 1, "the count")
    assert near(board.packets[-1], THERE)


def test_a_cancelled_goal_leaves_the_servos_where_they_are(goals, board, client, operator) -> None:
    decide(operator, client, Mode.TELEOP)
    handle = goals.send(goal((-2.0, -2.0, -2.0), seconds=20.0, source=SOURCE))
    client.wait(lambda: board.packets and board.packets[-1][0] < -0.1, "some motion")
    assert goals.cancel(handle) == 1
    ended = goals.end(handle)
    assert ended[:2] == (CANCELED, 0)
    assert_names(ended[2], "cancelled", "hold")
    count = operator.wait_hold(board)
    last = board.packets[count - 1]
    client.wait(lambda: len(board.packets) > count + 3, "what keeps the board alive")
    assert set(board.packets[count:]) == {last}
    assert_names(operator.status.message, "goal", "next command")


def test_what_stops_the_driver_ends_a_goal_and_says_what(goals, board, client, operator) -> None:
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState
    from std_srvs.srv import Trigger

    def transition(number: int) -> None:
        asked = ChangeState.Request(transition=Transition(id=number))
        assert client.call(ChangeState, "driver/change_state", asked).success

    decide(operator, client, Mode.TELEOP)
    long = goal((-2.0, -2.0, -2.0), seconds=30.0, source=SOURCE)
    handle = goals.send(long)
    transition(Transition.TRANSITION_DEACTIVATE)
    interrupted, refused = goals.end(handle), goals.end(goals.send(long))
    assert interrupted[:2] == refused[:2] == (ABORTED, -1)
    assert interrupted[2].endswith(refused[2])
    assert_names(interrupted[2], "interrupted")
    assert_names(refused[2], "not active", "ignored")
    transition(Transition.TRANSITION_ACTIVATE)
    handle = goals.send(long)
    client.call(Trigger, names.ROBOT_STOP, Trigger.Request())
    interrupted, refused = goals.end(handle), goals.end(goals.send(long))
    assert interrupted[:2] == refused[:2] == (ABORTED, -1)
    assert interrupted[2].endswith(refused[2])
    assert_names(interrupted[2], "interrupted")
    assert_names(refused[2], "service", "control mode")
    decide(operator, client, Mode.STOP)
    decide(operator, client, Mode.TELEOP)
    handle = goals.send(long)
    board.unplug()
    status, code, why = goals.end(handle)
    assert (status, code) == (ABORTED, -1)
    assert_names(why, "interrupted", board.path, "next attempt")


def test_a_driver_that_is_ended_ends_its_goal(board, client, operator, start_driver) -> None:
    driver = start_driver(f"port:={board.path}", *LEGACY)
    operator.ready()
    goals = Goals(client.node, "robot/follow_joint_trajectory", client.wait)
    decide(operator, client, Mode.TELEOP)
    ended = goals.send(goal((-2.0, -2.0, -2.0), seconds=30.0, source=SOURCE)).get_result_async()
    heard = len(goals.feedback)
    client.wait(lambda: len(goals.feedback) > heard + 3, "feedback from after the result was asked for")
    assert driver.stop() == 0
    client.wait(ended.done, "the result")
    assert ended.result().status == ABORTED
    assert_names(ended.result().result.error_string, "interrupted", "node")


def test_the_slew_rate_changes_while_it_runs(goals, board, client, operator) -> None:
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    decide(operator, client, Mode.TELEOP)
    slow = [Parameter("angle_speed", value=0.5).to_parameter_msg()]
    answer = client.call(SetParameters, "driver/set_parameters", SetParameters.Request(parameters=slow))
    assert answer.results[0].successful
    client.wait(lambda: list(operator.status.speed) == [0.5] * 3, "the range that is told")
    status, code, why = goals.end(goals.send(goal((-1.9, -1.9, -1.9), seconds=0.1, source=SOURCE)))
    assert (status, code) == (ABORTED, -5)
    assert_names(why, "servo_0", "-1.9000", "goal_tolerance", "0.01 rad")
    steps = np.abs(np.diff(np.array(board.packets), axis=0))
    assert len(steps) > 10
    assert steps.max() <= 0.5 * 0.02 + 2 * RESOLUTION
