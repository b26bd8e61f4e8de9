import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from tripod_msgs.msg import IkStatus

from tests.ik.ik_graph import WORKING, standing_at, start_alone
from tests.messages import assert_names
from tests.scenes import SHARP
from tripod_graph import names
from tripod_ik.solve_once import solve_once
from tripod_sim import load_scene
from tripod_sim.mesh_error.chord import NEAR
from tripod_sim.scene.file import scene_to_toml

pytestmark = pytest.mark.ros


def test_without_a_simulator_in_the_graph_it_runs_the_model_itself(graph):
    start_alone(graph, scene="tripod")
    sim = graph.sim
    first = graph.wait_state(IkStatus.TRACKING, "no target yet")
    assert list(first.command) == pytest.approx(WORKING, abs=1e-9)
    graph.wait(lambda: len(sim.commands) > 5)
    assert sim.angles == pytest.approx(WORKING, abs=1e-6)
    start = first.effector
    sim.say_target((start.x + 0.004, start.y - 0.002, start.z + 0.002))
    graph.wait(lambda: sim.states[-1].message == "" and sim.states[-1].error < 1e-6)
    assert sim.states[-1].effector.x == pytest.approx(start.x + 0.004, abs=1e-6)
    assert {s.effector_mesh_error for s in sim.states} == {-1.0}
    assert np.ptp(sim.angles) > 0.1
    sim.diagnostics.clear()
    (report,) = graph.wait(lambda: sim.diagnostics and sim.diagnostics[-1].status)
    assert {pair.key: pair.value for pair in report.values}["model"] == "own"


def test_an_answer_tells_the_error_of_the_mesh_where_the_scene_asks_for_it_as_tripod_ik_does(graph, tmp_path):
    scene = load_scene(SHARP, ["mesh.level=1", "clamp.stiffness=1.4e10", "mesh_error={}"])
    path = tmp_path / "scene.toml"
    path.write_text(scene_to_toml(scene), encoding="utf-8")
    start_alone(graph, scene=str(path))
    sim = graph.sim
    first = graph.wait(lambda: next((s for s in sim.states if s.effector_mesh_error > 0), None))
    target = [0.004, -0.002, -0.006]
    wanted = solve_once(scene, target, slide=0.035)["mesh_error"]["distance"]
    assert first.effector_mesh_error > wanted + 20 * NEAR  # of the pose in which it began
    sim.say_target(target)
    graph.wait(lambda: sim.states[-1].message == "" and sim.states[-1].error < 1e-6)
    graph.wait(lambda: abs(sim.states[-1].effector_mesh_error - wanted) < NEAR)


def start_parked(graph, **parameters):
    """Start the node where the robot is flat, and its servos allow no angle above 0."""
    graph.sim.follower = standing_at(np.zeros(3))
    start_alone(graph, scene=SHARP, set="servos.angle_max=0", slide=0.0, angle_max=0.0, **parameters)
    graph.wait_state(IkStatus.TRACKING, "no target yet")
    graph.sim.say_target([0.005, 0.0, -0.006])


def test_from_the_parked_pose_it_says_which_torque_a_closer_pose_needs_as_the_command_does(graph):
    """A slide of 0 stretches the strips: the pose at the target needs nearly three times the torque of the servos."""
    start_parked(graph)
    once = solve_once(
        load_scene(SHARP, ["servos.angle_max=0"]), [0.005, 0.0, -0.006], slide=0.0, start=[0.0] * 3
    )
    assert not once["reached"]
    assert_names(once["reason"], "torque", "limit 0.3 N m")
    status = graph.wait_state(IkStatus.CLOSEST, *once["reason"].split()[-4:])
    assert status.message == f"closest pose: {once['reason']}"
    assert status.residual == pytest.approx(once["error"], abs=1e-6)


def test_from_the_parked_pose_it_goes_where_the_command_does(graph):
    start_parked(graph, torque_max=float("inf"))
    once = solve_once(
        load_scene(SHARP, ["servos.angle_max=0"]), [0.005, 0.0, -0.006], slide=0.0, start=[0.0] * 3, torque_max=np.inf
    )  # fmt: skip
    assert once["reached"]
    assert max(once["torques"], key=abs) < -0.3
    sim = graph.sim
    graph.wait(lambda: sim.states[-1].error < 1e-6 and sim.states[-1].target.x == 0.005)
    assert sim.angles == pytest.approx(once["angles"], abs=1e-4)


def test_its_own_model_needs_to_know_where_the_robot_is(graph):
    start_alone(graph)
    graph.sim.joints.publish = lambda message: None
    graph.wait_state(IkStatus.STALE, "this node", names.ROBOT_JOINT_STATES, "driver")
    graph.hear(1)  # what was on its way
    graph.sim.commands.clear()
    graph.hear(2)
    assert not graph.sim.commands


def test_a_scene_that_has_no_inverse_is_named(graph):
    start_alone(graph, scene="silicone")
    graph.wait_state(IkStatus.STALE, "no model", "'silicone'", "no servos", "no effector")
    assert not graph.sim.commands
