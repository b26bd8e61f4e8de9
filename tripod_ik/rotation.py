"""Tilts of the effector by its normal, and quaternions that others send."""

import math

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.errors import IkError


def normal_of(roll: float, pitch: float) -> FloatArray:
    """Return the normal n of an effector turned by `roll` about x, then by `pitch` about y [rad], shape (3,).

    n = (sin p cos r, -sin r, cos p cos r): the third column of R_y(p) R_x(r), whatever yaw follows before.
    """
    return np.array(
        [
            math.sin(pitch) * math.cos(roll),
            -math.sin(roll),
            math.cos(pitch) * math.cos(roll),
        ]
    )


def roll_pitch(normal: FloatArray) -> tuple[float, float]:
    """Return roll and pitch [rad] of a unit `normal`: the inverse of `normal_of` for |pitch| < 90 degrees."""
    x, y, z = (float(v) for v in normal)
    return math.asin(min(1.0, max(-1.0, -y))), math.atan2(x, z)


def tilt_between(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the shortest rotation vector [rad] in world that turns the unit vector `start` into `end`, shape (3,)."""
    axis = np.cross(start, end)
    sine, cosine = float(np.linalg.norm(axis)), float(start @ end)
    if sine > 1e-12:
        return np.asarray(axis * (math.atan2(sine, cosine) / sine))
    if cosine > 0:
        return np.zeros(3)
    across = np.cross(start, np.eye(3)[int(np.argmin(np.abs(start)))])  # opposite: any axis across does
    return np.asarray(across * (math.pi / np.linalg.norm(across)))


def unit_quaternion(name: str, quaternion: FloatArray) -> FloatArray:
    """Return `quaternion`, shape (4,), with length one; raise IkError where it is no rotation at all."""
    length = float(np.linalg.norm(quaternion))
    if not abs(length - 1.0) < 1e-2:
        raise IkError(f"{name} has length {length:g}; it must be a unit quaternion (x, y, z, w)")
    return np.asarray(quaternion / length)
