"""Loops over rigid bodies in contact: where a stage brings them, its gradient, their vertices."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.rotation_kernels import carried, turned


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
    way: Array, s: float, spin: Array, angular: Array, inverse: Array, rotation: Array, most: int, same: float,
    turn: Array, there: Array,
) -> None:  # fmt: skip
    """Write t = w + s R I^-1 R^T L with R = exp([t]x) R_0 of each body to `turn`, and R to `there`.

    Args:
        way: w [rad], shape (b, 3).
        s: [s].
        spin: With which it begins [rad/s], shape (b, 3).
        angular: L [kg m²/s], shape (b, 3).
        inverse: I^-1 in the bodies' frames, shape (b, 3, 3).
        rotation: R_0, shape (b, 3, 3).
        most: Iterations.
        same: Change of t, as a share of it, at which they end.
        turn: Shape (b, 3).
        there: Shape (b, 3, 3).
    """
    w = np.empty(3)
    for k in range(len(rotation)):
        for i in range(3):
            turn[k, i] = way[k, i] + s * spin[k, i]
        found = False
        for _ in range(most):
            turned(turn[k], rotation[k], there[k])
            carried(there[k], inverse[k], angular[k], w)
            change = largest = 0.0
            for i in range(3):
                new = way[k, i] + s * w[i]
                change, largest = max(change, abs(new - turn[k, i])), max(largest, abs(new))
                turn[k, i] = new
            if change <= same * largest:  # at once where all axes are alike
                found = True
                break
        if not found:  # many radians in a step: R where the body ends, so that L stays
            turned(turn[k], rotation[k], there[k])


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
def moved(u: Array, centre: Array, rotation: Array, centres: Array, rotations: Array) -> None:
    """Write the centres (b, 3) and rotations (b, 3, 3) after the moves `u`, shape (6 b,)."""
    for k in range(len(centre)):
        for i in range(3):
            centres[k, i] = centre[k, i] + u[6 * k + i]
        turned(u[6 * k + 3 : 6 * k + 6], rotation[k], rotations[k])


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
