"""The driver's range: what it says that it accepts, which all who command and the simulated robot keep to. Pure."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tripod_graph.command import CommandError, CommandLimits
from tripod_graph.joint import Joint
from tripod_host.arrays import FloatArray

SILENT = 2.0
"""A driver not heard for this long [s] is not there: own limits count again."""


class RangeWatch:
    """Limits narrowed to the range of the driver while one is in the graph.

    Attributes:
        limits: What holds now: `own`, or what it shares with the driver's range.
        notice: Why the driver's range is not kept, empty if it is.
    """

    def __init__(self, own: CommandLimits) -> None:
        self._own = self.limits = own
        self.notice = ""
        self._told: tuple[tuple[Any, ...], ...] = ()
        self._heard = float("-inf")

    @property
    def narrowed(self) -> bool:
        """Whether a driver's range is kept."""
        return self.limits is not self._own

    def hear(
        self,
        lower: Sequence[float],
        upper: Sequence[float],
        speed: Sequence[float],
        now: float,
        names: Sequence[str] = (),
    ) -> bool:
        """Take ranges [rad, m, N, Pa] and slew rates of a RobotStatus, shape (n,) each, of the joints `names`.

        Without names they are of the servos. Return whether the limits changed.
        """
        if not len(lower):  # it does not tell
            return False
        told = tuple(lower), tuple(upper), tuple(speed), tuple(names)
        self._heard = now
        if told == self._told:
            return False
        self._told = told
        self._narrow()
        return True

    def adopt(self, own: CommandLimits) -> None:
        """Keep to other own limits from now on."""
        self._own = own
        self._narrow()

    def resize(self, servos: int, others: tuple[Joint, ...] = ()) -> None:
        """Be for other joints from now on. Raises CommandError where the own park position is of others."""
        self.adopt(self._own.of(servos, others))

    def lapse(self, now: float) -> bool:
        """Return whether the limits changed because the driver is gone. Call it regularly."""
        if not self._told or now - self._heard <= SILENT:
            return False
        self._told = ()
        self._narrow()
        return True

    def _narrow(self) -> None:
        self.limits, self.notice = self._own, ""
        if self._told:
            try:
                self.limits = self._own.within(*self._told)
            except CommandError as error:
                self.notice = f"the range of the driver cannot be applied: {error}"


class Fence:
    """What the driver does before it sends: the nearest within its range, at a limited speed also when that changes.

    Attributes:
        place: What it let through last, shape (size + 1,); None: nothing yet.
    """

    def __init__(self) -> None:
        self.place: FloatArray | None = None
        self._at = 0.0

    def nearest(
        self, joints: FloatArray, limits: CommandLimits, now: float, longest_step: float = 0.1
    ) -> FloatArray:
        """Return where to be at `now` [s] when asked for `joints`, shape (size + 1,). Call it at a regular rate."""
        asked = np.clip(joints, limits.lower, limits.upper)
        if self.place is not None:
            step = limits.speed * min(max(0.0, now - self._at), longest_step)
            asked = self.place + np.clip(asked - self.place, -step, step)
        self.place, self._at = asked, now
        return asked.copy()


def cut(joints: FloatArray, limits: CommandLimits) -> str:
    """Return which joint is asked for more than `limits` allow; empty if none is."""
    inside = limits.inside(joints)
    for joint, value, fits in zip(limits.table[:-1], joints, inside, strict=False):
        if not fits:
            unit = joint.unit
            safe = f"its safe range is {joint.low:.3f} to {joint.high:.3f} {unit}"
            beyond = f"{joint.name} is commanded to {value:.3f} {unit}, {safe}"
            return f"{beyond}; the nearest allowed {joint.quantity} is sent"
    return ""
