"""Servo angles for a tilt: the linear response of the robot about the pose in which it plays."""

from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_play.errors import PlayError


@dataclass(frozen=True, eq=False)
class TiltMap:
    """Angles a = a_0 + M (tilt_x, tilt_y, rise): M is the inverse of three rows of the effector's Jacobian; of more
    than three servos the one that moves them least.

    Attributes:
        angles: a_0, of the level plate [rad], shape (s,).
        matrix: M [rad/rad, rad/m], shape (s, 3).
        low, high: Smallest and largest servo angles [rad], shape (s,).
    """

    angles: FloatArray
    matrix: FloatArray
    low: FloatArray
    high: FloatArray

    def __call__(self, tilt: FloatArray, rise: float = 0.0) -> FloatArray:
        """Return the servo angles [rad], shape (s,), within their limits.

        Args:
            tilt: Rotation about x and y of `world` [rad], shape (2,).
            rise: Of the effector [m].
        """
        wanted = self.angles + self.matrix @ np.array([tilt[0], tilt[1], rise])
        return np.asarray(np.clip(wanted, self.low, self.high))


def tilt_map(w: FloatArray, angles: FloatArray, low: FloatArray, high: FloatArray) -> TiltMap:
    """Return the map about one state.

    Args:
        w: Compliance of effector and servos there, shape (6 + s, 6 + s), see `tripod_sim.compliance`.
        angles: Servo angles there [rad], shape (s,).
        low, high: Limits of the servo angles [rad], shape (s,).

    Raises:
        PlayError: the servos cannot tilt the effector in that state.
    """
    return TiltMap(np.array(angles), _inverse(_jacobian(w)), low, high)


def lever_of(w: FloatArray) -> float:
    """Return how far the effector's centre moves sideways per tilt, as that of a mast about its foot [m].

    Args:
        w: As for `tilt_map`.

    Raises:
        PlayError: the servos cannot tilt the effector in that state.
    """
    rows = _jacobian(w)
    shift = rows[:2] @ _inverse(rows)  # x, y by tilt about x, y and rise
    return float(0.5 * (shift[0, 1] - shift[1, 0]))


def _inverse(rows: FloatArray) -> FloatArray:
    """Return servo angles by tilt about x, y and rise, shape (s, 3), for motion of the effector by angle, (6, s)."""
    own = rows[[3, 4, 2]]
    square = own.shape[1] == len(own)
    return np.asarray(np.linalg.inv(own) if square else np.linalg.pinv(own), dtype=np.float64)


def _jacobian(w: FloatArray) -> FloatArray:
    """Return motion of the effector by angle, shape (6, s), if it can tilt and rise. Raises PlayError."""
    try:
        rows = w[:6, 6:] @ np.linalg.inv(w[6:, 6:])
        if np.linalg.cond(rows[[3, 4, 2]] * np.array([[1.0], [1.0], [20.0]])) < 1e3:
            return np.asarray(rows)
    except np.linalg.LinAlgError:
        pass
    raise PlayError("the servos cannot tilt the effector in this pose; go to the working pose first")
