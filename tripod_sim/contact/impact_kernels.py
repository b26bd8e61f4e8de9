"""Loops of the impact problem: impulses between bodies that hit each other, with restitution and Coulomb friction.

Contact k has the relative velocity d = J v and the impulse P = N n + T on its first side, the step's own impulse
included. With M the masses and v, P after the step, the velocities v' and impulses P' after the impact obey

    v' = v + M^-1 J^T (P' - P),
    n . d' >= b,  N' >= 0,  one of the two an equality,
    |T'| <= mu N',  T' against the tangential part of d', unless that is zero.

b is -e n . d before the step where that is a hit, else zero [Moreau1988]. Block Gauss-Seidel over the contacts
[JourdanAlartJean1998]; each block of three is solved exactly.
"""

from math import atan2, cos, pi, sin, sqrt

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.contact.contact_set import Contacts
from tripod_sim.contact.response_kernels import relative

HELD = 1e-10
"""Inverse mass along the surface of what does not yield there, over the trace of that of its contact: friction then
takes the direction of the slip."""

NEWTON, SCAN, HALVINGS = 12, 48, 60
"""Iterations for the direction of a slip; directions that are tried if they fail; bisections between two of them."""

EXACT = 1e-13
"""Change of the direction of a slip [rad] at which its iteration ends."""


@njit(cache=True, error_model="numpy")
def normal_speeds(c: Contacts, count: int, among: Array, v: Array, out: Array) -> tuple[float, float]:
    """Write n . J v of each contact [m/s], shape (count,).

    Return the least and the largest of those `among` them, shape (count,), that are under pressure; zero lies between.
    """
    least = most = 0.0
    for k in range(count):
        d = relative(c.base, c.lump, c.moment, c.width, k, v)
        n = c.normal[k]
        out[k] = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
        if among[k] and c.pressure[k] > 0.0:
            least, most = min(least, out[k]), max(most, out[k])
    return least, most


@njit(cache=True, error_model="numpy")
def step_impulses(c: Contacts, count: int, s: float, out: Array) -> None:
    """Write the impulse of each contact in a step of `s` [s], s (p n + f) [N s], shape (count, 3)."""
    for k in range(count):
        for i in range(3):
            out[k, i] = s * (c.pressure[k] * c.normal[k, i] + c.friction[k, i])


@njit(cache=True, error_model="numpy")
def work(c: Contacts, count: int, impulses: Array, before: Array, after: Array) -> float:
    """Return the work of impulses that change the velocities from `before` to `after`, sum of P . J (v + v') / 2 [J].

    It is the change of the kinetic energy, less the work of sides that are moved, whatever acts on them.
    """
    total = 0.0
    for k in range(count):
        a = relative(c.base, c.lump, c.moment, c.width, k, before)
        b = relative(c.base, c.lump, c.moment, c.width, k, after)
        for i in range(3):
            total += 0.5 * impulses[k, i] * (a[i] + b[i])
    return total


@njit(cache=True, error_model="numpy")
def inverse_masses(c: Contacts, count: int, inverse: Array, out: Array) -> None:
    """Write W = J M^-1 J^T of each contact, shape (count, 3, 3).

    `inverse`: M^-1, a block for each three unknowns [1/kg, 1/(kg m²)], shape (unknowns / 3, 3, 3).
    """
    R, RI = np.zeros((3, 3)), np.zeros((3, 3))
    for k in range(count):
        W = out[k]
        W[:] = 0.0
        for m in range(4):
            b = c.base[k, m]
            if b < 0:
                break
            w, A = c.lump[k, m] ** 2, inverse[b // 3]
            for i in range(3):
                for j in range(3):
                    W[i, j] += w * A[i, j]
            if c.width[k, m] != 6:
                continue
            r, A = c.moment[k, m], inverse[b // 3 + 1]
            R[0, 1], R[0, 2] = r[2], -r[1]
            R[1, 0], R[1, 2] = -r[2], r[0]
            R[2, 0], R[2, 1] = r[1], -r[0]
            for i in range(3):
                for j in range(3):
                    RI[i, j] = R[i, 0] * A[0, j] + R[i, 1] * A[1, j] + R[i, 2] * A[2, j]
            for i in range(3):
                for j in range(3):
                    W[i, j] += RI[i, 0] * R[j, 0] + RI[i, 1] * R[j, 1] + RI[i, 2] * R[j, 2]


@njit(cache=True, error_model="numpy")
def _stick(W: Array, d: Array, out: Array) -> None:
    """Write x of W x = d."""
    a00 = W[1, 1] * W[2, 2] - W[1, 2] * W[2, 1]
    a01 = W[1, 2] * W[2, 0] - W[1, 0] * W[2, 2]
    a02 = W[1, 0] * W[2, 1] - W[1, 1] * W[2, 0]
    a11 = W[0, 0] * W[2, 2] - W[0, 2] * W[2, 0]
    a12 = W[0, 1] * W[2, 0] - W[0, 0] * W[2, 1]
    a22 = W[0, 0] * W[1, 1] - W[0, 1] * W[1, 0]
    det = W[0, 0] * a00 + W[0, 1] * a01 + W[0, 2] * a02
    out[0] = (a00 * d[0] + a01 * d[1] + a02 * d[2]) / det
    out[1] = (a01 * d[0] + a11 * d[1] + a12 * d[2]) / det
    out[2] = (a02 * d[0] + a12 * d[1] + a22 * d[2]) / det


@njit(cache=True, error_model="numpy")
def _slip(W: Array, d: Array, mu: float, angle: float) -> tuple[float, float, float, float]:
    """Return how far friction at `angle` is from opposing the slip.

    Args:
        W, d: Of the contact in axes n, t_1, t_2: the inverse mass, and the change of velocity that is sought.
        mu: Coulomb's coefficient.
        angle: Of the friction in the plane of t_1 and t_2.

    Returns:
        The slip across the friction, times D, and its derivative; the slip along the friction, times D, which is
        negative where friction opposes it; and D, the normal velocity per normal impulse of a contact that slips so.
    """
    x, y = cos(angle), sin(angle)
    D, dD = W[0, 0] + mu * (W[0, 1] * x + W[0, 2] * y), mu * (W[0, 2] * x - W[0, 1] * y)
    u = d[0] * (W[0, 1] + mu * (W[1, 1] * x + W[1, 2] * y)) - d[1] * D
    v = d[0] * (W[0, 2] + mu * (W[1, 2] * x + W[2, 2] * y)) - d[2] * D
    du = d[0] * mu * (W[1, 2] * x - W[1, 1] * y) - d[1] * dD
    dv = d[0] * mu * (W[2, 2] * x - W[1, 2] * y) - d[2] * dD
    return v * x - u * y, dv * x - du * y - u * x - v * y, u * x + v * y, D


@njit(cache=True, error_model="numpy")
def _slip_angle(W: Array, d: Array, mu: float, first: float) -> float:
    """Return the angle of a friction that opposes the slip, NaN for none; the arguments are those of `_slip`."""
    angle = first
    for _ in range(NEWTON):
        off, slope, along, D = _slip(W, d, mu, angle)
        if slope == 0.0:
            break
        change = off / slope
        angle -= min(max(change, -0.5), 0.5)
        if abs(change) <= EXACT:
            if along < 0.0 < D:
                return angle
            break
    low, off = first, _slip(W, d, mu, first)[0]
    for k in range(1, SCAN + 1):
        high = first + 2.0 * pi * k / SCAN
        there = _slip(W, d, mu, high)[0]
        if (off < 0.0) != (there < 0.0):
            a, b = low, high
            for _ in range(HALVINGS):
                middle = 0.5 * (a + b)
                if (_slip(W, d, mu, middle)[0] < 0.0) == (off < 0.0):
                    a = middle
                else:
                    b = middle
            _, _, along, D = _slip(W, d, mu, b)
            if along <= 0.0 < D:
                return b
        low, off = high, there
    return np.nan


@njit(cache=True, error_model="numpy")
def _axes(n: Array, Q: Array) -> None:
    """Write n and two unit vectors across it as the rows of Q."""
    least = 0
    for i in range(1, 3):
        if abs(n[i]) < abs(n[least]):
            least = i
    size = sqrt(1.0 - n[least] * n[least])
    i, j = (least + 1) % 3, (least + 2) % 3
    Q[0, 0], Q[0, 1], Q[0, 2] = n[0], n[1], n[2]
    Q[1, least], Q[1, i], Q[1, j] = 0.0, -n[j] / size, n[i] / size
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        Q[2, i] = n[j] * Q[1, k] - n[k] * Q[1, j]


@njit(cache=True, error_model="numpy")
def one_contact(W: Array, n: Array, v: Array, least: float, mu: float, P: Array) -> None:
    """Write the impulse of one contact.

    Args:
        W: Its inverse mass [1/kg], shape (3, 3).
        n: Its normal.
        v: Relative velocity without the impulse [m/s], shape (3,).
        least: Normal velocity b that it leaves at least [m/s].
        mu: Coulomb's coefficient.
        P: [N s], shape (3,), written.
    """
    Q, own, d, x = np.empty((3, 3)), np.zeros((3, 3)), np.empty(3), np.zeros(3)
    _axes(n, Q)
    for i in range(3):
        d[i] = -(Q[i, 0] * v[0] + Q[i, 1] * v[1] + Q[i, 2] * v[2])
    d[0] += least
    if d[0] > 0.0:
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    own[i, j] += Q[i, k] * (W[k, 0] * Q[j, 0] + W[k, 1] * Q[j, 1] + W[k, 2] * Q[j, 2])
        held = HELD * (own[0, 0] + own[1, 1] + own[2, 2])
        own[1, 1], own[2, 2] = own[1, 1] + held, own[2, 2] + held
        _stick(own, d, x)
        size = sqrt(x[1] * x[1] + x[2] * x[2])
        if size > mu * x[0]:
            a = b = 0.0
            if mu > 0.0:
                angle = _slip_angle(own, d, mu, atan2(x[2], x[1]))
                a, b = mu * cos(angle), mu * sin(angle)
            x[0] = d[0] / (own[0, 0] + own[0, 1] * a + own[0, 2] * b)
            x[1], x[2] = a * x[0], b * x[0]
    for i in range(3):
        P[i] = Q[0, i] * x[0] + Q[1, i] * x[1] + Q[2, i] * x[2]


@njit(cache=True, error_model="numpy")
def solve_impact(
    c: Contacts, count: int, active: Array, W: Array, inverse: Array, least: Array, mu: float, most: int, aim: float,
    v: Array, impulses: Array,
) -> float:  # fmt: skip
    """Change the impulses and the velocities to those after the impact.

    Args:
        c, count: Contacts.
        active: Which of them take part, shape (count,).
        W, inverse: See `inverse_masses`.
        least: b of each contact [m/s], shape (count,).
        mu: Coulomb's coefficient.
        most: Rounds.
        aim: Change of a relative velocity within a round at which the rounds end [m/s].
        v: Velocities of the unknowns [m/s, rad/s], those after the step; changed.
        impulses: P [N s], shape (count, 3), those of the step; changed.

    Returns:
        The largest change of a relative velocity in the last round [m/s].
    """
    P, free = np.empty(3), np.empty(3)
    change = 0.0
    for _ in range(most):
        change = 0.0
        for k in range(count):
            if not active[k]:
                continue
            own, old = W[k], impulses[k]
            d = relative(c.base, c.lump, c.moment, c.width, k, v)
            for i in range(3):
                free[i] = d[i] - own[i, 0] * old[0] - own[i, 1] * old[1] - own[i, 2] * old[2]
            one_contact(own, c.normal[k], free, least[k], mu, P)
            for i in range(3):
                P[i] -= old[i]
                old[i] += P[i]
            for i in range(3):
                change = max(change, abs(own[i, 0] * P[0] + own[i, 1] * P[1] + own[i, 2] * P[2]))
            _push(c, k, inverse, P, v)
        if change <= aim:
            break
    return change


@njit(cache=True, error_model="numpy")
def _push(c: Contacts, k: int, inverse: Array, P: Array, v: Array) -> None:
    """Add M^-1 J^T P of contact k to the velocities."""
    for m in range(4):
        b = c.base[k, m]
        if b < 0:
            break
        w, A = c.lump[k, m], inverse[b // 3]
        for i in range(3):
            v[b + i] += w * (A[i, 0] * P[0] + A[i, 1] * P[1] + A[i, 2] * P[2])
        if c.width[k, m] == 6:
            r, A = c.moment[k, m], inverse[b // 3 + 1]
            x, y, z = r[1] * P[2] - r[2] * P[1], r[2] * P[0] - r[0] * P[2], r[0] * P[1] - r[1] * P[0]
            for i in range(3):
                v[b + 3 + i] += A[i, 0] * x + A[i, 1] * y + A[i, 2] * z
