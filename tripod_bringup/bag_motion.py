"""The motion of the joints that a recording holds, for the robot."""

from collections.abc import Callable

import numpy as np

from tripod_graph import names
from tripod_host.arrays import FloatArray
from tripod_play.joint_path import JointPath
from tripod_record.bag import Bag
from tripod_record.errors import RecordError

HEAD = 4
"""Columns of the simulator's commands before its joints: epoch, first and last step, stamp [ns]."""

STAY = 0.1
"""Time for which a motion of one pose stays there [s]."""

TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"


def joint_path(bag: Bag, wanted: Callable[[str], bool]) -> JointPath:
    """Return the motion that a recording holds.

    It is what the simulator was given, else what the driver sent, else the trajectories of another program
    (`TRAJECTORY`, on any topic).

    Raises:
        RecordError: there is none, or of several robots.
    """
    trajectories = {t.name for t in bag.info.topics if t.type == TRAJECTORY}
    for read, is_source in (
        (_commanded, lambda t: t.endswith(f"/{names.COMMANDS}")),
        (_sent, lambda t: t.endswith(f"/{names.ROBOT_JOINT_STATES}")),
        (_planned, trajectories.__contains__),
    ):
        topics = [t for t in bag.topics if is_source(t) and wanted(t)]
        if len(topics) > 1:
            raise RecordError(
                f"{bag.info.path} contains {len(topics)} robots, {', '.join(topics)}: choose one with --topics"
            )
        if topics:
            refuse_others(bag, topics[0])
            times, joints = read(bag, topics[0])
            if len(times):
                return _rising(times, joints, len(joints[0]) - (read is _commanded))
    raise RecordError(
        f"{bag.info.path} contains no motion of the joints ({names.COMMANDS}, "
        f"{names.ROBOT_JOINT_STATES} or {TRAJECTORY}); record one of these topics"
    )


def refuse_others(bag: Bag, topic: str) -> None:
    """Raise RecordError where a topic commands joints that are no servos: a robot's driver has none."""
    for heard in bag.messages(topic.__eq__):
        message = bag.decoded(heard)
        if topic.endswith(f"/{names.COMMANDS}"):
            told = message.layout.dim[-1].label.split()[HEAD:] if message.layout.dim else []
            others = sorted(set(told) - set(names.joint_names(len(told))))
            if others:
                raise RecordError(
                    f"{bag.info.path} commands {', '.join(others)}, which no driver moves so far; simulate "
                    "the session again with --to sim, or play one of servos alone"
                )
            return


def _commanded(bag: Bag, topic: str) -> tuple[list[float], list[FloatArray]]:
    times: list[float] = []
    joints: list[FloatArray] = []
    for heard in bag.messages(topic.__eq__):
        message = bag.decoded(heard)
        width = message.layout.dim[-1].size if message.layout.dim else 0
        if width <= HEAD or len(message.data) % width:
            continue
        rows = np.asarray(message.data).reshape(-1, width)
        # stamps are the simulator's, places in the recording the recorder's: the last of the rows has just been made
        for row in rows:
            times.append(1e-9 * (heard.log_time - bag.start) - 1e-9 * (rows[-1, 3] - row[3]))
            joints.append(row[HEAD:])
    return times, joints


def _sent(bag: Bag, topic: str) -> tuple[list[float], list[FloatArray]]:
    times: list[float] = []
    joints: list[FloatArray] = []
    for heard in bag.messages(topic.__eq__):
        message = bag.decoded(heard)
        angles = dict(zip(message.name, message.position, strict=False))
        row = np.array([angles[name] for name in names.servo_names(names.count_servos(angles))])
        if len(row) and np.isfinite(row).all() and (not joints or len(joints[0]) == len(row)):
            times.append(1e-9 * (heard.log_time - bag.start))
            joints.append(row)
    return times, joints


def _planned(bag: Bag, topic: str) -> tuple[list[float], list[FloatArray]]:
    """Return the motion of a joint that follows each trajectory until the next one comes, as ROS's controllers do.

    A trajectory begins when it was recorded or, if that is later, at its own stamp. Until its first point the joint
    goes there from where it is.
    """
    times: list[float] = []
    joints: list[FloatArray] = []
    for heard in bag.messages(topic.__eq__):
        message = bag.decoded(heard)
        if not message.points:
            continue
        rows = [_row(topic, message.joint_names, point.positions) for point in message.points]
        if joints and len(rows[0]) != len(joints[0]):
            raise RecordError(
                f"{topic} changes from {len(joints[0])} joints to {len(rows[0])}: two robots on one topic? "
                "Record them in namespaces of their own"
            )
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        begin = 1e-9 * (
            max(heard.log_time, stamp if stamp < bag.start + 1e9 * bag.info.duration else 0) - bag.start
        )
        places = [begin + p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points]
        if places[0] > begin:
            here = [np.interp(begin, times, column) for column in np.transpose(joints)] if joints else rows[0]
            places, rows = [begin, *places], [np.array(here), *rows]
        kept = int(np.searchsorted(times, begin))
        times[kept:], joints[kept:] = places, rows
    if len(times) == 1:
        times, joints = [times[0], times[0] + STAY], joints * 2
    return times, joints


def _row(topic: str, joints: list[str], positions: FloatArray) -> FloatArray:
    """Return the angles of a point of a trajectory in the order of the servos. Raises RecordError."""
    servos = names.servo_names(names.count_servos(joints))
    if not servos or len(positions) != len(joints) or not np.isfinite(positions).all():
        raise RecordError(
            f"{topic} holds a point with {len(positions)} positions of the joints {', '.join(joints) or '(none)'}; "
            "each of servo_0, servo_1, ... needs one finite number"
        )
    angles = dict(zip(joints, positions, strict=True))
    return np.array([angles[name] for name in servos])


def _rising(times: list[float], joints: list[FloatArray], servos: int) -> JointPath:
    t = np.maximum.accumulate(np.array(times))
    kept = np.append(np.diff(t) > 0, True)
    return JointPath(t[kept], np.array(joints)[kept], servos)
