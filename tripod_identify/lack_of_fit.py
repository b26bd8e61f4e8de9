"""What is left: how much of the residuals is a smooth function of the commands, which no noise is."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from tripod_host.arrays import FloatArray
from tripod_identify.measured import Measured
from tripod_sim.scene import Scene

SURE = 1e-3
"""Probability below which chance is ruled out."""

RULES = 0.5
"""Share of the squared residuals beyond which the model does not explain the data."""


@dataclass(frozen=True)
class LackOfFit:
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

    @property
    def note(self) -> str:
        """That the model does not explain the data, in a sentence; empty where it does."""
        if self.explained:
            return ""
        share = 100 * self.systematic**2 / self.rms**2
        return (
            f"the model does not explain the data: {share:.0f} % of the remaining squared error follows "
            "the commands or time, which noise does not"
        )

    def as_json(self) -> dict[str, Any]:
        """Return the numbers, SI."""
        return {**asdict(self), "explained": self.explained}


@dataclass(frozen=True, eq=False)
class Smooth:
    """Polynomials in what varies along rows, each of their numbers taken from its mean and over its range.

    Attributes:
        columns: Which of the numbers vary, shape (a,).
        mean, span: Of these, shape (a,).
    """

    columns: NDArray[np.int64]
    mean: FloatArray
    span: FloatArray

    @classmethod
    def of(cls, along: FloatArray) -> "Smooth":
        """Return those of rows, shape (k, a')."""
        columns = np.flatnonzero(np.ptp(along, axis=0) > 1e-9)
        varied = along[:, columns]
        return cls(columns, varied.mean(axis=0), np.ptp(varied, axis=0))

    def linear(self, along: FloatArray) -> FloatArray:
        """Return the terms of first degree of rows, shape (k, 1 + a)."""
        return np.column_stack([np.ones(len(along)), (along[:, self.columns] - self.mean) / self.span])

    def squares(self, along: FloatArray) -> FloatArray:
        """Return the terms up to second degree of rows, shape (k, q)."""
        linear = self.linear(along)
        a = linear.shape[1]
        return np.column_stack(
            [linear, *[linear[:, i] * linear[:, j] for i in range(1, a) for j in range(i, a)]]
        )


def lack_of_fit(residuals: FloatArray, along: FloatArray) -> LackOfFit:
    """Return how residuals divide into a polynomial of second degree in what they go along with, and scatter.

    Where the rows do not suffice, of first degree. Tested by Fisher's F.

    Args:
        residuals: Of one unit, NaN where there is none, shape (k, m).
        along: Commands, shape (k, a).
    """
    rms = float(np.sqrt(np.nanmean(residuals**2)))
    smooth = Smooth.of(along)
    linear, squares = smooth.linear(along), smooth.squares(along)
    if linear.shape[1] == 1:
        return LackOfFit(rms, 0.0, rms, np.nan)
    terms = next((t for t in (squares, linear) if len(along) >= 2 * t.shape[1] + 4), None)
    if terms is None:
        return LackOfFit(rms, 0.0, rms, np.nan)
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
        return LackOfFit(rms, 0.0, rms, np.nan)
    scatter = after / freedom
    chance = float(fisher.sf((before - after) / given / scatter, given, freedom))
    systematic = max(before - after - given * scatter, 0.0) / count
    return LackOfFit(rms, float(np.sqrt(systematic)), float(np.sqrt(scatter)), chance)


def what_is_left(residuals: FloatArray, measured: Measured, scene: Scene) -> LackOfFit:
    """Return what residuals of data are made of: of places, of rotations where there is no place.

    Args:
        residuals: Measured less predicted [m, rad], shape (k, m).
        measured: The data.
        scene: Whose commands they follow.
    """
    angle = np.array([c.angle for c in measured.channels])
    along = measured.joints(scene) if measured.times is None else measured.times[:, None]
    return lack_of_fit(residuals[:, ~angle if (~angle).any() else angle], along)
