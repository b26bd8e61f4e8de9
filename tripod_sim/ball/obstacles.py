"""What stands on a plate, sorted into a grid so that a ball asks only what is next to it."""

from typing import NamedTuple

import numpy as np

from tripod_host.arrays import Array, FloatArray

MOST_CELLS = 250_000


class Obstacles(NamedTuple):
    """Boxes and triangles in the frame of a plate, whose top is z = 0, as kernels take them.

    Attributes:
        boxes: Centre and half extents [m], shape (m, 6); if there are holes, box 0 is the floor.
        triangles: Corners [m], shape (n, 9).
        holes: Centre x, y and radius of round holes in the floor [m], shape (h, 3).
        extent: Low x, y and high x, y of the board and its underside [m], shape (5,).
        grid: Columns, rows, low x, low y and cell size, shape (5,).
        starts, items: Cell c has the obstacles items[starts[c]:starts[c + 1]]; boxes are counted first.
    """

    boxes: Array
    triangles: Array
    holes: Array
    extent: Array
    grid: Array
    starts: Array
    items: Array


def sorted_obstacles(
    boxes: FloatArray, triangles: FloatArray, holes: FloatArray, extent: FloatArray, size: float
) -> Obstacles:
    """Return obstacles, sorted into a grid of cells of `size` [m], or larger where that would be too many."""
    boxes, triangles, holes = (
        np.array(array, dtype=float).reshape(-1, width)
        for array, width in ((boxes, 6), (triangles, 9), (holes, 3))
    )
    corners = triangles.reshape(-1, 3, 3)
    low = np.concatenate([boxes[:, :2] - boxes[:, 3:5], corners[:, :, :2].min(axis=1)])
    high = np.concatenate([boxes[:, :2] + boxes[:, 3:5], corners[:, :, :2].max(axis=1)])
    origin = low.min(axis=0)
    span = high.max(axis=0) - origin
    while np.prod(np.floor(span / size) + 1) > MOST_CELLS:
        size *= 2
    columns, rows = (int(n) for n in np.floor(span / size) + 1)
    first = np.floor((low - origin) / size).astype(np.int64)
    last = np.minimum(np.floor((high - origin) / size).astype(np.int64), [columns - 1, rows - 1])
    members: list[list[int]] = [[] for _ in range(columns * rows)]
    for k, (a, b) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        for row in range(a[1], b[1] + 1):
            for column in range(a[0], b[0] + 1):
                members[row * columns + column].append(k)
    grid = np.array([columns, rows, *origin, size], dtype=float)
    starts = np.cumsum([0, *map(len, members)]).astype(np.int64)
    items = np.array([k for cell in members for k in cell], dtype=np.int64)
    return Obstacles(boxes, triangles, holes, np.array(extent, dtype=float), grid, starts, items)
