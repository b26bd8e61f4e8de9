"""Broad phase: which boxes overlap, by comparing all with all (the reference) or by a tree of boxes."""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.contact import broad_kernels as kernels

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


class Boxes:
    """Axis-aligned boxes around shapes that move from one place to another.

    Attributes:
        shapes: Vertices of each shape, shape (m, k).
        low, high: Corners of the boxes [m], shape (m, 3).
    """

    def __init__(self, shapes: IndexArray) -> None:
        self.shapes = np.ascontiguousarray(shapes, dtype=np.int64)
        self.low, self.high = np.zeros((2, len(shapes), 3))

    def sweep(self, start: FloatArray, end: FloatArray, margin: float) -> None:
        """Enclose the shapes on their way from `start` to `end`, (n, 3), and `margin` [m] around them."""
        kernels.swept_boxes(start, end, self.shapes, margin, self.low, self.high)


class AllPairs:
    """Compares all with all: the reference, in quadratic time."""

    def __init__(self, boxes: Boxes) -> None:
        self._boxes = boxes
        self._out = np.zeros((64, 2), dtype=np.int64)

    def update(self) -> None:
        """Take over the boxes: there is nothing to prepare."""

    def pairs(self, boxes: Boxes | None = None) -> IndexArray:
        """Return (box, box of this collection) that overlap, shape (p, 2), a view; among its own without `boxes`."""
        own, query = boxes is None, boxes or self._boxes
        while True:
            b = self._boxes
            count = kernels.all_overlaps(query.low, query.high, b.low, b.high, own, self._out)
            if count <= len(self._out):
                return self._out[:count]
            self._out = np.zeros((count + count // 2, 2), dtype=np.int64)


class Tree:
    """A tree of boxes: its time grows with n log n and the pairs found."""

    def __init__(self, boxes: Boxes) -> None:
        self._boxes, count = boxes, len(boxes.shapes)
        leaves = 1 << max(0, int(count - 1).bit_length())
        self._low, self._high = np.zeros((2, 2 * leaves - 1, 3))
        self._codes, self._order = np.zeros(count, dtype=np.int64), np.arange(count)
        self._out = np.zeros((64, 2), dtype=np.int64)

    def update(self) -> None:
        """Take over the boxes as they are now."""
        b = self._boxes
        kernels.curve_order(b.low, b.high, self._codes)
        self._order = np.argsort(self._codes, kind="stable")
        kernels.refit(b.low, b.high, self._order, self._low, self._high)

    def pairs(self, boxes: Boxes | None = None) -> IndexArray:
        """Return (box, box of this collection) that overlap, shape (p, 2), a view; among its own without `boxes`."""
        own, query = boxes is None, boxes or self._boxes
        if not len(self._order):
            return self._out[:0]
        while True:
            count = kernels.overlaps(
                query.low, query.high, self._order, self._low, self._high, own, self._out
            )
            if count <= len(self._out):
                return self._out[:count]
            self._out = np.zeros((count + count // 2, 2), dtype=np.int64)
