"""Joint values out of a joint state message."""

from collections.abc import Sequence

import numpy as np

from tripod_graph.joint import Joint
from tripod_graph.names import SLIDE, count_servos, servo_names
from tripod_host.arrays import FloatArray


class JointError(ValueError):
    """A joint state that is refused; the message names the joint and why."""


def joint_values(
    names: Sequence[str],
    positions: Sequence[float],
    efforts: Sequence[float] = (),
    others: Sequence[Joint] = (),
) -> FloatArray:
    """Return the angles of all servos [rad], commands of `others` [m, N, Pa] and the slide [m], shape (n + 1,).

    The command of a joint that takes an effort is its effort. A slide that is not named is 0: the real robot has none.
    Other joints are passed over. Raises JointError.
    """
    if len(names) != len(positions):
        raise JointError(f"the message has {len(positions)} positions for {len(names)} joints")
    values = dict(zip(names, positions, strict=True))
    servos = servo_names(count_servos(values))
    done = dict(zip(names, efforts, strict=False))
    for joint in others:
        if joint.name not in (done if joint.is_effort else values):
            raise JointError(f"joint '{joint.name}' is missing; joints: {', '.join(names) or 'none'}")
    values |= {joint.name: done[joint.name] for joint in others if joint.is_effort}
    if not (servos or others) or any(n.startswith("servo_") and n not in servos for n in values):
        raise JointError(f"joint 'servo_{len(servos)}' is missing; joints: {', '.join(names) or 'none'}")
    known = (*servos, *(joint.name for joint in others))
    joints = np.array([*(values[n] for n in known), values.get(SLIDE, 0.0)], float)
    for name, value in zip((*known, SLIDE), joints, strict=True):
        if not np.isfinite(value):
            raise JointError(f"joint '{name}' is {value}")
    return joints
