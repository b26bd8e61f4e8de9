"""Joint values out of a joint state message."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tripod_graph.names import SERVOS, SLIDE

FloatArray = NDArray[np.float64]


class JointError(ValueError):
    """A joint state that is refused; the message names the joint and why."""


def joint_values(names: Sequence[str], positions: Sequence[float]) -> FloatArray:
    """Return three angles [rad] and the slide [m], shape (4,).

    A slide that is not named is 0: the real robot has none. Other joints are passed over. Raises JointError.
    """
    if len(names) != len(positions):
        raise JointError(f"{len(positions)} positions for {len(names)} joints")
    values = dict(zip(names, positions, strict=True))
    if missing := [n for n in SERVOS if n not in values]:
        raise JointError(f"joint '{missing[0]}' is missing; joints: {', '.join(names) or 'none'}")
    joints = np.array([*(values[n] for n in SERVOS), values.get(SLIDE, 0.0)], float)
    for name, value in zip((*SERVOS, SLIDE), joints, strict=True):
        if not np.isfinite(value):
            raise JointError(f"joint '{name}' is {value}")
    return joints
