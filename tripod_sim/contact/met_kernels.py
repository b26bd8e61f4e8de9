"""Continuous detection: when shapes come too close during a step, and the contacts that they make then."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.contact.ccd_kernels import relative_speed, time_of_approach
from tripod_sim.contact.contact_set import Contacts
from tripod_sim.contact.distance_kernels import point_triangle, segment_segment
from tripod_sim.contact.narrow_kernels import BALLS, NOWHERE, ball_ball, edge_edge, point_face, vertices_of
from tripod_sim.contact.region_kernels import Topology


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
        least: Distance to keep [m], besides the radius of balls.
        out: Shape (p,).
        earliest: Of each vertex, lowered to the earliest of its times, shape (n,).
    """
    y, d, z = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
    v, round_ones = np.empty(4, dtype=np.int64), top.radius
    triangles, edges, body, itself = top.triangles, top.edges, top.body, top.touches_itself
    shape, count = max(1, first), 2 if first == BALLS else 4
    for k in range(pairs.shape[0]):
        out[k] = 1.0
        i, j = ones[pairs[k, 1 if flipped else 0]], others[pairs[k, 0 if flipped else 1]]
        apart, v[0], v[1], v[2], v[3] = vertices_of(triangles, edges, body, itself, first, i, j)
        if not apart:
            continue
        for m in range(4):
            for c in range(3):
                y[m, c], d[m, c] = x[v[m], c], move[v[m], c]
        radius = round_ones[v[0]] if first < 2 else 0.0
        if first == BALLS:
            radius += round_ones[v[1]]
            now = np.sqrt((y[0, 0] - y[1, 0]) ** 2 + (y[0, 1] - y[1, 1]) ** 2 + (y[0, 2] - y[1, 2]) ** 2)
        elif first == 1:
            now = np.sqrt(point_triangle(y[0], y[1], y[2], y[3])[3])
        else:
            now = np.sqrt(segment_segment(y[0], y[1], y[2], y[3])[2])
        keep = radius + min(least, 0.5 * (now - radius)) if now > radius else 0.5 * now
        if now - keep > relative_speed(d, shape, count):  # of most pairs: they cannot get there
            continue
        out[k] = time_of_approach(y, d, shape, count, keep, z)
        if out[k] < 1.0 and now > NOWHERE * least:
            for m in range(4):
                earliest[v[m]] = min(earliest[v[m]], out[k])
        else:
            out[k] = 1.0


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
        elif first == 1:
            closest = point_triangle(y[0], y[1], y[2], y[3])
            at = point_face(top, x, y, i, j, flipped, closest, distance, choice, n, out, at)
        else:
            pair = segment_segment(y[0], y[1], y[2], y[3])
            at = edge_edge(top, x, y, i, j, pair, distance, choice, v[:0], n, out, at)
    return at
