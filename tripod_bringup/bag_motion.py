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

SOURCES = (names.COMMANDS, names.ROBOT_JOINT_STATES)
"""What a motion is taken from, the better first: what the simulator was given, else what the driver sent."""


def joint_path(bag: Bag, wanted: Callable[[str], bool]) -> JointPath:
    """Return the motion. Raises RecordError if there is none, or of several robots."""
    for source in SOURCES:
        topics = [t for t in bag.topics if t.endswith("/" + source) and wanted(t)]
        if len(topics) > 1:
            raise RecordError(
                f"{bag.info.path} holds {len(topics)} robots, {', '.join(topics)}: choose one by --topics"
            )
        if topics:
            commanded = source == names.COMMANDS
            times, joints = (_commanded if commanded else _sent)(bag, topics[0])
            if len(times):
                return _rising(times, joints, len(joints[0]) - commanded)
    raise RecordError(f"{bag.info.path} holds no motion of the joints ({' or '.join(SOURCES)})")


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


def _rising(times: list[float], joints: list[FloatArray], servos: int) -> JointPath:
    t = np.maximum.accumulate(np.array(times))
    kept = np.append(np.diff(t) > 0, True)
    return JointPath(t[kept], np.array(joints)[kept], servos)
