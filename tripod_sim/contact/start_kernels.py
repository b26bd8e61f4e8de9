"""Loops that find what passes through what at one instant."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.distance_kernels import point_triangle_distance, segment_segment


@njit(cache=True, error_model="numpy")
def _side(a: Array, b: Array, c: Array, p: Array) -> float:
    """Return six times the signed volume of the tetrahedron a b c p."""
    u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    v0, v1, v2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return float(
        (p[0] - a[0]) * (u1 * v2 - u2 * v1)
        + (p[1] - a[1]) * (u2 * v0 - u0 * v2)
        + (p[2] - a[2]) * (u0 * v1 - u1 * v0)
    )


@njit(cache=True, error_model="numpy")
def passes(p: Array, q: Array, a: Array, b: Array, c: Array) -> bool:
    """Return whether segment p q passes through triangle a b c; touching its border counts, lying in it does not."""
    one, two = _side(a, b, c, p), _side(a, b, c, q)
    if one * two > 0.0 or (one == 0.0 and two == 0.0):
        return False
    x, y, z = _side(p, q, a, b), _side(p, q, b, c), _side(p, q, c, a)
    return (x >= 0.0 and y >= 0.0 and z >= 0.0) or (x <= 0.0 and y <= 0.0 and z <= 0.0)


@njit(cache=True, error_model="numpy")
def _stand_off(p: Array, q: Array, a: Array, b: Array, c: Array, least: float) -> bool:
    """Return whether p and q are both farther than `least` [m] from the plane of triangle a b c."""
    normal = np.cross(b - a, c - a)
    size = np.sqrt((normal * normal).sum())
    one, two = abs(_side(a, b, c, p)), abs(_side(a, b, c, q))
    return bool(min(one, two) > least * size)


@njit(cache=True, error_model="numpy")
def mark_passing(pairs: Array, edges: Array, triangles: Array, x: Array, least: float, out: Array) -> None:
    """Mark the vertices of edges and triangles (pairs of their numbers) that pass through each other, `out` (n,).

    Where `least` [m] is positive only edges count of which both ends are farther than that from the plane of the
    triangle: in a surface that is flat, but for rounding, none does.
    """
    for k in range(pairs.shape[0]):
        e, t = pairs[k, 0], pairs[k, 1]
        p, q = edges[e, 0], edges[e, 1]
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if p in (a, b, c) or q in (a, b, c):
            continue
        if passes(x[p], x[q], x[a], x[b], x[c]) and (
            least <= 0.0 or _stand_off(x[p], x[q], x[a], x[b], x[c], least)
        ):
            for v in (p, q, a, b, c):
                out[v] = True


@njit(cache=True, error_model="numpy")
def _segment_triangle(p: Array, q: Array, a: Array, b: Array, c: Array) -> float:
    """Return the squared distance of segment p q from triangle a b c [m²]; both may be degenerate."""
    if passes(p, q, a, b, c):
        return 0.0
    least = min(point_triangle_distance(p, a, b, c)[3], point_triangle_distance(q, a, b, c)[3])
    least = min(least, segment_segment(p, q, a, b)[2])
    return min(least, segment_segment(p, q, b, c)[2], segment_segment(p, q, c, a)[2])


@njit(cache=True, error_model="numpy")
def mark_within(
    segments: Array, ends: Array, triangles: Array, x: Array, distance: float, out: Array
) -> None:
    """Mark the vertices of `triangles` at `x` [m] that are closer than `distance` [m] to segments, `out` (n,).

    Args:
        segments: Of vertices at `ends`, shape (s, 2); a point is a segment from itself to itself.
        ends: [m], shape (m, 3).
        triangles: Of vertices at `x`, shape (t, 3); segments and points repeat the last vertex.
        x: [m], shape (n, 3).
        distance: [m].
        out: Changed.
    """
    for s in range(segments.shape[0]):
        p, q = ends[segments[s, 0]], ends[segments[s, 1]]
        for t in range(triangles.shape[0]):
            a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            if _segment_triangle(p, q, x[a], x[b], x[c]) < distance * distance:
                out[a] = out[b] = out[c] = True
