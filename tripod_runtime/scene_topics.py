"""What a node publishes of the body and the scene: the mesh and what else there is to draw, then positions."""

from dataclasses import replace

from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from shape_msgs.msg import Mesh, SolidPrimitive
from std_msgs.msg import String
from tripod_msgs.msg import BodyState
from visualization_msgs.msg import MarkerArray

from tripod_graph import names
from tripod_graph.qos import LATCHED, SENSOR
from tripod_runtime import messages
from tripod_runtime.markers import SceneMarkers
from tripod_runtime.realtime import Snapshot
from tripod_sim.maze.board_mesh import board_mesh
from tripod_sim.scene.file import scene_to_toml
from tripod_sim.simulation import Simulation


class SceneTopics:
    """Publishes mesh, maze, ball and scene of a simulation, and its body; markers and cloud while someone listens.

    Attributes:
        markers, cloud: Publishers of what is made only for those who listen.
        drawn: The markers of the simulation.
    """

    def __init__(self, node: Node, simulation: Simulation) -> None:
        """`node` publishes mesh and scene of `simulation` now, and the body when it is told to."""
        self._body = node.create_publisher(BodyState, names.BODY_STATE, SENSOR)
        self.markers = node.create_publisher(MarkerArray, names.MARKERS, SENSOR)
        self.cloud = node.create_publisher(PointCloud2, names.POINT_CLOUD, SENSOR)
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
        snapshot = replace(snapshot, positions=self._simulation.shown(positions))
        self._body.publish(messages.body_message(snapshot, self._skin))
        if self.markers.get_subscription_count():
            self.markers.publish(self.drawn.serialised(snapshot, self._simulation.cables(positions)))
        if self.cloud.get_subscription_count():
            self.cloud.publish(messages.cloud_message(snapshot))
