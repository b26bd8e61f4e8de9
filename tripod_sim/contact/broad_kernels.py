"""Loops of the broad phase: boxes around moving shapes, a tree of boxes, and the pairs that are near.

The tree is a complete binary one over the shapes in the order of a Z-curve through their centres
[LauterbachEtAl2009]: node k has the children 2 k + 1 and 2 k + 2, so that it needs no pointers, and a refit is one
pass from the end. Shapes beyond the last are empty boxes, which overlap nothing.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put

DEPTH = 64
"""Entries of the stack of a traversal; a tree of 2^40 leaves needs fewer."""


@njit(cache=True, error_model="numpy")
def swept_boxes(start: Array, end: Array, shapes: Array, radius: Array, low: Array, high: Array) -> None:
    """Write the boxes of shapes (m, k of vertices) that move from `start` to `end`, grown by `radius` (m,) [m]."""
    for s in range(shapes.shape[0]):
        for i in range(3):
            least, most = np.inf, -np.inf
            for k in range(shapes.shape[1]):
                a, b = start[shapes[s, k], i], end[shapes[s, k], i]
                least, most = min(least, a, b), max(most, a, b)
            low[s, i], high[s, i] = least - radius[s], most + radius[s]


@njit(cache=True, error_model="numpy")
def _spread(v: int) -> int:
    """Return the 16 bits of v with two zeros between any two."""
    v = (v | (v << 16)) & 0x00FF0000FF
    v = (v | (v << 8)) & 0xF00F00F00F
    v = (v | (v << 4)) & 0xC30C30C30C3
    return (v | (v << 2)) & 0x249249249249


@njit(cache=True, error_model="numpy")
def curve_order(low: Array, high: Array, codes: Array) -> None:
    """Write where the centre of each box lies along a Z-curve through all of them, as a number of 48 bits.

    Its cells are cubes: in what is flat or thin no half of the tree is split where the boxes overlap anyway.
    """
    least, most = np.full(3, np.inf), np.full(3, -np.inf)
    for s in range(low.shape[0]):
        for i in range(3):
            c = low[s, i] + high[s, i]
            least[i], most[i] = min(least[i], c), max(most[i], c)
    size = max(most[0] - least[0], most[1] - least[1], most[2] - least[2])
    scale = 65535.0 / size if size > 0.0 else 0.0
    for s in range(low.shape[0]):
        code = 0
        for i in range(3):
            part = (low[s, i] + high[s, i] - least[i]) * scale
            code |= _spread(int(min(max(part, 0.0), 65535.0))) << i
        codes[s] = code


@njit(cache=True, error_model="numpy")
def sort_codes(codes: Array, order: Array, spare: Array) -> None:
    """Write the order of ascending `codes`, of 48 bits, equal ones as they come: by four digits, the last one first.

    `spare` is scratch, as long as `order`.
    """
    n = codes.shape[0]
    for k in range(n):
        order[k] = k
    counts = np.empty(4097, dtype=np.int64)
    for digit in range(4):
        shift = 12 * digit
        counts[:] = 0
        for k in range(n):
            counts[((codes[k] >> shift) & 4095) + 1] += 1
        for c in range(4096):
            counts[c + 1] += counts[c]
        for k in range(n):
            d = (codes[order[k]] >> shift) & 4095
            spare[counts[d]] = order[k]
            counts[d] += 1
        put(order, spare)


@njit(cache=True, error_model="numpy")
def refit(low: Array, high: Array, order: Array, nodes: Array) -> None:
    """Write the boxes of all nodes of a tree over the shapes' boxes: lower, then upper corner, shape (2 l - 1, 6)."""
    leaves = (nodes.shape[0] + 1) // 2
    first = leaves - 1
    for k in range(leaves):
        if k < order.shape[0]:
            for i in range(3):
                nodes[first + k, i], nodes[first + k, 3 + i] = low[order[k], i], high[order[k], i]
        else:
            nodes[first + k, :3], nodes[first + k, 3:] = np.inf, -np.inf
    for k in range(first - 1, -1, -1):
        a, b = 2 * k + 1, 2 * k + 2
        for i in range(3):
            nodes[k, i] = min(nodes[a, i], nodes[b, i])
            nodes[k, 3 + i] = max(nodes[a, 3 + i], nodes[b, 3 + i])


@njit(cache=True, error_model="numpy")
def overlaps(
    low: Array, high: Array, margin: float, asked: Array, order: Array, nodes: Array, own: bool, out: Array
) -> int:
    """Write pairs (box, shape of the tree) nearer than `margin` [m] along each axis, as many as fit in `out`.

    Return how many there are.

    With `own` the boxes are those of the tree's shapes, and each pair of two different ones comes once. Boxes take
    their turn in the order `asked`: neighbours one after the other find the nodes that they need in the cache.
    """
    first = (nodes.shape[0] + 1) // 2 - 1
    stack = np.empty(DEPTH, dtype=np.int64)
    count = 0
    for turn in range(asked.shape[0]):
        q = asked[turn]
        l0, l1, l2 = low[q, 0] - margin, low[q, 1] - margin, low[q, 2] - margin
        h0, h1, h2 = high[q, 0] + margin, high[q, 1] + margin, high[q, 2] + margin
        stack[0] = 0
        top = 1
        while top > 0:
            top -= 1
            k = stack[top]
            if (
                nodes[k, 0] > h0
                or nodes[k, 3] < l0
                or nodes[k, 1] > h1
                or nodes[k, 4] < l1
                or nodes[k, 2] > h2
                or nodes[k, 5] < l2
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
