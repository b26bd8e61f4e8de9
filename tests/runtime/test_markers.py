"""The overwritten serialised markers against what they must decode to."""

from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from visualization_msgs.msg import Marker, MarkerArray

from tripod_runtime.markers import SceneMarkers
from tripod_runtime.realtime import RealTime
from tripod_sim import Simulation, load_scene
from tripod_sim.maze.board_mesh import board_mesh

FINGER = Path(__file__).parents[2] / "examples" / "tendon_finger.toml"
COARSE = ["mesh.element=h8_modes", "mesh.cells=[4,1,1]"]


def test_markers_decode_to_the_deformed_surface() -> None:
    simulation = Simulation(load_scene("tripod", ["mesh.level=1"]))
    surface = SceneMarkers(simulation.mesh)
    seen = []
    for angle in (0.0, -0.3):
        simulation.step(np.array([angle, 0, 0, 0]))
        snapshot = RealTime(simulation, lambda _: None).latest
        array = deserialize_message(surface.serialised(snapshot), MarkerArray)
        (marker,) = array.markers
        assert (marker.type, marker.ns, marker.header.frame_id) == (Marker.TRIANGLE_LIST, "body", "world")
        assert marker.header.stamp.sec * 10**9 + marker.header.stamp.nanosec == snapshot.stamp
        assert (marker.scale.x, marker.pose.orientation.w, marker.color.a) == (1.0, 1.0, 1.0)
        points = np.array([(p.x, p.y, p.z) for p in marker.points])
        np.testing.assert_array_equal(points, snapshot.positions[simulation.mesh.surface.ravel()])
        seen.append(points)
    assert np.abs(seen[1] - seen[0]).max() > 1e-3


def test_maze_and_ball_stand_where_effector_and_ball_are() -> None:
    simulation = Simulation(load_scene("maze", ["mesh.level=1", "maze.source=holes"]))
    assert simulation.plate
    maze = board_mesh(simulation.plate.board, simulation.plate.offset)
    markers = SceneMarkers(simulation.skin, maze, 0.002)
    joints = simulation.command
    for k in range(30):
        joints[0] += 0.01
        simulation.step(joints)
        if k % 29:
            continue
        snapshot = RealTime(simulation, lambda _: None).latest
        body, plate, ball = deserialize_message(markers.serialised(snapshot), MarkerArray).markers
        assert [m.ns for m in (body, plate, ball)] == ["body", "maze", "ball"]
        assert (plate.type, ball.type) == (Marker.TRIANGLE_LIST, Marker.SPHERE)
        for marker, pose in ((plate, snapshot.effector), (ball, snapshot.ball)):
            p, q = marker.pose.position, marker.pose.orientation
            assert pose
            assert [p.x, p.y, p.z] == pose.position.tolist()
            assert [q.x, q.y, q.z, q.w] == pose.quaternion.tolist()
            assert marker.header.frame_id == "world"
            assert marker.header.stamp.sec * 10**9 + marker.header.stamp.nanosec == snapshot.stamp
        points = np.array([(p.x, p.y, p.z) for p in plate.points])
        np.testing.assert_array_equal(points, maze.vertices[maze.triangles.ravel()])
        assert (ball.scale.x, ball.scale.y, ball.scale.z) == (0.004, 0.004, 0.004)
        points = np.array([(p.x, p.y, p.z) for p in body.points])
        np.testing.assert_array_equal(points, snapshot.positions[simulation.mesh.surface.ravel()])


def test_a_dot_stands_in_the_middle_of_each_watched_set() -> None:
    simulation = Simulation(
        load_scene("column", ["mesh.cells=[1, 1, 2]", 'marker=[{set="head"}, {set="foot"}]'])
    )
    markers = SceneMarkers(simulation.skin, sets=simulation.watched)
    for _ in range(20):
        simulation.step()
    snapshot = RealTime(simulation, lambda _: None).latest
    _, *dots = deserialize_message(markers.serialised(snapshot), MarkerArray).markers
    assert [dot.ns for dot in dots] == ["set head", "set foot"]
    for dot, place in zip(dots, simulation.markers, strict=True):
        p = dot.pose.position
        assert [p.x, p.y, p.z] == place.tolist()
        assert dot.scale.x == 0.02 * 0.1


def test_a_cable_is_a_line_through_its_points() -> None:
    simulation = Simulation(load_scene(str(FINGER), [*COARSE, "motion=off"]))
    markers = SceneMarkers(
        simulation.skin, sets=simulation.watched, cables=simulation.cables(simulation.positions)
    )
    seen = []
    for pulled in (0.0, 0.02):
        for _ in range(20):
            simulation.step(np.array([pulled, 0.0]))
        snapshot = RealTime(simulation, lambda _: None).latest
        serialised = markers.serialised(snapshot, simulation.cables(snapshot.positions))
        _, dot, line = deserialize_message(serialised, MarkerArray).markers
        assert (dot.ns, line.ns, line.type) == ("set tip", "cable tendon", Marker.LINE_STRIP)
        points = np.array([(p.x, p.y, p.z) for p in line.points])
        np.testing.assert_array_equal(points, simulation.cables(simulation.positions)["tendon"])
        assert points[0].tolist() == [-0.01, 0.01, 0.003]
        seen.append(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    assert seen[0] < 0.109  # slack: the weight bends the finger
    assert seen[1] == pytest.approx(0.109 - 0.02, abs=1e-4)
