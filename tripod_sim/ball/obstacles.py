"""What stands on a plate, sorted into a grid so that a ball asks only what is next to it."""

from dataclasses import dataclass, field

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray

MOST_CELLS = 250_000


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Boxes and triangles in the frame of a plate, whose top is z = 0.

    Attributes:
        boxes: Centre and half extents [m], shape (m, 6); if there are holes, box 0 is the floor.
        triangles: Corners [m], shape (n, 9).
        holes: Centre x, y and radius of round holes in the floor [m], shape (h, 3).
        extent: Low x, y and high x, y of the board and its underside [m], shape (5,).
        cell: Size of a cell of the grid [m].
        grid: Columns, rows, low x, low y and cell size, shape (5,).
        starts, items: Cell c has the obstacles items[starts[c]:starts[c + 1]]; boxes are counted first.
    """

    boxes: FloatArray
    triangles: FloatArray
    holes: FloatArray
    extent: FloatArray
    cell: float
    grid: FloatArray = field(init=False)
    starts: IndexArray = field(init=False)
    items: IndexArray = field(init=False)

    def __post_init__(self) -> None:
        for name, width in (("boxes", 6), ("triangles", 9), ("holes", 3)):
            array = np.array(getattr(self, name), dtype=float).reshape(-1, width)
            object.__setattr__(self, name, array)
        corners = self.triangles.reshape(-1, 3, 3)
        low = np.concatenate([self.boxes[:, :2] - self.boxes[:, 3:5], corners[:, :, :2].min(axis=1)])
        high = np.concatenate([self.boxes[:, :2] + self.boxes[:, 3:5], corners[:, :, :2].max(axis=1)])
        origin, size = low.min(axis=0), self.cell
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
        object.__setattr__(self, "grid", np.array([columns, rows, *origin, size], dtype=float))
        object.__setattr__(self, "starts", np.cumsum([0, *map(len, members)]).astype(np.int64))
        object.__setattr__(self, "items", np.array([k for cell in members for k in cell], dtype=np.int64))
