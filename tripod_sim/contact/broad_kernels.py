"""Loops of the broad phase: boxes around moving shapes, a tree of boxes, and the pairs that overlap.

The tree is a complete binary one over the shapes in the order of a Z-curve through their centres
[LauterbachEtAl2009]: node k has the children 2 k + 1 and 2 k + 2, so that it needs no pointers, and a refit is one
pass from the end. Shapes beyond the last are empty boxes, which overlap nothing.
"""

from typing import Any

import numpy as np
from numba import njit

Array = Any

DEPTH = 64
"""Entries of the stack of a traversal; a tree of 2^40 leaves needs fewer."""


@njit(cache=True, error_model="numpy")
def swept_boxes(start: Array, end: Array, shapes: Array, margin: float, low: Array, high: Array) -> None:
    """Write the boxes of shapes (m, k of vertices) that move from `start` to `end`, grown by `margin` [m]."""
    for s in range(shapes.shape[0]):
        for i in range(3):
            least, most = np.inf, -np.inf
            for k in range(shapes.shape[1]):
                a, b = start[shapes[s, k], i], end[shapes[s, k], i]
                least, most = min(least, a, b), max(most, a, b)
            low[s, i], high[s, i] = least - margin, most + margin


@njit(cache=True, error_model="numpy")
def _spread(v: int) -> int:
    """Return the ten bits of v with two zeros between any two."""
    v = (v | (v << 16)) & 0x030000FF
    v = (v | (v << 8)) & 0x0300F00F
    v = (v | (v << 4)) & 0x030C30C3
    return (v | (v << 2)) & 0x09249249


@njit(cache=True, error_model="numpy")
def curve_order(low: Array, high: Array, codes: Array) -> None:
    """Write where the centre of each box lies along a Z-curve through all of them."""
    least, most = np.full(3, np.inf), np.full(3, -np.inf)
    for s in range(low.shape[0]):
        for i in range(3):
            c = low[s, i] + high[s, i]
            least[i], most[i] = min(least[i], c), max(most[i], c)
    for s in range(low.shape[0]):
        code = 0
        for i in range(3):
            size = most[i] - least[i]
            part = (low[s, i] + high[s, i] - least[i]) / size if size > 0.0 else 0.0
            code |= _spread(int(min(max(part * 1024.0, 0.0), 1023.0))) << i
        codes[s] = code


@njit(cache=True, error_model="numpy")
def refit(low: Array, high: Array, order: Array, node_low: Array, node_high: Array) -> None:
    """Write the boxes of all nodes of a tree over the shapes' boxes."""
    leaves = (node_low.shape[0] + 1) // 2
    first = leaves - 1
    for k in range(leaves):
        if k < order.shape[0]:
            for i in range(3):
                node_low[first + k, i], node_high[first + k, i] = low[order[k], i], high[order[k], i]
        else:
            node_low[first + k, :], node_high[first + k, :] = np.inf, -np.inf
    for k in range(first - 1, -1, -1):
        a, b = 2 * k + 1, 2 * k + 2
        for i in range(3):
            node_low[k, i] = min(node_low[a, i], node_low[b, i])
            node_high[k, i] = max(node_high[a, i], node_high[b, i])


@njit(cache=True, error_model="numpy")
def overlaps(
    low: Array, high: Array, order: Array, node_low: Array, node_high: Array, own: bool, out: Array
) -> int:
    """Write pairs (box, shape of the tree) that overlap, as many as fit in `out`; return how many there are.

    With `own` the boxes are those of the tree's shapes, and each pair of two different ones comes once.
    """
    first = (node_low.shape[0] + 1) // 2 - 1
    stack = np.empty(DEPTH, dtype=np.int64)
    count = 0
    for q in range(low.shape[0]):
        l0, l1, l2 = low[q, 0], low[q, 1], low[q, 2]
        h0, h1, h2 = high[q, 0], high[q, 1], high[q, 2]
        stack[0] = 0
        top = 1
        while top > 0:
            top -= 1
            k = stack[top]
            if (
                node_low[k, 0] > h0
                or node_high[k, 0] < l0
                or node_low[k, 1] > h1
                or node_high[k, 1] < l1
                or node_low[k, 2] > h2
                or node_high[k, 2] < l2
            ):
                continue
            if k < first:
                stack[top], stack[top + 1] = 2 * k + 2, 2 * k + 1
                top += 2
                continue
            s = order[k - first]
            if own and s <= q:
                continue
            if count < out.shape[0]:
                out[count, 0], out[count, 1] = q, s
            count += 1
    return count


@njit(cache=True, error_model="numpy")
def all_overlaps(low: Array, high: Array, other_low: Array, other_high: Array, own: bool, out: Array) -> int:
    """The same by comparing all with all."""
    count = 0
    for q in range(low.shape[0]):
        for s in range(q + 1 if own else 0, other_low.shape[0]):
            apart = False
            for i in range(3):
                apart |= low[q, i] > other_high[s, i] or high[q, i] < other_low[s, i]
            if not apart:
                if count < out.shape[0]:
                    out[count, 0], out[count, 1] = q, s
                count += 1
    return count
