"""Joint values out of a joint state message."""

from collections.abc import Sequence

import numpy as np

from tripod_graph.names import SLIDE, count_servos, servo_names
from tripod_host.arrays import FloatArray


class JointError(ValueError):
    """A joint state that is refused; the message names the joint and why."""


def joint_values(names: Sequence[str], positions: Sequence[float]) -> FloatArray:
    """Return the angles of all servos [rad] and the slide [m], shape (s + 1,).

    A slide that is not named is 0: the real robot has none. Other joints are passed over. Raises JointError.
    """
    if len(names) != len(positions):
        raise JointError(f"the message has {len(positions)} positions for {len(names)} joints")
    values = dict(zip(names, positions, strict=True))
    servos = servo_names(count_servos(values))
    if not servos or any(n.startswith("servo_") and n not in servos for n in values):
        raise JointError(f"joint 'servo_{len(servos)}' is missing; joints: {', '.join(names) or 'none'}")
    joints = np.array([*(values[n] for n in servos), values.get(SLIDE, 0.0)], float)
    for name, value in zip((*servos, SLIDE), joints, strict=True):
        if not np.isfinite(value):
            raise JointError(f"joint '{name}' is {value}")
    return joints
