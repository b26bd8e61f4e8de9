"""Triangles and lines into a picture with a depth, point by point."""

import numpy as np
from numba import njit

from tripod_host.arrays import FloatArray, IndexArray


@njit(cache=True)
def fill_triangles(
    points: FloatArray, triangles: IndexArray, colours: FloatArray, picture: FloatArray, depth: FloatArray
) -> None:
    """Draw triangles into `picture`, where nothing nearer is.

    Args:
        points: Column, row and 1 / distance of each vertex; 0 and less: behind the eye, shape (n, 3).
        triangles: Shape (m, 3).
        colours: Of each triangle, shape (m, 1, 3), or of each of its corners, shape (m, 3, 3).
        picture: Changed, shape (h, w, 3).
        depth: 1 / distance of what is there; changed, shape (h, w).
    """
    rows, columns = depth.shape
    smooth = colours.shape[1] == 3
    for t in range(len(triangles)):
        a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
        if min(a[2], b[2], c[2]) <= 0.0:
            continue
        area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
        if area == 0.0:
            continue
        left = max(0, int(np.ceil(min(a[0], b[0], c[0]))))
        right = min(columns - 1, int(np.floor(max(a[0], b[0], c[0]))))
        top = max(0, int(np.ceil(min(a[1], b[1], c[1]))))
        bottom = min(rows - 1, int(np.floor(max(a[1], b[1], c[1]))))
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                u = ((b[0] - x) * (c[1] - y) - (c[0] - x) * (b[1] - y)) / area
                v = ((c[0] - x) * (a[1] - y) - (a[0] - x) * (c[1] - y)) / area
                w = 1.0 - u - v
                if u < 0.0 or v < 0.0 or w < 0.0:
                    continue
                near = u * a[2] + v * b[2] + w * c[2]
                if near > depth[y, x]:
                    depth[y, x] = near
                    if smooth:
                        picture[y, x] = u * colours[t, 0] + v * colours[t, 1] + w * colours[t, 2]
                    else:
                        picture[y, x] = colours[t, 0]


@njit(cache=True)
def draw_lines(
    points: FloatArray,
    lines: IndexArray,
    colour: FloatArray,
    share: float,
    picture: FloatArray,
    depth: FloatArray,
) -> None:
    """Blend lines between `points` into `picture`, where nothing nearer is; `share`: how much of `colour`, 0 to 1."""
    rows, columns = depth.shape
    for k in range(len(lines)):
        a, b = points[lines[k, 0]], points[lines[k, 1]]
        if min(a[2], b[2]) <= 0.0:
            continue
        steps = int(min(max(abs(b[0] - a[0]), abs(b[1] - a[1])), 20000.0)) + 1
        for s in range(steps):
            w = s / steps
            x = int(np.rint(a[0] + w * (b[0] - a[0])))
            y = int(np.rint(a[1] + w * (b[1] - a[1])))
            if 0 <= x < columns and 0 <= y < rows and a[2] + w * (b[2] - a[2]) >= 0.999 * depth[y, x]:
                picture[y, x] += share * (colour - picture[y, x])
