"""Narrow phase: from pairs of shapes that are near to contacts. Of those that meet in a step see `ccd_kernels`.

Only local minima of the distance become contacts: where the closest point lies on an edge or a vertex, the other side
must lie in the region that this feature is closest to, else a neighbour is closer and makes the contact. So a vertex
over a plane of many triangles has one contact and not one with every triangle in reach. Nor does a solid touch itself
through itself, however thin it is: there the way from one shape to the other begins or ends in it.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.contact.contact_set import FIRST, KIND, Contacts
from tripod_sim.contact.region_kernels import (
    HELD_ROOM,
    MET_ROOM,
    OWN_ROOM,
    ROOM,
    Topology,
    edge_normal,
    in_edge_region,
    in_vertex_region,
    into_edge,
    into_face,
    into_vertex,
    is_closest,
    may_touch,
    parallel,
)
from tripod_sim.distance_kernels import (
    across,
    point_triangle_distance,
    segment_segment,
    triangle_normal,
)

VERTEX_VERTEX, VERTEX_EDGE, VERTEX_FACE, EDGE_EDGE = 0, 1, 2, 3
"""What touches what, of moving vertices and edges against others; in a contact's key."""

NEAR, MET, ANY = 0, 1, 2
"""Which contacts are made: of shapes that are near; that meet; or all that are asked about."""

BALLS, FACES, EDGES, SEGMENTS = 0, 1, 2, 3
"""Kinds of pairs: two round points; a point and a triangle; two edges; a point and a segment of no triangle.

A shape is a set of points, segments and triangles with a radius about them: a ball is a round point, a capsule a round
segment with round points at its ends. Distances are those of the sets, less their radii.
"""

NOWHERE = 1e-9
"""A distance below this fraction of the contact distance has no direction."""


@njit(cache=True, error_model="numpy", inline="always")
def _snapped(weight: float) -> float:
    """Return a weight, zero if it is that but for rounding."""
    return weight if weight > 1e-9 else 0.0


@njit(cache=True, error_model="numpy", inline="always")
def _key(kind: int, a: int, b: int) -> int:
    return (kind << KIND) | (a << FIRST) | b


@njit(cache=True, error_model="numpy", inline="always")
def _put(
    out: Contacts, at: int, v: tuple[int, int, int, int], w: tuple[float, float, float, float], key: int,
    offset: float, distance: float, normal: Array,
) -> int:  # fmt: skip
    """Write a contact if there is room; return the next place."""
    if at < out.key.shape[0]:
        out.vertex[at, 0], out.vertex[at, 1], out.vertex[at, 2], out.vertex[at, 3] = v
        out.weight[at, 0], out.weight[at, 1], out.weight[at, 2], out.weight[at, 3] = w
        for i in range(3):
            out.normal[at, i] = normal[i]
            out.friction[at, i] = 0.0
        out.key[at], out.offset[at] = key, offset
        out.pressure[at] = 0.0
        out.gain[at] = 1.0
    return at + 1


@njit(cache=True, error_model="numpy")
def point_face(
    top: Topology, x: Array, y: Array, p: int, t: int, face_only: bool, closest: tuple[float, float, float, float],
    distance: float, choice: int, n: Array, out: Contacts, at: int,
) -> int:  # fmt: skip
    """Write the contact of vertex p with triangle t unless another makes it; return the next place.

    `y` holds where the point and the corners are, shape (4, 3), `closest` what `point_triangle_distance` returns for
    them; `x` all vertices, for the regions of features; `choice` is NEAR, MET or ANY.
    """
    a, b, c = top.triangles[t, 0], top.triangles[t, 1], top.triangles[t, 2]
    wa, wb, wc, square = closest
    offset, round_point = distance + top.radius[p] + top.radius[a], top.radius[p] > 0.0
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
    if round_point:
        face_only = False  # the vertices of triangles are not compared with it
    if zeros == 2 and face_only and choice == NEAR:
        return at  # the vertices of the triangle see this one themselves
    if face_only:
        room = max(room, OWN_ROOM)  # the moving triangle's neighbours
    if zeros == 0:
        if face_only and apart and choice == NEAR and not is_closest(top, x, p, n):
            return at
        key = _key(VERTEX_FACE, p, t)
        if not apart:
            triangle_normal(y[1], y[2], y[3], n)
    elif apart and choice == NEAR and not is_closest(top, x, p, n):
        return at
    elif zeros == 1:
        side = 1 if wa == 0.0 else 2 if wb == 0.0 else 0
        e = top.sides[t, side]
        if apart and not in_edge_region(top, x, e, n, room):
            return at
        key = _key(VERTEX_EDGE, p, e)
        if not apart:
            i, j = side + 1, (side + 1) % 3 + 1
            across(y[j, 0] - y[i, 0], y[j, 1] - y[i, 1], y[j, 2] - y[i, 2], n)
    else:
        q = a if wa > 0.0 else b if wb > 0.0 else c
        if apart and not in_vertex_region(top, x, q, n, room):
            return at
        key = _key(VERTEX_VERTEX, p, q)
        if not apart:
            n[0], n[1], n[2] = 0.0, 0.0, 1.0
    if apart:
        for i in range(3):
            n[i] /= gone
    return _put(out, at, (p, a, b, c), (1.0, -wa, -wb, -wc), key, offset, gone, n)


@njit(cache=True, error_model="numpy")
def point_segment(
    top: Topology, x: Array, y: Array, p: int, e: int, closest: tuple[float, float, float, float], distance: float,
    choice: int, n: Array, out: Contacts, at: int,
) -> int:  # fmt: skip
    """Write the contact of vertex p with segment e of no triangle unless another makes it; return the next place.

    The ends of a round segment are round points, which make theirs; those of a chain do not see the round vertex p.
    `closest` is what `point_triangle_distance` returns for the segment as a triangle a b b; the rest as in
    `point_face`.
    """
    a, b, wa, key = top.edges[e, 0], top.edges[e, 1], closest[0], _key(VERTEX_EDGE, p, e)
    end = not 1e-9 < wa < 1.0 - 1e-9
    if end and choice == NEAR and top.radius[a] > 0.0:
        return at
    for i in range(3):
        n[i] = y[0, i] - wa * y[1, i] - (1.0 - wa) * y[2, i]
    gone = np.sqrt(closest[3])
    if gone > NOWHERE * distance:
        if choice == NEAR and not is_closest(top, x, p, n):
            return at
        if end and choice == NEAR and not in_vertex_region(top, x, a if wa > 0.5 else b, n, ROOM):
            return at
        for i in range(3):
            n[i] /= gone
    else:
        across(y[2, 0] - y[1, 0], y[2, 1] - y[1, 1], y[2, 2] - y[1, 2], n)
    if end:
        wa = 1.0 if wa > 0.5 else 0.0
        key = _key(VERTEX_VERTEX, p, a if wa > 0.5 else b)
    offset = distance + top.radius[p] + top.radius[a]
    return _put(out, at, (p, a, b, b), (1.0, -wa, wa - 1.0, 0.0), key, offset, gone, n)


@njit(cache=True, error_model="numpy")
def edge_edge(
    top: Topology, x: Array, y: Array, e: int, f: int, closest: tuple[float, float, float], distance: float,
    choice: int, held: Array, n: Array, out: Contacts, at: int,
) -> int:  # fmt: skip
    """Write the contact of edges e and f, of which `segment_segment` says `closest`, unless it is no minimum."""
    s, t, square = closest
    for i in range(3):
        n[i] = (1.0 - s) * y[0, i] + s * y[1, i] - (1.0 - t) * y[2, i] - t * y[3, i]
    gone = np.sqrt(square)
    if gone > NOWHERE * distance:
        if choice == NEAR:
            key = _key(EDGE_EDGE, e, f)
            i = np.searchsorted(held, key)
            room = HELD_ROOM if i < held.shape[0] and held[i] == key else OWN_ROOM
            if parallel(y) or not in_edge_region(top, x, f, n, room):
                return at
            for i in range(3):
                n[i] = -n[i]
            own = in_edge_region(top, x, e, n, room)
            for i in range(3):
                n[i] = -n[i]
            if not own:
                return at
        for i in range(3):
            n[i] /= gone
    else:
        edge_normal(top, x, y, f, n)
    a, b, c, d = top.edges[e, 0], top.edges[e, 1], top.edges[f, 0], top.edges[f, 1]
    offset = distance + top.radius[a] + top.radius[c]
    return _put(out, at, (a, b, c, d), (1.0 - s, s, t - 1.0, -t), _key(EDGE_EDGE, e, f), offset, gone, n)


@njit(cache=True, error_model="numpy")
def ball_ball(
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
def _through_face(
    top: Topology, x: Array, y: Array, p: int, t: int, closest: tuple[float, float, float, float], w: Array
) -> bool:
    """Return whether the way between a vertex and a triangle of its own body is through that; as in `point_face`.

    `w` is written.
    """
    wa, wb, wc, _ = closest
    for i in range(3):
        w[i] = wa * y[1, i] + wb * y[2, i] + wc * y[3, i] - y[0, i]
    if into_vertex(top, x, p, w):
        return True
    for i in range(3):
        w[i] = -w[i]
    zeros = (wa == 0.0) + (wb == 0.0) + (wc == 0.0)
    if zeros == 0:
        return into_face(top, x, t, w)
    if zeros == 1:
        return into_edge(top, x, top.sides[t, 1 if wa == 0.0 else 2 if wb == 0.0 else 0], w)
    return into_vertex(top, x, top.triangles[t, 0 if wa > 0.0 else 1 if wb > 0.0 else 2], w)


@njit(cache=True, error_model="numpy")
def _through_edge(
    top: Topology, x: Array, y: Array, e: int, f: int, closest: tuple[float, float, float], w: Array
) -> bool:
    """Return whether the way between two edges of a body is through that; as in `edge_edge`. `w` is written."""
    s, t, _ = closest
    for i in range(3):
        w[i] = (1.0 - t) * y[2, i] + t * y[3, i] - (1.0 - s) * y[0, i] - s * y[1, i]
    if into_edge(top, x, e, w):
        return True
    for i in range(3):
        w[i] = -w[i]
    return into_edge(top, x, f, w)


@njit(cache=True, error_model="numpy", inline="always")
def vertices_of(
    triangles: Array, edges: Array, body: Array, itself: Array, first: int, i: int, j: int
) -> tuple[bool, int, int, int, int]:
    """Return whether a pair can touch, and its four vertices, where it has fewer the last repeated.

    The last one is of the second shape.
    """
    if first == BALLS:
        a, b, c, d = i, j, j, j
        apart = i != j
    elif first == SEGMENTS:
        a, b, c, d = i, edges[j, 0], edges[j, 1], edges[j, 1]
        apart = a not in (b, c)
    elif first == FACES:
        a, b, c, d = i, triangles[j, 0], triangles[j, 1], triangles[j, 2]
        apart = a not in (b, c, d)
    else:
        a, b, c, d = edges[i, 0], edges[i, 1], edges[j, 0], edges[j, 1]
        apart = a not in (c, d) and b not in (c, d)
    return apart and may_touch(body, itself, a, c), a, b, c, d


@njit(cache=True, error_model="numpy")
def near_contacts(
    pairs: Array, ones: Array, others: Array, first: int, flipped: bool, top: Topology, x: Array, distance: float,
    reach: float, held: Array, out: Contacts, at: int,
) -> int:  # fmt: skip
    """Write contacts of pairs of shapes closer than `reach` [m], besides their radii.

    Args:
        pairs: (place in `ones`, place in `others`), the other way round if `flipped`, shape (p, 2).
        ones, others: Numbers of the shapes of each pair, of the kind `first`.
        first: `BALLS`, `FACES`, `EDGES` or `SEGMENTS`.
        flipped: The points are fixed and the triangles move: then only insides of triangles count.
        top, x: Surfaces and where their vertices are [m], shape (n, 3).
        distance: The gap is the distance less this [m].
        reach: [m].
        held: Keys of contacts that carried a force in the step before, ascending; those of edges are let go of later.
        out: Written from place `at` on, as far as there is room.
        at: Next place.

    Returns:
        The place after the last, beyond the room if it does not suffice.
    """
    triangles, edges, radius, body, itself = (
        top.triangles,
        top.edges,
        top.radius,
        top.body,
        top.touches_itself,
    )
    y, n = np.empty((4, 3)), np.empty(3)
    for k in range(pairs.shape[0]):
        i, j = ones[pairs[k, 1 if flipped else 0]], others[pairs[k, 0 if flipped else 1]]
        apart, a, b, c, d = vertices_of(triangles, edges, body, itself, first, i, j)
        if not apart:
            continue
        for m in range(3):
            y[0, m], y[1, m], y[2, m], y[3, m] = x[a, m], x[b, m], x[c, m], x[d, m]
        if first == BALLS:
            at = ball_ball(top, y, i, j, distance, reach, n, out, at)
        elif first == SEGMENTS:
            closest = point_triangle_distance(y[0], y[1], y[2], y[3])
            if closest[3] < (reach + radius[a] + radius[d]) ** 2:
                at = point_segment(top, x, y, i, j, closest, distance, NEAR, n, out, at)
        elif first == FACES:
            closest = point_triangle_distance(y[0], y[1], y[2], y[3])
            near = closest[3] < (reach + radius[a] + radius[d]) ** 2
            if near and not (body[a] == body[b] and _through_face(top, x, y, i, j, closest, n)):
                at = point_face(top, x, y, i, j, flipped, closest, distance, NEAR, n, out, at)
        else:
            pair = segment_segment(y[0], y[1], y[2], y[3])
            # where the closest point is an end a vertex of the one sees the other's triangles or edges
            near = (
                0.0 < pair[0] < 1.0 and 0.0 < pair[1] < 1.0 and pair[2] < (reach + radius[a] + radius[d]) ** 2
            )
            if near and not (body[a] == body[c] and _through_edge(top, x, y, i, j, pair, n)):
                at = edge_edge(top, x, y, i, j, pair, distance, NEAR, held, n, out, at)
    return at
