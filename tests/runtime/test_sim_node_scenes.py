"""The simulator in a graph with other scenes than the tripod alone, and what its status tells of their steps."""

import json
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from shape_msgs.msg import SolidPrimitive
from tripod_msgs.msg import ControlMode, SimStatus

from tests.messages import assert_names, line_naming, lines_naming
from tests.sim.beams import bar_scene
from tests.sim.test_dead_pressure import bar
from tripod_graph import names
from tripod_sim import Simulation, load_scene

pytestmark = pytest.mark.ros


def test_silicone_works_without_servos(make) -> None:
    graph = make(scene="silicone").start()
    status = graph.status(state=SimStatus.RUNNING)
    assert status.scene == "silicone"
    first = graph.next(names.BODY_STATE)
    graph.next(names.BODY_STATE, lambda m: m.step > first.step and m.positions != first.positions)
    graph.choose(ControlMode.TELEOP)
    graph.command([0, 0, 0])
    status = graph.status(rejected_commands=1)
    assert_names(status.last_rejection, "scene 'silicone'", "no actuators")
    graph.listen(names.COMPLIANCE)
    graph.wait(graph.node._compliance.get_subscription_count, "the listener")
    graph.next(names.SIM_STATUS, lambda s: s.step > status.step + 100)
    for topic in (names.SIM_JOINT_STATES, names.EFFECTOR_POSE, names.COMPLIANCE):
        assert not graph.heard[topic]
    assert graph.status().state == SimStatus.RUNNING
    assert graph.reset().success


@pytest.mark.parametrize("scene", ["pendulum", "cloth"])
def test_a_body_of_springs_is_shown_by_its_surface(make, scene: str) -> None:
    graph = make(scene=scene, set="springs.nodes=5").start()
    mesh = graph.wait(lambda: graph.heard[names.MESH], "the mesh")[0]
    body = graph.next(names.BODY_STATE)
    graph.next(names.BODY_STATE, lambda m: m.step > body.step and m.positions != body.positions)
    assert len(body.positions) == 3 * len(mesh.vertices)
    assert body.topology_id == graph.node._physics.simulation.skin.topology_id
    assert max(max(t.vertex_indices) for t in mesh.triangles) < len(mesh.vertices)
    graph.listen(names.MARKERS)
    assert len(graph.next(names.MARKERS).markers[0].points) == 3 * len(mesh.triangles)
    assert graph.reset().success


def test_maze_and_ball_are_told_once_and_shown_by_markers(make) -> None:
    graph = make(scene="maze", set="mesh.level=1;maze.source=first").start()
    shape = graph.wait(lambda: graph.heard[names.BALL_SHAPE], "the ball")[0]
    assert (shape.type, list(shape.dimensions)) == (SolidPrimitive.SPHERE, [0.002])
    maze = graph.wait(lambda: graph.heard[names.MAZE_MESH], "the maze")[0]
    z = [p.z for p in maze.vertices]
    assert (min(z), max(z)) == pytest.approx((0.006, 0.012))  # above the centre of the disc
    assert len(graph.heard[names.MAZE_MESH]) == len(graph.heard[names.BALL_SHAPE]) == 1
    graph.listen(names.MARKERS)
    _, plate, ball = graph.next(names.MARKERS).markers
    assert len(plate.points) == 3 * len(maze.triangles)
    assert plate.pose.position.z < ball.pose.position.z < plate.pose.position.z + max(z)


def test_what_users_should_know_of_their_mesh_is_in_the_status(make, tmp_path: Path) -> None:
    scene = bar_scene(tmp_path, (4, 1, 1), "h20")
    (note,) = Simulation(load_scene(scene)).notes
    assert note in make(scene=str(scene)).start().next(names.SIM_STATUS).message


def test_a_note_that_comes_while_the_scene_runs_is_in_status_figures_and_log(
    make, tmp_path: Path, capfd
) -> None:
    graph = make(scene=str(bar(tmp_path, 'set = "top"\npressure = 600.0'))).start()
    said = ("load.0.pressure", "dead pressure")
    graph.next(names.SIM_STATUS, lambda status: lines_naming(status.message, *said))
    graph.next(
        names.SIM_FIGURES, lambda m: any(lines_naming(note, *said) for note in json.loads(m.data)["notes"])
    )
    line_naming(capfd.readouterr().err, *said)


def test_without_maze_and_ball_that_is_what_is_told(make) -> None:
    graph = make().start()
    assert not graph.wait(lambda: graph.heard[names.MAZE_MESH], "the maze")[0].vertices
    assert not graph.wait(lambda: graph.heard[names.BALL_SHAPE], "the ball")[0].dimensions


def test_an_unstable_scheme_is_told_in_the_status_and_stops_at_the_last_good_state(make) -> None:
    graph = make(scene="pendulum", set="springs.node_mass=0.005;inertia.substeps=off").start()
    status = graph.status(state=SimStatus.FAILED)
    assert_names(status.message, "unstable", "step", "sim/reset")
    assert graph.node.failure in status.message
    assert graph.reset().success


def test_the_estimated_error_of_the_steps_and_their_parts_are_in_the_status(make) -> None:
    graph = make(set="inertia.scheme=bdf2;dt=auto;time_error={tolerance=1e-7,estimate='global'}").start()
    status = graph.next(names.SIM_STATUS, lambda s: s.step > 5)
    assert status.parts >= 1
    assert 0 <= status.effector_time_error <= status.time_error < 1e-3


def test_an_estimate_that_nobody_asks_for_is_told_as_unknown(make) -> None:
    status = make().start().next(names.SIM_STATUS, lambda s: s.step > 5)
    assert (status.time_error, status.effector_time_error, status.parts) == (-1.0, -1.0, 1)
    assert (status.effector_mesh_error, status.effector_error) == (-1.0, -1.0)


def test_the_estimated_error_of_the_mesh_is_in_the_status_and_with_that_of_the_steps_a_bound(make) -> None:
    words = ["mesh.level=1", "clamp.stiffness=1.4e10", "mesh_error={}"]
    estimate = Simulation(load_scene("tripod", words)).mesh_error()
    assert estimate
    steps = ["inertia.scheme=bdf2", "time_error={}"]
    graph = make(set=";".join([*words, *steps])).start()
    graph.listen(names.COMPLIANCE)
    status = graph.next(names.SIM_STATUS, lambda s: s.step > 5)
    assert status.effector_mesh_error == pytest.approx(
        estimate.distance, rel=0.05
    )  # it stands where it began
    assert status.effector_mesh_error > 1e-5
    assert status.effector_time_error >= 0
    assert status.effector_error <= status.effector_mesh_error + status.effector_time_error + 1e-12
    assert status.effector_error >= status.effector_mesh_error - status.effector_time_error - 1e-12
    assert graph.next(names.COMPLIANCE).effector_mesh_error == pytest.approx(estimate.distance, rel=0.05)


def test_the_error_of_the_mesh_alone_bounds_what_is_known(make) -> None:
    graph = make(set="mesh.level=1;clamp.stiffness=1.4e10;mesh_error={}").start()
    status = graph.next(names.SIM_STATUS, lambda s: s.step > 5)
    assert status.effector_time_error == -1.0
    assert status.effector_error == status.effector_mesh_error > 1e-5


def test_an_effector_without_servos_has_a_compliance_of_its_own(make) -> None:
    graph = make(scene="silicone", set="mesh.level=1;effector={}").start()
    graph.listen(names.COMPLIANCE)
    compliance = graph.next(names.COMPLIANCE)
    assert list(compliance.joint_names) == []
    assert len(compliance.angles) == len(compliance.efforts) == 0
    assert len(compliance.w) == 36
    assert graph.next(names.EFFECTOR_POSE).header.frame_id == "world"
