"""The largest frequency of a spring body and the longest stable step of the explicit schemes.

In every configuration a spring's tangent is below k times the identity (stretched, its transverse part is
k (1 - L / l)), so the body's is below that of the network of the k alone. The largest eigenvalue of M^-1 times that
network, one unknown a node, bounds the square of every frequency that the motion can ever meet: it is found once.
"""

from typing import Any

import numpy as np
from scipy import sparse

from tripod_sim.springs.body import FloatArray, SpringBody

ITERATIONS = 2000
CHANGE = 1e-7
"""Relative change of the estimate at which the power iteration ends."""


def largest_eigenvalue(product: Any, size: int) -> float:
    """Return the largest eigenvalue of a symmetric positive semi-definite matrix by power iteration.

    Args:
        product: Called with a vector, shape (size,), it returns the matrix times it.
        size: Of the matrix.
    """
    p = np.random.default_rng(0).standard_normal(size)
    p /= np.linalg.norm(p)
    value = 0.0
    for _ in range(ITERATIONS):
        q = product(p)
        norm = float(np.linalg.norm(q))
        if not 0.0 < norm < np.inf:
            return norm
        before, value = value, float(p @ q)
        p = q / norm
        if abs(value - before) <= CHANGE * value:
            break
    return value


def network_bound(body: SpringBody, weights: FloatArray) -> float:
    """Return the largest eigenvalue of M^-1 L, L the network of springs with `weights` [N/m] or [N s/m], (m,).

    Gershgorin's circles bound it from above, the power iteration estimates it from below, to about one percent.
    """
    n = len(body.nodes)
    root = np.zeros(n)
    root[body.free] = 1 / np.sqrt(body.mass[body.free])
    i, j = body.ends.T
    off = sparse.coo_matrix((-weights * root[i] * root[j], (i, j)), shape=(n, n))
    degree = (
        np.bincount(i, weights=weights, minlength=n) + np.bincount(j, weights=weights, minlength=n)
    ) * root**2
    matrix = (off + off.T + sparse.diags(degree)).tocsr()
    circles = float(np.asarray(abs(matrix).sum(axis=1)).max(initial=0.0))
    return min(circles, 1.01 * largest_eigenvalue(lambda p: matrix @ p, n))


def longest_step(scheme: str, omega: float, rate: float) -> float:
    """Return the longest stable step of a scheme [s]; infinite where there is no force.

    For a mode x'' = -w² x - d x' the limits are

        semi-implicit Euler  (sqrt(d² + 4 w²) - d) / w²   (2 / w without damping),
        RK4                  2.6 / max(w, d)              (2.83 / w without damping),
        explicit Euler       d / w², 2 / d if that is less (0 without damping: it is never stable then).

    Args:
        scheme: `explicit_euler`, `semi_implicit_euler` or `rk4`.
        omega: Largest w [rad/s].
        rate: Largest d [1/s].
    """
    if omega == 0.0:
        return 2.0 / rate if rate > 0.0 else np.inf
    if scheme == "rk4":
        return 2.6 / max(omega, rate)
    if scheme == "explicit_euler":
        return min(rate / omega**2, 2.0 / rate) if rate > 0.0 else 0.0
    return float(4.0 / (np.sqrt(rate**2 + 4 * omega**2) + rate))
