"""Cables, chambers and forces in the node graph: commands, refusals, joint states and status."""

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from action_msgs.msg import GoalStatus
from control_msgs.msg import JointTolerance
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from tripod_msgs.msg import ControlMode, SimStatus

from tests.decisions import SOURCE
from tests.goals import Goals, goal
from tests.messages import assert_names
from tests.sim.actuator_scenes import VIA, finger, mixed
from tripod_graph import names

pytestmark = pytest.mark.ros
ROOT = Path(__file__).parents[2]
FINGER = str(ROOT / "examples" / "tendon_finger.toml")
COARSE = "mesh.element=h8_modes;mesh.cells=[4,1,1];motion=off"
NAN = float("nan")
MIXED = ";".join(
    (
        "mesh.element=h8_modes", "mesh.cells=[4,1,1]", "inertia={}", "damping.stiffness=0.01",
        f'cable=[{{name="tendon", via={VIA}, range=[0, 0.01]}}]',
        'force=[{name="push", set="tip", direction=[0, 1, 0], range=[-0.5, 1]}]',
    )
)  # fmt: skip
"""Of the finger."""


def send(
    graph: Any, joints: list[str], positions: list[float], effort: list[float], seconds: float = 0.0
) -> None:
    """Publish a trajectory of one point."""
    point = JointTrajectoryPoint(positions=positions, effort=effort)
    point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(seconds * 1e9), 10**9)
    message = JointTrajectory(joint_names=joints, points=[point])
    message.header.frame_id = SOURCE
    graph.trajectory.publish(message)


def state(graph: Any) -> dict[str, tuple[float, float]]:
    """Return position and effort of each joint, by name."""
    told = graph.next(names.SIM_JOINT_STATES)
    return {n: (p, e) for n, p, e in zip(told.name, told.position, told.effort, strict=True)}


def test_a_cable_follows_its_trajectory_holds_on_stop_and_parks(make) -> None:
    graph = make(scene=FINGER, set=f"'{COARSE}'", timeout=60.0, park_after=1.0, pose_rate=200.0).start()
    told = graph.status(state=SimStatus.PARKED)
    assert (list(told.joint_names), list(told.units)) == (["tendon"], ["m"])
    assert (list(told.lower), list(told.upper), list(told.speed)) == ([0.0], [0.03], [0.03])
    assert list(graph.next(names.SIM_JOINT_STATES).name) == ["tendon"]
    graph.choose(ControlMode.TELEOP)
    every = graph.listen_to_all(names.SIM_JOINT_STATES)
    send(graph, ["tendon"], [0.02], [])
    graph.next(names.SIM_JOINT_STATES, lambda m: m.position[0] > 0.019)
    there = graph.next(names.SIM_JOINT_STATES, lambda m: m.position[0] == pytest.approx(0.02))
    assert there.effort[0] > 0.1  # the tension
    times = np.array([m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in every])
    pulled = np.array([m.position[0] for m in every])
    moving = (pulled[1:] > pulled[:-1]) & (np.diff(times) > 0)
    assert (
        np.diff(pulled).max() <= 0.03 * 0.1 + 1e-9
    )  # no jump: its range in a second, a stall counts as 0.1 s
    assert moving.any()
    send(graph, ["tendon"], [0.0], [], seconds=5.0)
    graph.next(names.SIM_JOINT_STATES, lambda m: m.position[0] < 0.019)
    graph.choose(ControlMode.STOP)
    held = graph.status(state=SimStatus.HOLDING)
    assert_names(held.message or "tendon", "tendon")
    first = state(graph)["tendon"][0]
    assert 0.0 < first < 0.02
    graph.status(state=SimStatus.PARKED)
    graph.next(names.SIM_JOINT_STATES, lambda m: m.position[0] == 0.0)


@pytest.mark.parametrize(
    ("joints", "positions", "effort", "wrong"),
    [
        (["tendon", "push"], [0.005, 0.5], [], ("push", "effort", "force [N]")),
        (["tendon", "push"], [0.005, 0.5], [0.0, 0.5], ("push", "position 0.5", "force [N]", "NaN")),
        (["tendon", "push"], [0.005, 0.0], [2.0, 0.5], ("tendon", "effort 2", "length [m]")),
        (["tendon", "push"], [0.02, 0.0], [0.0, 0.5], ("tendon", "0.02 m", "0 to 0.01 m")),
        (["tendon", "push"], [0.005, 0.0], [0.0, -0.6], ("push", "-0.6 N", "-0.5 to 1 N")),
        (["tendon", "push"], [NAN, NAN], [NAN, 0.5], ("tendon", "nan m")),
        (["tendon", "push"], [0.005, NAN], [NAN, NAN], ("push", "nan N")),
        (["tendon"], [0.005], [], ("'push'", "missing", "tendon, push")),
        (["tendon", "pull"], [0.005, 0.0], [0.0, 0.5], ("'pull'", "tendon, push")),
        (["tendon", "push", "slide"], [0.005, 0.0, 0.0], [0.0, 0.5, 0.0], ("'slide'", "tendon, push")),
        (["tendon", "push"], [0.005], [0.0, 0.5], ("1 positions", "2 joints")),
    ],
)
def test_a_command_of_the_wrong_kind_is_refused(make, tmp_path, joints, positions, effort, wrong) -> None:
    graph = make(scene=finger(tmp_path), set=f"'{MIXED}'", timeout=60.0).start()
    graph.choose(ControlMode.TELEOP)
    send(graph, joints, positions, effort)
    told = graph.status(rejected_commands=1)
    assert_names(told.last_rejection, *wrong)
    assert state(graph)["tendon"][0] == 0.0


def test_lengths_are_positions_and_forces_are_efforts(make, tmp_path) -> None:
    graph = make(scene=finger(tmp_path), set=f"'{MIXED}'", timeout=60.0, range_time=0.1).start()
    told = graph.next(names.SIM_STATUS)
    assert (list(told.joint_names), list(told.units)) == (["tendon", "push"], ["m", "N"])
    assert list(told.speed) == pytest.approx([0.1, 15.0])
    graph.choose(ControlMode.TELEOP)
    send(graph, ["push", "tendon"], [NAN, 0.002], [0.3, 0.0])  # in any order
    graph.next(names.SIM_JOINT_STATES, lambda m: m.effort[1] == pytest.approx(0.3))
    graph.spin(0.5)
    now = state(graph)
    assert now["tendon"][0] == pytest.approx(0.002)
    assert now["push"][1] == pytest.approx(0.3)
    assert now["push"][0] > 1e-4  # where the force has moved its set
    labels = graph.next(names.COMMANDS).layout.dim[1].label
    assert labels.split()[-3:] == ["tendon", "push", "slide"]
    assert graph.call(names.SIM_RESET, Trigger.Request()).success
    assert state(graph)["push"][1] == 0.0


def test_every_link_of_the_description_is_on_tf(make, tmp_path) -> None:
    words = 'effector={set="tip"}'
    graph = make(scene=finger(tmp_path), set=f"'{MIXED};{words}'", timeout=60.0, range_time=0.1).start()
    graph.listen(names.TF)
    graph.choose(ControlMode.TELEOP)
    send(graph, ["tendon", "push"], [0.004, 0.0], [0.0, 0.1])
    moved = graph.next(
        names.TF, lambda m: any(t.transform.translation.x == pytest.approx(0.004) for t in m.transforms)
    )
    for topic in (names.TF_STATIC, names.ROBOT_DESCRIPTION):
        graph.wait(lambda t=topic: graph.heard[t], f"a message on {topic}")
    described = ET.fromstring(graph.heard[names.ROBOT_DESCRIPTION][0].data)
    frames = {t.child_frame_id for t in [*moved.transforms, *graph.heard[names.TF_STATIC][0].transforms]}
    assert (
        frames
        == {link.get("name") for link in described.iter("link")}
        == {"base_link", "tendon_end", "effector"}
    )


def test_goals_of_an_action_are_lengths_and_forces(make, tmp_path) -> None:
    graph = make(scene=finger(tmp_path), set=f"'{MIXED}'", timeout=60.0, range_time=0.2).start()
    goals = Goals(graph.ear, "sim/follow_joint_trajectory", graph.wait)
    graph.choose(ControlMode.TELEOP)
    asked = goal((0.004, 0.0), seconds=0.3, source=SOURCE, joints=("tendon", "push"))
    asked.trajectory.points[0].effort = [0.0, 0.4]
    status, code, why = goals.end(goals.send(asked))
    assert (status, code, why) == (GoalStatus.STATUS_SUCCEEDED, 0, "")
    now = state(graph)
    assert now["tendon"][0] == pytest.approx(0.004, abs=1e-4)
    assert now["push"][1] == pytest.approx(0.4, abs=0.01)
    told = goals.feedback[-1]
    assert list(told.joint_names) == ["tendon", "push"]
    assert (told.desired.effort[1], told.desired.positions[1]) == (pytest.approx(0.4, abs=0.1), 0.0)
    assert told.actual.positions[0] == pytest.approx(0.004, abs=1e-3)
    energy = json.loads(graph.next(names.SIM_FIGURES).data)["energy"]
    assert energy["work"] > 1e-4  # the force times its way, not the way times the force's rise
    assert not energy["grew"]
    asked.path_tolerance = [JointTolerance(name="servo_0", position=0.1)]
    status, _, why = goals.end(goals.send(asked))
    assert status == GoalStatus.STATUS_ABORTED
    assert_names(why, "path_tolerance", "'servo_0'", "tendon, push")


def test_a_goal_moves_a_servo_a_cable_a_chamber_and_a_force(make, tmp_path) -> None:
    graph = make(scene=mixed(tmp_path), timeout=60.0, range_time=0.2).start()
    joints = ("push", "air", "tendon", "servo_0")  # in any order
    goals = Goals(graph.ear, "sim/follow_joint_trajectory", graph.wait)
    graph.choose(ControlMode.TELEOP)
    asked = goal((0.0, 0.0, 0.004, 0.2), seconds=0.3, source=SOURCE, joints=joints)
    asked.trajectory.points[0].effort = [0.1, 2e3, 0.0, 0.0]
    assert goals.end(goals.send(asked))[:2] == (GoalStatus.STATUS_SUCCEEDED, 0)
    now = state(graph)
    assert list(now) == ["servo_0", "tendon", "air", "push", "slide"]
    assert now["servo_0"][0] == pytest.approx(0.2, abs=0.011)
    assert now["tendon"][0] == pytest.approx(0.004, abs=1.1e-4)
    assert [now[n][1] for n in ("air", "push")] == pytest.approx([2e3, 0.1], rel=0.05)
    assert now["air"][0] > 1e-7 and now["tendon"][1] > 0.0
