"""Rotations as scenes write them, and how the rotation vector of a step turns a body."""

import numpy as np

from tripod_sim.mesh.solid_mesh import FloatArray


def turned_by(quaternion: tuple[float, float, float, float]) -> FloatArray:
    """Return the rotation matrix of a quaternion x, y, z, w of norm about 1, shape (3, 3)."""
    x, y, z, w = np.array(quaternion) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def left_jacobian(theta: FloatArray) -> FloatArray:
    """Return J, shape (3, 3): exp(theta + d) is exp(J d) exp(theta) to first order in d.

    J = 1 + (1 - cos t) / t² [theta]x + (t - sin t) / t³ [theta]x², t = |theta|.
    """
    t = float(np.sqrt(theta @ theta))
    x, y, z = theta.tolist()
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if t < 1e-4:
        return np.asarray(np.eye(3) + 0.5 * cross + cross @ cross / 6)
    return np.asarray(np.eye(3) + (1 - np.cos(t)) / t**2 * cross + (t - np.sin(t)) / t**3 * (cross @ cross))
