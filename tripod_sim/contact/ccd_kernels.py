"""Continuous detection: the time until which two moving shapes surely keep a distance, by additive advancement.

Vertices move on straight lines over a step, x(t) = x + t d, t in 0..1. Two shapes of distance D cannot lose more than
l = max |d_i - mean| over the vertices of one + the same of the other in unit time, so (D - gap) / l is a time that is
surely safe; such times are added up until the distance is nearly the gap [LiKaufmanJiang2021]. The answer is never
later than the true time, whatever the shapes.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.contact.distance_kernels import point_triangle, segment_segment

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
        return np.sqrt(point_triangle(x[0], x[1], x[2], x[3])[3])
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
