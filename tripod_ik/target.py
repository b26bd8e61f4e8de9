"""Which targets are accepted."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from tripod_graph.names import WORLD
from tripod_host.arrays import FloatArray
from tripod_host.rotations import quaternion_matrix
from tripod_ik.arrays import frozen
from tripod_ik.errors import IkError

Hint = Callable[[float, str, Callable[[float], bool]], str]
"""What to add for a value, its unit, and what tells whether another value is allowed."""


@dataclass(frozen=True, eq=False)
class TargetBox:
    """Targets lie in the frame `world`, within a box; so one in millimetres or in another frame is noticed.

    The box may well be larger than the reach of the robot: a target out of reach gives the closest pose.

    Attributes:
        low: Smallest coordinates [m], shape (3,).
        high: Largest coordinates [m], shape (3,).
    """

    low: FloatArray
    high: FloatArray

    def __post_init__(self) -> None:
        for name in ("low", "high"):
            object.__setattr__(self, name, frozen(f"target_{name}", getattr(self, name), (3,)))
        if not (self.low < self.high).all():
            raise IkError(
                f"target_low {self.low.tolist()} m must be below target_high {self.high.tolist()} m"
            )

    def check(
        self, frame: str, position: Sequence[float], orientation: Sequence[float]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the target's position [m] and normal, shape (3,) each.

        Args:
            frame: Name of the frame that the target is expressed in.
            position: x, y, z [m].
            orientation: Quaternion x, y, z, w; zero, as a message without one has it, means upright. Where it is not
                followed, too, one that is not finite means a broken sender.

        Raises:
            IkError: the target is refused.
        """
        if frame != WORLD:
            raise IkError(f"the target is given in frame {frame!r}; it must be given in {WORLD!r}")
        target = frozen("target position", position, (3,))
        turned = frozen("target orientation", orientation, (4,))
        length = float(np.linalg.norm(turned))
        if length == 0:
            normal = np.array([0.0, 0.0, 1.0])
        elif abs(length - 1.0) < 1e-2:
            normal = quaternion_matrix(turned)[:, 2]
        else:
            raise IkError(f"target orientation has length {length:g}; it must be a unit quaternion")
        self.check_position(target)
        return target, normal

    def check_position(self, target: FloatArray, hint: Hint = lambda *_: "") -> None:
        """Raise IkError for a position [m], shape (3,), that is outside; `hint` ends the message."""
        for axis, value, low, high in zip("xyz", target.tolist(), self.low, self.high, strict=True):
            fits = partial(_between, low, high)
            if not fits(value):
                more = hint(value, "m", fits)
                raise IkError(f"target {axis} is {value:g} m; allowed: {low:.4g} to {high:.4g} m{more}")


def _between(low: float, high: float, value: float) -> bool:
    return low <= value <= high
