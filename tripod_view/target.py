"""The target that one can drag: where it is, who moves it, and what of the browser's input is taken."""

from collections.abc import Sequence

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_view.pose import Pose, PoseError


class TargetError(ValueError):
    """A target that is refused; the message gives its value and what is allowed."""


def checked_point(values: Sequence[float] | FloatArray, what: str) -> FloatArray:
    """Return `values` as a point [m], shape (3,); raise TargetError unless they are three finite numbers."""
    try:
        point = np.array(values, float)
    except (TypeError, ValueError):
        raise TargetError(f"{what} {values!r:.80} is not three numbers") from None
    if point.shape != (3,) or not np.isfinite(point).all():
        raise TargetError(f"{what} {point.tolist()!r:.80} must be three finite numbers [m]")
    return point


class TargetHandle:
    """Rules of the handle.

    Until somebody sets a target the handle rides on the effector, so that switching inverse kinematics on
    moves nothing. A drag is clamped to a box; while one lasts, targets of others do not move the handle.

    Attributes:
        position: Where the handle stands [m], shape (3,); None before the effector is known.
        quaternion: How it is turned (x, y, z, w), shape (4,).
        set: Whether somebody set the target, by hand or by topic.
    """

    def __init__(self, low: Sequence[float], high: Sequence[float]) -> None:
        """`low`, `high`: corners of the box for drags [m], shape (3,)."""
        self.low, self.high = checked_point(low, "target_low"), checked_point(high, "target_high")
        if not (self.low < self.high).all():
            raise TargetError(
                f"target_low {self.low.tolist()} must be below target_high {self.high.tolist()} in x, y and z"
            )
        self.position: FloatArray | None = None
        self.quaternion: FloatArray = np.array([0.0, 0.0, 0.0, 1.0])
        self.set = False
        self._draggers: set[int] = set()

    @property
    def dragging(self) -> bool:
        """Whether a client holds the handle."""
        return bool(self._draggers)

    def ride(self, effector: Pose) -> bool:
        """Follow `effector` unless a target is set or dragged; return whether the handle moved."""
        if self.set or self.dragging:
            return False
        return self._move(effector)

    def hear(self, target: Pose) -> bool:
        """Take the target of somebody else; return whether the handle moved (not while it is dragged)."""
        if self.dragging:
            return False
        self.set = True
        return self._move(target)

    def release(self) -> None:
        """Forget that a target was set: the handle rides on the effector again."""
        self.set = False

    def grab(self, client: int) -> None:
        """Note that `client` began to drag."""
        self._draggers.add(client)

    def drag(
        self, client: int, values: Sequence[float] | FloatArray, quaternion: Sequence[float] | FloatArray
    ) -> Pose:
        """Return the target asked for by dragging to `values` [m], within the box, and turning it to `quaternion`
        (x, y, z, w).

        Raises TargetError.
        """
        point = np.clip(checked_point(values, "dragged target"), self.low, self.high)
        try:
            x, y, z, w = (float(v) for v in quaternion)
            pose = Pose.of(point, (x, y, z, w))
        except (PoseError, TypeError, ValueError):
            raise TargetError(
                f"dragged target is turned by {quaternion!r:.80}; four numbers that are not 0"
            ) from None
        self._draggers.add(client)
        self.set = True
        self._move(pose)
        return pose

    def drop(self, client: int) -> None:
        """Note that `client` let go or left."""
        self._draggers.discard(client)

    def _move(self, pose: Pose) -> bool:
        same = self.position is not None and bool((self.position == pose.position).all())
        moved = not (same and bool((self.quaternion == pose.quaternion).all()))
        self.position, self.quaternion = np.array(pose.position), np.array(pose.quaternion)
        return moved
