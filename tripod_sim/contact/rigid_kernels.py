"""Loops over rigid bodies in contact: where a stage brings them, its gradient, their vertices."""

from math import atan2, pi, sqrt

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put
from tripod_sim.rotation_kernels import carried, cross, rotation_rate, turned
from tripod_sim.rotation_kernels import turn as turn_quaternion

MOST_ROUNDS, MOST_PARTS, SAME = 20, 4096, 1e-13
"""Of Newton's method for a turn, and parts of it, at most; error of the turn at which it is found, as a share of the
largest that the angular momentum could give."""


@njit(cache=True, error_model="numpy")
def carry(tensors: Array, rotation: Array, vectors: Array, out: Array) -> None:
    """Write R T R^T v of each body: T in its frame, R its `rotation`, both (b, 3, 3); v and `out` in world, (b, 3)."""
    for k in range(len(rotation)):
        carried(rotation[k], tensors[k], vectors[k], out[k])


@njit(cache=True, error_model="numpy")
def tensors_in_world(tensors: Array, rotation: Array, out: Array) -> None:
    """Write R T R^T of each body, shape (b, 3, 3)."""
    unit, column = np.zeros(3), np.empty(3)
    for k in range(len(rotation)):
        for j in range(3):
            unit[:] = 0.0
            unit[j] = 1.0
            carried(rotation[k], tensors[k], unit, column)
            for i in range(3):
                out[k, i, j] = column[i]


@njit(cache=True, error_model="numpy")
def turn_freely(
    way: Array, s: float, spin: Array, angular: Array, inverse: Array, rotation: Array, turn: Array, there: Array
) -> None:  # fmt: skip
    """Write t = w + s R I^-1 R^T L with R = exp([t]x) R_0 of each body to `turn`, and R to `there`.

    With w = 0 a body keeps L and gains no energy, however long s is: the spin v = R I^-1 R^T L turns about itself, so
    that V = R^T v and its value V_0 before obey V . I V = V . I V_0. Where Newton's method does not find t, w and parts
    of s are taken one after the other.

    Args:
        way: w [rad], shape (b, 3).
        s: [s].
        spin: With which it begins [rad/s], shape (b, 3).
        angular: L [kg m²/s], shape (b, 3).
        inverse: I^-1 in the bodies' frames, shape (b, 3, 3).
        rotation: R_0, shape (b, 3, 3).
        turn: Shape (b, 3).
        there: Shape (b, 3, 3).
    """
    for k in range(len(rotation)):
        of = angular[k], inverse[k], rotation[k]
        for i in range(3):
            turn[k, i] = way[k, i] + s * spin[k, i]
        parts, found = 1, find_turn(way[k], s, *of, turn[k], there[k])
        while not found and parts < MOST_PARTS:
            parts *= 2
            found = turn_in_parts(way[k], s, parts, *of, turn[k], there[k])


@njit(cache=True, error_model="numpy")
def find_turn(
    way: Array, s: float, angular: Array, inverse: Array, rotation: Array, t: Array, there: Array
) -> bool:
    """Improve t of one body as in `turn_freely` by Newton's method; write R; return whether t is found.

    A turn by p from R changes t by J^-1 p, J the derivative of exp([t]x), and v by p x v - R I^-1 R^T (p x L).
    """
    v, change, by, unit, p, off = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    M, before = np.empty((3, 3)), np.inf  # a row for each p of length 1
    noise = SAME * s * sqrt((angular**2).sum() * (inverse**2).sum())
    for _ in range(MOST_ROUNDS):
        turned(t, rotation, there)
        carried(there, inverse, angular, v)
        size = 0.0
        for i in range(3):
            off[i] = way[i] + s * v[i] - t[i]
            size = max(size, abs(off[i]))
        if size <= noise:
            return True
        if not size < before:
            return False
        before = size
        for j in range(3):
            unit[:] = 0.0
            unit[j] = 1.0
            rotation_rate(t, unit, M[j])
            cross(unit, angular, by)
            carried(there, inverse, by, change)
            cross(unit, v, by)
            for i in range(3):
                M[j, i] -= s * (by[i] - change[i])
        for j in range(3):  # by Cramer's rule
            cross(M[(j + 1) % 3], M[(j + 2) % 3], by)
            det = M[j, 0] * by[0] + M[j, 1] * by[1] + M[j, 2] * by[2]
            if det == 0.0:
                return False
            p[j] = (off[0] * by[0] + off[1] * by[1] + off[2] * by[2]) / det
        rotation_rate(t, p, change)
        for i in range(3):
            t[i] += change[i]
    turned(t, rotation, there)
    return False


@njit(cache=True, error_model="numpy")
def turn_in_parts(
    way: Array, s: float, parts: int, angular: Array, inverse: Array, rotation: Array, t: Array, there: Array
) -> bool:
    """Write t and R of one body after the turn by w and `parts` of s; return whether each was found."""
    at, total, none, of = np.empty((3, 3)), way.copy(), np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
    found = True
    turned(way, rotation, there)
    turn_quaternion(of, way, 1.0)
    for _ in range(parts):
        put(at, there)
        carried(at, inverse, angular, t)
        for i in range(3):
            t[i] *= s / parts
        found = found and find_turn(none, s / parts, angular, inverse, at, t, there)
        turn_quaternion(of, t, 1.0)
        for i in range(3):
            total[i] += t[i]
    half = sqrt(of[0] ** 2 + of[1] ** 2 + of[2] ** 2)
    angle, along = 2 * atan2(half, of[3]), 0.0
    for i in range(3):
        t[i] = of[i] / half if half else 0.0
        along += total[i] * t[i]
    angle += 2 * pi * round((along - angle) / (2 * pi))  # of all t to this R the one nearest to the sum
    for i in range(3):
        t[i] *= angle
    return found


@njit(cache=True, error_model="numpy")
def add_inertia(u: Array, aim: Array, mass: Array, tensors: Array, square: float, out: Array) -> float:
    """Add the gradient of m |u_c - a_c|² / (2 q) + |u_r - a_r|²_I / (2 q), q = `square`, to `out`; return the sum [J].

    Args:
        u: Moves, shape (6 b,).
        aim: a, shape (b, 6).
        mass: Shape (b,).
        tensors: I in world, shape (b, 3, 3).
        square: s s_f of the stage [s²].
        out: Shape (6 b,).
    """
    phi = 0.0
    for k in range(len(mass)):
        for i in range(3):
            off = u[6 * k + i] - aim[k, i]
            force = mass[k] * off / square
            moment = 0.0
            for j in range(3):
                moment += tensors[k, i, j] * (u[6 * k + 3 + j] - aim[k, 3 + j])
            moment /= square
            phi += 0.5 * (off * force + (u[6 * k + 3 + i] - aim[k, 3 + i]) * moment)
            out[6 * k + i] += force
            out[6 * k + 3 + i] += moment
    return phi


@njit(cache=True, error_model="numpy")
def vertices(
    first: Array, shape: Array, centre: Array, rotation: Array, arm: Array, positions: Array
) -> None:
    """Write what turns and moves with rigid bodies: arms from their centres and positions [m].

    Args:
        first: First vertex of each body, and behind the last one, shape (b + 1,).
        shape: Vertices in the bodies' frames, about the centre, shape (n, 3).
        centre, rotation: Of the bodies, shapes (b, 3), (b, 3, 3).
        arm, positions: Shape (n, 3).
    """
    for k in range(len(centre)):
        for p in range(first[k], first[k + 1]):
            for i in range(3):
                a = 0.0
                for j in range(3):
                    a += rotation[k, i, j] * shape[p, j]
                arm[p, i] = a
                positions[p, i] = centre[k, i] + a
