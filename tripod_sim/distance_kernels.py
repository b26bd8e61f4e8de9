"""Distances of points, segments and triangles: closest points as weights of the vertices, robust for degenerate shapes.

A triangle may be a segment or a point, a segment a point, and all may coincide: the answer is then one of the closest
pairs, never NaN. Every closest point is the best of the candidates on features of all dimensions, so that rounding in
one of them cannot win over a better other.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array

SLIVER = 1e-14
"""Squared sine of the angle of two directions below which they count as parallel."""


@njit(cache=True, error_model="numpy", inline="always")
def _along(
    w0: float, w1: float, w2: float, u0: float, u1: float, u2: float, square: float
) -> tuple[float, float]:
    """Return t in 0..1 of the point t u closest to `w`, and the squared distance; `square` is u . u.

    Numbers instead of arrays: in the loops over pairs, views of rows took four times as long as the arithmetic.
    """
    t = 0.0
    if square > 0.0:
        t = min(max((w0 * u0 + w1 * u1 + w2 * u2) / square, 0.0), 1.0)
    d0, d1, d2 = w0 - t * u0, w1 - t * u1, w2 - t * u2
    return t, d0 * d0 + d1 * d1 + d2 * d2


@njit(cache=True, error_model="numpy")
def point_triangle_distance(p: Array, a: Array, b: Array, c: Array) -> tuple[float, float, float, float]:
    """Return the weights of `a`, `b`, `c` of the triangle's point closest to `p`, and the squared distance [m²].

    The weights are not negative and sum to 1; exact zeros tell that the point lies on an edge or vertex.
    """
    u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    v0, v1, v2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    w0, w1, w2 = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    uu, vv = u0 * u0 + u1 * u1 + u2 * u2, v0 * v0 + v1 * v1 + v2 * v2
    t, best = _along(w0, w1, w2, u0, u1, u2, uu)
    wa, wb, wc = 1.0 - t, t, 0.0
    e0, e1, e2 = c[0] - b[0], c[1] - b[1], c[2] - b[2]
    t, d = _along(p[0] - b[0], p[1] - b[1], p[2] - b[2], e0, e1, e2, e0 * e0 + e1 * e1 + e2 * e2)
    if d < best:
        best, wa, wb, wc = d, 0.0, 1.0 - t, t
    t, d = _along(p[0] - c[0], p[1] - c[1], p[2] - c[2], -v0, -v1, -v2, vv)
    if d < best:
        best, wa, wb, wc = d, t, 0.0, 1.0 - t
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    area = n0 * n0 + n1 * n1 + n2 * n2
    if area > SLIVER * uu * vv:
        # weights of b and c: (w x v) . n / n², (u x w) . n / n²
        y = ((w1 * v2 - w2 * v1) * n0 + (w2 * v0 - w0 * v2) * n1 + (w0 * v1 - w1 * v0) * n2) / area
        z = ((u1 * w2 - u2 * w1) * n0 + (u2 * w0 - u0 * w2) * n1 + (u0 * w1 - u1 * w0) * n2) / area
        if y > 0.0 and z > 0.0 and y + z < 1.0:
            d0, d1, d2 = w0 - y * u0 - z * v0, w1 - y * u1 - z * v1, w2 - y * u2 - z * v2
            d = d0 * d0 + d1 * d1 + d2 * d2
            if d <= best:
                best, wa, wb, wc = d, 1.0 - y - z, y, z
    return wa, wb, wc, best


@njit(cache=True, error_model="numpy")
def segment_segment(a: Array, b: Array, c: Array, d: Array) -> tuple[float, float, float]:
    """Return s, t and the squared distance [m²] of the closest points a + s (b - a) and c + t (d - c)."""
    u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    v0, v1, v2 = d[0] - c[0], d[1] - c[1], d[2] - c[2]
    w0, w1, w2 = a[0] - c[0], a[1] - c[1], a[2] - c[2]
    uu, vv = u0 * u0 + u1 * u1 + u2 * u2, v0 * v0 + v1 * v1 + v2 * v2
    t, best = _along(w0, w1, w2, v0, v1, v2, vv)
    s = 0.0
    other, dist = _along(b[0] - c[0], b[1] - c[1], b[2] - c[2], v0, v1, v2, vv)
    if dist < best:
        best, s, t = dist, 1.0, other
    other, dist = _along(-w0, -w1, -w2, u0, u1, u2, uu)
    if dist < best:
        best, s, t = dist, other, 0.0
    other, dist = _along(d[0] - a[0], d[1] - a[1], d[2] - a[2], u0, u1, u2, uu)
    if dist < best:
        best, s, t = dist, other, 1.0
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    cross = n0 * n0 + n1 * n1 + n2 * n2
    if cross > SLIVER * uu * vv:
        uv = u0 * v0 + u1 * v1 + u2 * v2
        uw, vw = u0 * w0 + u1 * w1 + u2 * w2, v0 * w0 + v1 * w1 + v2 * w2
        x, y = (uv * vw - vv * uw) / cross, (uu * vw - uv * uw) / cross
        if 0.0 < x < 1.0 and 0.0 < y < 1.0:
            d0, d1, d2 = w0 + x * u0 - y * v0, w1 + x * u1 - y * v1, w2 + x * u2 - y * v2
            dist = d0 * d0 + d1 * d1 + d2 * d2
            if dist <= best:
                best, s, t = dist, x, y
    return s, t, best


@njit(cache=True, error_model="numpy")
def triangle_normal(a: Array, b: Array, c: Array, out: Array) -> None:
    """Write the unit normal of a triangle; of a degenerate one write some unit vector across its longest side."""
    u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    v0, v1, v2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    out[0], out[1], out[2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    uu, vv = u0 * u0 + u1 * u1 + u2 * u2, v0 * v0 + v1 * v1 + v2 * v2
    square = out[0] * out[0] + out[1] * out[1] + out[2] * out[2]
    if square > SLIVER * uu * vv:
        length = np.sqrt(square)
        for i in range(3):
            out[i] /= length
        return
    if uu < vv:
        u0, u1, u2 = v0, v1, v2
    across(u0, u1, u2, out)


@njit(cache=True, error_model="numpy")
def across(u0: float, u1: float, u2: float, out: Array) -> None:
    """Write a unit vector at right angles to `u`; the z axis, leant towards that, where `u` is (nearly) zero."""
    square = u0 * u0 + u1 * u1 + u2 * u2
    if not square > 1e-200:
        out[0], out[1], out[2] = 0.0, 0.0, 1.0
        return
    # e - (e . u) u / u² with the axis e least along u, the z axis where it may be
    k = 2
    if abs(u1) < 0.5 * abs(u2):
        k = 1
    if abs(u0) < 0.5 * min(abs(u1), abs(u2)):
        k = 0
    along = (u0 if k == 0 else u1 if k == 1 else u2) / square
    out[0], out[1], out[2] = -along * u0, -along * u1, -along * u2
    out[k] += 1.0
    length = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    for i in range(3):
        out[i] /= length


@njit(cache=True, error_model="numpy")
def nearest_places(
    points: Array, corners: Array, first: Array, candidates: Array, places: Array, squares: Array
) -> None:
    """Write the place of triangles nearest to each point, and its squared distance.

    Args:
        points: Positions [m], shape (k, 3).
        corners: Of the triangles [m], shape (m, 3, 3).
        first: The candidates of point p are candidates[first[p] : first[p + 1]], shape (k + 1,).
        candidates: Triangles, shape (c,).
        places: Takes the nearest places [m], shape (k, 3); stays as it is for a point without candidates.
        squares: Takes the squared distances [m²], shape (k,).
    """
    for p in range(len(points)):
        squares[p] = np.inf
        for k in range(first[p], first[p + 1]):
            a, b, c = corners[candidates[k], 0], corners[candidates[k], 1], corners[candidates[k], 2]
            wa, wb, wc, square = point_triangle_distance(points[p], a, b, c)
            if square < squares[p]:
                squares[p] = square
                for i in range(3):
                    places[p, i] = wa * a[i] + wb * b[i] + wc * c[i]
