"""Elastic constants from Young's modulus and Poisson's ratio."""

from tripod_sim.errors import SceneError


def lame_constants(young: float, poisson: float) -> tuple[float, float]:
    """Return (lambda, mu) [Pa] = (E nu / ((1 + nu)(1 - 2 nu)), E / (2 (1 + nu))).

    Args:
        young: E [Pa], positive.
        poisson: nu, in -1 < nu < 0.5.

    Raises:
        SceneError: a value out of its range or not a number.
    """
    if not 0 < young < float("inf"):
        raise SceneError(f"material.young is {young} Pa; it must be positive and finite")
    if not -1 < poisson < 0.5:
        raise SceneError(f"material.poisson is {poisson}; allowed: above -1 and below 0.5 (0.499 for rubber)")
    return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
