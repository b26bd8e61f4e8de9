"""Where the joints are now, as simulator and driver tell it."""

import math
from collections.abc import Sequence

from tripod_graph.names import SLIDE, count_servos, servo_names

STALE = 1.0
"""Age at which joint values are no longer believed [s]."""


class JointError(ValueError):
    """A joint state that is refused; the message names the joint and why."""


Joints = tuple[float, ...]
"""The angle of each servo [rad], and the slide [m] if it is known."""


class JointWatch:
    """Keeps the newest joint values of the simulator and of the robot.

    The robot's angles count before the simulator's: what must not jump is the hardware. The slide is known to the
    simulator only.

    Attributes:
        servos: How many servos were told of last.
        trouble: Why the joint values are not known although they are told; empty otherwise.
    """

    def __init__(self) -> None:
        self.servos, self.trouble = 0, ""
        self._sim: tuple[Joints, int, float] | None = None
        self._robot: tuple[Joints, int, float] | None = None

    def hear_sim(self, names: Sequence[str], positions: Sequence[float], now: float) -> None:
        """Take a joint state of the simulator; raises JointError."""
        self._sim = self._told(names, positions, now)

    def hear_robot(self, names: Sequence[str], positions: Sequence[float], now: float) -> None:
        """Take a joint state of the driver; raises JointError."""
        self._robot = self._told(names, positions, now)

    def _told(
        self, names: Sequence[str], positions: Sequence[float], now: float
    ) -> tuple[Joints, int, float]:
        values = joint_values(names, positions)
        self.servos = count_servos(names)
        return values, self.servos, now

    def joints(self, now: float) -> Joints | None:
        """Return the joint values at `now` [s]; None if nobody has told them lately."""
        sim, robot = (None if s is None or now - s[2] > STALE else s[:2] for s in (self._sim, self._robot))
        self.trouble = ""
        if sim and robot and sim[1] != robot[1]:
            self.trouble = f"the simulator has {sim[1]} servos, the driver {robot[1]}"
            return None
        if robot is None:
            return sim and sim[0]
        return robot[0][: robot[1]] + (sim[0][sim[1] :] if sim else ())


def joint_values(names: Sequence[str], positions: Sequence[float]) -> Joints:
    """Return the angles of all servos [rad] and, if it is named, the slide [m]. Raises JointError."""
    if len(names) != len(positions):
        raise JointError(f"the message has {len(positions)} positions for {len(names)} joints")
    told = dict(zip(names, positions, strict=True))
    servos = servo_names(count_servos(told))
    if not servos or any(n.startswith("servo_") and n not in servos for n in told):
        raise JointError(f"joint 'servo_{len(servos)}' is missing; joints: {', '.join(names)[:80] or 'none'}")
    known = [n for n in (*servos, SLIDE) if n in told]
    if strange := [n for n in known if not math.isfinite(told[n])]:
        raise JointError(f"joint {strange[0]!r} is at {told[strange[0]]}; it must be a finite number")
    return tuple(float(told[n]) for n in known)
