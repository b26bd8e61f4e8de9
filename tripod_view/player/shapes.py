"""Triangles of simple shapes: vertices [m], shape (n, 3), and indices, shape (m, 3), seen from outside. Pure."""

from collections.abc import Sequence

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray

Shape = tuple[FloatArray, IndexArray]

_SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def box(size: Sequence[float], centre: Sequence[float] = (0.0, 0.0, 0.0)) -> Shape:
    """Return a box with edges `size` [m]."""
    triangles = [t for a, b, c, d in _SIDES for t in ((a, b, c), (a, c, d))]
    return _CORNERS * np.asarray(size) + np.asarray(centre), np.array(triangles)


def disc(radius: float, height: float, sides: int = 32) -> Shape:
    """Return a cylinder about Z, its centre in the origin [m]."""
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = radius * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    up = np.array([0.0, 0.0, height / 2])
    vertices = np.concatenate([ring - up, ring + up, [-up, up]])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    low, high = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    faces = [(i, j, j + sides), (i, j + sides, i + sides), (low, j, i), (high, i + sides, j + sides)]
    return vertices, np.concatenate([np.stack(f, axis=1) for f in faces])


def ball(radius: float, rings: int = 12) -> tuple[Shape, Shape]:
    """Return a ball as two shapes, every other eighth of it each: in two colours one sees it roll."""
    sides = 2 * rings
    polar = np.pi * np.arange(rings + 1) / rings
    turn = 2 * np.pi * np.arange(sides) / sides
    x = np.sin(polar)[:, None] * np.cos(turn)
    y = np.sin(polar)[:, None] * np.sin(turn)
    z = np.repeat(np.cos(polar)[:, None], sides, axis=1)
    vertices = radius * np.stack([x, y, z], axis=2).reshape(-1, 3)
    halves: tuple[list[tuple[int, int, int]], list[tuple[int, int, int]]] = ([], [])
    for r in range(rings):
        for s in range(sides):
            a, b = r * sides + s, r * sides + (s + 1) % sides
            kind = ((2 * r) // rings + (4 * s) // sides) % 2
            halves[kind].extend([(a, a + sides, b + sides), (a, b + sides, b)])
    one, other = (np.array(half) for half in halves)
    return (vertices, one), (vertices, other)


def joined(shapes: Sequence[Shape]) -> Shape:
    """Return several shapes as one."""
    counts = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)])
    triangles = [t + first for (_, t), first in zip(shapes, counts, strict=False)]
    return np.concatenate([vertices for vertices, _ in shapes]), np.concatenate(triangles)


def tube(points: FloatArray, radius: float) -> Shape:
    """Return a triangular tube along a line that moves.

    Args:
        points: Of the line in each of k pictures [m], shape (k, n, 3).
        radius: Of the tube [m].

    Returns:
        Vertices in each picture, shape (k, 6 (n - 1), 3), and triangles.
    """
    along = np.diff(points, axis=1)
    along /= np.maximum(np.linalg.norm(along, axis=2), 1e-12)[..., None]
    across = np.cross(along, np.where(np.abs(along[..., 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
    across /= np.maximum(np.linalg.norm(across, axis=2), 1e-12)[..., None]
    turn = 2 * np.pi * np.arange(3) / 3
    ring = radius * (
        np.cos(turn)[:, None] * across[:, :, None]
        + np.sin(turn)[:, None] * np.cross(along, across)[:, :, None]
    )  # (k, n - 1, 3, 3)
    vertices = np.concatenate([points[:, :-1, None] + ring, points[:, 1:, None] + ring], axis=2)
    sides = [t for a, b in ((0, 1), (1, 2), (2, 0)) for t in ((a, b, b + 3), (a, b + 3, a + 3))]
    triangles = np.array(sides) + 6 * np.arange(along.shape[1])[:, None, None]
    return vertices.reshape(len(points), -1, 3), triangles.reshape(-1, 3)
