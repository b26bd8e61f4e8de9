"""How a few unknowns of a body answer, alone and where something holds it: nothing is factored again."""

from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray

REDUNDANT = 1e-10
"""Share of the largest eigenvalue of D, its rows of one size, up to which other rows hold a combination already."""

SMALLEST = 1e-4
"""Size of a row of D, as a share of the largest, below which it is not scaled up."""


@dataclass(frozen=True, eq=False)
class Holding:
    """What holds the body at some of its unknowns x, at its driven angles q and by further unknowns y.

    Its energy is z^T Z z / 2 + r . y with z = (x, q, y), under the conditions C z = 0.

    Attributes:
        unknowns: Numbers of x, ascending, shape (u,).
        stiffness: Z, symmetric, shape (u + s + b, u + s + b).
        rows: C, independent, shape (m, u + s + b).
        unbalanced: r [N, N m], shape (b,).
        scale: Size of a unit of y [m, m/rad], shape (b,).
    """

    unknowns: IndexArray
    stiffness: FloatArray
    rows: FloatArray
    unbalanced: FloatArray
    scale: FloatArray


@dataclass(frozen=True, eq=False)
class Response:
    """How some unknowns x of the body and the servos' torques answer: x = F f + J q + d, dtau = S q - J^T f.

    Attributes:
        flexibility: F [m/N, ...], shape (z, z).
        jacobian: J [m/rad, rad/rad], shape (z, s).
        stiffness: S [N m/rad], shape (s, s).
        fall: d, to the equilibrium [m, rad], shape (z,).
    """

    flexibility: FloatArray
    jacobian: FloatArray
    stiffness: FloatArray
    fall: FloatArray


def held_response(free: Response, holding: Holding, where: IndexArray) -> Response:
    """Return how a body answers that `holding` holds.

    With Z = [Z_xx, Z_xq, Z_xy; ...] and M = (I + F Z_xx)^-1, its stiffness makes of F, J, d and S

        M F,   M J - M F Z_xq,   M d,   S + J^T (Z_xx J' + Z_xq) + Z_qx J' + Z_qq,   J' = M J - M F Z_xq.

    Then y and the multipliers of C are forces n with rows G: with N = [Z_yy, C_y^T; C_y, 0], D = G_x F G_x^T - N,
    D^+ its pseudo-inverse and B = G_q + G_x J,

        F loses F G_x^T D^+ G_x F,   J loses F G_x^T D^+ B,   d loses F G_x^T D^+ (G_x d + r),   S gains B^T D^+ B.

    Args:
        free: Response of the body by itself, to forces on z of its unknowns.
        holding: What holds it.
        where: Places of its x among these z, shape (u,).

    Raises:
        LinAlgError: I + F Z_xx is singular.
    """
    z, s = free.jacobian.shape
    b, m = len(holding.unbalanced), len(holding.rows)
    whole, rows = np.zeros((z + s + b, z + s + b)), np.zeros((m, z + s + b))
    at = np.concatenate([where, np.arange(z, z + s + b)])
    whole[at[:, None], at], rows[:, at] = holding.stiffness, holding.rows
    x, q, y = slice(z), slice(z, z + s), slice(z + s, None)
    right = np.concatenate([free.flexibility, free.jacobian, free.fall[:, None]], axis=1)
    solved = np.linalg.solve(np.eye(z) + free.flexibility @ whole[x, x], right)
    F, fall = solved[:, :z], solved[:, -1]
    J = solved[:, z:-1] - F @ whole[x, q]
    S = free.stiffness + free.jacobian.T @ (whole[x, x] @ J + whole[x, q]) + whole[q, x] @ J + whole[q, q]
    if not b + m:
        return Response(F, J, S, fall)
    G, N = np.concatenate([whole[y], rows]), np.zeros((b + m, b + m))
    N[:b, :b], N[:b, b:], N[b:, :b] = whole[y, y], rows[:, y].T, rows[:, y]
    push, missing = F @ G[:, x].T, np.concatenate([holding.unbalanced, np.zeros(m)])
    own = G[:, x] @ push
    size = np.sqrt(np.abs(np.diag(own)))
    largest = size[b:].max(initial=0.0) or 1.0
    size = np.maximum(size, SMALLEST * largest)
    size[:b] = holding.scale / largest
    answer = _pseudo_inverse(0.5 * (own + own.T) - N, size)
    push, B = push @ answer, G[:, q] + G[:, x] @ J
    return Response(
        F - push @ (G[:, x] @ F), J - push @ B, S + B.T @ answer @ B, fall - push @ (G[:, x] @ fall + missing)
    )


def _pseudo_inverse(d: FloatArray, size: FloatArray) -> FloatArray:
    """Return the pseudo-inverse of `d`, symmetric, shape (k, k), whose rows have the given sizes."""
    values, vectors = np.linalg.eigh(d / np.outer(size, size))
    new = np.abs(values) > REDUNDANT * np.abs(values).max(initial=0.0)
    vectors = vectors[:, new] / size[:, None]
    return np.asarray((vectors / values[new]) @ vectors.T)
