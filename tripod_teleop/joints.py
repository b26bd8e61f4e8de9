"""Where the joints are now, as simulator and driver tell it."""

import math
from collections.abc import Sequence

from tripod_graph.names import SERVOS, SLIDE

STALE = 1.0
"""Age at which joint values are no longer believed [s]."""


class JointError(ValueError):
    """A joint state that is refused; the message names the joint and why."""


Joints = tuple[float, ...]
"""Three servo angles [rad], and the slide [m] if it is known."""


class JointWatch:
    """Keeps the newest joint values of the simulator and of the robot.

    The robot's angles count before the simulator's: what must not jump is the hardware. The slide is known to the
    simulator only.
    """

    def __init__(self) -> None:
        self._sim: tuple[Joints, float] | None = None
        self._robot: tuple[Joints, float] | None = None

    def hear_sim(self, names: Sequence[str], positions: Sequence[float], now: float) -> None:
        """Take a joint state of the simulator; raises JointError."""
        self._sim = joint_values(names, positions), now

    def hear_robot(self, names: Sequence[str], positions: Sequence[float], now: float) -> None:
        """Take a joint state of the driver; raises JointError."""
        self._robot = joint_values(names, positions), now

    def joints(self, now: float) -> Joints | None:
        """Return the joint values at `now` [s]; None if nobody has told them lately."""
        sim, robot = (None if s is None or now - s[1] > STALE else s[0] for s in (self._sim, self._robot))
        if robot is None:
            return sim
        return robot[:3] + (sim[3:] if sim else ())


def joint_values(names: Sequence[str], positions: Sequence[float]) -> Joints:
    """Return three servo angles [rad] and, if it is named, the slide [m]. Raises JointError."""
    if len(names) != len(positions):
        raise JointError(f"{len(positions)} positions for {len(names)} joints")
    told = dict(zip(names, positions, strict=True))
    if missing := [n for n in SERVOS if n not in told]:
        raise JointError(f"joint {missing[0]!r} is missing; joints: {', '.join(names)[:80] or 'none'}")
    known = [n for n in (*SERVOS, SLIDE) if n in told]
    if strange := [n for n in known if not math.isfinite(told[n])]:
        raise JointError(f"joint {strange[0]!r} is {told[strange[0]]}")
    return tuple(float(told[n]) for n in known)
