"""What a part of a step errs, point by point (see `path_error_control`), compiled."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put


@njit(cache=True, error_model="numpy")
def write_corners(
    first: int, corners: Array, body: Array, centres: Array, rotations: Array, velocities: Array, spins: Array,
    x: Array, v: Array,
) -> None:  # fmt: skip
    """Write positions and velocities of the corners of rigid bodies to the rows of `x` and `v` from `first` on.

    corners: Of all bodies, about their centres in their frames [m], shape (k, 3); body: of each, shape (k,).
    """
    for k in range(len(body)):
        b, n = body[k], first + k
        arm0, arm1, arm2 = 0.0, 0.0, 0.0
        for j in range(3):
            arm0 += rotations[b, 0, j] * corners[k, j]
            arm1 += rotations[b, 1, j] * corners[k, j]
            arm2 += rotations[b, 2, j] * corners[k, j]
        x[n, 0], x[n, 1], x[n, 2] = centres[b, 0] + arm0, centres[b, 1] + arm1, centres[b, 2] + arm2
        v[n, 0] = velocities[b, 0] + spins[b, 1] * arm2 - spins[b, 2] * arm1
        v[n, 1] = velocities[b, 1] + spins[b, 2] * arm0 - spins[b, 0] * arm2
        v[n, 2] = velocities[b, 2] + spins[b, 0] * arm1 - spins[b, 1] * arm0


@njit(cache=True, error_model="numpy")
def write_errors(
    h: float, ratio: float, start: Array, end: Array, before: Array, a_start: Array, free: Array, a_end: Array,
    out: Array,
) -> None:  # fmt: skip
    """Write what positions and velocities, rows of `start` and `end`, differ from the trapezoidal rule to `out`.

    ratio: h over the length of the part before, whose velocities at the start are `before`; 0: differences do not look
    back over the start. a_start, a_end: accelerations [m/s²], the latter is written. Of points that are not `free` the
    errors are 0.
    """
    c1, c0, cb = (1 + 2 * ratio) / (1 + ratio), 1 + ratio, ratio * ratio / (1 + ratio)
    for n in range(len(free)):
        for i in range(3):
            v0, v1 = start[1, n, i], end[1, n, i]
            a_end[n, i] = (c1 * v1 - c0 * v0 + cb * before[n, i]) / h
            out[0, n, i] = end[0, n, i] - start[0, n, i] - 0.5 * h * (v0 + v1) if free[n] else 0.0
            out[1, n, i] = v1 - v0 - 0.5 * h * (a_start[n, i] + a_end[n, i]) if free[n] else 0.0


@njit(cache=True, error_model="numpy")
def drop_normal(
    count: int, vertex: Array, weight: Array, normal: Array, pressure: Array, row: Array, body: Array, first: Array,
    errors: Array,
) -> None:  # fmt: skip
    """Take the part along the normal from the errors of what is pressed: there positions are where the surface is.

    row, body: Point and rigid body of each vertex, -1 for none; first: of the corners of each body, and their end.
    """
    for c in range(count):
        if not pressure[c] > 0.0:
            continue
        for m in range(4):
            p = vertex[c, m]
            if weight[c, m] == 0.0:
                continue
            low, high = row[p], row[p] + 1
            if body[p] >= 0:
                low, high = first[body[p]], first[body[p] + 1]
            elif low < 0:
                continue
            for n in range(low, high):
                for k in range(2):
                    along = 0.0
                    for i in range(3):
                        along += errors[k, n, i] * normal[c, i]
                    for i in range(3):
                        errors[k, n, i] -= along * normal[c, i]


@njit(cache=True, error_model="numpy")
def write_lengths(
    h: float, longest: float, start: Array, end: Array, a_start: Array, a_end: Array, errors: Array, origin: Array,
    free: Array, sums: Array, ends: Array, added: Array, ways: Array, far: Array,
) -> None:  # fmt: skip
    """Write what `errors` add to each point's error to `added`, its way to `ways`, its distance from `origin` to `far`.

    An error of the velocity puts a point off by as much over w, w² = |da/dt| / |v|, at least 1 / longest, as in a
    vibration of that frequency. Each row of `sums` becomes that of `ends`, shape (n, 4): the square of what
    errors of velocities have come to, and the last of these, which those within 1 / w go along with.
    """
    for n in range(len(free)):
        error, fast, with_last, jerk, speed, way, off = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        put(ends[n], sums[n])
        added[n] = 0.0
        if free[n]:
            for i in range(3):
                error += errors[0, n, i] ** 2
                fast += errors[1, n, i] ** 2
                jerk += (a_end[n, i] - a_start[n, i]) ** 2
                speed += (0.5 * (start[1, n, i] + end[1, n, i])) ** 2
                way += (end[0, n, i] - start[0, n, i]) ** 2
                off += (end[0, n, i] - origin[n, i]) ** 2
            rate = np.sqrt(max(np.sqrt(jerk) / h / max(np.sqrt(speed), 1e-12), longest**-2))
            fade = np.exp(-rate * h)
            for i in range(3):
                with_last += fade * sums[n, 1 + i] * errors[1, n, i] / rate
                ends[n, 1 + i] = fade * sums[n, 1 + i] + errors[1, n, i] / rate
            ends[n, 0] = max(sums[n, 0] + fast / rate**2 + 2 * with_last, 0.0)
            added[n] = np.sqrt(error) + max(np.sqrt(ends[n, 0]) - np.sqrt(sums[n, 0]), 0.0)
        ways[n], far[n] = np.sqrt(way), np.sqrt(off)


@njit(cache=True, error_model="numpy")
def ratio_over_path(
    accuracy: float, floor: float, spend: float, least: float, added: Array, ways: Array, far: Array, before: Array,
    furthest: float,
) -> tuple[float, float]:  # fmt: skip
    """Return the largest of what points have `added` over what they may, and which part of this their way gives them.

    The first is NaN where a number is not finite.

    before: Errors of parts before; furthest: that a point has been from its origin then [m]. Arrays have the shape (n,)
    and are of points of one kind.
    """
    share, total = accuracy * ways.max(), accuracy * max(furthest, far.max()) + floor
    worst, given = 0.0, 0.0
    for n in range(len(added)):
        if added[n] == 0.0:
            continue
        may = share + max(spend * (total - before[n]), least * total)
        ratio = added[n] / may
        if np.isnan(ratio):
            return ratio, 0.0
        if ratio > worst:
            worst, given = ratio, share / may
    return worst, given
