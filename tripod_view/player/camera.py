"""From where a film is looked at: fitted to what moves in it. Pure."""

from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_view.frame import FAR
from tripod_view.player.film import Film


@dataclass(frozen=True)
class Camera:
    """Where to look.

    Attributes:
        centre: What is looked at [m].
        radius: Of the sphere about it that is to be seen [m].
        azimuth, elevation: Of the eye from there [degrees].
        follow: Whether it goes along with the bodies: they go far.
        floor: Height of the ground [m].
    """

    centre: tuple[float, float, float]
    radius: float
    azimuth: float
    elevation: float
    follow: bool
    floor: float


def camera(film: Film) -> Camera:
    """Return the camera that sees what moves in all pictures, and of what stands still the part near it."""
    low, high = _moving(film)
    first_low, first_high = _moving(film, pictures=1)
    size = float(np.linalg.norm(first_high - first_low)) or 0.1
    follow = bool(np.linalg.norm(high - low) > FAR * size)
    if follow:
        low, high = first_low, first_high
    still = [piece.vertices for piece in film.pieces if piece.poses is None and len(piece.vertices)]
    near_low, near_high = low - 0.4 * size, high + 0.4 * size
    for vertices in still:
        low = np.minimum(low, np.maximum(vertices.min(axis=0), near_low))
        high = np.maximum(high, np.minimum(vertices.max(axis=0), near_high))
    extent = high - low
    flat = extent[1] < 0.15 * max(
        extent[0], extent[2]
    )  # a motion in the plane of x and z is seen from the front
    centre = (low + high) / 2
    ground = [low[2], *(vertices[:, 2].min() for vertices in still)]
    return Camera(
        centre=(float(centre[0]), float(centre[1]), float(centre[2])),
        radius=float(0.43 * np.linalg.norm(extent)) or 0.05,  # of a sphere that a box does not fill
        azimuth=-80.0 if flat else -50.0,
        elevation=10.0 if flat else 30.0,
        follow=follow,
        floor=float(min(ground)) - 0.002 * size,
    )


def _moving(film: Film, pictures: int | None = None) -> tuple[FloatArray, FloatArray]:
    """Return the corners of the box about what moves, in the first `pictures` or in all."""
    found = [body.positions[:pictures].reshape(-1, 3) for body in film.bodies if body.positions.shape[1]]
    for piece in film.pieces:
        if piece.poses is not None and len(piece.vertices):
            poses = piece.poses[:pictures]
            found.append(_corners(piece.vertices, poses[np.isfinite(poses).all(axis=1)]))
    found = [points for points in found if len(points)]
    points = np.concatenate(found or [piece.vertices for piece in film.pieces] or [np.zeros((1, 3))])
    return points.min(axis=0), points.max(axis=0)


def _corners(vertices: FloatArray, poses: FloatArray) -> FloatArray:
    """Return the corners of the box about `vertices` in each of some poses, shape (8 k, 3)."""
    ends = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    corners = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    axis, w = poses[:, None, 3:6], poses[:, None, 6:7]
    turned = 2 * np.cross(axis, corners)
    return np.asarray(corners + w * turned + np.cross(axis, turned) + poses[:, None, :3]).reshape(-1, 3)
