"""Where the joints are now, as simulator and driver tell it."""

from collections.abc import Sequence

from tripod_graph.joint import Joint, joint_values
from tripod_graph.names import count_servos

STALE = 1.0
"""Age at which joint values are no longer believed [s]."""


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
