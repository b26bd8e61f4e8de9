"""Motion of rigid bodies made of mass points: momentum, angular momentum about the mass centre, rotations.

With C the mass centre, R the rotation, V the velocity of C and w the spin, the points stand at x_i = C + R a_i and move
with v_i = V + w x (x_i - C). The spin follows from the angular momentum S about C,

    w = R J^-1 R^T S,   J = sum_i m_i (|a_i|² - a_i a_i^T),   dS/dt = sum_i (x_i - C) x f_i,   dR/dt = [w]x R,

so gyroscopic terms need no formula of their own: where there is no moment S is constant [HairerLubichWanner2006,
chapter VII.5].
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put
from tripod_sim.rotation_kernels import carried, cross, turned


class Bodies(NamedTuple):
    """All rigid bodies of a system, b of them; what changes in time is written in place.

    members (k,): nodes of the bodies; owner (k,): whose; arm (k, 3): a_i [m]; mass (b,) [kg]; inverse (b, 3, 3): J^-1
    [1/(kg m²)]; centre (b, 3): C [m]; turn (b, 3, 3): R; velocity (b, 3): V [m/s]; spin (b, 3): w [rad/s]; angular
    (b, 3): S [kg m²/s]; force (b, 3) [N] and moment (b, 3) [N m]: of the last `add_up`.
    """

    members: Array
    owner: Array
    arm: Array
    mass: Array
    inverse: Array
    centre: Array
    turn: Array
    velocity: Array
    spin: Array
    angular: Array
    force: Array
    moment: Array


@njit(cache=True, error_model="numpy")
def read_bodies(x: Array, v: Array, mass: Array, bodies: Bodies) -> None:
    """Write V, S and w of the bodies from the velocities `v` (n, 3) of their nodes at `x`, whose `mass` is given (n,).

    Velocities that are not rigid are replaced by those of the same momentum and angular momentum.
    """
    bodies.velocity[:] = 0.0
    bodies.angular[:] = 0.0
    part = np.empty(3)
    for k in range(bodies.members.shape[0]):
        n, b = bodies.members[k], bodies.owner[k]
        cross(x[n] - bodies.centre[b], v[n], part)
        for i in range(3):
            bodies.velocity[b, i] += mass[n] / bodies.mass[b] * v[n, i]
            bodies.angular[b, i] += mass[n] * part[i]
    for b in range(bodies.mass.shape[0]):
        carried(bodies.turn[b], bodies.inverse[b], bodies.angular[b], bodies.spin[b])


@njit(cache=True, error_model="numpy")
def carry(bodies: Bodies, x: Array, v: Array) -> None:
    """Write positions and velocities (n, 3) of the bodies' nodes from C, R, V and w."""
    for k in range(bodies.members.shape[0]):
        n, b, a = bodies.members[k], bodies.owner[k], bodies.arm[k]
        R, w = bodies.turn[b], bodies.spin[b]
        r0 = R[0, 0] * a[0] + R[0, 1] * a[1] + R[0, 2] * a[2]
        r1 = R[1, 0] * a[0] + R[1, 1] * a[1] + R[1, 2] * a[2]
        r2 = R[2, 0] * a[0] + R[2, 1] * a[1] + R[2, 2] * a[2]
        x[n, 0], x[n, 1], x[n, 2] = (
            bodies.centre[b, 0] + r0,
            bodies.centre[b, 1] + r1,
            bodies.centre[b, 2] + r2,
        )
        v[n, 0] = bodies.velocity[b, 0] + w[1] * r2 - w[2] * r1
        v[n, 1] = bodies.velocity[b, 1] + w[2] * r0 - w[0] * r2
        v[n, 2] = bodies.velocity[b, 2] + w[0] * r1 - w[1] * r0


@njit(cache=True, error_model="numpy")
def add_up(g: Array, x: Array, bodies: Bodies) -> None:
    """Write force and moment about C of the nodal forces -g (n, 3)."""
    bodies.force[:] = 0.0
    bodies.moment[:] = 0.0
    for k in range(bodies.members.shape[0]):
        n, b = bodies.members[k], bodies.owner[k]
        r0, r1, r2 = (
            x[n, 0] - bodies.centre[b, 0],
            x[n, 1] - bodies.centre[b, 1],
            x[n, 2] - bodies.centre[b, 2],
        )
        bodies.force[b, 0] -= g[n, 0]
        bodies.force[b, 1] -= g[n, 1]
        bodies.force[b, 2] -= g[n, 2]
        bodies.moment[b, 0] -= r1 * g[n, 2] - r2 * g[n, 1]
        bodies.moment[b, 1] -= r2 * g[n, 0] - r0 * g[n, 2]
        bodies.moment[b, 2] -= r0 * g[n, 1] - r1 * g[n, 0]


@njit(cache=True, error_model="numpy")
def drift(bodies: Bodies, h: float) -> None:
    """Move the bodies freely for `h` [s]: C' = C + h V, R' = exp(h w) R with w at half the way, S and V constant."""
    middle, way = np.empty((3, 3)), np.empty(3)
    for b in range(bodies.mass.shape[0]):
        for i in range(3):
            bodies.centre[b, i] += h * bodies.velocity[b, i]
        R, S, inverse = bodies.turn[b], bodies.angular[b], bodies.inverse[b]
        carried(R, inverse, S, way)
        for i in range(3):
            way[i] *= 0.5 * h
        turned(way, R, middle)
        carried(middle, inverse, S, way)
        for i in range(3):
            way[i] *= h
        turned(way, R, middle)
        put(R, middle)
        carried(R, inverse, S, bodies.spin[b])
