"""Loops over the rigid groups of a solid in contact: what fits a field best, and gradients per rotation vector."""

import math

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.rotation_kernels import carried, cross


@njit(cache=True, error_model="numpy")
def fit(
    field: Array, positions: Array, free: Array, members: Array, first: Array, centres: Array, rotations: Array,
    spreads: Array, out: Array,
) -> None:  # fmt: skip
    """Write the unknowns' share of a linear field on the nodes of a solid in its present pose.

    Free nodes move with the field; a rigid group with its mean and the spin that fits best,
    w = S sum_i (r_i - r) x (v_i - v), S = (sum_i |a_i|² - a_i a_i^T)^-1 turned into world.

    Args:
        field, positions: Shape (n, 3).
        free: Nodes, shape (f,).
        members: Nodes of rigid groups, one group after the other, shape (k,).
        first: First of each group among them, and behind the last one, shape (b + 1,).
        centres, rotations: Of the groups, shapes (b, 3), (b, 3, 3).
        spreads: S in the groups' frames, shape (b, 3, 3).
        out: Shape (3 f + 6 b,).
    """
    for k in range(len(free)):
        for i in range(3):
            out[3 * k + i] = field[free[k], i]
    arm, mean, moment, part, turning = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for b in range(len(spreads)):
        nodes = members[first[b] : first[b + 1]]
        arm[:], mean[:], moment[:] = 0.0, 0.0, 0.0
        for n in nodes:
            arm += positions[n]
            mean += field[n]
        arm /= len(nodes)
        mean /= len(nodes)
        for n in nodes:
            cross(positions[n] - arm, field[n] - mean, part)
            moment += part
        carried(rotations[b], spreads[b], moment, turning)
        cross(turning, arm - centres[b], part)
        k = 3 * len(free) + 6 * b
        for i in range(3):
            out[k + i], out[k + 3 + i] = mean[i] - part[i], turning[i]


@njit(cache=True, error_model="numpy")
def add_residual(residual: Array, first: int, u: Array, out: Array) -> None:
    """Add a gradient per small turn to that per rotation vector, of rigid groups whose unknowns begin at `first`.

    exp(theta + d) is exp(J d) exp(theta) to first order in d, J = 1 + a [theta]x + b [theta]x², with
    a = (1 - cos t) / t², b = (t - sin t) / t³, t = |theta|; so a moment m per small turn counts as J^T m.

    Args:
        residual: Per moves of free nodes, and of rigid groups and their small turns, shape (q,).
        first: Three times the number of free nodes.
        u: Moves and rotation vectors, of which the first q are these, shape (n,).
        out: Shape (n,).
    """
    for k in range(first):
        out[k] += residual[k]
    once, twice = np.empty(3), np.empty(3)
    for k in range(first, len(residual), 6):
        theta, moment = u[k + 3 : k + 6], residual[k + 3 : k + 6]
        t2 = theta[0] ** 2 + theta[1] ** 2 + theta[2] ** 2
        if t2 < 1e-8:
            a, b = 0.5 - t2 / 24, 1 / 6 - t2 / 120
        else:
            t = math.sqrt(t2)
            a, b = (1 - math.cos(t)) / t2, (t - math.sin(t)) / (t2 * t)
        cross(theta, moment, once)
        cross(theta, once, twice)
        for i in range(3):
            out[k + i] += residual[k + i]
            out[k + 3 + i] += moment[i] - a * once[i] + b * twice[i]
