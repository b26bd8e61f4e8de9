"""Messages to and from the plain values that the rest works with."""

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from rclpy.duration import Duration
from shape_msgs.msg import Mesh, SolidPrimitive
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import BodyState, Field, Forces, SimStatus

from tripod_graph import names
from tripod_graph.trajectory import point_of
from tripod_host.arrays import FloatArray
from tripod_view.body import FARTHEST, BodyError, Surface
from tripod_view.forces import MOST_ARROWS, MOST_GROUPS, Group
from tripod_view.motion import Trajectory
from tripod_view.pose import Pose, PoseError

SHOWN = (
    "dt", "time", "real_time_factor", "step_time_median", "step_time_p99", "time_error", "effector_time_error",
)  # fmt: skip
"""Numbers of a status of the simulator that the page shows."""

LARGEST_BALL = 1.0
"""Radius of the largest ball that is drawn [m]."""


LONGEST_NAME = 100
"""Of a group of forces [characters]."""


class ForcesError(ValueError):
    """Forces that are refused; the message says why."""


class StatusError(ValueError):
    """A status that is refused; the message says why."""


def checked_status(message: SimStatus) -> SimStatus:
    """Return a status of the simulator as it is. Raises StatusError where a number that is shown is not finite."""
    for name in SHOWN:
        if not np.isfinite(value := getattr(message, name)):
            raise StatusError(f"{name} is {value}; it must be finite")
    return message


def surface_of(message: Mesh) -> Surface:
    """Return the surface of a mesh message. Raises BodyError."""
    nodes = np.array([(p.x, p.y, p.z) for p in message.vertices], float).reshape(-1, 3)
    triangles = np.array([t.vertex_indices for t in message.triangles], np.uint32).reshape(-1, 3)
    return Surface(nodes, triangles)


def maze_of(message: Mesh) -> Surface | None:
    """Return the maze of a mesh message, in the frame of the effector, None if it is empty. Raises BodyError."""
    return surface_of(message) if message.vertices or message.triangles else None


def ball_radius_of(message: SolidPrimitive) -> float | None:
    """Return the radius of the ball [m], None if the message says that there is none. Raises BodyError."""
    sizes = list(message.dimensions)
    if not sizes:
        return None
    if message.type != SolidPrimitive.SPHERE or len(sizes) != 1:
        raise BodyError(
            f"shape of type {message.type} with {len(sizes)} dimensions; a sphere has type 2 and one"
        )
    if not 0 < sizes[0] <= LARGEST_BALL:  # the negation also catches NaN
        raise BodyError(f"radius of the ball is {sizes[0]} m; allowed: above 0 to {LARGEST_BALL:g} m")
    return float(sizes[0])


def state_of(message: BodyState) -> tuple[int, FloatArray]:
    """Return topology id and flat node positions [m], shape (3 n,)."""
    return message.topology_id, np.asarray(message.positions, float)


def field_of(message: Field) -> tuple[int, FloatArray]:
    """Return topology id and values of a field, shape (n,)."""
    return message.topology_id, np.asarray(message.values, float)


def groups_of(message: Forces) -> tuple[Group, ...]:
    """Return the groups of forces of a message. Raises ForcesError."""
    names, units, counts = list(message.names), list(message.units), np.asarray(message.counts, np.int64)
    if not len(names) == len(units) == len(counts) <= MOST_GROUPS or len(set(names)) != len(names):
        raise ForcesError(
            f"{len(names)} names, {len(units)} units, {len(counts)} counts of groups of forces; as many of each are "
            f"needed, at most {MOST_GROUPS}, and no name twice"
        )
    if any(not 0 < len(text) <= LONGEST_NAME or "/" in text for text in (*names, *units)):
        raise ForcesError(
            f"a group of forces has a name or unit that is empty, has / or over {LONGEST_NAME} characters"
        )
    points, vectors, total = np.asarray(message.points), np.asarray(message.vectors), int(counts.sum())
    if not len(points) == len(vectors) == 3 * total or total > MOST_ARROWS:
        raise ForcesError(
            f"{len(points)} coordinates, {len(vectors)} components of {total} forces; 3 of each are needed for each, "
            f"of at most {MOST_ARROWS}"
        )
    for what, values in (("coordinate", points), ("component", vectors)):
        if not (np.abs(values) <= FARTHEST).all():  # NaN fails
            raise ForcesError(f"a {what} of a force is not finite or beyond {FARTHEST:g}")
    ends = np.cumsum(counts)[:-1]
    rows = (np.split(values.reshape(-1, 3), ends) for values in (points, vectors))
    return tuple(Group(*group) for group in zip(names, units, *rows, strict=True)) if names else ()


def pose_of(message: PoseStamped) -> Pose:
    """Return the pose of a message in frame `world`. Raises PoseError."""
    if message.header.frame_id != names.WORLD:
        raise PoseError(f"frame '{message.header.frame_id}' is not known; the frame must be '{names.WORLD}'")
    p, q = message.pose.position, message.pose.orientation
    return Pose.of((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def trajectory_message(trajectory: Trajectory, source: str) -> JointTrajectory:
    """Return `trajectory` of `source` as a message; it begins when it is received."""
    message = JointTrajectory(joint_names=list(trajectory.names))
    message.header.frame_id = source
    for seconds, row in zip(trajectory.times, trajectory.positions, strict=True):
        point = point_of(row, trajectory.joints)
        point.time_from_start = Duration(seconds=float(seconds)).to_msg()
        message.points.append(point)
    return message


def target_message(position: FloatArray, quaternion: FloatArray, stamp: Time) -> PoseStamped:
    """Return a target at `position` [m] in frame `world`, turned by `quaternion` (x, y, z, w)."""
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = stamp, names.WORLD
    p, q = message.pose.position, message.pose.orientation
    p.x, p.y, p.z = (float(v) for v in position)
    q.x, q.y, q.z, q.w = (float(v) for v in quaternion)
    return message
