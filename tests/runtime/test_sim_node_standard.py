"""The simulator as programs know it that work with any: simulation_interfaces, an action, joint_states, parameters."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("simulation_interfaces", reason="the interfaces are not built: run `make setup`")

from action_msgs.msg import GoalStatus
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from simulation_interfaces.msg import Result, SimulationState, SimulatorFeatures
from simulation_interfaces.srv import (
    GetSimulationState,
    GetSimulatorFeatures,
    ResetSimulation,
    SetSimulationState,
    StepSimulation,
)
from tripod_msgs.msg import ControlMode, SimStatus

from tests.decisions import SOURCE
from tests.goals import Goals, goal
from tests.messages import assert_names
from tests.runtime.sim_graph import Graph
from tests.services import call
from tripod_graph import names
from tripod_graph.qos import RELIABLE
from tripod_sim import StepError

pytestmark = pytest.mark.ros

STOPPED, PLAYING, PAUSED = (
    SimulationState.STATE_STOPPED,
    SimulationState.STATE_PLAYING,
    SimulationState.STATE_PAUSED,
)
OK = (Result.RESULT_OK, "")
THERE = (-0.2, -0.3, -0.4)


class Standard:
    """Calls the services of simulation_interfaces."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph

    def __call__(self, kind: Any, name: str, **request: Any) -> Any:
        asked = kind.Request(**request)
        return call(self._graph.ear, kind, name, asked, server="sim", wait=self._graph.wait)

    def state(self) -> int:
        return int(self(GetSimulationState, names.SIM_GET_STATE).state.state)

    def set_state(self, state: int) -> tuple[int, str]:
        return answer(self(SetSimulationState, names.SIM_SET_STATE, state=SimulationState(state=state)))

    def step(self, steps: int) -> tuple[int, str]:
        return answer(self(StepSimulation, names.SIM_STANDARD_STEP, steps=steps))

    def reset(self, scope: int) -> tuple[int, str]:
        return answer(self(ResetSimulation, names.SIM_STANDARD_RESET, scope=scope))


def answer(response: Any) -> tuple[int, str]:
    return response.result.result, response.result.error_message


def test_it_is_stepped_reset_and_stopped_as_any_simulator(make) -> None:
    graph = make().start()
    standard = Standard(graph)
    told = standard(GetSimulatorFeatures, names.SIM_FEATURES).features
    assert SimulatorFeatures.STEP_SIMULATION_MULTIPLE in told.features
    assert 0 not in told.features  # spawning
    assert standard.state() == PLAYING
    assert standard.set_state(PLAYING) == (SetSimulationState.Response.ALREADY_IN_TARGET_STATE, "")
    code, why = standard.step(3)
    assert code == Result.RESULT_INCORRECT_STATE
    assert_names(why, "not paused", "2 (paused)")
    assert standard.set_state(PAUSED) == OK
    assert standard.state() == PAUSED
    first = graph.status(state=SimStatus.PAUSED).step
    assert standard.step(40) == OK
    assert graph.status(state=SimStatus.PAUSED).step == first + 40
    code, why = standard.step(0)
    assert code == Result.RESULT_OPERATION_FAILED
    assert_names(why, "steps", 0, "at least 1")
    assert standard.reset(ResetSimulation.Request.SCOPE_DEFAULT) == OK
    assert graph.status(state=SimStatus.PAUSED).step == 0
    code, why = standard.reset(ResetSimulation.Request.SCOPE_TIME)
    assert code == Result.RESULT_FEATURE_UNSUPPORTED
    assert_names(why, "scope 1", "allowed: 0, 3, 7, 255")
    assert standard.set_state(STOPPED) == OK
    assert standard.state() == STOPPED
    assert standard.set_state(PAUSED) == OK
    assert standard.state() == PAUSED
    assert standard.set_state(STOPPED) == OK
    assert standard.step(1) == OK
    assert standard.state() == PAUSED
    assert standard.set_state(PLAYING) == OK
    graph.status(state=SimStatus.PARKED)
    code, why = standard.set_state(SimulationState.STATE_QUITTING)
    assert code == Result.RESULT_FEATURE_UNSUPPORTED
    assert_names(why, "state 3", "0 (stopped)", "1 (playing)", "2 (paused)")


def test_a_failed_step_is_told_and_stopping_recovers(make, monkeypatch) -> None:
    graph = make().start()
    standard = Standard(graph)

    failure = "element 7 is crushed"

    def crush(joints: object) -> None:
        raise StepError(failure)

    with monkeypatch.context() as patch:
        patch.setattr(graph.node._physics._simulation, "step", crush)
        graph.status(state=SimStatus.FAILED)
        found = standard(GetSimulationState, names.SIM_GET_STATE)
        assert answer(found) == (Result.RESULT_OPERATION_FAILED, failure)
        code, why = standard.set_state(PLAYING)
        assert code == SetSimulationState.Response.STATE_TRANSITION_ERROR
        assert_names(why, failure, "sim/reset")
        assert standard.step(1) == (Result.RESULT_INCORRECT_STATE, failure)
    assert standard.set_state(STOPPED) == OK
    assert standard.state() == STOPPED
    assert graph.status(state=SimStatus.PAUSED).step == 0
    assert standard.set_state(PLAYING) == OK
    graph.status(state=SimStatus.PARKED)


def test_a_goal_moves_the_joints_and_a_reset_ends_one(make) -> None:
    graph = make(timeout=5.0).start()
    goals = Goals(graph.ear, "sim/follow_joint_trajectory", graph.wait)
    status, _, why = goals.end(goals.send(goal(THERE, seconds=0.2, source=SOURCE)))
    assert status == GoalStatus.STATUS_ABORTED
    assert_names(why, "STOP")
    assert graph.joints() == [0, 0, 0, 0]
    graph.choose(ControlMode.TELEOP)
    assert goals.end(goals.send(goal(THERE, seconds=0.2, source=SOURCE)))[0] == GoalStatus.STATUS_SUCCEEDED
    assert graph.joints()[:3] == pytest.approx(THERE, abs=0.01)
    joints = (*names.SERVOS, names.SLIDE)
    goals.feedback.clear()
    handle = goals.send(goal((*THERE, 0.01), seconds=30.0, source=SOURCE, joints=joints))
    graph.wait(lambda: goals.feedback, "feedback")
    assert goals.feedback[0].joint_names == list(joints)
    graph.reset()
    status, code, why = goals.end(handle)
    assert (status, code) == (GoalStatus.STATUS_ABORTED, -1)
    assert_names(why, f"TELEOP by {SOURCE}")
    assert graph.node._refused == 0


def test_a_goal_ends_while_paused_too(make) -> None:
    graph = make().start()
    goals = Goals(graph.ear, "sim/follow_joint_trajectory", graph.wait)
    graph.choose(ControlMode.TELEOP)
    assert Standard(graph).set_state(PAUSED) == OK
    status, code, why = goals.end(goals.send(goal(THERE, seconds=0.2, source=SOURCE)))
    assert (status, code) == (GoalStatus.STATUS_ABORTED, -5)
    assert_names(why, "servo_0", "0.0000 rad", "-0.2000")


def test_a_goal_that_a_clock_at_rest_holds_up_ends_with_its_operator(make) -> None:
    graph = make(publish_clock=True).start()
    goals = Goals(graph.ear, "sim/follow_joint_trajectory", graph.wait)
    graph.choose(ControlMode.TELEOP)
    assert Standard(graph).set_state(PAUSED) == OK
    handle = goals.send(goal(THERE, seconds=0.2, source=SOURCE))
    leaves = ControlMode(mode=ControlMode.TELEOP, source=SOURCE, lease=0.1)
    leaves.header.stamp = graph.ear.get_clock().now().to_msg()
    graph.mode.publish(leaves)
    status, code, why = goals.end(handle)
    assert (status, code) == (GoalStatus.STATUS_ABORTED, -1)
    assert why.startswith("interrupted: ")


def test_joint_states_are_told_where_others_look_only_if_asked(make) -> None:
    graph = make(joint_states=True).start()
    heard: list[Any] = []
    graph.ear.create_subscription(JointState, names.JOINT_STATES, heard.append, RELIABLE)
    graph.wait(lambda: heard, "joint states")
    assert list(heard[0].name) == [*names.SERVOS, names.SLIDE]


def test_rates_and_limits_change_while_it_runs(make) -> None:
    graph = make(timeout=60.0, publish_clock=True).start()  # joints move by the time of the steps
    graph.choose(ControlMode.TELEOP)
    changes = {"angle_speed": 0.5, "pose_rate": 10.0, "compliance_rate": 5.0, "body_rate": 100.0}
    results = graph.node.set_parameters([Parameter(n, value=v) for n, v in changes.items()])
    assert all(result.successful for result in results)
    assert graph.node._pose_every == round(0.1 / graph.node._physics.simulation.scene.dt)
    assert graph.node._physics.compliance_period == 0.2
    assert graph.node._body_timer.timer_period_ns == 10_000_000
    way = graph.listen_to_all(names.SIM_JOINT_STATES)
    graph.wait(lambda: way, "joint states")
    graph.command([-2.0, -2.0, -2.0], seconds=1.0)
    graph.wait(lambda: way[-1].position[0] < -0.5, "motion")
    angles = np.array([m.position[0] for m in way])
    times = np.array([m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in way])
    times, first = np.unique(times, return_index=True)
    speeds = -np.diff(angles[first]) / np.diff(times)
    assert speeds.max() == pytest.approx(0.5, rel=1e-3)
    refused = graph.node.set_parameters([Parameter("angle_max", value=0.1)])
    assert_names(refused[0].reason, "read-only", "angle_max")
