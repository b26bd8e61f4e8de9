"""Stable steps of the explicit schemes, and the largest frequency by power iteration."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray

if TYPE_CHECKING:
    from tripod_sim.integrators.scheme import ExplicitScheme

CHANGE = 1e-7
"""Relative change of the estimate at which the power iteration ends."""

SHARE = 0.5
"""Of the stability limit that a part of a divided step takes: nearer to it the fastest modes are stable and wrong."""


def largest_eigenvalue(
    product: Callable[[FloatArray], FloatArray], start: FloatArray, iterations: int
) -> tuple[float, FloatArray]:
    """Return an estimate from below of the largest eigenvalue of a symmetric matrix, and its unit vector.

    Args:
        product: Returns the matrix times a vector.
        start: Where the power iteration begins, not zero.
        iterations: At most so many products.
    """
    p = start / np.linalg.norm(start)
    value = 0.0
    for _ in range(iterations):
        q = product(p)
        norm = float(np.linalg.norm(q))
        if not 0.0 < norm < np.inf:
            return norm, p
        before, value = value, float(np.vdot(p, q))
        p = q / norm
        if abs(value - before) <= CHANGE * abs(value):
            break
    return value, p


def remedy(limit: float, *, divides: bool) -> str:
    """Return what to do where an explicit scheme of the stability `limit` [s] failed, its steps divided or not."""
    if limit == 0.0:
        return (
            "this scheme is unstable at every dt without damping: add [damping], or set "
            "inertia.scheme to semi_implicit_euler, rk4 or an implicit scheme"
        )
    return ("" if divides else "substeps = 'auto' divides the step, ") + "an implicit scheme needs no limit"


def longest_part(scheme: "ExplicitScheme", omega: float, rate: float) -> float:
    """Return the length of the parts into which a step is divided [s]; arguments as of its `longest_step`."""
    return SHARE * scheme.divisor(omega, rate)
