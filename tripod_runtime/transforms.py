"""The robot for RViz and others: its description, latched, and its frames on /tf while someone listens."""

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from tripod_graph.names import ROBOT_DESCRIPTION, TF, TF_STATIC, WORLD
from tripod_graph.qos import LATCHED, RELIABLE
from tripod_runtime.messages import header, set_stamp
from tripod_runtime.realtime import Snapshot
from tripod_sim.scene import Scene
from tripod_sim.scene.description import BALL, BASE, EFFECTOR, PLATE, arm_frames, urdf
from tripod_sim.tables.short_forms import joints_of


class Transforms:
    """Publishes `robot_description` once, base_link and plate on /tf_static, all that moves on /tf."""

    def __init__(self, node: Node, scene: Scene, prefix: str) -> None:
        """`scene` has actuators; `prefix` stands before every frame but `world`."""
        self._joints, self._prefix = joints_of(scene), prefix
        self._moving = node.create_publisher(TFMessage, TF, RELIABLE)
        self._description = node.create_publisher(String, ROBOT_DESCRIPTION, LATCHED)
        self._description.publish(String(data=urdf(scene)))
        self._static = node.create_publisher(TFMessage, TF_STATIC, LATCHED)
        self._told: dict[str, TransformStamped] = {}
        stamp = node.get_clock().now().nanoseconds
        fixed = [self._tell(stamp, WORLD, BASE, [0, 0, 0], [0, 0, 0, 1])]
        if scene.maze:
            fixed.append(self._tell(stamp, EFFECTOR, PLATE, [0, 0, scene.maze.offset], [0, 0, 0, 1]))
        self._static.publish(TFMessage(transforms=fixed))

    def publish(self, snapshot: Snapshot) -> None:
        """Publish the frames of a snapshot, if anybody listens."""
        if not self._moving.get_subscription_count() or self._joints is None:
            return
        found = [
            self._tell(snapshot.stamp, parent, child, position.tolist(), quaternion.tolist())
            for parent, child, position, quaternion in arm_frames(self._joints, snapshot.joints)
        ]
        for child, pose in ((EFFECTOR, snapshot.effector), (BALL, snapshot.ball)):
            if pose:
                place = pose.position.tolist(), pose.quaternion.tolist()
                found.append(self._tell(snapshot.stamp, BASE, child, *place))
        self._moving.publish(TFMessage(transforms=found))

    def _tell(
        self, stamp: int, parent: str, child: str, position: list[float], quaternion: list[float]
    ) -> TransformStamped:
        """Return a frame as a message, the same each time: what it is made of costs more than what it says."""
        message = self._told.get(child)
        if message is None:
            message = TransformStamped(header=header(0), child_frame_id=self._prefix + child)
            message.header.frame_id = parent if parent == WORLD else self._prefix + parent
            self._told[child] = message
        set_stamp(message.header, stamp)
        t, r = message.transform.translation, message.transform.rotation
        t.x, t.y, t.z = map(float, position)
        r.x, r.y, r.z, r.w = map(float, quaternion)
        return message
