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
