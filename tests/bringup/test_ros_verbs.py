"""What `ros2 node|topic|service|lifecycle|param|action` ask a running suite, by the calls of rclpy that they make.

ROS 2's command line has no wheels; ros_table.md lists what a person checks with it by hand.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("control_msgs", reason="the interfaces are not built: run `make setup`")

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from rcl_interfaces.srv import DescribeParameters
from rclpy.action import (
    get_action_client_names_and_types_by_node,
    get_action_names_and_types,
    get_action_server_names_and_types_by_node,
)
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool, Trigger
from tripod_msgs.msg import ControlMode

from tests.domains import own_domain
from tests.goals import Goals, goal
from tests.messages import assert_names
from tests.messages import names as names_all
from tests.services import call
from tripod_graph import names
from tripod_graph.mode import LONGEST_LEASE, Mode
from tripod_graph.qos import LATCHED
from tripod_record.definitions import message_class

pytestmark = pytest.mark.ros

ROOT = Path(__file__).parents[2]
DEADLINE = 120.0  # [s], for a loaded machine
SOURCE = "/me"
FOLLOW = "control_msgs/action/FollowJointTrajectory"


class User:
    """A node that asks, as the command line does."""

    def __init__(self, domain: int) -> None:
        self.context = rclpy.Context()
        self.context.init(domain_id=domain)
        self.node = rclpy.create_node("user", context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)

    def wait(self, done: Callable[[], Any], what: str) -> None:
        deadline = time.monotonic() + DEADLINE
        while not done():
            assert time.monotonic() < deadline, f"no {what}"
            self._executor.spin_once(timeout_sec=0.1)

    def ask(self, kind: Any, node: str, verb: str, request: Any) -> Any:
        return call(self.node, kind, f"/left/{node}/{verb}", request, server=f"/left/{node}", wait=self.wait)

    def echo(self, topic: str) -> str:
        """Return one message as text."""
        (name,) = dict(self.node.get_topic_names_and_types())[f"/left/{topic}"]
        heard: list[Any] = []
        offered = self.node.get_publishers_info_by_topic(f"/left/{topic}")[0].qos_profile
        qos = QoSProfile(depth=1, reliability=offered.reliability, durability=offered.durability)
        subscription = self.node.create_subscription(message_class(name), f"/left/{topic}", heard.append, qos)
        self.wait(lambda: heard, topic)
        self.node.destroy_subscription(subscription)
        return str(heard[0])

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture(scope="module")
def user() -> Iterator[User]:
    """A user beside a suite in the namespace `left`."""
    words = ["up", "--no-view", "--namespace", "left", "--set", "mesh.level=1", "--set", "driver.timeout=5.0"]
    with own_domain() as domain:
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }
        suite = subprocess.Popen(
            [sys.executable, "-m", "tripod_bringup.cli", *words],
            cwd=ROOT,
            env=environment,
            stdout=subprocess.DEVNULL,
        )
        asking = User(domain)
        try:
            asking.wait(lambda: asking.node.count_services("/left/driver/get_state"), "driver")
            yield asking
        finally:
            asking.close()
            suite.send_signal(signal.SIGINT)
            assert suite.wait(DEADLINE) == 0


def test_node_list_and_info(user: User) -> None:
    wanted = {f"/left/{name}" for name in ("bringup", "driver", "ik", "sim")}
    user.wait(lambda: set(user.node.get_fully_qualified_node_names()) - {"/user"} == wanted, "four nodes")
    for ask, node, name, kind in (
        (
            user.node.get_publisher_names_and_types_by_node,
            "ik",
            "joint_trajectory",
            "trajectory_msgs/msg/JointTrajectory",
        ),
        (
            user.node.get_subscriber_names_and_types_by_node,
            "driver",
            "control_mode",
            "tripod_msgs/msg/ControlMode",
        ),
        (user.node.get_service_names_and_types_by_node, "sim", "sim/reset", "std_srvs/srv/Trigger"),
    ):
        # a node is known sooner than what it has
        user.wait(lambda ask=ask, node=node, name=name: f"/left/{name}" in dict(ask(node, "/left")), name)
        assert dict(ask(node, "/left"))[f"/left/{name}"] == [kind]


def test_topic_list_info_and_echo(user: User) -> None:
    wanted = {
        names.JOINT_TRAJECTORY: "trajectory_msgs/msg/JointTrajectory",
        names.CONTROL_MODE: "tripod_msgs/msg/ControlMode",
        names.TARGET_POSE: "geometry_msgs/msg/PoseStamped",
        names.BODY_STATE: "tripod_msgs/msg/BodyState",
        names.SIM_JOINT_STATES: "sensor_msgs/msg/JointState",
        names.ROBOT_STATUS: "tripod_msgs/msg/RobotStatus",
        names.ROBOT_DESCRIPTION: "std_msgs/msg/String",
    }
    user.wait(
        lambda: {f"/left/{t}" for t in wanted} <= dict(user.node.get_topic_names_and_types()).keys(), "topics"
    )
    found = dict(user.node.get_topic_names_and_types())
    for topic, kind in wanted.items():
        assert found[f"/left/{topic}"] == [kind]
    assert found["/tf"] == ["tf2_msgs/msg/TFMessage"]
    assert f"/left/{names.JOINT_STATES}" not in found  # unless asked for
    (mesh,) = user.node.get_publishers_info_by_topic("/left/sim/mesh")
    assert mesh.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL
    (body,) = user.node.get_publishers_info_by_topic("/left/sim/body_state")
    assert body.qos_profile.reliability is ReliabilityPolicy.BEST_EFFORT
    assert "real_time_factor=" in user.echo("sim/status")
    assert "'servo_0'" in user.echo("robot/status")
    assert '<robot name="tripod">' in user.echo("robot_description")


def test_service_list_and_call(user: User) -> None:
    found = dict(user.node.get_service_names_and_types())
    assert found["/left/sim/step_simulation"] == ["simulation_interfaces/srv/StepSimulation"]
    pause = SetBool.Request(data=True), SetBool.Request(data=False)
    assert user.ask(SetBool, "sim", "pause", pause[0]).message == "paused"
    assert user.ask(Trigger, "sim", "step", Trigger.Request()).message.startswith("step ")
    assert user.ask(SetBool, "sim", "pause", pause[1]).message == "running"


def test_lifecycle_get_list_and_set(user: User) -> None:
    def state() -> str:
        return str(user.ask(GetState, "driver", "get_state", GetState.Request()).current_state.label)

    def change(number: int) -> bool:
        asked = ChangeState.Request(transition=Transition(id=number))
        return bool(user.ask(ChangeState, "driver", "change_state", asked).success)

    user.wait(lambda: state() == "active", "active driver")
    asked = GetAvailableTransitions.Request()
    offered = user.ask(GetAvailableTransitions, "driver", "get_available_transitions", asked)
    assert {t.transition.label for t in offered.available_transitions} == {"deactivate", "shutdown"}
    assert not change(Transition.TRANSITION_CONFIGURE)  # which this state does not have
    assert change(Transition.TRANSITION_DEACTIVATE)
    assert state() == "inactive"
    assert change(Transition.TRANSITION_ACTIVATE)
    assert state() == "active"


def test_param_describe(user: User) -> None:
    asked = DescribeParameters.Request(names=["rate", "port"])
    rate, port = user.ask(DescribeParameters, "driver", "describe_parameters", asked).descriptors
    assert_names(rate.description, "packets", "[Hz]")
    assert (rate.floating_point_range[0].from_value, rate.floating_point_range[0].to_value) == (5.0, 50.0)
    assert (rate.read_only, port.read_only) == (False, True)


def test_action_list_info_and_send_goal_with_feedback(user: User) -> None:
    actions = {f"/left/{node}/follow_joint_trajectory" for node in ("sim", "robot")}
    user.wait(lambda: len(get_action_names_and_types(user.node)) == len(actions), "both actions")
    assert dict(get_action_names_and_types(user.node)) == {action: [FOLLOW] for action in actions}
    servers = get_action_server_names_and_types_by_node(user.node, "driver", "/left")
    assert servers == [("/left/robot/follow_joint_trajectory", [FOLLOW])]
    assert get_action_client_names_and_types_by_node(user.node, "driver", "/left") == []
    decided = ControlMode(mode=int(Mode.TELEOP), source=SOURCE, lease=LONGEST_LEASE)
    publisher = user.node.create_publisher(ControlMode, "/left/control_mode", LATCHED)
    goals = {name: Goals(user.node, name, user.wait) for name in sorted(actions)}
    user.wait(lambda: publisher.get_subscription_count() >= 4, "who listens to the mode")
    publisher.publish(decided)
    user.wait(
        lambda: SOURCE in user.echo("robot/status") and SOURCE in user.echo("sim/status"), "who is in charge"
    )
    for name, client in goals.items():
        there = goal((-0.3, -0.3, -0.3), seconds=0.5, source=SOURCE)
        ended = client.end(client.send(there))
        for _ in range(
            5
        ):  # a machine that holds the driver up for half a second: its user sends the goal again
            if not names_all(ended[2], "board", "watchdog"):
                break
            ended = client.end(client.send(there))
        assert ended[1:] == (0, ""), name
        assert client.feedback, name
        assert list(client.feedback[-1].joint_names) == list(names.SERVOS)
