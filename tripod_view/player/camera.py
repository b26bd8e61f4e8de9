"""From where a film is looked at: fitted to what moves in it. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_view.frame import AZIMUTH, ELEVATION, FAR, FIELD, MARGIN, span, staying
from tripod_view.player.film import Deforming, Film

HALF = FIELD / 2
"""Half the angle of view of the player [rad]."""

EIGHT = np.array(list(product((0, 1), repeat=3)))
"""Which end of a box each of its corners has along each axis, shape (8, 3)."""


@dataclass(frozen=True)
class Camera:
    """Where to look.

    Attributes:
        centre: What is looked at [m].
        radius: Of the sphere about it that is to be seen [m].
        azimuth, elevation: Of the eye from there [degrees].
        follow: Whether it goes along with the bodies: they go far.
        seen: Of each body, whether it is looked at: it has not left the others in the end.
        floor: Height of the ground [m].
    """

    centre: tuple[float, float, float]
    radius: float
    azimuth: float
    elevation: float
    follow: bool
    seen: tuple[bool, ...]
    floor: float


def camera(film: Film) -> Camera:
    """Return the camera that sees what moves in all pictures, and of what stands still the part near it."""
    first = span(_moving(film, film.bodies, pictures=1))
    size = float(np.linalg.norm(first[1] - first[0])) or 0.1
    seen = _seen(film.bodies, first)
    bodies = [body for body, stays in zip(film.bodies, seen, strict=True) if stays]
    points = _moving(film, bodies)
    follow = bool(np.linalg.norm(np.ptp(points, axis=0)) > FAR * size)
    if follow:
        points = _moving(film, bodies, pictures=1)
    low, high = span(points)
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
    azimuth, elevation = (-80.0, 10.0) if flat else (AZIMUTH, ELEVATION)
    needed = MARGIN * _needed(points - centre, np.radians(azimuth), np.radians(elevation))
    whole = 0.43 * float(np.linalg.norm(extent))  # of a sphere that a box does not fill
    return Camera(
        centre=(float(centre[0]), float(centre[1]), float(centre[2])),
        radius=max(whole, needed) or 0.05,
        azimuth=azimuth,
        elevation=elevation,
        follow=follow,
        seen=seen,
        floor=float(min(ground)) - 0.002 * size,
    )


def _seen(bodies: Sequence[Deforming], first: FloatArray) -> tuple[bool, ...]:
    """Return which bodies have not left the others in the end; `first`: box about all that moves at first [m]."""
    drawn = [b for b, body in enumerate(bodies) if body.positions.shape[1]]
    seen = np.ones(len(bodies), dtype=bool)
    if drawn:
        seen[drawn] = staying(first, np.array([_boxes(bodies[b])[-1] for b in drawn]))
    return tuple(seen.tolist())


def _moving(film: Film, bodies: Sequence[Deforming], pictures: int | None = None) -> FloatArray:
    """Return the corners of boxes about `bodies` and pieces that move, in the first `pictures` or in all, shape (n, 3).

    Where nothing moves: what stands still.
    """
    found = [
        _boxes(body)[:pictures, EIGHT, [0, 1, 2]].reshape(-1, 3) for body in bodies if body.positions.shape[1]
    ]
    for piece in film.pieces:
        if piece.poses is not None and len(piece.vertices):
            poses = piece.poses[:pictures]
            found.append(_corners(piece.vertices, poses[np.isfinite(poses).all(axis=1)]))
    found = [points for points in found if len(points)]
    return np.concatenate(found or [piece.vertices for piece in film.pieces] or [np.zeros((1, 3))])


def _needed(points: FloatArray, azimuth: float, elevation: float) -> float:
    """Return the radius at which all `points`, from the centre [m], shape (n, 3), are in the picture; angles [rad]."""
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    towards = points @ [ce * ca, ce * sa, se]
    aside = np.abs(points @ np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce]]).T).max(axis=1)
    return float((np.sin(HALF) * towards + np.cos(HALF) * aside).max())


def _boxes(body: Deforming) -> FloatArray:
    """Return the box about a body in each picture [m], shape (pictures, 2, 3)."""
    return np.stack([body.positions.min(axis=1), body.positions.max(axis=1)], axis=1)


def _corners(vertices: FloatArray, poses: FloatArray) -> FloatArray:
    """Return the corners of the box about `vertices` in each of some poses, shape (8 k, 3)."""
    corners = span(vertices)[EIGHT, [0, 1, 2]]
    axis, w = poses[:, None, 3:6], poses[:, None, 6:7]
    turned = 2 * np.cross(axis, corners)
    return np.asarray(corners + w * turned + np.cross(axis, turned) + poses[:, None, :3]).reshape(-1, 3)
