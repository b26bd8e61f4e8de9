"""Messages of the simulator from its snapshots."""

import array
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, PoseStamped
from geometry_msgs.msg import Pose as PoseMessage
from sensor_msgs.msg import JointState, PointCloud2, PointField
from shape_msgs.msg import Mesh, MeshTriangle, SolidPrimitive
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension, MultiArrayLayout, UInt8MultiArray
from tripod_msgs.msg import BodyState, Compliance, Field
from tripod_msgs.msg import Forces as ForcesMessage

from tripod_graph.names import SLIDE, WORLD, servo_names
from tripod_host.arrays import FloatArray, IndexArray
from tripod_runtime.checkpoint import Checkpoint, checkpoint_bytes
from tripod_runtime.input_log import APPLIED, HEAD
from tripod_runtime.notices import known
from tripod_runtime.realtime import Snapshot
from tripod_sim.acting_forces import UNITS, kind_of
from tripod_sim.compliance import Compliance as Linearised
from tripod_sim.fields import FIELDS
from tripod_sim.maze.board_mesh import BoardMesh
from tripod_sim.simulation import Pose, Skin
from tripod_sim.tables.joints import Joints
from tripod_study.summary.errors import mesh_error


def header(stamp: int) -> Header:
    """Return a header in `world` at `stamp` [ns]."""
    message = Header(frame_id=WORLD)
    set_stamp(message, stamp)
    return message


def set_stamp(message: Header, stamp: int) -> None:
    """Let a header be of `stamp` [ns]."""
    message.stamp.sec, message.stamp.nanosec = divmod(stamp, 1_000_000_000)


def flat(values: FloatArray) -> array.array:
    """Return an array as rclpy takes it without a copy per number."""
    return array.array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def pose_message(pose: Pose) -> PoseMessage:
    """Return a pose [m, unit quaternion]."""
    message = PoseMessage()
    set_pose(message, pose)
    return message


def set_pose(message: PoseMessage, pose: Pose) -> None:
    """Let a message tell a pose [m, unit quaternion]."""
    p, q = pose.position.tolist(), pose.quaternion.tolist()
    message.position.x, message.position.y, message.position.z = p
    message.orientation.x, message.orientation.y, message.orientation.z, message.orientation.w = q


class PoseTeller:
    """Poses as messages: one and the same message, since what it is made of costs more than what it says."""

    def __init__(self) -> None:
        self._message = PoseStamped(header=header(0))

    def message(self, snapshot: Snapshot, pose: Pose) -> PoseStamped:
        """Return a pose of a snapshot; good until the next call."""
        set_stamp(self._message.header, snapshot.stamp)
        set_pose(self._message.pose, pose)
        return self._message


class JointTeller:
    """Joint states as messages: one and the same message, as `PoseTeller`."""

    def __init__(self, joints: Joints | None) -> None:
        """`joints`: of the scene; None: it has none."""
        self._joints = joints
        self._slides = not joints or bool(joints.arms)
        names = [a.name for a in joints.actuators] if joints else []
        self._message = JointState(header=header(0), name=[*names, *([SLIDE] if self._slides else [])])

    def message(self, snapshot: Snapshot) -> JointState:
        """Return where the joints are and what they do there, see `Joints.moved`; the slide has no effort of its own.

        Good until the next call.
        """
        set_stamp(self._message.header, snapshot.stamp)
        positions, efforts = snapshot.joints[:-1], snapshot.efforts
        if self._joints and self._joints.others:
            positions, efforts = self._joints.moved(positions, efforts)
        slide, none = ([float(snapshot.joints[-1])], [0.0]) if self._slides else ([], [])
        self._message.position = array.array("d", [*positions.tolist(), *slide])
        self._message.effort = array.array("d", [*efforts.tolist(), *none])
        return self._message


def body_message(snapshot: Snapshot, mesh: Skin) -> BodyState:
    """Return the node positions."""
    return BodyState(
        header=header(snapshot.stamp), topology_id=mesh.topology_id, step=snapshot.step, time=snapshot.time,
        positions=flat(snapshot.positions),
    )  # fmt: skip


def field_message(name: str, values: FloatArray, snapshot: Snapshot, mesh: Skin) -> Field:
    """Return a field at the vertices of `mesh`, shape (v,), of a snapshot."""
    return Field(
        header=header(snapshot.stamp), topology_id=mesh.topology_id, step=snapshot.step, time=snapshot.time,
        unit=FIELDS[name].unit, values=array.array("f", values.astype(np.float32).tobytes()),
    )  # fmt: skip


def forces_message(snapshot: Snapshot) -> ForcesMessage:
    """Return the forces on the bodies."""
    groups, none = snapshot.forces, np.zeros((0, 3))
    points = np.concatenate([none, *(group.points for group in groups)])
    vectors = np.concatenate([none, *(group.vectors for group in groups)])
    return ForcesMessage(
        header=header(snapshot.stamp), step=snapshot.step, time=snapshot.time, names=[g.name for g in groups],
        units=[UNITS[kind_of(g.name)] for g in groups], counts=[len(g.points) for g in groups], points=flat(points),
        vectors=flat(vectors),
    )  # fmt: skip


def compliance_message(snapshot: Snapshot, joints: Joints | None = None) -> Compliance | None:
    """Return the compliance of the snapshot, or None if it has none; its rows are `joints`, None: servos."""
    c = snapshot.compliance
    if c is None:
        return None
    soft = c.stability_margin
    return Compliance(
        header=header(snapshot.stamp), joint_names=_actuator_names(len(c.angles), joints), angles=flat(c.angles),
        efforts=flat(c.efforts), effector=pose_message(Pose(c.position, c.quaternion)),
        equilibrium_offset=c.equilibrium_offset, w=flat(c.w), slide=c.slide,
        stability_margin=soft.value if soft else 1.0, stability_margin_slope=flat(soft.slope) if soft else [],
        effector_mesh_error=known(mesh_error(snapshot.report)), **_actuator_fields(c, joints),
    )  # fmt: skip


def _actuator_fields(c: Linearised, joints: Joints | None) -> dict[str, Any]:
    """Return the fields of a compliance that servos alone leave empty."""
    if not (joints and joints.others):
        return {}
    return {
        "units": [a.unit for a in joints.actuators], "lower": flat(joints.low), "upper": flat(joints.high),
        "effort_max": [np.inf if a.effort_max is None else a.effort_max for a in joints.actuators],
        "pulls": [a.pulls for a in joints.actuators],
        "jacobian": flat(c.jacobian), "stiffness": flat(c.stiffness),
    }  # fmt: skip


def commands_message(rows: FloatArray, joints: Joints | None = None) -> Float64MultiArray:
    """Return rows of the input log, shape (n, k), of `joints`, None: servos; the labels tell rows and columns."""
    count, width = rows.shape
    columns = " ".join(("epoch", "first", "last", "stamp_ns", *_joint_names(width - HEAD, joints)))
    layout = [
        MultiArrayDimension(label="runs", size=count, stride=count * width),
        MultiArrayDimension(label=columns, size=width, stride=width),
    ]
    return Float64MultiArray(layout=MultiArrayLayout(dim=layout), data=flat(rows))


def applied_message(rows: FloatArray) -> Float64MultiArray:
    """Return runs of applied forces, shape (m, 7); the labels tell rows and columns."""
    layout = [
        MultiArrayDimension(label="runs", size=len(rows), stride=rows.size),
        MultiArrayDimension(label="epoch first last node fx fy fz", size=APPLIED, stride=APPLIED),
    ]
    return Float64MultiArray(layout=MultiArrayLayout(dim=layout), data=flat(rows))


def _joint_names(count: int, joints: Joints | None) -> tuple[str, ...]:
    """Return the names of `count` joints: actuators and the slide; none of a scene without actuators."""
    return (*_actuator_names(count - 1, joints), SLIDE) if count else ()


def _actuator_names(count: int, joints: Joints | None) -> list[str]:
    return [a.name for a in joints.actuators] if joints else list(servo_names(count))


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
