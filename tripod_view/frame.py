"""What the camera is to show: a box about all that is drawn, and the place from which it is seen. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_view.drawing import Aim
from tripod_view.picture import Picture

FIELD = 0.6
"""Of view of the camera, up and down [rad]."""

AZIMUTH, ELEVATION = -50.0, 30.0
"""Of the camera, from what is seen [degrees]."""

DIRECTION = np.array(
    [
        np.cos(np.radians(ELEVATION)) * np.cos(np.radians(AZIMUTH)),
        np.cos(np.radians(ELEVATION)) * np.sin(np.radians(AZIMUTH)),
        np.sin(np.radians(ELEVATION)),
    ]
)
"""From what is seen to the camera."""

RIGHT = np.cross([0.0, 0.0, 1.0], DIRECTION) / np.linalg.norm(DIRECTION[:2])
UP = np.cross(DIRECTION, RIGHT)
"""Of the picture, which is taken to be as wide as it is high: it never is much narrower."""

MARGIN = 1.05
"""Distance of the camera over that at which the corners of the box touch the edge of the picture."""

FAR = 6.0
"""The camera goes along with bodies that leave their first place by so many times their size."""

LOST = 20.0
"""A body that is so many times the size of all of them from where they began is left alone, where others are not."""

GONE = 1000.0
"""Bodies that have come so many times their size fall for ever, too fast to be followed."""

ROBOT = 0.085
"""Radius in which the robot stands [m]."""

NEAR = 0.025
"""How far from its axis a servo reaches [m]."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A box [m], shape (3,) each, and the height of the ground under it [m]."""

    low: FloatArray
    high: FloatArray
    floor: float

    @property
    def centre(self) -> FloatArray:
        """Of the box [m]."""
        return np.asarray(0.5 * (self.low + self.high))

    @property
    def radius(self) -> float:
        """Of the sphere about it [m]."""
        return max(0.5 * float(np.linalg.norm(self.high - self.low)), 1e-4)

    @property
    def camera(self) -> FloatArray:
        """From where all of it is seen [m]."""
        corners = np.array(list(product(*zip(self.low, self.high, strict=True)))) - self.centre
        aside = np.abs(corners @ np.column_stack([RIGHT, UP])).max(axis=1)
        distance = max(float((corners @ DIRECTION + aside / np.tan(FIELD / 2)).max()), self.radius)
        return np.asarray(self.centre + DIRECTION * MARGIN * distance)

    @property
    def aim(self) -> Aim:
        """How a page is to show it."""
        x, y, z = self.centre.tolist()
        distance = float(np.linalg.norm(self.camera - self.centre))
        floor = self.floor - 0.004 * self.radius
        return Aim((x, y, z), distance * float(np.sin(FIELD / 2)), AZIMUTH, ELEVATION, floor)


def frame(picture: Picture, nodes: FloatArray | None, depth: float) -> Frame:
    """Return what the camera is to show.

    What hangs swings: a body that is held somewhere is given room below and beyond that. Of large obstacles only what
    is near the bodies counts.

    Args:
        picture: The scene.
        nodes: Of the bodies, as they are [m], shape (n, 3); None while they are not known.
        depth: Of the servo axes where no scene is known [m].
    """
    boxes = [] if nodes is None or not len(nodes) else [span(nodes)]
    if boxes and len(picture.held) and any(part.kind == "springs" for part in picture.parts):
        boxes.append(_swing(picture.held.mean(axis=0), *boxes[0]))
    for arm in picture.servos.arms if picture.servos else ():
        hub = np.array(arm.hub)
        boxes.append(np.add(hub, [[-NEAR, -NEAR, 0.0], [NEAR, NEAR, arm.length]]))
        depth = max(depth, arm.length)
    if picture.servos or not (picture.name and boxes):
        boxes.append(np.array([[-ROBOT, -ROBOT, -depth - 0.012], [ROBOT, ROBOT, 0.012]]))
    low, high = union(boxes)
    reach = 0.6 * float((high - low).max())
    for obstacle in picture.obstacles:
        bottom, top = obstacle.nodes.min(axis=0), obstacle.nodes.max(axis=0)
        boxes.append(np.array([np.maximum(bottom, low - reach), np.minimum(top, high + reach)]))
    low, high = union(boxes)
    return Frame(low, high, float(low[2]))


def widened(seen: FloatArray, box: FloatArray) -> FloatArray:
    """Return the box about what was seen and what is there now, shape (2, 3) each.

    Or the latter alone where that is far away: beside the whole way it would be a speck.
    """
    both = union([seen, box])
    return box if np.linalg.norm(both[1] - both[0]) > FAR * np.linalg.norm(box[1] - box[0]) else both


def gone(first: FloatArray, box: FloatArray) -> float:
    """Return how far bodies have come from their first box [m], shape (2, 3) each, where that is too far to look at."""
    far = float(np.linalg.norm(box.mean(axis=0) - first.mean(axis=0)))
    return far if far > GONE * float(np.linalg.norm(box[1] - box[0])) else 0.0


def staying(first: FloatArray, boxes: FloatArray) -> NDArray[np.bool_]:
    """Return which bodies are to be seen: those that are not lost, or all where none has stayed.

    Else what falls off a table would take the camera so far away that nothing is seen of what lies on it.

    Args:
        first: Box about all of them in the beginning [m], shape (2, 3).
        boxes: About each of them now [m], shape (b, 2, 3).
    """
    far = np.linalg.norm(boxes.mean(axis=1) - first.mean(axis=0), axis=1)
    near = far <= LOST * np.linalg.norm(first[1] - first[0])
    return near if near.any() else ~near


def union(boxes: Sequence[FloatArray] | FloatArray) -> FloatArray:
    """Return the box about boxes [m], shape (b, 2, 3)."""
    corners = np.asarray(boxes)
    return np.array([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])


def span(nodes: FloatArray) -> FloatArray:
    """Return the box about `nodes` [m], shape (2, 3)."""
    axes = np.ascontiguousarray(nodes.T)  # along the rows of many points NumPy is slow
    return np.array([axes.min(axis=1), axes.max(axis=1)])


def _swing(held: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the box in which a body may swing that is held at a point: mirrored, and as far down as it is long."""
    reach = np.maximum(np.abs(low - held), np.abs(high - held))
    down = float(reach.max())
    return np.array([[*(held - reach)[:2], held[2] - down], [*(held + reach)[:2], held[2]]])
