"""The overwritten serialised markers against what they must decode to."""

import numpy as np
from rclpy.serialization import deserialize_message
from visualization_msgs.msg import Marker, MarkerArray

from tripod_sim import Simulation, load_scene
from tripod_sim.markers import SurfaceMarkers
from tripod_sim.realtime import RealTime


def test_markers_decode_to_the_deformed_surface() -> None:
    simulation = Simulation(load_scene("tripod", ["mesh.level=1"]))
    surface = SurfaceMarkers(simulation.mesh)
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
