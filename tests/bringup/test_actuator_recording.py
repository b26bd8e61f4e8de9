"""A robot with cables as its user has it: brought up, driven, recorded; the recording read, drawn and made again."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

import rclpy
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from tripod_msgs.msg import ControlMode

from tests.bringup.processes import DEADLINE
from tests.bringup.test_whole_chain import start
from tests.domains import own_domain
from tests.messages import assert_names
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
    with own_domain() as domain:
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }
        command = [sys.executable, "-m", "tripod_bringup", "bag", "play", str(file), "--to", "sim"]
        played = subprocess.run(
            [*command, "--rate", "inf"],
            env=environment,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=DEADLINE,
            check=False,
        )
    assert played.returncode == 0, played.stderr
    assert_names(played.stdout, "steps made again", "bit for bit")
