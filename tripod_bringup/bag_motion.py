"""The motion of the joints that a recording holds, for the robot."""

from collections.abc import Callable, Sequence
from typing import Any

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
            times, joints, named = read(bag, topics[0])
            if len(times):
                return _rising(times, joints, named)
    raise RecordError(
        f"{bag.info.path} contains no motion of the joints ({names.COMMANDS}, "
        f"{names.ROBOT_JOINT_STATES} or {TRAJECTORY}); record one of these topics"
    )


Motion = tuple[list[float], list[FloatArray], list[str]]
"""Times [s], joint values at each, and the names of these joints."""


def _commanded(bag: Bag, topic: str) -> Motion:
    times: list[float] = []
    joints: list[FloatArray] = []
    named: list[str] = []
    for heard in bag.messages(topic.__eq__):
        message = bag.decoded(heard)
        width = message.layout.dim[-1].size if message.layout.dim else 0
        if width <= HEAD or len(message.data) % width:
            continue
        told = message.layout.dim[-1].label.split()[HEAD:]
        if len(told) != width - HEAD:  # of an older recorder, of servos
            told = list(names.joint_names(width - HEAD - 1))
        if named and told != named:
            raise RecordError(
                f"{topic} changes from {', '.join(named)} to {', '.join(told)}: choose a part with --start"
            )
        named = told
        rows = np.asarray(message.data).reshape(-1, width)
        # stamps are the simulator's, places in the recording the recorder's: the last of the rows has just been made
        for row in rows:
            times.append(1e-9 * (heard.log_time - bag.start) - 1e-9 * (rows[-1, 3] - row[3]))
            joints.append(row[HEAD:])
    return times, joints, named


def _sent(bag: Bag, topic: str) -> Motion:
    times: list[float] = []
    joints: list[FloatArray] = []
    named: list[str] = []
    for heard in bag.messages(topic.__eq__):
        message = bag.decoded(heard)
        values = dict(zip(message.name, message.position, strict=False))
        efforts = zip(message.name, message.effort, strict=False)
        values |= {name: effort for name, effort in efforts if np.isnan(values.get(name, np.nan))}
        told = _ordered([name for name in message.name if name != names.SLIDE])
        row = np.array([values.get(name, np.nan) for name in told])
        if len(row) and np.isfinite(row).all() and (not joints or told == named):
            named = told
            times.append(1e-9 * (heard.log_time - bag.start))
            joints.append(row)
    return times, joints, named


def _ordered(joints: Sequence[str]) -> list[str]:
    """Return the servos in their order, then the others in theirs."""
    servos = names.servo_names(names.count_servos(joints))
    return [*servos, *(name for name in joints if name not in servos)]


def _planned(bag: Bag, topic: str) -> Motion:
    """Return the motion of a joint that follows each trajectory until the next one comes, as ROS's controllers do.

    A trajectory begins when it was recorded or, if that is later, at its own stamp. Until its first point the joint
    goes there from where it is.
    """
    times: list[float] = []
    joints: list[FloatArray] = []
    named: list[str] = []
    for heard in bag.messages(topic.__eq__):
        message = bag.decoded(heard)
        if not message.points:
            continue
        told = _ordered([name for name in message.joint_names if name != names.SLIDE])
        rows = [_row(topic, told, message.joint_names, point) for point in message.points]
        if joints and told != named:
            raise RecordError(
                f"{topic} changes from {', '.join(named)} to {', '.join(told)}: two robots on one topic? Record them "
                "in namespaces of their own"
            )
        named = told
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
    return times, joints, named


def _row(topic: str, wanted: Sequence[str], told: Sequence[str], point: Any) -> FloatArray:
    """Return what a point of a trajectory asks of the joints `wanted`: its position, or its effort where it has none.

    Raises RecordError.
    """
    given = {len(point.positions), len(point.effort)}
    positions = dict(zip(told, point.positions, strict=False))
    efforts = dict(zip(told, point.effort, strict=False))
    row = [positions.get(n, 0.0) if efforts.get(n, 0.0) in (0.0, None) else efforts[n] for n in wanted]
    if not wanted or not given <= {0, len(told)} or given == {0} or not np.isfinite(row).all():
        raise RecordError(
            f"{topic} holds a point with {len(point.positions)} positions of the joints {', '.join(told) or '(none)'}; "
            "each needs one finite number, a position or an effort"
        )
    return np.array(row)


def _rising(times: list[float], joints: list[FloatArray], named: Sequence[str]) -> JointPath:
    """Return the motion of the joints `named`, in which the slide, if it is known, is the last."""
    t = np.maximum.accumulate(np.array(times))
    kept = np.append(np.diff(t) > 0, True)
    servos = names.count_servos(named)
    others = tuple(name for name in named[servos:] if name != names.SLIDE)
    width = len(named) if servos else len(others)  # without servos there is nothing that slides
    return JointPath(t[kept], np.array(joints)[kept, :width], servos, others)
