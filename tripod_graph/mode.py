"""Which source may command the robot: the newest decision of any operator."""

from dataclasses import dataclass
from enum import IntEnum


class Mode(IntEnum):
    """Values of tripod_msgs/ControlMode."""

    STOP = 0
    TELEOP = 1
    IK = 2
    REPLAY = 3


@dataclass
class ModeTracker:
    """Keeps the newest mode.

    Several operators publish `control_mode` and a late joiner receives the last word of each, in any order;
    the stamp decides. A message typed by hand has no stamp (0): it counts as decided after all that is known.

    Attributes:
        mode: The mode in force.
        stamp: When its operator decided [s].
    """

    mode: Mode = Mode.STOP
    stamp: float = float("-inf")

    def update(self, mode: int, stamp: float) -> bool:
        """Take a message; return whether the mode in force changed. An unknown `mode` raises ValueError."""
        try:
            known = Mode(mode)
        except ValueError:
            names = ", ".join(f"{m.value} {m.name}" for m in Mode)
            raise ValueError(f"control mode {mode} is unknown; modes: {names}") from None
        stamp = max(self.stamp, 0.0) if stamp == 0 else stamp
        if not stamp >= self.stamp:  # NaN decides nothing
            return False
        changed = known is not self.mode
        self.mode, self.stamp = known, stamp
        return changed
