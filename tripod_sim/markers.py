"""The deformed surface as visualization markers, for RViz and Foxglove.

A marker has one Point object for each corner of each triangle; making a thousand of them thirty times a second
would keep the physics thread waiting. The message is therefore serialised once, and each time only its stamp and points
are overwritten.
"""

import struct

import numpy as np
from geometry_msgs.msg import Point
from rclpy.serialization import serialize_message
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from tripod_graph.names import WORLD
from tripod_sim.realtime import Snapshot
from tripod_sim.simulation import Skin

STAMP = 8
"""Where the stamp of the first marker stands in a serialised MarkerArray: after encapsulation and count."""


class SurfaceMarkers:
    """Serialised MarkerArrays of one mesh."""

    def __init__(self, mesh: Skin) -> None:
        self._corners = mesh.surface.ravel()
        sentinel = 0.1234567890123456
        message = self._message([Point(x=sentinel)] * len(self._corners))
        self._buffer = bytearray(serialize_message(message))
        self._first = self._buffer.index(struct.pack("<d", sentinel))

    @staticmethod
    def _message(points: list[Point]) -> MarkerArray:
        marker = Marker(ns="body", id=0, type=Marker.TRIANGLE_LIST, action=Marker.ADD, points=points)
        marker.header.frame_id = WORLD
        marker.scale.x = marker.scale.y = marker.scale.z = 1.0
        marker.pose.orientation.w = 1.0
        marker.color = ColorRGBA(r=0.85, g=0.75, b=0.62, a=1.0)
        return MarkerArray(markers=[marker])

    def serialised(self, snapshot: Snapshot) -> bytes:
        """Return the MarkerArray of a snapshot in CDR, for `Publisher.publish`."""
        seconds, nanoseconds = divmod(snapshot.stamp, 1_000_000_000)
        struct.pack_into("<iI", self._buffer, STAMP, seconds, nanoseconds)
        points = np.ascontiguousarray(snapshot.positions[self._corners], dtype="<f8").tobytes()
        self._buffer[self._first : self._first + len(points)] = points
        return bytes(self._buffer)
