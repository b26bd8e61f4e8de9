"""A ball on surfaces that deform: triangles whose corners move evenly over a step.

The ball goes on in sub-steps in which it moves, relative to what is near, by less than a quarter of its radius; so it
cannot pass a surface, and what a sub-step leaves of penetration is taken back at its end.
"""

from math import ceil, sqrt
from typing import Any

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.ball.contact_kernels import solve_contacts
from tripod_sim.ball.obstacle_kernels import triangle_distance
from tripod_sim.ball.plate_kernels import (
    FRICTION,
    GAP,
    GRAVITY,
    HARDEST,
    IMPACTS,
    MASS,
    NEAR,
    RADIUS,
    REST_SPEED,
    RESTITUTION,
    ROLLING,
    SHIFT,
    SKIN,
    SLOW,
    SUBSTEP,
    book,
    contact_work,
)
from tripod_sim.rotation_kernels import turn

MOST_CONTACTS = 16
MOST_CORRECTIONS = 20


def workspace(triangles: int) -> tuple[Any, Any, Any]:
    """Return the scratch arrays of `advance_on_surface`: rows of vectors, candidates, and triangles of contacts."""
    size = 9 * MOST_CONTACTS + 12
    return np.zeros((size, 3)), np.zeros(triangles, dtype=np.int64), np.zeros(MOST_CONTACTS, dtype=np.int64)


@njit(cache=True, error_model="numpy")
def advance_on_surface(
    ball: Array,
    before: Array,
    after: Array,
    triangles: Array,
    dt: float,
    numbers: Array,
    ledger: Array,
    reaction: Array,
    rows: Array,
    candidates: Array,
    owners: Array,
) -> None:
    """Advance a ball by one step, in place.

    Args:
        ball: Position, velocity, angular velocity, quaternion, shape (13,).
        before, after: Corners of the surfaces at the start and at the end of the step [m], shape (n, 3).
        triangles: Their indices, shape (m, 3).
        dt: [s].
        numbers: Of the ball, see `plate_kernels`.
        ledger: Its account, changed.
        reaction: Impulses on the corners [N s], shape (n, 3), written.
        rows, candidates, owners: From `workspace`.
    """
    C = MOST_CONTACTS
    normals, weights, speeds = rows[:C], rows[C : 2 * C], rows[2 * C : 3 * C]
    impulses, couples, bounds, gaps = (
        rows[3 * C : 4 * C],
        rows[4 * C : 5 * C],
        rows[5 * C : 6 * C, 0],
        rows[6 * C : 7 * C, 0],
    )
    base = 7 * C
    v0, w0, spin, n, b, work = (
        rows[base],
        rows[base + 1],
        rows[base + 2],
        rows[base + 3],
        rows[base + 4],
        rows[base + 5],
    )
    corners = rows[base + 6 : base + 9].reshape(9)
    p, v, w, quaternion = ball[0:3], ball[3:6], ball[6:9], ball[9:13]
    m, radius, reach = numbers[MASS], numbers[RADIUS], numbers[RADIUS] + SKIN
    reaction[:] = 0.0
    spin[:] = 0.0
    speed = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + 10.0 * dt
    far = 2.0 * radius + speed * dt
    near, fastest = 0, 0.0
    for k in range(triangles.shape[0]):
        inside = True
        for a in range(3):
            low, high = 1e30, -1e30
            for c in range(3):
                low = min(low, before[triangles[k, c], a], after[triangles[k, c], a])
                high = max(high, before[triangles[k, c], a], after[triangles[k, c], a])
            inside &= low <= p[a] + far and high >= p[a] - far
        if inside:
            candidates[near] = k
            near += 1
            for c in range(3):
                square = 0.0
                for a in range(3):
                    square += (after[triangles[k, c], a] - before[triangles[k, c], a]) ** 2
                fastest = max(fastest, square)
    way = speed * dt + sqrt(fastest)
    parts = max(1, ceil(dt / numbers[SUBSTEP] - 1e-9), ceil(4.0 * way / radius))
    h = dt / parts
    for part in range(parts):
        s = (part + 1.0) / parts
        # where it would be at the end of the sub-step
        for a in range(3):
            v0[a], w0[a] = v[a], w[a]
            n[a] = p[a]
            v[a] += numbers[GRAVITY + a] * h
            p[a] += 0.5 * h * (v0[a] + v[a])
        count, smallest = 0, 1e30
        for j in range(near):
            k = candidates[j]
            for c in range(3):
                for a in range(3):
                    i = triangles[k, c]
                    corners[3 * c + a] = before[i, a] + s * (after[i, a] - before[i, a])
            d = triangle_distance(corners, p, normals[count], weights[count])
            smallest = min(smallest, d)
            if d > reach + NEAR or count == C - 1:
                continue
            known = False
            for i in range(count):
                known |= (
                    normals[i, 0] * normals[count, 0]
                    + normals[i, 1] * normals[count, 1]
                    + normals[i, 2] * normals[count, 2]
                    > 1 - 1e-9
                )
            if known:
                continue
            gaps[count], owners[count] = d - reach, k
            closing = 0.0
            for a in range(3):
                speeds[count, a] = 0.0
                for c in range(3):
                    i = triangles[k, c]
                    speeds[count, a] += weights[count, c] * (after[i, a] - before[i, a]) / dt
                closing += (v0[a] - speeds[count, a]) * normals[count, a]
            bounds[count] = -numbers[RESTITUTION] * closing if closing < -numbers[REST_SPEED] else 0.0
            if closing < -SLOW:
                ledger[IMPACTS] += 1
                ledger[HARDEST] = max(ledger[HARDEST], -closing)
            count += 1
        if count:
            solve_contacts(
                count, v, w, normals, normals, speeds, spin, bounds, m, radius, numbers[FRICTION], numbers[ROLLING],
                impulses, couples,
            )  # fmt: skip
            contact_work(
                count, v0, w0, v, w, normals, speeds, speeds, spin, spin, impulses, couples, radius, 1.0, work
            )
            book(ledger, work[0], work[1])
            for i in range(count):
                k = owners[i]
                for c in range(3):
                    for a in range(3):
                        reaction[triangles[k, c], a] -= weights[i, c] * impulses[i, a]
            # the way with the speed after the contacts, then out of what it still overlaps
            for a in range(3):
                b[a] = 0.5 * h * (v0[a] + v[a])
                p[a] = n[a] + b[a]
            for attempt in range(MOST_CORRECTIONS):
                smallest = 1e30
                for i in range(count):
                    k = owners[i]
                    for c in range(3):
                        for a in range(3):
                            j = triangles[k, c]
                            corners[3 * c + a] = before[j, a] + s * (after[j, a] - before[j, a])
                    over = triangle_distance(corners, p, normals[i], weights[i]) - reach
                    smallest = min(smallest, over + reach)
                    if over < 0.0 and attempt < MOST_CORRECTIONS - 1:
                        for a in range(3):
                            p[a] -= over * normals[i, a]
                if smallest >= reach:
                    break
            for a in range(3):
                ledger[SHIFT] -= m * numbers[GRAVITY + a] * (p[a] - n[a] - b[a])
        if smallest < 1e29:
            ledger[GAP] = min(ledger[GAP], smallest - radius)
        for a in range(3):
            b[a] = 0.5 * (w0[a] + w[a])
        turn(quaternion, b, h)
