"""The simulator in a graph: what it publishes, and which commands it follows."""

import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from rclpy.duration import Duration
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import ControlMode, Field, RobotStatus, SimStatus

from tests.decisions import SOURCE
from tests.messages import assert_names, lines_naming
from tests.runtime.sim_graph import DEADLINE, PUBLISHED, QUIET
from tripod_graph import names
from tripod_graph.qos import LATCHED, RELIABLE
from tripod_runtime import messages, transforms
from tripod_runtime.notices import notices
from tripod_sim import Simulation, load_scene
from tripod_sim.fields import MESH_ERROR
from tripod_sim.integrators.report import StepReport

pytestmark = pytest.mark.ros

NAN, INF = float("nan"), float("inf")
MESH = Simulation(load_scene("tripod", ["mesh.level=1"])).mesh


def times_of(heard: list[Any]) -> np.ndarray:
    """Return the stamps of messages [ns]."""
    return np.array([m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in heard])


def history(heard: list[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the times [s], from that of the first on, and the joints of joint states."""
    times = times_of(heard)
    return 1e-9 * (times - times[0]), np.array([m.position for m in heard])


def test_its_frames_are_on_tf_with_the_prefix_asked_for(make) -> None:
    graph = make(frame_prefix="left/", scene="maze").start()
    graph.listen(names.TF)
    for topic in (names.TF_STATIC, names.ROBOT_DESCRIPTION):
        graph.wait(lambda topic=topic: graph.heard[topic], topic)
    fixed = {t.child_frame_id: t for t in graph.heard[names.TF_STATIC][0].transforms}
    assert set(fixed) == {"left/base_link", "left/plate"}
    assert fixed["left/base_link"].header.frame_id == "world"
    moving = {t.child_frame_id: t for t in graph.next(names.TF).transforms}
    arms = {f"left/{kind}_{i}" for kind in ("carriage", "arm") for i in range(3)}
    assert set(moving) == arms | {"left/effector", "left/ball"}
    pose, t = graph.next(names.EFFECTOR_POSE).pose, moving["left/effector"].transform
    assert abs(t.translation.z - pose.position.z) < 1e-3
    assert moving["left/carriage_0"].transform.translation.x == pytest.approx(0.06 - 0.035)
    assert '<robot name="maze">' in graph.heard[names.ROBOT_DESCRIPTION][0].data


def test_it_publishes_every_topic_of_its_table_with_the_right_sizes(make) -> None:
    began = time.time()
    graph = make().start()
    for topic in QUIET:
        graph.listen(topic)
    for topic, messages_heard in graph.heard.items():
        graph.wait(lambda heard=messages_heard: heard, topic)
    own = graph.node.get_namespace()
    found = dict(graph.ear.get_publisher_names_and_types_by_node("sim", own))
    expected = {t if t.startswith("/") else f"{own}/{t}" for t in PUBLISHED}
    shown = {topic for topic in found if "/_" not in topic}  # the topics of an action are hidden
    silent = {names.field_topic(name) for name in graph.node._physics.simulation.field_names}
    expected |= {f"{own}/{topic}" for topic in (*silent, names.APPLIED_FORCES)}
    assert shown == expected | {"/rosout", "/parameter_events"}

    count = len(MESH.nodes)
    body, status = graph.next(names.BODY_STATE), graph.next(names.SIM_STATUS)
    assert len(body.positions) == 3 * count
    assert body.topology_id == MESH.topology_id
    assert np.abs(np.reshape(body.positions, (-1, 3)) - MESH.nodes).max() < 0.01
    mesh = graph.heard[names.MESH][0]
    assert len(mesh.vertices) == count
    assert len(mesh.triangles) == len(MESH.surface)
    joints = graph.next(names.SIM_JOINT_STATES)
    assert list(joints.name) == [*names.SERVOS, names.SLIDE]
    assert len(joints.position) == len(joints.effort) == 4
    assert abs(graph.next(names.EFFECTOR_POSE).pose.position.z) < 0.01
    compliance = graph.next(names.COMPLIANCE)
    w = np.reshape(compliance.w, (9, 9))
    np.testing.assert_allclose(w, w.T, rtol=0, atol=1e-12 * np.abs(w).max())
    assert np.linalg.eigvalsh(w).min() > 0
    cloud, (marker,) = graph.next(names.POINT_CLOUD), graph.next(names.MARKERS).markers
    assert cloud.width == count
    assert len(marker.points) == 3 * len(MESH.surface)
    for header in (m.header for m in (body, status, joints, compliance, cloud, marker)):
        assert header.frame_id == "world"
        assert began - 1 < header.stamp.sec <= time.time()

    assert status.scene == "tripod"
    assert status.dt == 0.002
    assert status.state == SimStatus.PARKED
    assert status.message == status.last_rejection == ""
    assert status.time == pytest.approx(status.step * 0.002)
    later = graph.next(names.SIM_STATUS, lambda s: s.step > status.step + 20)
    assert later.step_time_p99 >= later.step_time_median > 0
    assert later.capacity == pytest.approx(0.002 / later.step_time_median)
    assert later.real_time_factor > 0
    assert later.strain_energy > 0
    diagnostics = graph.next(names.DIAGNOSTICS, lambda m: m.status[0].name == f"{own}/sim").status[0]
    values = {pair.key: pair.value for pair in diagnostics.values}
    assert values["control mode"] == "STOP"
    assert [float(values[key]) >= 0 for key in ("real-time factor", "median step [s]", "missed")] == [
        True
    ] * 3
    assert diagnostics.level in (b"\x00", b"\x01")  # a busy machine may be slower than time


def test_markers_cloud_and_compliance_are_made_only_while_someone_listens(make, monkeypatch) -> None:
    graph = make(body_rate=100.0).start()
    made = dict.fromkeys(QUIET, 0)

    def counted(topic: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def count(*arguments: Any) -> Any:
            made[topic] += 1
            return function(*arguments)

        return count

    physics = graph.node._physics
    monkeypatch.setattr(
        graph.node._topics.drawn,
        "serialised",
        counted(names.MARKERS, graph.node._topics.drawn.serialised),
    )
    monkeypatch.setattr(messages, "cloud_message", counted(names.POINT_CLOUD, messages.cloud_message))
    frames = counted(names.TF, transforms.arm_frames)
    monkeypatch.setattr(transforms, "arm_frames", frames)
    field = names.field_topic("von_mises")
    monkeypatch.setattr(messages, "field_message", counted(field, messages.field_message))
    forces = counted(names.FORCES, physics._simulation.forces)
    monkeypatch.setattr(physics._simulation, "forces", forces)
    compliance = counted(names.COMPLIANCE, physics._simulation.compliance)
    monkeypatch.setattr(physics._simulation, "compliance", compliance)

    def unheard() -> dict[str, int]:
        """Return what is made while ten bodies and three statuses are published."""
        before = dict(made)
        for topic, count in ((names.BODY_STATE, 10), (names.SIM_STATUS, 3)):
            heard = graph.heard[topic]
            heard.clear()
            graph.wait(lambda heard=heard, count=count: len(heard) >= count, topic)
        return {topic: made[topic] - before[topic] for topic in made}

    assert unheard() == dict.fromkeys(QUIET, 0)
    ears = [graph.listen(topic) for topic in QUIET]
    for topic in QUIET:
        graph.next(topic)
    before = dict(made)
    graph.wait(lambda: all(made[topic] > before[topic] for topic in QUIET), "more of what is heard")
    for ear in ears:
        graph.ear.destroy_subscription(ear)
    node, topics = graph.node, graph.node._topics
    for publisher in (
        topics.markers,
        topics.cloud,
        topics.fields["von_mises"],
        topics.forces,
        node._compliance,
    ):
        graph.wait(lambda p=publisher: p.get_subscription_count() == 0, "the end of the subscription")
    graph.wait(
        lambda: not (physics.want_compliance or physics.wanted.forces), "the end of compliances and forces"
    )
    assert unheard() == dict.fromkeys(QUIET, 0)


def test_fields_and_forces_are_those_of_the_simulation(make) -> None:
    graph = make().start()
    simulation, stress = graph.node._physics.simulation, names.field_topic("von_mises")
    graph.listen(stress)
    every = graph.listen_to_all(names.FORCES)
    field = graph.next(stress, lambda f: f.step > 10)
    body = graph.next(names.BODY_STATE)
    assert (field.unit, field.topology_id, field.header.frame_id) == ("Pa", body.topology_id, "world")
    forces = graph.wait(lambda: every and every[-1], "forces")
    assert list(forces.names) == ["reaction", "reaction moment", "servo torque", "weight"]
    assert list(forces.units) == ["N", "N m", "N m", "N"]
    assert list(forces.counts) == [3, 3, 3, 1]
    assert len(forces.points) == len(forces.vectors) == 3 * 10
    graph.pause(True)
    step = graph.node._physics.latest.step
    field = graph.next(stress, lambda f: f.step == step)
    expected = simulation.fields().values(["von_mises"], simulation.positions)["von_mises"]
    np.testing.assert_allclose(field.values, expected, rtol=1e-6)
    assert field.time == pytest.approx(simulation.state.time)
    graph.call(names.SIM_STEP, Trigger.Request())
    told = graph.wait(lambda: next((f for f in every if f.step == step + 1), None), "forces of the step")
    expected = simulation.forces()
    np.testing.assert_array_equal(
        np.reshape(told.vectors, (-1, 3)), np.concatenate([f.vectors for f in expected])
    )
    np.testing.assert_array_equal(
        np.reshape(told.points, (-1, 3)), np.concatenate([f.points for f in expected])
    )


def test_the_error_of_the_mesh_is_a_field_where_the_scene_estimates_it(make) -> None:
    assert MESH_ERROR not in Simulation(load_scene("tripod", ["mesh.level=1"])).field_names
    graph = make(set="mesh.level=1; mesh_error={}").start()
    simulation, topic = graph.node._physics.simulation, names.field_topic(MESH_ERROR)
    found: list[Any] = []
    original = simulation.mesh_error_field
    simulation.mesh_error_field = lambda: found.append(original()) or found[-1]
    graph.listen(names.FORCES)
    graph.next(names.FORCES, lambda f: f.step > 10)
    assert not found, "nobody listens"
    every: list[Any] = []
    ear = graph.ear.create_subscription(Field, topic, every.append, RELIABLE)
    graph.wait(lambda: len(every) > 2, "the error of the mesh")
    graph.pause(True)
    step = graph.node._physics.latest.step
    graph.step()
    graph.wait(lambda: every[-1].step == step + 1, "the error of the step")
    expected = original()
    assert np.isfinite(expected).any()
    np.testing.assert_allclose(every[-1].values, expected, rtol=1e-6)
    assert (every[-1].unit, len(every[-1].values)) == ("m", len(simulation.skin.nodes))
    graph.ear.destroy_subscription(ear)
    graph.wait(lambda: not graph.node._physics.wanted.mesh_error, "the end of the subscription")
    graph.pause(False)
    found.clear()
    graph.next(names.FORCES, lambda f: f.step > step + 100)
    assert not found


def test_forces_chosen_while_paused_come_without_a_step(make) -> None:
    graph = make().start()
    graph.listen(names.SIM_FIGURES)  # somebody looks at the run
    graph.wait(lambda: graph.node._physics.watched, "the one who looks")
    step = graph.node._physics.latest.step
    graph.next(names.BODY_STATE, lambda b: b.step > step + 2)
    graph.pause(True)
    step = graph.node._physics.latest.step
    every = graph.listen_to_all(names.FORCES)
    told = graph.wait(lambda: every and every[-1], "forces")
    assert (told.step, graph.node._physics.latest.step) == (step, step)
    expected = np.concatenate([f.vectors for f in graph.node._physics.simulation.forces()])
    np.testing.assert_array_equal(np.reshape(told.vectors, (-1, 3)), expected)
    late = graph.listen_to_all(names.FORCES)
    graph.wait(lambda: late, "forces for who listens later")
    assert late[0].step == step


def test_it_begins_in_stop_and_ignores_commands(make) -> None:
    graph = make().start()
    graph.command([-0.5, -0.5, -0.5])
    graph.wait(lambda: graph.status().authority.ignored_commands == 1, "the ignored command")
    status = graph.status()
    assert_names(status.authority.last_ignored_command, "STOP", "ignored", f"{SOURCE!r}")
    assert status.message == status.authority.last_ignored_command
    assert status.authority.ignored_sources == [SOURCE]
    assert status.rejected_commands == 0
    assert status.state == SimStatus.PARKED
    assert graph.joints() == [0, 0, 0, 0]


def test_it_follows_a_command_within_its_limits(make) -> None:
    """At 2 rad/s, 0.8 rad take 0.4 s and more; one step moves no more than 0.1 s of it, however late it comes."""
    graph = make(angle_speed=2.0, slide_speed=0.05, pose_rate=1000.0, timeout=5.0).start()
    graph.choose(ControlMode.TELEOP)
    heard = graph.listen_to_all(names.SIM_JOINT_STATES)
    graph.wait(lambda: heard, "the joints")
    began = time.monotonic()
    target = [-0.8, -0.4, 0.2, 0.01]
    graph.command(target[::-1], [*names.SERVOS, names.SLIDE][::-1])
    graph.wait(lambda: list(heard[-1].position) == pytest.approx(target, abs=1e-9), "the target")
    assert time.monotonic() - began >= 0.4
    status = graph.status(state=SimStatus.RUNNING)
    assert status.rejected_commands == 0
    path = np.array([m.position for m in heard])
    moves = np.diff(path, axis=0) * np.sign(target)
    assert (moves >= 0).all()
    assert (moves[:, :3].max(axis=0) <= 0.2 + 1e-9).all()  # so it takes four steps at least
    assert (
        graph.next(names.EFFECTOR_POSE).pose.position.x > 0.005
    )  # and the body follows the servo that bends most


def test_a_trajectory_takes_the_time_that_it_says(make) -> None:
    """Joints move by the time of the steps here, whatever this machine is busy with."""
    graph = make(publish_clock=True, pose_rate=1000.0, timeout=5.0).start()
    graph.choose(ControlMode.TELEOP)
    heard = graph.listen_to_all(names.SIM_JOINT_STATES)
    graph.wait(lambda: heard, "the joints")
    graph.command([-0.3, -0.3, -0.3], seconds=0.6)
    graph.wait(lambda: heard[-1].position[0] <= -0.3 + 1e-9, "the target")
    times, path = history(heard)
    begin = times[np.flatnonzero(path[:, 0] == 0)[-1]]
    assert len(path) > 300
    expected = -0.5 * np.clip(times - begin, 0.0, 0.6)
    np.testing.assert_allclose(path[:, :3], np.tile(expected[:, None], 3), rtol=0, atol=1e-6)


def test_bad_commands_are_refused_counted_and_reported_and_move_nothing(make) -> None:
    graph = make().start()
    graph.choose(ControlMode.TELEOP)
    own, slide = names.SERVOS, (*names.SERVOS, names.SLIDE)
    empty = JointTrajectory(joint_names=list(own))
    empty.header.frame_id = SOURCE
    bad: list[tuple[Callable[[], None], tuple[str, ...]]] = [
        (lambda: graph.command([0, NAN, 0]), ("point 0", "servo_1", "nan rad", "-2.1 to 0.6 rad")),
        (lambda: graph.command([0, 0, INF]), ("point 0", "servo_2", "inf rad")),
        (lambda: graph.command([0.7, 0, 0]), ("point 0", "servo_0", "0.7 rad", "-2.1 to 0.6 rad")),
        (lambda: graph.command([-0.1] * 3 + [0.05], slide), ("point 0", "slide", "0.05 m", "0 to 0.04 m")),
        (lambda: graph.command([-0.1] * 3, ["servo_0", "servo_1", "elbow"]), ("'elbow'", "joints: servo_0,")),
        (lambda: graph.command([-0.1] * 3, ["servo_0", "servo_1", "servo_1"]), ("'servo_1'", "twice")),
        (lambda: graph.command([-0.1] * 2, ["servo_0", "servo_1"]), ("'servo_2'", "missing")),
        (lambda: graph.command([-0.1] * 4), ("point 0", "4 positions", "3 joints")),
        (lambda: graph.command([-0.1] * 3, seconds=-1), ("time of point 0", "-1 s")),
        (lambda: graph.trajectory.publish(empty), ("0 points", "0 times", "at least one")),
        (lambda: graph.choose(77), ("control mode 77", "0 STOP, 1 TELEOP, 2 IK, 3 REPLAY")),
    ]  # fmt: skip
    for count, (send, named) in enumerate(bad, start=1):
        send()
        status = graph.status(rejected_commands=count)
        assert_names(status.last_rejection, *named)
        assert graph.joints() == [0, 0, 0, 0]
    assert graph.node._authority.mode == ControlMode.TELEOP
    graph.command([-0.1] * 3)
    graph.wait(lambda: graph.joints()[0] < -0.05, "a good command after the bad")
    assert graph.status().rejected_commands == len(bad)


def test_with_a_driver_in_the_graph_it_goes_where_the_driver_sends_and_says_so(make) -> None:
    graph = make(timeout=60.0).start()
    graph.choose(ControlMode.TELEOP)
    driver = graph.ear.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)
    status = RobotStatus(lower=[-2.1] * 3, upper=[0.0, 0.0, 0.3], speed=[4.0] * 3)
    timer = graph.ear.create_timer(0.1, lambda: driver.publish(status))
    graph.wait(lambda: list(graph.status().upper) == [0.0, 0.0, 0.3], "the driver's range")
    graph.command([0.5, 0.5, 0.5])
    graph.wait(lambda: graph.joints()[2] > 0.3 - 1e-6, "the end of the range")
    assert graph.joints()[:3] == pytest.approx([0.0, 0.0, 0.3], abs=1e-6)
    told = ("servo_0", "0.500 rad", "-2.100 to 0.000 rad")
    graph.wait(lambda: lines_naming(graph.status().message, *told), "what is cut, at the end of the ramp")
    graph.ear.destroy_timer(timer)  # the driver is gone: own limits
    graph.wait(lambda: graph.joints()[0] > 0.4, "the own range")
    assert list(graph.status().upper) == [0.6] * 3


def test_a_trajectory_begins_where_the_driver_lets_the_joints_be(make) -> None:
    graph = make(timeout=60.0).start()
    graph.choose(ControlMode.TELEOP)
    driver = graph.ear.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)
    status = RobotStatus(lower=[-2.1] * 3, upper=[0.0, 0.0, 0.3], speed=[4.0] * 3)
    graph.ear.create_timer(0.1, lambda: driver.publish(status))
    graph.wait(lambda: list(graph.status().upper) == [0.0, 0.0, 0.3], "the driver's range")
    graph.command([0.5, 0.5, 0.5])
    graph.wait(lambda: lines_naming(graph.status().message, "servo_0", "0.000 rad"), "what is cut")
    graph.wait(lambda: graph.joints()[2] > 0.3 - 1e-6, "the end of the range")
    graph.command([-0.5, -0.5, -0.5], seconds=2.0)
    graph.wait(lambda: graph.joints()[2] < 0.1, "motion")
    joints = graph.joints()
    share = (0.3 - joints[2]) / 0.8
    assert joints[:2] == pytest.approx([-0.5 * share] * 2, abs=1e-6)


def test_stop_holds_where_the_joints_are(make) -> None:
    graph = make(angle_speed=0.1, timeout=60.0).start()  # it would take 15 s, much longer than to stop it
    graph.choose(ControlMode.TELEOP)
    graph.command([-1.5, -1.5, -1.5], seconds=1.0)
    graph.wait(lambda: graph.joints()[0] < -0.1, "motion")
    graph.choose(ControlMode.STOP)
    step = graph.status(state=SimStatus.HOLDING).step
    where = graph.joints()
    assert -1.4 < where[0] < -0.1
    graph.next(names.SIM_STATUS, lambda s: s.step > step + 100)
    assert graph.joints() == where


def test_silence_holds_and_then_parks(make) -> None:
    """By the time of the steps, too."""
    park = [-0.1, -0.1, -0.1, 0.005]
    limits = {"timeout": 0.15, "park_after": 1.5, "park": str(park), "angle_speed": 20.0}
    graph = make(publish_clock=True, pose_rate=1000.0, **limits).start()
    graph.choose(ControlMode.TELEOP)
    heard, statuses = (graph.listen_to_all(topic) for topic in (names.SIM_JOINT_STATES, names.SIM_STATUS))
    graph.wait(lambda: heard, "the joints")
    graph.command([-0.3, -0.2, 0.1])
    graph.wait(lambda: list(heard[-1].position) == pytest.approx(park, abs=1e-9), "the park position")
    graph.status(state=SimStatus.PARKED)
    times, path = history(heard)
    begin = np.flatnonzero((path == 0).all(axis=1))[-1]
    there = np.flatnonzero((np.abs(path - [-0.3, -0.2, 0.1, 0]) < 1e-9).all(axis=1))
    assert len(there) == there[-1] - there[0] + 1
    assert times[there[-1]] - times[begin] == pytest.approx(0.15 + 1.5, abs=0.01)
    seen = 1e-9 * (times_of(statuses) - times_of(heard)[0])
    inside = (times[there[0]] + 0.2 < seen) & (seen < times[there[-1]] - 0.05)
    held = [statuses[k] for k in np.flatnonzero(inside)]
    assert {(s.state, s.message) for s in held} == {(SimStatus.HOLDING, "")}


def test_the_newest_of_several_operators_decides_for_a_late_simulator(make) -> None:
    """The last word of each waits for the simulator, in any order: it must keep them all, not the last to arrive."""
    graph = make()
    operators = [graph.ear.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED) for _ in range(6)]
    for stamp, operator in enumerate(operators, start=1):
        newest = stamp == 3
        word = ControlMode(mode=ControlMode.IK if newest else ControlMode.TELEOP, source=str(stamp))
        word.header.stamp.sec = 1000 if newest else stamp
        operator.publish(word)

    def arrive() -> None:
        deadline = time.monotonic() + DEADLINE
        while not all(operator.get_subscription_count() for operator in operators):
            assert time.monotonic() < deadline, "the operators do not find the simulator"
            time.sleep(0.01)
        assert all(operator.wait_for_all_acked(Duration(seconds=DEADLINE)) for operator in operators)

    graph.start(arrive)
    graph.wait(lambda: graph.node._authority.mode == ControlMode.IK, "the newest word")
    step = graph.status().step
    graph.next(names.SIM_STATUS, lambda s: s.step > step + 100)
    assert graph.node._authority.mode == ControlMode.IK
    assert graph.status().rejected_commands == 0


def test_the_status_names_rigid_bodies_that_the_compliance_leaves_out() -> None:
    def words(*left_out: int) -> str:
        snapshot = SimpleNamespace(report=StepReport(), event="", left_out=left_out)
        return notices(cast(Any, snapshot))

    assert words() == ""
    assert_names(words(0, 2), "compliance", "without", "rigid.0, rigid.2")
