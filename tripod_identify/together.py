"""How errors of one motion that are close in time hang together, and what they then make of values.

Values found by least squares from A with the errors e of covariance Ω have the covariance [NeweyWest1987]

    (A^T A)^-1  A^T Ω A  (A^T A)^-1.

The errors of each number are taken as stationary, those of all places alike and of all rotations alike, and different
numbers as independent. So A^T Ω A is the sum over frequencies of their spectrum times the products of the spectra of
A's columns: an error that swings as slowly as a column counts most. The spectrum is that of the residuals' correlation
at lags, which are taken whole up to m rows and fade out at 2 m (a flat top); m is the last lag before five in a row
are below 2 sqrt(log10(n) / n) of n numbers [Politis2003], none where already the first five are. What is negative of a
spectrum that was found so is left out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

BELOW = 2.0
"""Times sqrt(log10(n) / n): a correlation that is less is none."""

IN_A_ROW = 5
"""Lags at which there is none, one after the other, where correlations are taken to end."""


@dataclass(frozen=True, eq=False)
class Together:
    """How the errors of k rows of m numbers hang together.

    Attributes:
        spectra: Of places and rotations, of errors whose mean square is one, shape (2, f); None where no error has to
            do with another.
        angle: Which numbers are rotations, shape (m,).
    """

    spectra: FloatArray | None
    angle: NDArray[np.bool_]

    @classmethod
    def of(cls, errors: FloatArray, use: NDArray[np.bool_], angle: NDArray[np.bool_]) -> "Together":
        """Return what residuals of a motion show, shape (k, m), of which `use` count."""
        kinds = [_spectrum(errors[:, kind], use[:, kind]) for kind in (~angle, angle)]
        if all(found is None for found in kinds):
            return cls(None, angle)
        even = np.ones(_length(len(errors)) // 2 + 1)
        return cls(np.array([even if found is None else found for found in kinds]), angle)

    def more(self, columns: FloatArray) -> FloatArray:
        """Return A^T (R - 1) A, R being Ω of errors of size one; A of shape (k, m, q), zero where it does not count."""
        q = columns.shape[2]
        found = np.zeros((q, q))
        if self.spectra is None:
            return found
        size = _length(len(columns))
        twice = np.full(size // 2 + 1, 2.0)  # each frequency stands for its negative, too
        twice[[0, -1]] = 1.0
        for j, turned in enumerate(self.angle):
            wave = np.fft.rfft(columns[:, j], size, axis=0)
            weighted = wave * (twice * (self.spectra[int(turned)] - 1.0) / size)[:, None]
            found += (wave.conj().T @ weighted).real
        return found

    def worth(self, use: NDArray[np.bool_]) -> float:
        """Return how many independent numbers would tell the size of errors as well as those in use [Bartlett1946]."""
        counts = [int(use[:, kind].sum()) for kind in (~self.angle, self.angle)]
        if self.spectra is None:
            return float(sum(counts))
        return float(sum(n / _mean(s**2) for n, s in zip(counts, self.spectra, strict=True)))


def _length(rows: int) -> int:
    """Return to how many rows columns are filled up with zeros: even, and twice as many as there are."""
    return 2 * max(rows, 1)


def _mean(spectrum: FloatArray) -> float:
    """Return the mean over positive and negative frequencies."""
    return float((2 * spectrum.sum() - spectrum[0] - spectrum[-1]) / (2 * (len(spectrum) - 1)))


def _spectrum(errors: FloatArray, use: NDArray[np.bool_]) -> FloatArray | None:
    """Return the spectrum of one kind of errors, its mean one; None where they have nothing to do with each other."""
    count, rows = int(use.sum()), len(errors)
    size = _length(rows)

    def lagged(table: FloatArray) -> FloatArray:
        return np.fft.irfft((np.abs(np.fft.rfft(table, size, axis=0)) ** 2).sum(axis=1), size)[:rows]

    sums, pairs = lagged(np.where(use, errors, 0.0)), lagged(use.astype(np.float64)).round()
    if count < 2 or sums[0] <= 0:
        return None
    most = max(rows // 2, 1)  # of longer lags too few pairs are left
    correlation = (sums / np.maximum(pairs, 1.0))[:most] / (sums[0] / count)
    least = BELOW * np.sqrt(np.log10(count) / count)
    none = np.concatenate([np.abs(correlation) < least, np.ones(IN_A_ROW, dtype=bool)])
    m = next(lag for lag in range(most) if none[lag + 1 : lag + 1 + IN_A_ROW].all())
    if m == 0:
        return None
    lags = np.arange(min(2 * m, most))
    weights = np.minimum(1.0, 2.0 - lags / m)
    parts = np.zeros(size)
    parts[lags] = weights * correlation[lags]
    parts[size - lags[1:]] = parts[lags[1:]]
    spectrum = np.maximum(np.fft.rfft(parts).real, 0.0)
    return np.asarray(spectrum / _mean(spectrum))
