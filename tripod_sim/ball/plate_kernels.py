"""A ball on a moving plate with walls and holes: one step, in sub-steps, each up to the next touch.

Positions are kept in the plate's frame, where the walls stand still, so nothing that the plate does can bring the ball
through one. Within a sub-step the ball goes along a straight line of that frame: the free parabola, seen from the
moving plate, less what would go into a surface already touched.
"""

from math import ceil, floor, sqrt
from typing import Any

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put
from tripod_sim.ball.contact_kernels import solve_contacts
from tripod_sim.ball.motion_kernels import plate_at
from tripod_sim.ball.obstacle_kernels import DEEPEST, MISSES, distance, sweep
from tripod_sim.ball.obstacles import Obstacles
from tripod_sim.rotation_kernels import rotate, rotate_back, turn

SKIN = 1e-7
"""Gap at which surfaces count as touching [m]."""

NEAR = 1e-7
"""Gap above the skin up to which a contact still holds [m]."""

SLOW = 1e-4
"""Normal speed below which a contact is neither an impact nor ending [m/s]."""

MOST_CONTACTS = 12
MOST_ATTEMPTS = 5
MOST_TOUCHES = 64
"""In one sub-step; then the ball rides with the plate for the rest of it, and the ledger counts it."""

MASS, RADIUS, FRICTION, RESTITUTION, REST_SPEED, ROLLING, SUBSTEP, GRAVITY = 0, 1, 2, 3, 4, 5, 6, 7
"""Places in the array of numbers of a ball; gravity takes three."""

WORK, LOSS, GAIN, SHIFT, GAP, IMPACTS, STUCK, HARDEST = range(8)
"""Places in the ledger of a ball: work of the plate on it, energy lost in contacts and gained there by rounding,
energy of the corrections of position [J], smallest gap [m], impacts, sub-steps not finished, hardest impact [m/s]."""

ON_PLATE, IN_HOLE, LEFT = 0, 1, 2
"""Where the ball is."""


@njit(cache=True, error_model="numpy")
def floor_distance(o: Obstacles, q: Array, normal: Array, weights: Array) -> float:
    """Return the distance from `q` to the floor, which is box 0 less the holes [m], and write the normal.

    Over a hole of radius R, at r < R from its axis and z above the floor, the rim is next: sqrt((R - r)² + z²).
    """
    holes = o.holes
    for h in range(holes.shape[0]):
        x, y = q[0] - holes[h, 0], q[1] - holes[h, 1]
        r = sqrt(x * x + y * y)
        if r < holes[h, 2]:
            out, z = holes[h, 2] - r, q[2]
            d = sqrt(out * out + z * z)
            if r == 0.0:
                normal[0], normal[1], normal[2] = -out / d, 0.0, z / d
            else:
                normal[0], normal[1], normal[2] = -out * x / (r * d), -out * y / (r * d), z / d
            return d
    return distance(0, o, q, normal, weights)


@njit(cache=True, error_model="numpy")
def over_hole(holes: Array, q: Array, margin: float) -> bool:
    """Return whether a hole is within `margin` [m] of the point of the floor under `q`."""
    for h in range(holes.shape[0]):
        x, y, r = q[0] - holes[h, 0], q[1] - holes[h, 1], holes[h, 2] + margin
        if x * x + y * y < r * r:
            return True
    return False


@njit(cache=True, error_model="numpy")
def cells_of(grid: Array, low_x: float, low_y: float, high_x: float, high_y: float, cells: Array) -> None:
    """Write the range of grid cells that a rectangle meets: first and last column, first and last row."""
    columns, rows, x0, y0, size = grid[0], grid[1], grid[2], grid[3], grid[4]
    cells[0] = int(min(max(floor((low_x - x0) / size), 0.0), columns - 1))
    cells[1] = int(min(max(floor((high_x - x0) / size), 0.0), columns - 1))
    cells[2] = int(min(max(floor((low_y - y0) / size), 0.0), rows - 1))
    cells[3] = int(min(max(floor((high_y - y0) / size), 0.0), rows - 1))


@njit(cache=True, error_model="numpy")
def touching(
    q: Array, reach: float, o: Obstacles, normals: Array, distances: Array, near: Array, cells: Array
) -> int:
    """Write normals and distances of the obstacles within `reach` of `q`, each direction once; return how many.

    `near[0]` becomes the smallest distance found, or stays.
    """
    count = 0
    normal, weights = normals[MOST_CONTACTS], normals[MOST_CONTACTS + 1]
    cells_of(o.grid, q[0] - reach, q[1] - reach, q[0] + reach, q[1] + reach, cells)
    for row in range(cells[2], cells[3] + 1):
        for column in range(cells[0], cells[1] + 1):
            cell = row * int(o.grid[0]) + column
            for j in range(o.starts[cell], o.starts[cell + 1]):
                k = o.items[j]
                if k == 0 and o.holes.shape[0]:
                    d = floor_distance(o, q, normal, weights)
                else:
                    d = distance(k, o, q, normal, weights)
                near[0] = min(near[0], d)
                if d > reach or count == MOST_CONTACTS:
                    continue
                known = False
                for i in range(count):
                    known |= (
                        normals[i, 0] * normal[0] + normals[i, 1] * normal[1] + normals[i, 2] * normal[2]
                        > 1 - 1e-9
                    )
                if not known:
                    put(normals[count], normal)
                    distances[count] = d
                    count += 1
    return count


@njit(cache=True, error_model="numpy")
def first_touch(
    q: Array, move: Array, reach: float, o: Obstacles, skip_floor: bool, scratch: Array, cells: Array
) -> float:
    """Return the fraction of `move` up to the first touch, or `MISSES`."""
    first = MISSES
    cells_of(
        o.grid,
        min(q[0], q[0] + move[0]) - reach,
        min(q[1], q[1] + move[1]) - reach,
        max(q[0], q[0] + move[0]) + reach,
        max(q[1], q[1] + move[1]) + reach,
        cells,
    )
    for row in range(cells[2], cells[3] + 1):
        for column in range(cells[0], cells[1] + 1):
            cell = row * int(o.grid[0]) + column
            for j in range(o.starts[cell], o.starts[cell + 1]):
                if o.items[j] or not skip_floor:
                    s = sweep(o.items[j], o, q, move, reach, scratch)
                    first = min(first, s)
    return first


@njit(cache=True, error_model="numpy")
def contact_work(
    count: int,
    v0: Array,
    w0: Array,
    v1: Array,
    w1: Array,
    normals: Array,
    s0: Array,
    s1: Array,
    spin0: Array,
    spin1: Array,
    impulses: Array,
    couples: Array,
    radius: float,
    part: float,
    out: Array,
) -> None:
    """Write the work of the surfaces on the ball and the energy that it receives of it [J], shape (2,).

    With impulses P that act evenly over a time, the ball receives P . (c_before + c_after)/2, c the speed of its
    contact point; the surface gives the same with its own speed. The rest is lost in the contact. Only `part` of the
    impulses and of the change from 0 to 1 happens.
    """  # fmt: skip
    given = taken = 0.0
    for i in range(count):
        n, P, Q = normals[i], impulses[i], couples[i]
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            v, s = v0[a] + 0.5 * part * (v1[a] - v0[a]), s0[i, a] + 0.5 * part * (s1[i, a] - s0[i, a])
            wb, wc = w0[b] + 0.5 * part * (w1[b] - w0[b]), w0[c] + 0.5 * part * (w1[c] - w0[c])
            taken += part * P[a] * (v - radius * (wb * n[c] - wc * n[b]))
            given += part * P[a] * s
            taken += part * Q[a] * (w0[a] + 0.5 * part * (w1[a] - w0[a]))
            given += part * Q[a] * (spin0[a] + 0.5 * part * (spin1[a] - spin0[a]))
    out[0], out[1] = given, taken


@njit(cache=True, error_model="numpy")
def book(ledger: Array, given: float, taken: float) -> None:
    """Enter work and loss of contacts in the ledger."""
    ledger[WORK] += given
    ledger[LOSS] += max(given - taken, 0.0)
    ledger[GAIN] += max(taken - given, 0.0)


@njit(cache=True, error_model="numpy")
def react(
    reaction: Array,
    count: int,
    pose: Array,
    q: Array,
    normals: Array,
    impulses: Array,
    couples: Array,
    radius: float,
    part: float,
    arm: Array,
) -> None:
    """Add the impulses on the plate to `reaction`: sum [N s], moment about its centre [N m s], sum of what of them is
    along the normals [N s], shape (3, 3).
    """
    for i in range(count):
        n, P = normals[i], impulses[i]
        along = (P[0] * n[0] + P[1] * n[1] + P[2] * n[2]) / (n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
        rotate(pose[3:], q, arm)
        for a in range(3):
            arm[a] -= radius * normals[i, a]
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            reaction[0, a] -= part * impulses[i, a]
            reaction[1, a] -= part * (arm[b] * impulses[i, c] - arm[c] * impulses[i, b] + couples[i, a])
            reaction[2, a] -= part * along * n[a]


@njit(cache=True, error_model="numpy")
def surface_speeds(
    count: int, pose: Array, q: Array, normals: Array, radius: float, arm: Array, out: Array
) -> None:
    """Write the speed of the plate at each contact [m/s]; `normals` in world, `q` in the plate's frame."""
    rotate(pose[3:], q, arm)
    V, W = pose[1], pose[2]
    for i in range(count):
        x, y, z = (
            arm[0] - radius * normals[i, 0],
            arm[1] - radius * normals[i, 1],
            arm[2] - radius * normals[i, 2],
        )
        out[i, 0] = V[0] + W[1] * z - W[2] * y
        out[i, 1] = V[1] + W[2] * x - W[0] * z
        out[i, 2] = V[2] + W[0] * y - W[1] * x


def workspace() -> Any:
    """Return the scratch arrays of `advance`: rows of vectors, and a range of cells."""
    return np.zeros((9 * (MOST_CONTACTS + 2) + 40, 3)), np.zeros(4, dtype=np.int64)


@njit(cache=True, error_model="numpy")
def advance(
    ball: Array,
    plate: Array,
    dt: float,
    numbers: Array,
    o: Obstacles,
    ledger: Array,
    reaction: Array,
    rows: Array,
    cells: Array,
) -> int:
    """Advance a ball on a plate by one step, in place; return where it is, `ON_PLATE`, `IN_HOLE` or `LEFT`.

    Args:
        ball: Position [m], velocity [m/s], angular velocity [rad/s] in world, quaternion, shape (13,).
        plate: Motion over the step, see `plate_at`.
        dt: [s].
        numbers: Of the ball, see `MASS` and the following.
        o: What stands on the plate.
        ledger: Sums over the whole run, see `WORK` and the following, changed.
        reaction: See `react`, shape (3, 3), written.
        rows, cells: From `workspace`.
    """  # fmt: skip
    C = MOST_CONTACTS + 2
    flat, normals, speeds0, speeds1 = rows[:C], rows[C : 2 * C], rows[2 * C : 3 * C], rows[3 * C : 4 * C]
    impulses, couples = rows[4 * C : 5 * C], rows[5 * C : 6 * C]
    middle = rows[8 * C : 9 * C]
    bounds, distances, closing = rows[6 * C : 7 * C, 0], rows[7 * C : 8 * C, 0], rows[7 * C : 8 * C, 1]
    base = 9 * C
    pose0, pose1, scratch = rows[base : base + 6], rows[base + 6 : base + 12], rows[base + 12 : base + 15]
    q, q1, move, v1, w1 = rows[base + 15], rows[base + 16], rows[base + 17], rows[base + 18], rows[base + 19]
    arm, d, near, work = rows[base + 20], rows[base + 21], rows[base + 22], rows[base + 23]
    v0, w0, ahead = rows[base + 25], rows[base + 26], rows[base + 27]
    p, v, w, quaternion = ball[0:3], ball[3:6], ball[6:9], ball[9:13]
    m, radius, gravity = numbers[MASS], numbers[RADIUS], numbers[GRAVITY : GRAVITY + 3]
    reach = radius + SKIN
    reaction[:] = 0.0
    plate_at(plate, 0.0, dt, pose0)
    for a in range(3):
        d[a] = p[a] - pose0[0, a]
    rotate_back(pose0[3:], d, q)
    parts = max(1, ceil(dt / numbers[SUBSTEP] - 1e-9))
    h = dt / parts
    for part in range(parts):
        time, left, touches = part * h, h, 0
        while left > 0.0:
            plate_at(plate, min(time / dt, 1.0), dt, pose0)
            near[0] = reach + NEAR
            count = touching(q, reach + NEAR, o, flat, distances, near, cells)
            ledger[GAP] = min(ledger[GAP], near[0] - radius)
            for i in range(count):
                rotate(pose0[3:], flat[i], normals[i])
            # impacts: whatever closes faster than SLOW
            surface_speeds(count, pose0, q, normals, radius, arm, speeds0)
            hardest = 0.0
            for i in range(count):
                closing[i] = _normal_speed(v, normals[i], speeds0[i])
                hardest = min(hardest, closing[i])
                bounds[i] = -numbers[RESTITUTION] * closing[i] if closing[i] < -numbers[REST_SPEED] else 0.0
            if hardest < -SLOW:
                put(v0, v)
                put(w0, w)
                for attempt in range(2):
                    solve_contacts(
                        count, v, w, normals, normals, speeds0, pose0[2], bounds, m, radius, numbers[FRICTION],
                        numbers[ROLLING], impulses, couples,
                    )  # fmt: skip
                    contact_work(
                        count, v0, w0, v, w, normals, speeds0, speeds0, pose0[2], pose0[2], impulses, couples,
                        radius, 1.0, work,
                    )  # fmt: skip
                    if work[1] <= work[0] + 1e-20 or attempt:
                        break
                    put(v, v0)  # several impacts at once gained energy: without restitution
                    put(w, w0)
                    bounds[:count] = 0.0
                book(ledger, work[0], work[1])
                react(reaction, count, pose0, q, normals, impulses, couples, radius, 1.0, arm)
                ledger[IMPACTS] += 1
                ledger[HARDEST] = max(ledger[HARDEST], -hardest)
            # what stays in contact comes first in `flat`
            kept = 0
            for i in range(count):
                if _normal_speed(v, normals[i], speeds0[i]) <= SLOW:
                    _swap(flat, distances, i, kept)
                    kept += 1
            put(v0, v)
            put(w0, w)
            tau = left
            for attempt in range(MOST_ATTEMPTS):
                # free motion over tau, then the contacts at its end
                plate_at(plate, min((time + tau) / dt, 1.0), dt, pose1)
                rotate(pose0[3:], q, arm)
                for a in range(3):
                    b, c = (a + 1) % 3, (a + 2) % 3
                    d[a] = (v0[a] - pose0[1, a] - pose0[2, b] * arm[c] + pose0[2, c] * arm[b]) * tau
                    v1[a], w1[a] = v0[a] + gravity[a] * tau, w0[a]
                rotate_back(pose0[3:], d, ahead)
                for a in range(3):
                    ahead[a] += q[a]
                for i in range(count):
                    rotate(pose0[3:], flat[i], normals[i])
                    bounds[i] = 0.0
                surface_speeds(count, pose0, q, normals, radius, arm, speeds0)
                earliest = tau
                for i in range(kept, count):
                    closing[i] = _normal_speed(v0, normals[i], speeds0[i])
                for i in range(kept):
                    put(middle[i], normals[i])
                    rotate(pose1[3:], flat[i], normals[i])
                    for a in range(3):
                        middle[i, a] = 0.5 * (middle[i, a] + normals[i, a])
                surface_speeds(kept, pose1, ahead, normals, radius, arm, speeds1)
                solve_contacts(
                    kept, v1, w1, normals, middle, speeds1, pose1[2], bounds, m, radius, numbers[FRICTION],
                    numbers[ROLLING], impulses, couples,
                )  # fmt: skip
                for a in range(3):
                    d[a] = p[a] + 0.5 * (v0[a] + v1[a]) * tau - pose1[0, a]
                rotate_back(pose1[3:], d, q1)
                for a in range(3):
                    move[a] = q1[a] - q[a]
                for _ in range(8):
                    worst = 0.0
                    for i in range(kept):
                        into = flat[i, 0] * move[0] + flat[i, 1] * move[1] + flat[i, 2] * move[2]
                        into += min(distances[i] - reach, 0.0)
                        if into < 0.0:
                            worst = min(worst, into)
                            for a in range(3):
                                move[a] -= into * flat[i, a]
                    if worst > -1e-16:
                        break
                # what was left slowly may be fallen back on within tau: stop there
                for i in range(kept, count):
                    into = flat[i, 0] * move[0] + flat[i, 1] * move[1] + flat[i, 2] * move[2]
                    if into < -DEEPEST:
                        earliest = min(earliest, tau * closing[i] * tau / (closing[i] * tau - into))
                if earliest == tau:
                    break
                if attempt < MOST_ATTEMPTS - 2:
                    tau = 0.999 * earliest
                else:  # shorter and shorter: hold all contacts, which the ledger shows as a gain
                    kept = count
            rim = over_hole(o.holes, q, 1.5 * radius)
            s = first_touch(q, move, reach, o, rim, scratch, cells)
            hit = s <= 1.0
            s = min(s, 1.0)
            if rim:  # the rim is no convex set: small moves, then out of it
                length = sqrt(move[0] * move[0] + move[1] * move[1] + move[2] * move[2])
                if length * s > 0.1 * radius:
                    s, hit = 0.1 * radius / length, True
            for a in range(3):
                q[a] += s * move[a]
                v[a] = v0[a] + s * (v1[a] - v0[a])
                w[a] = w0[a] + s * (w1[a] - w0[a])
            if rim:
                for _ in range(4):
                    under = floor_distance(o, q, scratch[1], scratch[2]) - reach
                    if under >= 0.0 or q[2] < 0.0:
                        break
                    for a in range(3):
                        q[a] -= under * scratch[1, a]
            contact_work(
                kept, v0, w0, v1, w1, middle, speeds0, speeds1, pose0[2], pose1[2], impulses, couples, radius, s, work
            )  # fmt: skip
            book(ledger, work[0], work[1])
            react(reaction, kept, pose0, q, middle, impulses, couples, radius, s, arm)
            for a in range(3):
                arm[a] = 0.5 * (w0[a] + w[a])
            turn(quaternion, arm, s * tau)
            # the position in world, and the energy of what was corrected
            hit |= tau < left
            spent = s * tau
            time += spent
            left -= spent
            touches += 1
            if not hit:
                left = 0.0
            elif touches >= MOST_TOUCHES:
                time, left = time + left, 0.0
                ledger[STUCK] += 1
            plate_at(plate, min(time / dt, 1.0), dt, pose0)
            rotate(pose0[3:], q, d)
            for a in range(3):
                new = d[a] + pose0[0, a]
                ledger[SHIFT] -= m * gravity[a] * (new - p[a] - 0.5 * (v0[a] + v[a]) * spent)
                p[a] = new
            where = place(q, radius, o)
            if where != ON_PLATE:
                fall(ball, dt - time, gravity)
                return where
    return ON_PLATE


@njit(cache=True, error_model="numpy")
def _swap(normals: Array, distances: Array, i: int, j: int) -> None:
    """Exchange two contacts."""
    for a in range(3):
        normals[i, a], normals[j, a] = normals[j, a], normals[i, a]
    distances[i], distances[j] = distances[j], distances[i]


@njit(cache=True, error_model="numpy")
def _normal_speed(v: Array, n: Array, speed: Array) -> float:
    """Return u . n of the contact with normal n; the rotation of a sphere does not enter."""
    return (v[0] - speed[0]) * n[0] + (v[1] - speed[1]) * n[1] + (v[2] - speed[2]) * n[2]


@njit(cache=True, error_model="numpy")
def place(q: Array, radius: float, o: Obstacles) -> int:
    """Return where a ball with its centre at `q`, in the plate's frame, is."""
    extent = o.extent
    if q[2] < 0.0 and over_hole(o.holes, q, 0.0):
        return IN_HOLE
    if q[0] < extent[0] - radius or q[1] < extent[1] - radius or q[2] < extent[4] - radius:
        return LEFT
    if q[0] > extent[2] + radius or q[1] > extent[3] + radius:
        return LEFT
    return ON_PLATE


@njit(cache=True, error_model="numpy")
def fall(ball: Array, time: float, gravity: Array) -> None:
    """Let a ball that touches nothing fall for `time` [s]."""
    for a in range(3):
        ball[a] += time * (ball[3 + a] + 0.5 * time * gravity[a])
        ball[3 + a] += time * gravity[a]
    turn(ball[9:13], ball[6:9], time)
