"""What a ball can touch: distance to boxes and triangles, and the first time at which a moving ball does.

The distance d from a point to a convex set is convex along a straight line, so the tangent of f(s) = d(s) - reach lies
below f and Newton's method from the start of the line approaches the first root from the left: it never oversteps it,
and stops where the ball would touch, however fast it is and however thin the wall.
"""

from math import sqrt

from numba import njit

from tripod_host.arrays import Array
from tripod_sim.ball.obstacles import Obstacles
from tripod_sim.distance_kernels import point_triangle_distance

TOUCHING = 1e-11
"""Distance above `reach` at which a moving ball counts as touching [m]."""

DEEPEST = 1e-13
"""A move that goes no deeper than this into what it touches is rounding [m]."""

MISSES = 2.0
"""What `sweep` returns when nothing is touched."""

MOST_ITERATIONS = 100


@njit(cache=True, error_model="numpy")
def box_distance(box: Array, q: Array, normal: Array) -> float:
    """Return the distance from `q` to a box [m], negative inside; write the unit vector from it to `q`.

    Args:
        box: Centre and half extents [m], shape (6,).
        q: Point [m], shape (3,).
        normal: Written, shape (3,).
    """
    square, deepest, side = 0.0, -1e30, 0
    for i in range(3):
        d = q[i] - box[i]
        out = abs(d) - box[3 + i]
        if out > deepest:
            deepest, side = out, i
        normal[i] = 0.0
        if out > 0.0:
            normal[i] = out if d > 0.0 else -out
            square += out * out
    if square > 0.0:
        distance = sqrt(square)
        for i in range(3):
            normal[i] /= distance
        return distance
    normal[side] = 1.0 if q[side] >= box[side] else -1.0
    return deepest


@njit(cache=True, error_model="numpy")
def triangle_distance(triangle: Array, q: Array, normal: Array, weights: Array) -> float:
    """Return the distance from `q` to a triangle [m]; write the unit vector from it to `q` and the closest point.

    Args:
        triangle: Corners [m], shape (9,).
        q: Point [m], shape (3,).
        normal: Written, shape (3,); where the distance is 0, the normal of the triangle.
        weights: Barycentric coordinates of the closest point, written, shape (3,).
    """
    weights[0], weights[1], weights[2], _ = point_triangle_distance(
        q, triangle[:3], triangle[3:6], triangle[6:]
    )
    square = 0.0
    for i in range(3):
        normal[i] = (
            q[i] - weights[0] * triangle[i] - weights[1] * triangle[3 + i] - weights[2] * triangle[6 + i]
        )
        square += normal[i] * normal[i]
    distance = sqrt(square)
    if distance > 1e-15:
        for i in range(3):
            normal[i] /= distance
        return distance
    a0, a1, a2 = triangle[3] - triangle[0], triangle[4] - triangle[1], triangle[5] - triangle[2]
    b0, b1, b2 = triangle[6] - triangle[0], triangle[7] - triangle[1], triangle[8] - triangle[2]
    n0, n1, n2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    length = sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    normal[0], normal[1], normal[2] = n0 / length, n1 / length, n2 / length
    return 0.0


@njit(cache=True, error_model="numpy")
def distance(k: int, o: Obstacles, q: Array, normal: Array, weights: Array) -> float:
    """Return the distance from `q` to obstacle `k` [m] and write the normal: boxes first, then triangles."""
    if k < o.boxes.shape[0]:
        return box_distance(o.boxes[k], q, normal)
    return triangle_distance(o.triangles[k - o.boxes.shape[0]], q, normal, weights)


@njit(cache=True, error_model="numpy")
def sweep(k: int, o: Obstacles, q: Array, move: Array, reach: float, scratch: Array) -> float:
    """Return the fraction of `move` after which a point at `q` is first `reach` away from obstacle `k`, or `MISSES`.

    Never later than the true one; a point that is nearer already but moves away misses.

    Args:
        k, o: Number of the obstacle, and all of them.
        q: Start [m], shape (3,).
        move: [m], shape (3,).
        reach: Radius of the ball, and a skin [m].
        scratch: Shape (3, 3).
    """
    point, normal, weights = scratch[0], scratch[1], scratch[2]
    s = 0.0
    for _ in range(MOST_ITERATIONS):
        for i in range(3):
            point[i] = q[i] + s * move[i]
        over = distance(k, o, point, normal, weights) - reach
        slope = normal[0] * move[0] + normal[1] * move[1] + normal[2] * move[2]
        if slope * (1.0 - s) >= -DEEPEST:
            return MISSES
        if over <= TOUCHING:
            return s
        s += over / -slope
        if s > 1.0:
            return MISSES
    return s
