"""The topic `joint_trajectory` in nodes that obey it: what is too large is refused before it is read."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from builtin_interfaces.msg import Duration, Time
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from tripod_graph import names
from tripod_graph.cdr import check_size
from tripod_graph.command import CommandError
from tripod_graph.control_mode import clocks
from tripod_graph.joint import Joint
from tripod_graph.qos import RELIABLE
from tripod_host.arrays import FloatArray


@dataclass(frozen=True)
class Command:
    """A trajectory as it was sent; see `CommandFollower.accept`.

    Attributes:
        source: Who sent it.
        names: Joint names.
        times: Of each point from the start [s].
        positions: Joint values of each point.
        velocities: Of each point; none, or of all.
        efforts: Of each point; none, or of all.
        age: How long ago it begins [s]; negative: it begins later.
        now: The steady time at which it came [s].
    """

    source: str
    names: Sequence[str]
    times: Sequence[float]
    positions: Sequence[Sequence[float]]
    velocities: Sequence[Sequence[float]]
    efforts: Sequence[Sequence[float]]
    age: float
    now: float


def obey(node: Node, follow: Callable[[Command], object], refuse: Callable[[CommandError], None]) -> None:
    """Give every trajectory to `follow`; what that raises, and what cannot be read, to `refuse`."""

    def take(data: bytes) -> None:
        try:
            check_size(data)
            follow(command_of(deserialize_message(data, JointTrajectory), *clocks(node)))
        except CommandError as error:
            refuse(error)

    node.create_subscription(JointTrajectory, names.JOINT_TRAJECTORY, take, RELIABLE, raw=True)


def command_of(message: JointTrajectory, wall: float, now: float) -> Command:
    """Return what a message commands, received at these times. Raises CommandError for what is not used."""
    points = message.points
    if any(len(point.accelerations) for point in points):
        raise CommandError(
            "the points of the trajectory have accelerations, which are not supported: leave them out"
        )
    stamp = seconds(message.header.stamp)
    moving = [point.velocities for point in points if len(point.velocities)]
    return Command(
        message.header.frame_id,
        message.joint_names,
        [seconds(point.time_from_start) for point in points],
        [point.positions for point in points],
        moving,
        [point.effort for point in points] if any(len(point.effort) for point in points) else [],
        wall - stamp if stamp else 0.0,
        now,
    )


def point_of(values: Sequence[float] | FloatArray, joints: Sequence[Joint]) -> JointTrajectoryPoint:
    """Return a point with the values of `joints`, shape (n,): positions, and efforts of joints that take one."""
    pairs = [(float(value), joint.is_effort) for value, joint in zip(values, joints, strict=True)]
    return JointTrajectoryPoint(
        positions=[0.0 if is_effort else value for value, is_effort in pairs],
        effort=[value if is_effort else 0.0 for value, is_effort in pairs]
        if any(e for _, e in pairs)
        else [],
    )


def seconds(time: Duration | Time) -> float:
    """Return a duration, or an instant, as a number [s]."""
    return float(time.sec) + 1e-9 * float(time.nanosec)
