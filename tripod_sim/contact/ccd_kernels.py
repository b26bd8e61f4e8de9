"""Continuous collision detection: when shapes come too close during a step, and the contacts that they make then.

Vertices move on straight lines over a step, x(t) = x + t d, t in 0..1. Two shapes of distance D cannot lose more than
l = max |d_i - mean| over the vertices of one + the same of the other in unit time, so (D - gap) / l is a time that is
surely safe; such times are added up until the distance is nearly the gap [LiKaufmanJiang2021]. The answer is never
later than the true time, whatever the shapes.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.contact.contact_set import Contacts
from tripod_sim.contact.narrow_kernels import (
    BALLS,
    EDGES,
    NOWHERE,
    SEGMENTS,
    ball_ball,
    edge_edge,
    point_face,
    point_segment,
    vertices_of,
)
from tripod_sim.contact.region_kernels import Topology
from tripod_sim.distance_kernels import point_triangle_distance, segment_segment

CLOSE = 0.05
"""Fraction of the initial distance above the gap at which advancing stops."""

MOST = 300
"""Advancements, after which the time reached so far is returned: it is safe, if early."""


@njit(cache=True, error_model="numpy")
def _distance(x: Array, first: int, count: int) -> float:
    """Return the distance between the shape of the first `first` of `count` vertices and that of the others."""
    if count == 2:
        s = 0.0
        for i in range(3):
            s += (x[0, i] - x[1, i]) ** 2
        return np.sqrt(s)
    if first == 1:
        return np.sqrt(point_triangle_distance(x[0], x[1], x[2], x[3])[3])
    return np.sqrt(segment_segment(x[0], x[1], x[2], x[3])[2])


@njit(cache=True, error_model="numpy", inline="always")
def relative_speed(d: Array, first: int, count: int) -> float:
    """Take the mean off the moves `d`, and return the distance [m] that the two shapes can lose at most."""
    for i in range(3):
        mean = 0.0
        for k in range(count):
            mean += d[k, i]
        mean /= count
        for k in range(count):
            d[k, i] -= mean
    one = two = 0.0
    for k in range(count):
        square = d[k, 0] ** 2 + d[k, 1] ** 2 + d[k, 2] ** 2
        if k < first:
            one = max(one, square)
        else:
            two = max(two, square)
    return np.sqrt(one) + np.sqrt(two)


@njit(cache=True, error_model="numpy")
def time_of_approach(x: Array, d: Array, first: int, count: int, gap: float, y: Array) -> float:
    """Return a time in 0..1 until which two shapes keep a distance above `gap`; 1 if they do for the whole step.

    Args:
        x: Vertices at the start [m], shape (4, 3), of which `count` are used: those of the first shape, then the other.
        d: Their moves [m], shape (4, 3); overwritten by the moves relative to their mean.
        first: Vertices of the first shape: 1 (a point against a point or triangle) or 2 (two segments).
        count: Of vertices: 2 for two points, else 4.
        gap: [m], not negative, less than the distance at the start; else the answer is 0.
        y: Scratch, shape (4, 3); holds the vertices at the returned time afterwards.
    """
    speed = relative_speed(d, first, count)
    for k in range(count):
        for i in range(3):
            y[k, i] = x[k, i]
    distance = _distance(y, first, count)
    if not distance > gap:
        return 0.0
    if speed <= 0.0 or distance - gap > speed:
        for k in range(count):
            for i in range(3):
                y[k, i] = x[k, i] + d[k, i]
        return 1.0
    margin = CLOSE * (distance - gap)
    t = 0.0
    for _ in range(MOST):
        ahead = (distance - gap) / speed
        if distance - gap <= margin:
            return t
        step = (1.0 - 0.2 * CLOSE) * ahead
        if t + step >= 1.0:
            t = 1.0
        else:
            t += step
        for k in range(count):
            for i in range(3):
                y[k, i] = x[k, i] + t * d[k, i]
        if t >= 1.0:
            return 1.0
        distance = _distance(y, first, count)
    return t


@njit(cache=True, error_model="numpy")
def times(
    pairs: Array, ones: Array, others: Array, first: int, flipped: bool, top: Topology, x: Array, move: Array,
    least: float, out: Array, earliest: Array,
) -> None:  # fmt: skip
    """Write for each pair the time until which it keeps its least distance over the moves of a step; 1 for the whole.

    A pair that begins closer than twice the least distance must keep half of what it has.

    Args:
        pairs, ones, others, first, flipped, top, x: See `near_contacts`.
        move: Of vertices over the step [m], shape (n, 3).
        least: Distance to keep [m], besides radii.
        out: Shape (p,).
        earliest: Of each vertex, lowered to the earliest of its times, shape (n,).
    """
    y, d, z = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
    v = np.empty(4, dtype=np.int64)
    triangles, edges, body, itself = top.triangles, top.edges, top.body, top.touches_itself
    shape, count = 2 if first == EDGES else 1, 2 if first == BALLS else 4
    for k in range(pairs.shape[0]):
        out[k] = 1.0
        i, j = ones[pairs[k, 1 if flipped else 0]], others[pairs[k, 0 if flipped else 1]]
        apart, v[0], v[1], v[2], v[3] = vertices_of(triangles, edges, body, itself, first, i, j)
        if not apart:
            continue
        for m in range(4):
            for c in range(3):
                y[m, c], d[m, c] = x[v[m], c], move[v[m], c]
        radius = top.radius[v[0]] + top.radius[v[3]]
        now = _distance(y, shape, count)
        keep = radius + min(least, 0.5 * (now - radius)) if now > radius else 0.5 * now
        if now - keep > relative_speed(d, shape, count):  # of most pairs: they cannot get there
            continue
        reached = time_of_approach(y, d, shape, count, keep, z)
        if reached < 1.0 and now > NOWHERE * least:
            out[k] = reached
            for m in range(4):
                earliest[v[m]] = min(earliest[v[m]], reached)


@njit(cache=True, error_model="numpy")
def met_contacts(
    pairs: Array, ones: Array, others: Array, first: int, flipped: bool, top: Topology, x: Array, move: Array,
    distance: float, when: Array, earliest: Array, moving: Array, choice: int, out: Contacts, at: int,
) -> int:  # fmt: skip
    """Write the contacts of pairs that meet, as they stand when they do: of each moving vertex the first that it meets.

    Args:
        pairs, ones, others, first, flipped, top, x, move, out, at: As in `times`, `near_contacts`.
        distance: As in `near_contacts`.
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
        _, v[0], v[1], v[2], v[3] = vertices_of(
            top.triangles, top.edges, top.body, top.touches_itself, first, i, j
        )
        late = False
        for m in range(4):
            late |= moving[v[m]] and when[k] > earliest[v[m]] + 1e-3 * (1.0 - earliest[v[m]])
        if late:
            continue
        for m in range(4):
            for c in range(3):
                y[m, c] = x[v[m], c] + when[k] * move[v[m], c]
        if first == BALLS:
            at = ball_ball(top, y, i, j, distance, np.inf, n, out, at)
        elif first == EDGES:
            pair = segment_segment(y[0], y[1], y[2], y[3])
            at = edge_edge(top, x, y, i, j, pair, distance, choice, v[:0], n, out, at)
        else:
            closest = point_triangle_distance(y[0], y[1], y[2], y[3])
            if first == SEGMENTS:
                at = point_segment(top, x, y, i, j, closest, distance, choice, n, out, at)
            else:
                at = point_face(top, x, y, i, j, flipped, closest, distance, choice, n, out, at)
    return at
