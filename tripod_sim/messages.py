"""Messages of the simulator from its snapshots."""

import array

import numpy as np
from geometry_msgs.msg import Point, PoseStamped
from geometry_msgs.msg import Pose as PoseMessage
from numpy.typing import NDArray
from sensor_msgs.msg import JointState, PointCloud2, PointField
from shape_msgs.msg import Mesh, MeshTriangle, SolidPrimitive
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension, MultiArrayLayout, UInt8MultiArray
from tripod_msgs.msg import BodyState, Compliance

from tripod_graph.names import SERVOS, SLIDE, WORLD
from tripod_sim.checkpoint import Checkpoint, checkpoint_bytes
from tripod_sim.journal import HEAD
from tripod_sim.maze.board_mesh import BoardMesh
from tripod_sim.realtime import Snapshot
from tripod_sim.simulation import Pose, Skin

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


def header(stamp: int) -> Header:
    """Return a header in `world` at `stamp` [ns]."""
    message = Header(frame_id=WORLD)
    message.stamp.sec, message.stamp.nanosec = divmod(stamp, 1_000_000_000)
    return message


def flat(values: FloatArray) -> array.array:
    """Return an array as rclpy takes it without a copy per number."""
    return array.array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def pose_message(pose: Pose) -> PoseMessage:
    """Return a pose [m, unit quaternion]."""
    message = PoseMessage()
    p, q = pose.position.tolist(), pose.quaternion.tolist()
    message.position.x, message.position.y, message.position.z = p
    message.orientation.x, message.orientation.y, message.orientation.z, message.orientation.w = q
    return message


def effector_message(snapshot: Snapshot, pose: Pose) -> PoseStamped:
    """Return the effector's pose."""
    return PoseStamped(header=header(snapshot.stamp), pose=pose_message(pose))


def ball_message(snapshot: Snapshot, pose: Pose) -> PoseStamped:
    """Return the ball's pose."""
    return PoseStamped(header=header(snapshot.stamp), pose=pose_message(pose))


def body_message(snapshot: Snapshot, mesh: Skin) -> BodyState:
    """Return the node positions."""
    return BodyState(
        header=header(snapshot.stamp), topology_id=mesh.topology_id, step=snapshot.step, time=snapshot.time,
        positions=flat(snapshot.positions),
    )  # fmt: skip


def joint_message(snapshot: Snapshot) -> JointState:
    """Return angles, slide and torques; the slide has no effort of its own."""
    return JointState(
        header=header(snapshot.stamp), name=[*SERVOS, SLIDE], position=flat(snapshot.joints),
        effort=flat(np.append(snapshot.torques, 0.0)),
    )  # fmt: skip


def compliance_message(snapshot: Snapshot) -> Compliance | None:
    """Return the compliance of the snapshot, or None if it has none."""
    c = snapshot.compliance
    if c is None:
        return None
    soft = c.softness
    return Compliance(
        header=header(snapshot.stamp), joint_names=list(SERVOS[: len(c.angles)]), angles=flat(c.angles),
        torques=flat(c.torques), effector=pose_message(Pose(c.position, c.quaternion)),
        equilibrium_offset=c.equilibrium_offset, w=flat(c.w), slide=c.slide, firmness=soft.firmness if soft else 1.0,
        firmness_slope=flat(soft.slope) if soft else [],
    )  # fmt: skip


def commands_message(rows: FloatArray) -> Float64MultiArray:
    """Return runs of a journal, shape (n, k); the labels tell rows and columns."""
    count, width = rows.shape
    columns = " ".join(("epoch", "first", "last", "stamp_ns", *(*SERVOS, SLIDE)[: width - HEAD]))
    layout = [
        MultiArrayDimension(label="runs", size=count, stride=count * width),
        MultiArrayDimension(label=columns, size=width, stride=width),
    ]
    return Float64MultiArray(layout=MultiArrayLayout(dim=layout), data=flat(rows))


def checkpoint_message(checkpoint: Checkpoint) -> UInt8MultiArray:
    """Return a checkpoint as an npz file."""
    return UInt8MultiArray(data=array.array("B", checkpoint_bytes(checkpoint)))


def mesh_message(mesh: Skin) -> Mesh:
    """Return the undeformed surface; its vertices are all nodes, so that indices are those of body_state."""
    return _mesh(mesh.nodes, mesh.surface)


def maze_message(maze: BoardMesh | None) -> Mesh:
    """Return plate and walls of a maze, in the frame of the effector; an empty mesh says that there is none."""
    return _mesh(maze.vertices, maze.triangles) if maze else Mesh()


def ball_shape_message(radius: float | None) -> SolidPrimitive:
    """Return the ball as a sphere of `radius` [m]; one without dimensions says that there is none."""
    return SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[] if radius is None else [radius])


def _mesh(nodes: FloatArray, surface: IndexArray) -> Mesh:
    triangles = [MeshTriangle(vertex_indices=t.astype(np.uint32)) for t in surface]
    vertices = [Point(x=x, y=y, z=z) for x, y, z in nodes.tolist()]
    return Mesh(triangles=triangles, vertices=vertices)


def cloud_message(snapshot: Snapshot) -> PointCloud2:
    """Return the nodes as a cloud of float32 points [m]."""
    data = snapshot.positions.astype("<f4")
    fields = [
        PointField(name=n, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, n in enumerate("xyz")
    ]
    return PointCloud2(
        header=header(snapshot.stamp), height=1, width=len(data), fields=fields, is_bigendian=False, point_step=12,
        row_step=12 * len(data), data=array.array("B", data.tobytes()), is_dense=True,
    )  # fmt: skip
