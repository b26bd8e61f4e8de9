"""The longest stable step of the explicit schemes, and the largest frequency by power iteration."""

from collections.abc import Callable

import numpy as np

from tripod_host.arrays import FloatArray

EXPLICIT_EULER, SEMI_IMPLICIT_EULER, RK4 = 0, 1, 2
SCHEMES = {"explicit_euler": EXPLICIT_EULER, "semi_implicit_euler": SEMI_IMPLICIT_EULER, "rk4": RK4}
"""The explicit schemes, as compiled loops know them."""

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


def longest_step(scheme: str, omega: float, rate: float) -> float:
    """Return the longest stable step of a scheme [s]; infinite where there is no force.

    For a mode x'' = -w² x - d x' the limits are

        semi-implicit Euler  (sqrt(d² + 4 w²) - d) / w²   (2 / w without damping),
        RK4                  2.6 / max(w, d)              (2.83 / w without damping),
        explicit Euler       d / w², 2 / d if that is less (0 without damping: it is never stable then).

    Args:
        scheme: A name of `SCHEMES`.
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


def remedy(limit: float, *, divides: bool) -> str:
    """Return what to do where an explicit scheme of the stability `limit` [s] failed, its steps divided or not."""
    if limit == 0.0:
        return (
            "explicit Euler is unstable at every dt without damping: add [damping], or set "
            "inertia.scheme to semi_implicit_euler, rk4 or an implicit scheme"
        )
    return ("" if divides else "substeps = 'auto' divides the step, ") + "an implicit scheme needs no limit"


def longest_part(scheme: str, omega: float, rate: float) -> float:
    """Return the length of the parts into which a step is divided [s].

    Explicit Euler, which has no stable step without damping, is divided like the semi-implicit scheme; it grows all the
    same, and that is reported.
    """
    limit = longest_step(scheme, omega, rate)
    return SHARE * (
        max(limit, longest_step("semi_implicit_euler", omega, rate)) if scheme == "explicit_euler" else limit
    )
