"""Where the joints are now, as simulator and driver tell it."""

import math
from collections.abc import Sequence

from tripod_graph.joint import Joint
from tripod_graph.names import SLIDE, count_servos, servo_names

STALE = 1.0
"""Age at which joint values are no longer believed [s]."""


class JointError(ValueError):
    """A joint state that is refused; the message names the joint and why."""


Joints = tuple[float, ...]
"""The angle of each servo [rad], other joints [m, N, Pa], and the slide [m] if it is known."""


class JointWatch:
    """Keeps the newest joint values of the simulator and of the robot.

    The robot's angles count before the simulator's: what must not jump is the hardware. The slide is known to the
    simulator only.

    Attributes:
        servos: How many servos were told of last.
        others: Joints that are no servos, as the simulator's status tells them.
        trouble: Why the joint values are not known although they are told; empty otherwise.
    """

    def __init__(self) -> None:
        self.servos, self.trouble = 0, ""
        self.others: tuple[Joint, ...] = ()
        self._sim: tuple[Joints, int, float] | None = None
        self._robot: tuple[Joints, int, float] | None = None

    def hear_sim(
        self, names: Sequence[str], positions: Sequence[float], now: float, efforts: Sequence[float] = ()
    ) -> None:
        """Take a joint state of the simulator; raises JointError."""
        self._sim = self._told(names, positions, now, efforts, self.others)

    def hear_robot(
        self, names: Sequence[str], positions: Sequence[float], now: float, efforts: Sequence[float] = ()
    ) -> None:
        """Take a joint state of the driver; raises JointError."""
        others = [joint for joint in self.others if joint.name in names]
        self._robot = self._told(names, positions, now, efforts, others)

    def _told(
        self,
        names: Sequence[str],
        positions: Sequence[float],
        now: float,
        efforts: Sequence[float],
        others: Sequence[Joint],
    ) -> tuple[Joints, int, float]:
        values = joint_values(names, positions, efforts, others)
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
        return robot[0] + (sim[0][len(robot[0]) :] if sim else ())


def joint_values(
    names: Sequence[str],
    positions: Sequence[float],
    efforts: Sequence[float] = (),
    others: Sequence[Joint] = (),
) -> Joints:
    """Return the angles of all servos [rad], commands of `others` and, if it is named, the slide [m].

    The command of a joint that takes an effort is its effort. Raises JointError.
    """
    if len(names) != len(positions):
        raise JointError(f"the message has {len(positions)} positions for {len(names)} joints")
    told = dict(zip(names, positions, strict=True))
    done = dict(zip(names, efforts, strict=False))
    servos = servo_names(count_servos(told))
    if not (servos or others) or any(n.startswith("servo_") and n not in servos for n in told):
        raise JointError(f"joint 'servo_{len(servos)}' is missing; joints: {', '.join(names)[:80] or 'none'}")
    for joint in others:
        if joint.name not in (done if joint.is_effort else told):
            raise JointError(f"joint {joint.name!r} is missing; joints: {', '.join(names)[:80] or 'none'}")
    told |= {joint.name: done[joint.name] for joint in others if joint.is_effort}
    known = [n for n in (*servos, *(j.name for j in others), SLIDE) if n in told]
    if strange := [n for n in known if not math.isfinite(told[n])]:
        raise JointError(f"joint {strange[0]!r} is at {told[strange[0]]}; it must be a finite number")
    return tuple(float(told[n]) for n in known)
