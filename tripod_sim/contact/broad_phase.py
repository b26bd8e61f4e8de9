"""Broad phase: which boxes are near, by comparing all with all (the reference) or by a tree of boxes."""

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.contact import broad_kernels as kernels


class Boxes:
    """Axis-aligned boxes around shapes that move from one place to another.

    Attributes:
        shapes: Vertices of each shape, shape (m, k).
        low, high: Corners of the boxes [m], shape (m, 3).
    """

    def __init__(self, shapes: IndexArray, radius: FloatArray | None = None) -> None:
        """`radius`: of each shape, a ball [m], shape (m,); zero without it."""
        self._radius = np.zeros(len(shapes)) if radius is None else radius
        self.shapes = np.ascontiguousarray(shapes, dtype=np.int64)
        self.low, self.high = np.zeros((2, len(shapes), 3))

    def sweep(self, start: FloatArray, end: FloatArray) -> None:
        """Enclose the shapes on their way from `start` to `end` [m], shape (n, 3)."""
        kernels.swept_boxes(start, end, self.shapes, self._radius, self.low, self.high)


class Tree:
    """A tree of boxes: its time grows with n log n and the pairs found."""

    MANY = 4096
    """Boxes from which on a search takes them along the curve, so that it finds what it needs in the cache."""

    def __init__(self, boxes: Boxes) -> None:
        self._boxes, count = boxes, len(boxes.shapes)
        leaves = 1 << max(0, int(count - 1).bit_length())
        self._nodes = np.zeros((2 * leaves - 1, 6))
        self._order = _Order(count)
        self._asked = _Order(0)
        self._out = np.zeros((64, 2), dtype=np.int64)

    def update(self) -> None:
        """Take over the boxes as they are now."""
        b = self._boxes
        self._order.sort(b)
        kernels.refit(b.low, b.high, self._order.places, self._nodes)

    def pairs(self, boxes: Boxes | None = None, margin: float = 0.0) -> IndexArray:
        """Return (box, box of this collection) nearer than `margin` [m] along each axis, shape (p, 2), a view.

        Without `boxes` among its own.
        """
        own, query = boxes is None, boxes or self._boxes
        order = self._order.places
        if not len(order):
            return self._out[:0]
        asked = order if own else self._turns(query)
        while True:
            count = kernels.overlaps(query.low, query.high, margin, asked, order, self._nodes, own, self._out)
            if count <= len(self._out):
                return self._out[:count]
            self._out = np.zeros((count + count // 2, 2), dtype=np.int64)

    def _turns(self, boxes: Boxes) -> IndexArray:
        """Return the order in which `boxes` are looked up."""
        if len(self._asked.places) != len(boxes.low):
            self._asked = _Order(len(boxes.low))
        if len(boxes.low) >= self.MANY:
            self._asked.sort(boxes)
        return self._asked.places


class _Order:
    """Places of boxes along a Z-curve, as they come until they are sorted."""

    def __init__(self, count: int) -> None:
        self.places = np.arange(count)
        self._codes, self._spare = np.zeros((2, count), dtype=np.int64)

    def sort(self, boxes: Boxes) -> None:
        kernels.curve_order(boxes.low, boxes.high, self._codes)
        kernels.sort_codes(self._codes, self.places, self._spare)
