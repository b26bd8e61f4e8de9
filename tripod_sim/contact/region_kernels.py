"""Which feature of a surface is closest to what lies in some direction: the regions of edges and vertices."""

from typing import NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.distance_kernels import SLIVER, across, triangle_normal

ROOM, OWN_ROOM, HELD_ROOM = 1e-6, 0.2, 0.6
"""How far outside of a feature's region a direction may point, as a cosine. More is allowed of the shape that touches
an edge or vertex, and of two edges: what lies flat touches with all its corners and edges, tilted by a few degrees or
not, so that contacts do not come and go as it rocks; most of two edges that press each other already."""

MET_ROOM = 1e-3
"""The same for shapes that meet during a step."""

PARALLEL = 1e-3
"""Squared sine of the angle below which two edges are left to their ends, which are as close."""


class Topology(NamedTuple):
    """Of `Surfaces`, as kernels take it."""

    body: Array
    touches_itself: Array
    radius: Array
    triangles: Array
    filled: Array
    edges: Array
    sides: Array
    faces: Array
    first_edge: Array
    edge_list: Array


@njit(cache=True, error_model="numpy", inline="always")
def may_touch(body: Array, itself: Array, a: int, b: int) -> bool:
    """Return whether the bodies of vertices a and b can touch; `body` and `itself` are those of `Topology`."""
    return body[a] != body[b] or itself[body[a]]


@njit(cache=True, error_model="numpy")
def in_edge_region(top: Topology, x: Array, e: int, w: Array, room: float) -> bool:
    """Return whether direction `w`, from edge e outward, points into none of the triangles at e, but for a cosine.

    A triangle without an area, as for `point_triangle_distance`, has no inside: where its third corner is beside the
    edge is rounding.
    """
    a, b = top.edges[e, 0], top.edges[e, 1]
    u0, u1, u2 = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    square = u0 * u0 + u1 * u1 + u2 * u2
    if not square > 0.0:
        return True
    size = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    for k in range(2):
        t = top.faces[e, k]
        if t < 0:
            continue
        o = top.triangles[t, 0] + top.triangles[t, 1] + top.triangles[t, 2] - a - b
        m0, m1, m2 = x[o, 0] - x[a, 0], x[o, 1] - x[a, 1], x[o, 2] - x[a, 2]
        share, far = (m0 * u0 + m1 * u1 + m2 * u2) / square, m0 * m0 + m1 * m1 + m2 * m2
        m0, m1, m2 = m0 - share * u0, m1 - share * u1, m2 - share * u2
        inward, high = w[0] * m0 + w[1] * m1 + w[2] * m2, m0 * m0 + m1 * m1 + m2 * m2
        if inward > 0.0 and inward * inward > room * room * size * high and high > SLIVER * far:
            return False
    return True


@njit(cache=True, error_model="numpy")
def in_vertex_region(top: Topology, x: Array, v: int, w: Array, room: float) -> bool:
    """Return whether direction `w`, from vertex v outward, points along none of the edges at v, but for a cosine."""
    size = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    for k in range(top.first_edge[v], top.first_edge[v + 1]):
        e = top.edge_list[k]
        o = top.edges[e, 0] + top.edges[e, 1] - v
        u0, u1, u2 = x[o, 0] - x[v, 0], x[o, 1] - x[v, 1], x[o, 2] - x[v, 2]
        along = w[0] * u0 + w[1] * u1 + w[2] * u2
        if along > 0.0 and along * along > room * room * size * (u0 * u0 + u1 * u1 + u2 * u2):
            return False
    return True


@njit(cache=True, error_model="numpy")
def into_face(top: Topology, x: Array, t: int, w: Array) -> bool:
    """Return whether direction `w`, from triangle t on, leads into the solid behind it, if there is one."""
    if t < 0 or not top.filled[t]:
        return False
    a, b, c = top.triangles[t, 0], top.triangles[t, 1], top.triangles[t, 2]
    u0, u1, u2 = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    v0, v1, v2 = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    along, size = n0 * w[0] + n1 * w[1] + n2 * w[2], w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    return bool(along < 0.0 and along * along > ROOM * ROOM * size * (n0 * n0 + n1 * n1 + n2 * n2))


@njit(cache=True, error_model="numpy")
def into_edge(top: Topology, x: Array, e: int, w: Array) -> bool:
    """Return whether `w`, from edge e on, leads into the solid behind all triangles there."""
    one, two = top.faces[e, 0], top.faces[e, 1]
    return into_face(top, x, one, w) and (two < 0 or into_face(top, x, two, w))


@njit(cache=True, error_model="numpy")
def into_vertex(top: Topology, x: Array, v: int, w: Array) -> bool:
    """Return whether `w`, from vertex v on, leads into the solid behind all triangles there."""
    for k in range(top.first_edge[v], top.first_edge[v + 1]):
        if not into_edge(top, x, top.edge_list[k], w):
            return False
    return bool(top.first_edge[v] < top.first_edge[v + 1])


@njit(cache=True, error_model="numpy")
def is_closest(top: Topology, x: Array, p: int, n: Array) -> bool:
    """Return whether vertex p is about the point of its own body closest to what lies in direction -n."""
    for i in range(3):
        n[i] = -n[i]
    own = in_vertex_region(top, x, p, n, OWN_ROOM)
    for i in range(3):
        n[i] = -n[i]
    return own


@njit(cache=True, error_model="numpy")
def parallel(y: Array) -> bool:
    """Return whether two edges, shape (4, 3), are nearly parallel."""
    u0, u1, u2 = y[1, 0] - y[0, 0], y[1, 1] - y[0, 1], y[1, 2] - y[0, 2]
    v0, v1, v2 = y[3, 0] - y[2, 0], y[3, 1] - y[2, 1], y[3, 2] - y[2, 2]
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    uu, vv = u0 * u0 + u1 * u1 + u2 * u2, v0 * v0 + v1 * v1 + v2 * v2
    return not n0 * n0 + n1 * n1 + n2 * n2 > PARALLEL * uu * vv


@njit(cache=True, error_model="numpy")
def edge_normal(top: Topology, x: Array, y: Array, f: int, n: Array) -> None:
    """Write the direction at right angles to two edges that cross, on the side to which the triangles at f face."""
    u0, u1, u2 = y[1, 0] - y[0, 0], y[1, 1] - y[0, 1], y[1, 2] - y[0, 2]
    v0, v1, v2 = y[3, 0] - y[2, 0], y[3, 1] - y[2, 1], y[3, 2] - y[2, 2]
    n[0], n[1], n[2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    size = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    lengths = np.sqrt((u0 * u0 + u1 * u1 + u2 * u2) * (v0 * v0 + v1 * v1 + v2 * v2))
    if not size > 1e-7 * lengths:
        across(v0, v1, v2, n)
        return
    m, outward = np.empty(3), 0.0
    for k in range(2):
        t = top.faces[f, k]
        if t >= 0:
            triangle_normal(x[top.triangles[t, 0]], x[top.triangles[t, 1]], x[top.triangles[t, 2]], m)
            outward += m[0] * n[0] + m[1] * n[1] + m[2] * n[2]
    sign = -1.0 if outward < 0.0 else 1.0
    for i in range(3):
        n[i] *= sign / size
