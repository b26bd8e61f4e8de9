"""What a node publishes of the body and the scene: the mesh and what else there is to draw, then positions."""

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from shape_msgs.msg import Mesh, SolidPrimitive
from std_msgs.msg import String
from tripod_msgs.msg import BodyState, Field, Forces
from visualization_msgs.msg import MarkerArray

from tripod_graph import names
from tripod_graph.qos import LATCHED, RELIABLE, SENSOR
from tripod_runtime import messages
from tripod_runtime.markers import SceneMarkers
from tripod_runtime.realtime import Snapshot, Wanted
from tripod_sim.fields import MESH_ERROR
from tripod_sim.maze.board_mesh import board_mesh
from tripod_sim.scene.file import scene_to_toml
from tripod_sim.simulation import Simulation

if TYPE_CHECKING:
    from tripod_sim.fields import NodalFields

FIELD_PERIOD = 0.1
"""Shortest time between two messages of a field [s]."""

FIELD_SHARE = 0.1
"""Largest share of the time in which fields are computed: large ones come less often."""


class SceneTopics:
    """Publishes mesh, maze, ball and scene of a simulation, and its body; all else while someone listens.

    Attributes:
        markers, cloud, fields, forces: Publishers of what is made only for those who listen; fields by name.
        drawn: The markers of the simulation.
    """

    def __init__(self, node: Node, simulation: Simulation) -> None:
        """`node` publishes mesh and scene of `simulation` now, and the body when it is told to."""
        self._body = node.create_publisher(BodyState, names.BODY_STATE, SENSOR)
        self.markers = node.create_publisher(MarkerArray, names.MARKERS, SENSOR)
        self.cloud = node.create_publisher(PointCloud2, names.POINT_CLOUD, SENSOR)
        self.fields = {
            name: node.create_publisher(Field, names.field_topic(name), RELIABLE)
            for name in simulation.field_names
        }
        self.forces = node.create_publisher(Forces, names.FORCES, RELIABLE)
        self._nodal: NodalFields | None = None
        self._fields_due = float("-inf")
        self._mesh = node.create_publisher(Mesh, names.MESH, LATCHED)
        self._maze = node.create_publisher(Mesh, names.MAZE_MESH, LATCHED)
        self._ball = node.create_publisher(SolidPrimitive, names.BALL_SHAPE, LATCHED)
        self._scene = node.create_publisher(String, names.SCENE, LATCHED)
        self._simulation, self._skin = simulation, simulation.skin
        plate, ball = simulation.plate, simulation.scene.ball
        maze = board_mesh(plate.board, plate.offset) if plate else None
        radius = ball.radius if ball else None
        self.drawn = SceneMarkers(
            self._skin, maze, radius, simulation.watched, simulation.cables(simulation.positions)
        )
        self._mesh.publish(messages.mesh_message(self._skin))
        self._maze.publish(messages.maze_message(maze))
        self._ball.publish(messages.ball_shape_message(radius))
        self._scene.publish(String(data=scene_to_toml(simulation.scene)))

    def publish(self, snapshot: Snapshot) -> None:
        """Publish a snapshot of the simulation that is shown."""
        positions = snapshot.positions
        self._publish_fields(snapshot)
        snapshot = replace(snapshot, positions=self._simulation.shown(positions))
        self._body.publish(messages.body_message(snapshot, self._skin))
        if self.markers.get_subscription_count():
            self.markers.publish(self.drawn.serialised(snapshot, self._simulation.cables(positions)))
        if self.cloud.get_subscription_count():
            self.cloud.publish(messages.cloud_message(snapshot))

    @property
    def wanted(self) -> Wanted:
        """What snapshots are to have because somebody listens to it."""
        error = self.fields.get(MESH_ERROR)
        return Wanted(
            forces=self.forces.get_subscription_count() > 0,
            mesh_error=error is not None and error.get_subscription_count() > 0,
        )

    def _publish_fields(self, snapshot: Snapshot) -> None:
        """Publish the fields of positions that somebody listens to, if they are due."""
        heard = [
            name
            for name, publisher in self.fields.items()
            if name != MESH_ERROR and publisher.get_subscription_count()
        ]
        if not heard:
            self._nodal = None
            return
        begun = time.monotonic()
        if begun < self._fields_due:
            return
        if self._nodal is None:
            self._nodal = self._simulation.fields()
        for name, values in self._nodal.values(heard, snapshot.positions).items():
            self.fields[name].publish(messages.field_message(name, values, snapshot, self._skin))
        self._fields_due = begun + max(FIELD_PERIOD, (time.monotonic() - begun) / FIELD_SHARE)

    def publish_wanted(self, snapshot: Snapshot) -> None:
        """Publish forces and mesh error of a snapshot that has them."""
        if snapshot.forces:
            self.forces.publish(messages.forces_message(snapshot))
        if (error := snapshot.mesh_error) is not None:
            message = messages.field_message(MESH_ERROR, error, snapshot, self._skin)
            self.fields[MESH_ERROR].publish(message)
