"""A rigid pose, checked when it comes from outside."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray


class PoseError(ValueError):
    """A pose that is refused; the message gives its value and what is allowed."""


@dataclass(frozen=True)
class Pose:
    """A rigid pose in `world`.

    Attributes:
        position: Origin of the frame [m], shape (3,).
        quaternion: Its orientation (x, y, z, w), unit, w not negative, shape (4,).
    """

    position: FloatArray
    quaternion: FloatArray

    @classmethod
    def of(cls, position: Sequence[float] | FloatArray, quaternion: Sequence[float] | FloatArray) -> "Pose":
        """Return the pose with `quaternion` (x, y, z, w) scaled to unit length.

        Raises PoseError unless all numbers are finite and the quaternion is not zero.
        """
        p, q = np.array(position, float), np.array(quaternion, float)
        norm = math.hypot(*q)
        if not (np.isfinite(p).all() and math.isfinite(norm) and norm > 1e-6):
            raise PoseError(
                f"position {p.tolist()} with quaternion {q.tolist()}: finite and not zero is needed"
            )
        return cls(p, q / (-norm if q[3] < 0 else norm))

    def apply(self, points: FloatArray) -> FloatArray:
        """Return `points` of this frame, shape (..., 3) [m], in `world`."""
        axis, w = self.quaternion[:3], self.quaternion[3]
        turned = 2 * np.cross(axis, points)
        return np.asarray(points + w * turned + np.cross(axis, turned) + self.position)
