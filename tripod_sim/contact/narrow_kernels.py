"""Narrow phase: from pairs of shapes to contacts, by distance at one time or by continuous detection over a step.

Only local minima of the distance become contacts: where the closest point lies on an edge or a vertex, the other side
must lie in the region that this feature is closest to, else a neighbour is closer and makes the contact. So a vertex
over a plane of many triangles has one contact and not one with every triangle in reach.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from tripod_sim.contact.ccd_kernels import time_of_approach
from tripod_sim.contact.contact_set import FIRST, KIND, Contacts
from tripod_sim.contact.distance_kernels import across, point_triangle, segment_segment, triangle_normal

Array = Any

VERTEX_VERTEX, VERTEX_EDGE, VERTEX_FACE, EDGE_EDGE = 0, 1, 2, 3
"""What touches what, of moving vertices and edges against others; in a contact's key."""

ROOM, OWN_ROOM, HELD_ROOM = 1e-6, 0.2, 0.6
"""How far outside of a feature's region a direction may point, as a cosine. More is allowed of the shape that touches
an edge or vertex, and of two edges: what lies flat touches with all its corners and edges, tilted by a few degrees or
not, so that contacts do not come and go as it rocks;
most of two edges that press each other already."""

MET_ROOM = 1e-3
"""The same for shapes that meet during a step."""

PARALLEL = 1e-3
"""Squared sine of the angle below which two edges are left to their ends, which are as close."""

BALLS = 0
"""Instead of the vertices of the first shape: two balls."""

NEAR, MET, ANY = 0, 1, 2
"""Which contacts are made: of shapes that are near; that meet; or all that are asked about."""

NOWHERE = 1e-9
"""A distance below this fraction of the contact distance has no direction."""


class Topology(NamedTuple):
    """Of `Surfaces`, as kernels take it."""

    body: Array
    touches_itself: Array
    radius: Array
    triangles: Array
    edges: Array
    sides: Array
    faces: Array
    first_edge: Array
    edge_list: Array


@njit(cache=True, error_model="numpy")
def _may_touch(top: Topology, a: int, b: int) -> bool:
    """Return whether the bodies of vertices a and b can touch."""
    return top.body[a] != top.body[b] or top.touches_itself[top.body[a]]


@njit(cache=True, error_model="numpy")
def _in_edge_region(top: Topology, x: Array, e: int, w: Array, room: float) -> bool:
    """Return whether direction `w`, from edge e outward, points into none of the triangles at e, but for a cosine."""
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
        share = (m0 * u0 + m1 * u1 + m2 * u2) / square
        m0, m1, m2 = m0 - share * u0, m1 - share * u1, m2 - share * u2
        inward = w[0] * m0 + w[1] * m1 + w[2] * m2
        if inward > 0.0 and inward * inward > room * room * size * (m0 * m0 + m1 * m1 + m2 * m2):
            return False
    return True


@njit(cache=True, error_model="numpy")
def _in_vertex_region(top: Topology, x: Array, v: int, w: Array, room: float) -> bool:
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
def _snapped(weight: float) -> float:
    """Return a weight, zero if it is that but for rounding."""
    return weight if weight > 1e-9 else 0.0


@njit(cache=True, error_model="numpy")
def _faces(top: Topology, x: Array, p: int, n: Array) -> bool:
    """Return whether vertex p is about the point of its own body closest to what lies in direction -n."""
    for i in range(3):
        n[i] = -n[i]
    own = _in_vertex_region(top, x, p, n, OWN_ROOM)
    for i in range(3):
        n[i] = -n[i]
    return own


@njit(cache=True, error_model="numpy")
def _parallel(y: Array) -> bool:
    """Return whether two edges, shape (4, 3), are nearly parallel."""
    u0, u1, u2 = y[1, 0] - y[0, 0], y[1, 1] - y[0, 1], y[1, 2] - y[0, 2]
    v0, v1, v2 = y[3, 0] - y[2, 0], y[3, 1] - y[2, 1], y[3, 2] - y[2, 2]
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    uu, vv = u0 * u0 + u1 * u1 + u2 * u2, v0 * v0 + v1 * v1 + v2 * v2
    return not n0 * n0 + n1 * n1 + n2 * n2 > PARALLEL * uu * vv


@njit(cache=True, error_model="numpy")
def _key(kind: int, a: int, b: int) -> int:
    return (kind << KIND) | (a << FIRST) | b


@njit(cache=True, error_model="numpy")
def _put(
    out: Contacts, at: int, v: tuple[int, int, int, int], w: tuple[float, float, float, float], key: int,
    offset: float, distance: float, normal: Array,
) -> int:  # fmt: skip
    """Write a contact if there is room; return the next place."""
    if at < out.key.shape[0]:
        for k in range(4):
            out.vertex[at, k], out.weight[at, k] = v[k], w[k]
        for i in range(3):
            out.normal[at, i] = normal[i]
        out.key[at], out.offset[at] = key, offset
        out.pressure[at] = 0.0
        out.friction[at] = 0.0
        out.gain[at] = 1.0
    return at + 1


@njit(cache=True, error_model="numpy")
def _point_face(  # noqa: PLR0911 - every kind of feature has its reason to be left out
    top: Topology, x: Array, y: Array, p: int, t: int, face_only: bool, distance: float, reach: float,
    choice: int, n: Array, out: Contacts, at: int,
) -> int:  # fmt: skip
    """Write the contact of vertex p with triangle t if they are closer than `reach`; return the next place.

    `y` holds where the point and the corners are, shape (4, 3); `x` all vertices, for the regions of features;
    `choice` is NEAR, MET or ANY.
    """
    a, b, c = top.triangles[t, 0], top.triangles[t, 1], top.triangles[t, 2]
    wa, wb, wc, square = point_triangle(y[0], y[1], y[2], y[3])
    offset = distance + top.radius[p]
    if square >= (reach + top.radius[p]) ** 2:
        return at
    for i in range(3):
        n[i] = y[0, i] - wa * y[1, i] - wb * y[2, i] - wc * y[3, i]
    gone = np.sqrt(square)
    apart = gone > NOWHERE * distance
    room = ROOM if choice == NEAR else MET_ROOM if choice == MET else 1.0
    if choice == NEAR:  # on an edge to rounding is on the edge, so that both its triangles say the same
        wa, wb, wc = _snapped(wa), _snapped(wb), _snapped(wc)
        total = wa + wb + wc
        wa, wb, wc = wa / total, wb / total, wc / total
    zeros = (wa == 0.0) + (wb == 0.0) + (wc == 0.0)
    if zeros == 2 and face_only and choice == NEAR:
        return at  # the vertices of the triangle see this one themselves
    if face_only:
        room = max(room, OWN_ROOM)  # the moving triangle's neighbours
    if zeros == 0:
        if face_only and apart and choice == NEAR and not _faces(top, x, p, n):
            return at
        key = _key(VERTEX_FACE, p, t)
        if not apart:
            triangle_normal(y[1], y[2], y[3], n)
    elif apart and choice == NEAR and not _faces(top, x, p, n):
        return at
    elif zeros == 1:
        side = 1 if wa == 0.0 else 2 if wb == 0.0 else 0
        e = top.sides[t, side]
        if apart and not _in_edge_region(top, x, e, n, room):
            return at
        key = _key(VERTEX_EDGE, p, e)
        if not apart:
            i, j = side + 1, (side + 1) % 3 + 1
            across(y[j, 0] - y[i, 0], y[j, 1] - y[i, 1], y[j, 2] - y[i, 2], n)
    else:
        q = a if wa > 0.0 else b if wb > 0.0 else c
        if apart and not _in_vertex_region(top, x, q, n, room):
            return at
        key = _key(VERTEX_VERTEX, p, q)
        if not apart:
            n[0], n[1], n[2] = 0.0, 0.0, 1.0
    if apart:
        for i in range(3):
            n[i] /= gone
    return _put(out, at, (p, a, b, c), (1.0, -wa, -wb, -wc), key, offset, gone, n)


@njit(cache=True, error_model="numpy")
def _edge_edge(
    top: Topology, x: Array, y: Array, e: int, f: int, distance: float, reach: float, choice: int, held: Array,
    n: Array, out: Contacts, at: int,
) -> int:  # fmt: skip
    """Write the contact of edges e and f if their closest points lie inside both, closer than `reach`."""
    s, t, square = segment_segment(y[0], y[1], y[2], y[3])
    if square >= reach * reach:
        return at
    inside = 0.0 < s < 1.0 and 0.0 < t < 1.0
    if not inside and choice == NEAR:
        return at  # a vertex of one: seen with the other's triangles, or as vertex and edge there
    for i in range(3):
        n[i] = (1.0 - s) * y[0, i] + s * y[1, i] - (1.0 - t) * y[2, i] - t * y[3, i]
    gone = np.sqrt(square)
    if gone > NOWHERE * distance:
        if choice == NEAR:
            key = _key(EDGE_EDGE, e, f)
            i = np.searchsorted(held, key)
            room = HELD_ROOM if i < held.shape[0] and held[i] == key else OWN_ROOM
            if _parallel(y) or not _in_edge_region(top, x, f, n, room):
                return at
            for i in range(3):
                n[i] = -n[i]
            own = _in_edge_region(top, x, e, n, room)
            for i in range(3):
                n[i] = -n[i]
            if not own:
                return at
        for i in range(3):
            n[i] /= gone
    else:
        _edge_normal(top, x, y, f, n)
    a, b, c, d = top.edges[e, 0], top.edges[e, 1], top.edges[f, 0], top.edges[f, 1]
    return _put(out, at, (a, b, c, d), (1.0 - s, s, t - 1.0, -t), _key(EDGE_EDGE, e, f), distance, gone, n)


@njit(cache=True, error_model="numpy")
def _edge_normal(top: Topology, x: Array, y: Array, f: int, n: Array) -> None:
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


@njit(cache=True, error_model="numpy")
def near_point_faces(
    pairs: Array, points: Array, faces: Array, flipped: bool, top: Topology, x: Array, distance: float, reach: float,
    out: Contacts, at: int,
) -> int:  # fmt: skip
    """Write contacts of vertices and triangles closer than `reach` [m], besides the radius of balls.

    Args:
        pairs: (place in `points`, place in `faces`), the other way round if `flipped`, shape (p, 2).
        points, faces: Vertices; triangles.
        flipped: The points are fixed and the triangles move: then only insides of triangles count.
        top, x: Surfaces and where their vertices are [m], shape (n, 3).
        distance: The gap is the distance less this [m].
        reach: [m].
        out: Written from place `at` on, as far as there is room.
        at: Next place.

    Returns:
        The place after the last, beyond the room if it does not suffice.
    """
    y, n = np.empty((4, 3)), np.empty(3)
    for k in range(pairs.shape[0]):
        p, t = points[pairs[k, 1 if flipped else 0]], faces[pairs[k, 0 if flipped else 1]]
        a, b, c = top.triangles[t, 0], top.triangles[t, 1], top.triangles[t, 2]
        if p in (a, b, c) or not _may_touch(top, p, a):
            continue
        y[0], y[1], y[2], y[3] = x[p], x[a], x[b], x[c]
        at = _point_face(top, x, y, p, t, flipped, distance, reach, NEAR, n, out, at)
    return at


@njit(cache=True, error_model="numpy")
def near_edges(
    pairs: Array, edges: Array, others: Array, top: Topology, x: Array, distance: float, reach: float, held: Array,
    out: Contacts, at: int,
) -> int:  # fmt: skip
    """Write contacts of two edges closer than `reach`, as `near_point_faces` does.

    `held`: keys of contacts that carried a force in the step before, ascending; they are let go of later.
    """
    y, n = np.empty((4, 3)), np.empty(3)
    for k in range(pairs.shape[0]):
        e, f = edges[pairs[k, 0]], others[pairs[k, 1]]
        a, b, c, d = top.edges[e, 0], top.edges[e, 1], top.edges[f, 0], top.edges[f, 1]
        if a in (c, d) or b in (c, d) or not _may_touch(top, a, c):
            continue
        y[0], y[1], y[2], y[3] = x[a], x[b], x[c], x[d]
        at = _edge_edge(top, x, y, e, f, distance, reach, NEAR, held, n, out, at)
    return at


@njit(cache=True, error_model="numpy")
def _ball_ball(
    top: Topology, y: Array, p: int, q: int, distance: float, reach: float, n: Array, out: Contacts, at: int
) -> int:
    """Write the contact of the balls about vertices p and q, at y[0] and y[1], if they are closer than `reach`.

    Where the centres are equal the normal is the z axis.
    """
    square = 0.0
    for i in range(3):
        n[i] = y[0, i] - y[1, i]
        square += n[i] * n[i]
    gone, both = np.sqrt(square), top.radius[p] + top.radius[q]
    if gone >= reach + both:
        return at
    if gone > NOWHERE * distance:
        for i in range(3):
            n[i] /= gone
    else:
        n[0], n[1], n[2] = 0.0, 0.0, 1.0
    key = _key(VERTEX_VERTEX, p, q)
    return _put(out, at, (p, q, q, q), (1.0, -1.0, 0.0, 0.0), key, distance + both, gone, n)


@njit(cache=True, error_model="numpy")
def near_balls(
    pairs: Array, balls: Array, others: Array, top: Topology, x: Array, distance: float, reach: float, out: Contacts,
    at: int,
) -> int:  # fmt: skip
    """Write contacts of two balls closer than `reach`, besides their radii, as `near_point_faces` does."""
    y, n = np.empty((2, 3)), np.empty(3)
    for k in range(pairs.shape[0]):
        p, q = balls[pairs[k, 0]], others[pairs[k, 1]]
        if p == q or not _may_touch(top, p, q):
            continue
        y[0], y[1] = x[p], x[q]
        at = _ball_ball(top, y, p, q, distance, reach, n, out, at)
    return at


@njit(cache=True, error_model="numpy")
def times(
    pairs: Array, ones: Array, others: Array, first: int, flipped: bool, top: Topology, x: Array, move: Array,
    least: float, out: Array, earliest: Array,
) -> None:  # fmt: skip
    """Write for each pair the time until which it keeps its least distance over the moves of a step; 1 for the whole.

    A pair that begins closer than twice the least distance must keep half of what it has.

    Args:
        pairs: Vertex and triangle (`first` 1), two edges (2) or two balls (`BALLS`); see `near_point_faces`.
        ones, others, flipped, top, x: As there.
        first: Vertices of the first shape, or `BALLS`.
        move: Of vertices over the step [m], shape (n, 3).
        least: Distance to keep [m], besides the radius of balls.
        out: Shape (p,).
        earliest: Of each vertex, lowered to the earliest of its times, shape (n,).
    """
    y, d, z = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
    v = np.empty(4, dtype=np.int64)
    for k in range(pairs.shape[0]):
        out[k] = 1.0
        i, j = ones[pairs[k, 1 if flipped else 0]], others[pairs[k, 0 if flipped else 1]]
        if not _vertices(top, first, i, j, v):
            continue
        for m in range(4):
            y[m], d[m] = x[v[m]], move[v[m]]
        radius = top.radius[v[0]] if first < 2 else 0.0
        if first == BALLS:
            radius += top.radius[v[1]]
            now = np.sqrt((y[0, 0] - y[1, 0]) ** 2 + (y[0, 1] - y[1, 1]) ** 2 + (y[0, 2] - y[1, 2]) ** 2)
        elif first == 1:
            now = np.sqrt(point_triangle(y[0], y[1], y[2], y[3])[3])
        else:
            now = np.sqrt(segment_segment(y[0], y[1], y[2], y[3])[2])
        keep = radius + min(least, 0.5 * (now - radius)) if now > radius else 0.5 * now
        out[k] = time_of_approach(y, d, max(1, first), 2 if first == BALLS else 4, keep, z)
        if out[k] < 1.0 and now > NOWHERE * least:
            for m in range(4):
                earliest[v[m]] = min(earliest[v[m]], out[k])
        else:
            out[k] = 1.0


@njit(cache=True, error_model="numpy")
def _vertices(top: Topology, first: int, i: int, j: int, v: Array) -> bool:
    """Write the four vertices of a pair, of balls one repeated; return whether it can touch."""
    if first == BALLS:
        v[0], v[1], v[2], v[3] = i, j, j, j
        return i != j and _may_touch(top, i, j)
    if first == 1:
        v[0], v[1], v[2], v[3] = i, top.triangles[j, 0], top.triangles[j, 1], top.triangles[j, 2]
        return i not in (v[1], v[2], v[3]) and _may_touch(top, i, v[1])
    v[0], v[1], v[2], v[3] = top.edges[i, 0], top.edges[i, 1], top.edges[j, 0], top.edges[j, 1]
    return v[0] not in (v[2], v[3]) and v[1] not in (v[2], v[3]) and _may_touch(top, v[0], v[2])


@njit(cache=True, error_model="numpy")
def met_contacts(
    pairs: Array, ones: Array, others: Array, first: int, flipped: bool, top: Topology, x: Array, move: Array,
    distance: float, when: Array, earliest: Array, moving: Array, choice: int, out: Contacts, at: int,
) -> int:  # fmt: skip
    """Write the contacts of pairs that meet, as they stand when they do: of each moving vertex the first that it meets.

    Args:
        pairs, ones, others, first, flipped, top, x, move, out, at: As in `times`, `near_point_faces`.
        distance: As in `near_point_faces`.
        when, earliest: What `times` wrote.
        moving: Whether each vertex can move, shape (n,).
        choice: MET leaves out what meets a feature from where another is closer; ANY takes all.
    """
    y, n = np.empty((4, 3)), np.empty(3)
    v = np.empty(4, dtype=np.int64)
    for k in range(pairs.shape[0]):
        if when[k] >= 1.0:
            continue
        i, j = ones[pairs[k, 1 if flipped else 0]], others[pairs[k, 0 if flipped else 1]]
        _vertices(top, first, i, j, v)
        late = False
        for m in range(4):
            late |= moving[v[m]] and when[k] > earliest[v[m]] + 1e-3 * (1.0 - earliest[v[m]])
        if late:
            continue
        for m in range(4):
            for c in range(3):
                y[m, c] = x[v[m], c] + when[k] * move[v[m], c]
        if first == BALLS:
            at = _ball_ball(top, y, i, j, distance, np.inf, n, out, at)
        elif first == 1:
            at = _point_face(top, x, y, i, j, flipped, distance, np.inf, choice, n, out, at)
        else:
            at = _edge_edge(top, x, y, i, j, distance, np.inf, choice, v[:0], n, out, at)
    return at
