"""`tripod up` of a robot of cables and of one of air: simulator, driver on the mock port, recording, replay."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("tripod_msgs", reason="the messages are not built: run `make setup`")

from rclpy.node import Node
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import ControlMode, RobotStatus, SimStatus

from tests.bringup.test_whole_chain import DEADLINE, start
from tests.decisions import SOURCE
from tests.domains import own_domain
from tests.driver.conftest import Client
from tests.messages import assert_names
from tripod_bringup.up_command import chain_values
from tripod_graph import names
from tripod_graph.joint import Joint
from tripod_graph.mode import LONGEST_LEASE, Mode
from tripod_graph.qos import LATCHED, RELIABLE
from tripod_graph.trajectory import point_of

pytestmark = [pytest.mark.ros, pytest.mark.slow]
COARSE = ("--set", "dt=0.02", "--set", "mesh_error=off")


def play(file: Path, scene: str, domain: int, environment: dict[str, str]) -> str:
    """Play a recording to a driver of this robot on the mock port; return what is said."""
    values = chain_values({}, scene, [], "mock")["driver"]
    words = [f"{name}:={value}" for name, value in values.items()]
    driver = subprocess.Popen([sys.executable, "-m", "tripod_driver.node", *words], env=environment)
    try:
        code = "from tripod_bringup.cli import main; main()"
        command = [sys.executable, "-c", code, "bag", "play", str(file), "--to", "robot", "--rate", "0.8"]
        played = subprocess.run(
            command, check=False, env=environment, capture_output=True, text=True, timeout=3 * DEADLINE
        )
    finally:
        driver.send_signal(signal.SIGINT)
        driver.wait(DEADLINE)
    assert played.returncode == 0, played.stdout + played.stderr
    return played.stdout


def records(node: Node, topic: str) -> bool:
    """Return whether the recorder listens to a topic: of a busy machine it may find it seconds after others."""
    return "record" in {found.node_name for found in node.get_subscriptions_info_by_topic(topic)}


@pytest.mark.parametrize(
    ("scene", "goal"), [("finger_cable", (0.005, 0.002)), ("finger_pneumatic", (4e3,))], ids=str
)
def test_the_simulated_and_the_real_robot_follow_one_command(
    scene: str, goal: tuple[float, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with own_domain() as domain:
        process = start(scene, "--no-view", "--record", "bags", directory=tmp_path, domain=domain)
        client = Client(domain, "/")
        try:
            heard: dict[str, list] = {}
            for kind, topic in (
                (RobotStatus, names.ROBOT_STATUS),
                (SimStatus, names.SIM_STATUS),
                (JointState, names.SIM_JOINT_STATES),
                (JointState, names.ROBOT_JOINT_STATES),
            ):
                heard[topic] = []
                client.node.create_subscription(kind, topic, heard[topic].append, RELIABLE)
            trajectory = client.node.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)
            mode = client.node.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
            client.wait(lambda: process.poll() is not None or all(heard.values()), "the chain")
            robot, sim = heard[names.ROBOT_STATUS][-1], heard[names.SIM_STATUS][-1]
            table = [Joint(n, u, 0.0, 1.0, 1.0) for n, u in zip(robot.joint_names, robot.units, strict=True)]
            assert (robot.joint_names, robot.units) == (sim.joint_names, sim.units)
            client.wait(lambda: heard[names.ROBOT_STATUS][-1].state >= RobotStatus.READY, "the board")
            client.wait(
                lambda: records(client.node, names.ROBOT_STATUS), "the recorder at the driver's status"
            )
            decision = ControlMode(mode=int(Mode.TELEOP), source=SOURCE, lease=LONGEST_LEASE)
            decision.header.stamp = client.node.get_clock().now().to_msg()
            mode.publish(decision)

            def command() -> None:
                message = JointTrajectory(joint_names=[joint.name for joint in table])
                message.header.frame_id = SOURCE
                message.points = [point_of(goal, table)]
                message.points[0].time_from_start.nanosec = 200_000_000
                trajectory.publish(message)

            def reached(topic: str) -> bool:
                state = heard[topic][-1]
                rows = {
                    n: (p, e)
                    for n, p, e in zip(
                        state.name, state.position, state.effort or state.position, strict=True
                    )
                }
                found = [rows[joint.name][joint.is_effort] for joint in table]
                return bool(np.allclose(found, goal, rtol=0.03, atol=0.0))

            for topic in (names.ROBOT_JOINT_STATES, names.SIM_JOINT_STATES):
                client.wait(lambda topic=topic: reached(topic), f"the goal in {topic}", meanwhile=command)
            sent = lambda: heard[names.ROBOT_STATUS][-1].sent  # noqa: E731 - told less often
            client.wait(
                lambda: np.allclose(sent(), goal, rtol=0.03, atol=0.0), "the goal sent", meanwhile=command
            )
        finally:
            client.close()
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=3 * DEADLINE)
        assert process.returncode == 0, out + err
        file = next((tmp_path / "bags").glob("*/*.mcap"))
        with AnyReader([file.parent]) as reader:
            wanted = [c for c in reader.connections if c.topic == f"/{names.ROBOT_STATUS}"]
            assert wanted, reader.topics  # without any all are read
            assert [reader.deserialize(raw, c.msgtype).units for c, _, raw in reader.messages(wanted)][
                -1
            ] == robot.units
        environment = process_environment(domain, tmp_path)
        assert_names(play(file, scene, domain, environment), "played", "s of motion")


def process_environment(domain: int, directory: Path) -> dict[str, str]:
    root = str(Path(__file__).parents[2])
    return dict(
        os.environ,
        PYTHONPATH=root,
        ROS_DOMAIN_ID=str(domain),
        ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
        XDG_RUNTIME_DIR=str(directory),
    )
