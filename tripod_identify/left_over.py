"""What is left: how much of the residuals is a smooth function of the commands, which no noise is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

FloatArray = NDArray[np.float64]

SURE = 1e-3
"""Probability below which chance is ruled out."""

RULES = 0.5
"""Share of the squared residuals beyond which the model does not explain the data."""


@dataclass(frozen=True)
class LeftOver:
    """Residuals divided.

    Attributes:
        rms: Of all [m or rad].
        systematic: Of the part that follows the commands, or time.
        scatter: Of the rest.
        chance: Probability that there is no such part; NaN where there are too few rows to tell.
    """

    rms: float
    systematic: float
    scatter: float
    chance: float

    @property
    def explained(self) -> bool:
        """Whether the model leaves no more than noise, as far as that can be told."""
        return not (self.chance < SURE and self.systematic**2 > RULES * self.rms**2)


def smooth_terms(along: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the polynomials of first and of second degree in what varies of `along`, shapes (k, 1 + a), (k, q)."""
    varied = along[:, np.ptp(along, axis=0) > 1e-9]
    a = varied.shape[1]
    scaled = (varied - varied.mean(axis=0)) / np.ptp(varied, axis=0)
    linear = np.column_stack([np.ones(len(scaled)), scaled])
    return linear, np.column_stack(
        [linear, *[scaled[:, i] * scaled[:, j] for i in range(a) for j in range(i, a)]]
    )


def left_over(residuals: FloatArray, along: FloatArray) -> LeftOver:
    """Return how residuals divide into a polynomial of second degree in what they go along with, and scatter.

    Where the rows do not suffice, of first degree. Tested by Fisher's F.

    Args:
        residuals: Of one unit, NaN where there is none, shape (k, m).
        along: Commands, shape (k, a).
    """
    rms = float(np.sqrt(np.nanmean(residuals**2)))
    linear, squares = smooth_terms(along)
    if linear.shape[1] == 1:
        return LeftOver(rms, 0.0, rms, np.nan)
    terms = next((t for t in (squares, linear) if len(along) >= 2 * t.shape[1] + 4), None)
    if terms is None:
        return LeftOver(rms, 0.0, rms, np.nan)
    before = after = 0.0
    given = freedom = count = 0
    for column in residuals.T:
        own = np.isfinite(column)
        n, q = int(own.sum()), terms.shape[1]
        if n < 2 * q + 4:
            continue
        fitted = terms[own] @ np.linalg.lstsq(terms[own], column[own], rcond=None)[0]
        before += float((column[own] ** 2).sum())
        after += float(((column[own] - fitted) ** 2).sum())
        given, freedom, count = given + q, freedom + n - q, count + n
    if not freedom or after <= 0:
        return LeftOver(rms, 0.0, rms, np.nan)
    scatter = after / freedom
    chance = float(fisher.sf((before - after) / given / scatter, given, freedom))
    systematic = max(before - after - given * scatter, 0.0) / count
    return LeftOver(rms, float(np.sqrt(systematic)), float(np.sqrt(scatter)), chance)
