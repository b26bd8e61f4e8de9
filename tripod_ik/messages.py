"""What the node reads from messages, and writes into them."""

from array import array
from typing import Any

from geometry_msgs.msg import Point
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from tripod_graph import names
from tripod_host.arrays import FloatArray
from tripod_ik.errors import IkError
from tripod_ik.state import LinearState


def linear_state(message: Any) -> LinearState:
    """Return the state in a tripod_msgs/Compliance; raise IkError if it cannot be used."""
    if message.header.frame_id != names.WORLD:
        raise IkError(f"compliance in frame {message.header.frame_id!r}; the frame must be {names.WORLD!r}")
    joints = tuple(message.joint_names)
    if not joints or joints != names.servo_names(len(joints)):
        raise IkError(f"compliance of joints {list(joints)}; they must be servo_0, servo_1 and so on")
    rows = 6 + len(joints)
    if len(message.w) != rows**2:
        raise IkError(f"compliance has {len(message.w)} entries; {len(joints)} joints give {rows**2}")
    p, q = message.effector.position, message.effector.orientation
    return LinearState(
        joint_names=joints,
        angles=message.angles,
        efforts=message.efforts,
        effector=(p.x, p.y, p.z),  # type: ignore[arg-type]
        rotation=(q.x, q.y, q.z, q.w),  # type: ignore[arg-type]
        equilibrium_offset=message.equilibrium_offset,
        W=[message.w[rows * i : rows * (i + 1)] for i in range(rows)],  # type: ignore[arg-type]
        stability_margin=message.stability_margin if len(message.stability_margin_slope) else 1.0,
        stability_margin_slope=message.stability_margin_slope,
    )


def trajectory(command: FloatArray, source: str, over: float = 0.0) -> JointTrajectory:
    """Return the command [rad], shape (n,), of `source` as a trajectory: go there evenly within `over` [s], and no
    faster than your slew rate allows.
    """
    point = JointTrajectoryPoint()
    point.positions = array("d", command)
    point.time_from_start.nanosec = round(1e9 * over)
    message = JointTrajectory()
    message.header.frame_id = source
    message.joint_names = list(names.servo_names(len(command)))
    message.points = [point]
    return message


def point(position: FloatArray) -> Point:
    """Return a position [m], shape (3,), as a message."""
    x, y, z = (float(value) for value in position)
    return Point(x=x, y=y, z=z)
