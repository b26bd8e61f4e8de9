"""Impulses between a sphere and what it touches: unilateral contact, Coulomb friction, rolling resistance.

With m and I = 2/5 m r² of the sphere, contact i at -r n_i from its centre, and the surface there at speed s_i, the
relative speed is u_i = v + w x (-r n_i) - s_i. Impulses P_i = N_i n_i + T_i and Q_i change the motion by

    m dv = sum P_i + m g dt,   I dw = sum (-r n_i) x P_i + Q_i,

so that  u_i . n_i >= b_i, N_i >= 0, one of the two an equality;  |T_i| <= mu N_i, T_i opposite to the slip unless
there is none;  |Q_i| <= c r N_i, opposite to the rotation relative to the surface unless there is none. Solved by
projected Gauss-Seidel [JourdanAlartJean1998]; a single contact is exact at once, as normal and tangent do not couple.
"""

from math import sqrt

from numba import njit

from tripod_host.arrays import Array

MOST_SWEEPS = 200


@njit(cache=True, error_model="numpy")
def solve_contacts(
    count: int,
    v: Array,
    w: Array,
    normals: Array,
    directions: Array,
    speeds: Array,
    spin: Array,
    bounds: Array,
    mass: float,
    radius: float,
    friction: float,
    rolling: float,
    impulses: Array,
    couples: Array,
) -> None:
    """Change `v` and `w` by the impulses of `count` contacts, and write the impulses.

    Args:
        count: Contacts.
        v, w: Velocity [m/s] and angular velocity [rad/s] without the impulses; with them on return.
        normals: n_i from the surface to the sphere, shape (>= count, 3).
        directions: Those along which the impulses act: n_i in an impact; in a motion over a time, in which the surface
            turns, the normals halfway, so that the result is of second order in it.
        speeds: s_i [m/s], shape (>= count, 3).
        spin: Angular velocity of the surfaces [rad/s], shape (3,).
        bounds: b_i, the least normal speed afterwards [m/s], shape (>= count,).
        mass, radius: Of the sphere [kg], [m].
        friction: mu.
        rolling: c.
        impulses: P_i on the sphere [N s], shape (>= count, 3), written.
        couples: Q_i [N m s], shape (>= count, 3), written.
    """
    inertia = 0.4 * mass * radius * radius
    for i in range(count):
        for a in range(3):
            impulses[i, a] = 0.0
            couples[i, a] = 0.0
    for _ in range(MOST_SWEEPS):
        change = 0.0
        for i in range(count):
            n, e, P, Q = normals[i], directions[i], impulses[i], couples[i]
            u0 = v[0] - radius * (w[1] * n[2] - w[2] * n[1]) - speeds[i, 0]
            u1 = v[1] - radius * (w[2] * n[0] - w[0] * n[2]) - speeds[i, 1]
            u2 = v[2] - radius * (w[0] * n[1] - w[1] * n[0]) - speeds[i, 2]
            un = u0 * n[0] + u1 * n[1] + u2 * n[2]
            before = P[0] * e[0] + P[1] * e[1] + P[2] * e[2]
            after = max(0.0, before + mass * (bounds[i] - un))
            # the tangential part: what stops the slip, within the cone
            k = 2.0 / 7.0 * mass
            t0 = P[0] - before * e[0] - k * (u0 - un * n[0])
            t1 = P[1] - before * e[1] - k * (u1 - un * n[1])
            t2 = P[2] - before * e[2] - k * (u2 - un * n[2])
            size = sqrt(t0 * t0 + t1 * t1 + t2 * t2)
            scale = friction * after / size if size > friction * after else 1.0
            p0, p1, p2 = after * e[0] + scale * t0, after * e[1] + scale * t1, after * e[2] + scale * t2
            d0, d1, d2 = p0 - P[0], p1 - P[1], p2 - P[2]
            P[0], P[1], P[2] = p0, p1, p2
            v[0] += d0 / mass
            v[1] += d1 / mass
            v[2] += d2 / mass
            w[0] -= radius * (e[1] * d2 - e[2] * d1) / inertia
            w[1] -= radius * (e[2] * d0 - e[0] * d2) / inertia
            w[2] -= radius * (e[0] * d1 - e[1] * d0) / inertia
            change = max(change, abs(d0) + abs(d1) + abs(d2))
            if rolling > 0.0:
                c0 = Q[0] - inertia * (w[0] - spin[0])
                c1 = Q[1] - inertia * (w[1] - spin[1])
                c2 = Q[2] - inertia * (w[2] - spin[2])
                size = sqrt(c0 * c0 + c1 * c1 + c2 * c2)
                most = rolling * radius * after
                scale = most / size if size > most else 1.0
                d0, d1, d2 = scale * c0 - Q[0], scale * c1 - Q[1], scale * c2 - Q[2]
                Q[0], Q[1], Q[2] = Q[0] + d0, Q[1] + d1, Q[2] + d2
                w[0] += d0 / inertia
                w[1] += d1 / inertia
                w[2] += d2 / inertia
                change = max(change, (abs(d0) + abs(d1) + abs(d2)) / radius)
        if change <= 1e-13 * mass:  # of the speed: 1e-13 m/s
            return
