"""Deformed surface, maze, ball, cables and the sets that a scene watches as markers, for RViz and Foxglove.

A marker has one Point object for each corner of each triangle; making a thousand of them thirty times a second
would keep the physics thread waiting. The message is therefore serialised once, and each time only stamps, poses and
the points of the body are overwritten. To be found again they are serialised as numbers that occur nowhere else.
"""

import struct
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Point
from geometry_msgs.msg import Pose as PoseMessage
from rclpy.serialization import serialize_message
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from tripod_graph.names import WORLD
from tripod_host.arrays import FloatArray, IndexArray
from tripod_runtime.realtime import Snapshot
from tripod_sim.simulation import Pose, Skin

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.maze.board_mesh import BoardMesh

BODY = ColorRGBA(r=0.85, g=0.75, b=0.62, a=1.0)
MAZE = ColorRGBA(r=0.72, g=0.55, b=0.36, a=1.0)
BALL = ColorRGBA(r=0.80, g=0.16, b=0.16, a=1.0)
CABLE = ColorRGBA(r=0.15, g=0.15, b=0.18, a=1.0)
SET = ColorRGBA(r=0.13, g=0.40, b=0.67, a=1.0)

DOT = 0.02
"""Diameter of a dot that marks a set, in parts of the body's largest extent."""

PLACE = 0.1234567890123456
"""Stands for a number to be overwritten, plus a whole number."""

SECONDS, NANOSECONDS = 0x5E57A300, 0x2A5E57A3
"""Stand for the stamp of marker 0; the seconds count the markers."""


class SceneMarkers:
    """Serialised MarkerArrays of one body and, if there are, of one maze, one ball and sets: marker 0, 1, 2, ..."""

    def __init__(
        self,
        mesh: Skin,
        maze: "BoardMesh | None" = None,
        ball_radius: float | None = None,
        sets: Mapping[str, IndexArray] | None = None,
        cables: Mapping[str, FloatArray] | None = None,
    ) -> None:
        """Prepare the message.

        Args:
            mesh: The body.
            maze: Fastened to the effector.
            ball_radius: [m].
            sets: Nodes by name, a dot in the middle of each.
            cables: Points of each cable by name [m], shape (k, 3).
        """
        self._corners = mesh.surface.ravel()
        markers = [_marker("body", Marker.TRIANGLE_LIST, BODY)]
        markers[0].points = [Point(x=PLACE)] * len(self._corners)
        if maze:
            markers.append(_marker("maze", Marker.TRIANGLE_LIST, MAZE, place=PLACE + 1))
            markers[-1].points = [
                Point(x=x, y=y, z=z) for x, y, z in maze.vertices[maze.triangles.ravel()].tolist()
            ]
        if ball_radius is not None:
            markers.append(_marker("ball", Marker.SPHERE, BALL, place=PLACE + 2, scale=2 * ball_radius))
        self._sets = list((sets or {}).values())
        size = DOT * float(np.ptp(mesh.nodes, axis=0).max())
        for i, name in enumerate(sets or {}):
            markers.append(_marker(f"set {name}", Marker.SPHERE, SET, place=PLACE + 3 + i, scale=size))
        lines = cables or {}
        first = PLACE + 3 + len(self._sets)
        for i, (name, points) in enumerate(lines.items()):
            markers.append(_marker(f"cable {name}", Marker.LINE_STRIP, CABLE, scale=0.25 * size))
            markers[-1].points = [Point(x=first + i)] * len(points)
        for i, marker in enumerate(markers):
            marker.header.stamp.sec, marker.header.stamp.nanosec = SECONDS + i, NANOSECONDS
        self._buffer = bytearray(serialize_message(MarkerArray(markers=markers)))
        self._stamps = [self._find("<iI", SECONDS + i, NANOSECONDS) for i in range(len(markers))]
        self._points = self._find("<d", PLACE)
        self._maze_pose = self._find("<d", PLACE + 1) if maze else None
        self._ball_pose = self._find("<d", PLACE + 2) if ball_radius is not None else None
        self._middles = [self._find("<d", PLACE + 3 + i) for i in range(len(self._sets))]
        self._lines = [self._find("<d", first + i) for i in range(len(lines))]

    def _find(self, form: str, *values: float) -> int:
        return self._buffer.index(struct.pack(form, *values))

    def serialised(self, snapshot: Snapshot, cables: Mapping[str, FloatArray] | None = None) -> bytes:
        """Return the MarkerArray of a snapshot in CDR, for `Publisher.publish`; `cables`: as in the beginning."""
        seconds, nanoseconds = divmod(snapshot.stamp, 1_000_000_000)
        for place in self._stamps:
            struct.pack_into("<iI", self._buffer, place, seconds, nanoseconds)
        points = np.ascontiguousarray(snapshot.positions[self._corners], dtype="<f8").tobytes()
        self._buffer[self._points : self._points + len(points)] = points
        self._put(self._maze_pose, snapshot.effector)
        self._put(self._ball_pose, snapshot.ball)
        for place, nodes in zip(self._middles, self._sets, strict=True):
            struct.pack_into("<3d", self._buffer, place, *snapshot.positions[nodes].mean(axis=0).tolist())
        for place, line in zip(self._lines, (cables or {}).values(), strict=True):
            data = np.ascontiguousarray(line, dtype="<f8").tobytes()
            self._buffer[place : place + len(data)] = data
        return bytes(self._buffer)

    def _put(self, place: int | None, pose: Pose | None) -> None:
        if place is not None and pose is not None:
            struct.pack_into("<7d", self._buffer, place, *pose.position.tolist(), *pose.quaternion.tolist())


def _marker(name: str, kind: int, colour: ColorRGBA, *, place: float = 0.0, scale: float = 1.0) -> Marker:
    """Return a marker at a pose that begins with the number `place`."""
    marker = Marker(ns=name, id=0, type=kind, action=Marker.ADD, color=colour, pose=PoseMessage())
    marker.header.frame_id = WORLD
    marker.scale.x = marker.scale.y = marker.scale.z = scale
    marker.pose.position.x, marker.pose.orientation.w = place, 1.0
    return marker
