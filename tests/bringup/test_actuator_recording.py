"""A robot with cables as its user has it: brought up, driven, recorded; the recording read, drawn and made again."""

import csv
import json
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from tripod_msgs.msg import ControlMode, IkStatus

from tests.bringup.processes import DEADLINE, play_to_simulator
from tests.bringup.test_whole_chain import start
from tests.domains import own_domain
from tests.driver.conftest import Client
from tests.messages import assert_names
from tests.sim.actuator_scenes import mixed
from tripod_bringup import cli
from tripod_bringup.bag_plot import joint_units, panels
from tripod_graph import names
from tripod_graph.qos import LATCHED, RELIABLE
from tripod_record.bag import Bag
from tripod_record.table import read_series

pytestmark = [pytest.mark.ros, pytest.mark.slow]
PULLED = {"left": 0.012, "right": 0.002}  # [m]


def pull(domain: int) -> None:
    """Pull the cables as an operator, and wait until they are there."""
    context = rclpy.Context()
    context.init(domain_id=domain)
    node, executor = rclpy.create_node("me", context=context), SingleThreadedExecutor(context=context)
    executor.add_node(node)
    heard: list[JointState] = []
    node.create_subscription(JointState, names.SIM_JOINT_STATES, heard.append, RELIABLE)
    mode = node.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
    commands = node.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)

    def wait(done: Callable[[], object]) -> None:
        until = time.monotonic() + DEADLINE
        while not done():
            assert time.monotonic() < until, heard[-1:]
            executor.spin_once(timeout_sec=0.1)

    try:
        wait(lambda: heard and commands.get_subscription_count())
        mode.publish(ControlMode(mode=ControlMode.TELEOP, source="/me", lease=600.0))
        point = JointTrajectoryPoint(positions=list(PULLED.values()))
        message = JointTrajectory(joint_names=list(PULLED), points=[point])
        message.header.frame_id = "/me"

        def there() -> bool:
            commands.publish(message)  # again and again: the simulator may hear it before the mode
            return list(heard[-1].position) == pytest.approx(list(PULLED.values()), abs=1e-6)

        wait(there)
        count = len(heard)
        wait(lambda: len(heard) > count + 20)
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()


def tripod(*words: str) -> str:
    """Return what a command prints; it must end well."""
    result = CliRunner().invoke(cli.app, list(words))
    assert result.exit_code == 0, result.output
    return result.stdout


def test_cables_are_recorded_drawn_and_made_again_bit_for_bit(tmp_path: Path) -> None:
    with own_domain() as domain:
        process = start("finger_cable", "--no-view", "--record", "bags", directory=tmp_path, domain=domain)
        try:
            pull(domain)
        finally:
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=DEADLINE)
    assert process.returncode == 0, err
    file = next((tmp_path / "bags").glob("*/*.mcap"))
    topics = {topic["name"] for topic in json.loads(tripod("bag", "info", str(file), "--json"))["topics"]}
    assert {f"/{names.SIM_JOINT_STATES}", f"/{names.JOINT_TRAJECTORY}"} <= topics
    plot, page, table = (tmp_path / f"bag.{end}" for end in ("png", "html", "csv"))
    tripod("bag", "plot", str(file), str(plot))
    tripod("bag", "html", str(file), str(page))
    tripod("bag", "export", str(file), str(table))
    assert plot.stat().st_size > 10_000
    assert_names(page.read_text(), "length", "tension", "left", "right")
    with table.open() as text:
        rows = list(csv.DictReader(text))
    found = {
        key: max(float(row[f"{names.SIM_JOINT_STATES}.{key}"] or 0.0) for row in rows)
        for key in ("position.left", "position.right", "effort.left")
    }
    assert found["position.left"] == pytest.approx(PULLED["left"], abs=1e-6)
    assert found["position.right"] == pytest.approx(PULLED["right"], abs=1e-6)
    assert found["effort.left"] > 0.1  # the tension
    bag = Bag(file)
    assert joint_units(bag) == {"left": "m", "right": "m"}
    assert {unit for title, unit, _ in panels(read_series(bag), joint_units(bag)) if "cables" in title} == {
        "mm",
        "N",
    }
    assert_names(play_to_simulator(file), "steps made again", "bit for bit")


def test_a_servo_a_cable_and_a_chamber_play_a_script_and_seek_a_target(tmp_path: Path) -> None:
    played = {"servo_0": 0.2, "tendon": 0.004, "air": 3e3, "push": 0.0}
    script = ["--servo", "0: 0; 0.5: 0.2"]
    for line in ("tendon=0: 0; 0.5: 4mm", "air=0: 0; 0.5: 3kPa"):
        script += ["--actuate", line]
    scene = mixed(tmp_path)
    with own_domain() as domain:
        words = ["--no-view", "--record", "bags", *script]
        process, client = start(scene, *words, directory=tmp_path, domain=domain), Client(domain, "/")
        states, poses, reached = list[JointState](), list[PoseStamped](), list[IkStatus]()
        for kind, topic, heard in (
            (JointState, names.SIM_JOINT_STATES, states),
            (PoseStamped, names.EFFECTOR_POSE, poses),
            (IkStatus, names.IK_STATUS, reached),
        ):
            client.node.create_subscription(kind, topic, heard.append, RELIABLE)
        mode = client.node.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
        targets = client.node.create_publisher(PoseStamped, names.TARGET_POSE, RELIABLE)

        def there() -> bool:
            told = states[-1] if states else JointState()
            found = {
                n: e if n in ("air", "push") else p
                for n, p, e in zip(told.name, told.position, told.effort, strict=True)
            }
            return {n: found.get(n) for n in played} == pytest.approx(played, rel=1e-6, abs=1e-9)

        try:
            client.wait(lambda: process.poll() is not None or there(), "the end of the script")
            target = PoseStamped()
            target.header.frame_id, target.pose = names.WORLD, poses[-1].pose
            target.pose.position.x -= 1e-3
            target.pose.position.z += 2e-3
            decision = ControlMode(mode=ControlMode.IK, source="/me", lease=600.0)
            decision.header.stamp = client.node.get_clock().now().to_msg()
            mode.publish(decision)
            client.wait(
                lambda: reached and reached[-1].state == IkStatus.TRACKING and 0.0 <= reached[-1].error < 1e-5
                and reached[-1].target.z == target.pose.position.z,
                "the target", meanwhile=lambda: targets.publish(target),
            )  # fmt: skip
            assert list(reached[-1].joint_names) == list(played)
            client.wait(
                lambda: abs(poses[-1].pose.position.z - target.pose.position.z) < 1e-4, "the effector"
            )
        finally:
            client.close()
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=DEADLINE)
    assert process.returncode == 0, err
    file = next((tmp_path / "bags").glob("*/*.mcap"))
    assert joint_units(Bag(file)) == {"servo_0": "rad", "tendon": "m", "air": "Pa", "push": "N"}
    assert_names(play_to_simulator(file), "steps made again", "bit for bit")
