"""How errors of one motion that are close in time hang together, and what they then make of values.

Values found by least squares from A with the errors e of covariance Ω have the covariance [NeweyWest1987]

    (A^T A)^-1  A^T Ω A  (A^T A)^-1.

The errors of each number are taken as stationary, those of all places alike and of all rotations alike, and different
numbers as independent. So A^T Ω A is the sum over frequencies of their spectrum times the products of the spectra of
A's columns: an error that swings as slowly as a column counts most. The spectrum is that of the residuals' correlation
at lags, which are taken whole up to m rows and fade out at 2 m (a flat top); m is the last lag before five in a row
are below 2 sqrt(log10(n) / n) of n numbers [Politis2003], none where already the first five are. What is negative of a
spectrum that was found so is left out.

Residuals are (1 - H) e, H = A M A^T: the fit has taken along what looks like its columns, slow errors above all. Their
covariance lacks H Ω + Ω H - H Ω H, which is computed of the Ω found so far and given back, some times over.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

BELOW = 2.0
"""Times sqrt(log10(n) / n): a correlation that is less is none."""

IN_A_ROW = 5
"""Lags at which there is none, one after the other, where correlations are taken to end."""


GIVEN_BACK = 4
"""Times that what the fit has taken along is given back to the correlations."""


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
    def of(
        cls,
        errors: FloatArray,
        use: NDArray[np.bool_],
        angle: NDArray[np.bool_],
        columns: FloatArray,
        inverse: FloatArray,
    ) -> "Together":
        """Return what residuals of a motion show.

        Args:
            errors: Residuals, shape (k, m).
            use: Which of them count, shape (k, m).
            angle: Which numbers are rotations, shape (m,).
            columns: A that was fitted, shape (k, m, q), zero where it does not count.
            inverse: M, shape (q, q).
        """
        kinds = [_Kind(errors[:, kind], use[:, kind], columns[:, kind]) for kind in (~angle, angle)]
        spectra = [kind.spectrum(0.0) for kind in kinds]
        if all(found is None for found in spectra):
            return cls(None, angle)
        even = np.ones(len(errors) + 1)
        whole = [even if s is None else s for s in spectra]
        for _ in range(GIVEN_BACK):
            answers = [kind.answer(s) for kind, s in zip(kinds, whole, strict=True)]
            middle = np.sum(
                [np.einsum("kjp,kjq->pq", kind.columns, y) for kind, y in zip(kinds, answers, strict=True)],
                axis=0,
            )
            for i, (kind, answer) in enumerate(zip(kinds, answers, strict=True)):
                if spectra[i] is not None:
                    found = kind.spectrum(kind.taken(answer, inverse, middle))
                    whole[i] = even if found is None else found
        return cls(np.array(whole), angle)

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


class _Kind:
    """Residuals of all places, or of all rotations."""

    def __init__(self, errors: FloatArray, use: NDArray[np.bool_], columns: FloatArray) -> None:
        self.columns, self.use, self.count = columns, use, int(use.sum())
        self._sums = _lagged(np.where(use, errors, 0.0)[..., None])
        self._pairs = np.maximum(_lagged(use.astype(np.float64)[..., None]).round(), 1.0)

    def spectrum(self, taken: FloatArray | float) -> FloatArray | None:
        """Return the spectrum, its mean one; None where no error has to do with another; `taken` as below."""
        rows = len(self.use)
        most = max(rows // 2, 1)  # of longer lags too few pairs are left
        taken = np.broadcast_to(taken, rows)
        left = self.count - taken[0]
        if left < 2 or self._sums[0] <= 0:
            return None
        correlation = ((self._sums * left / self._sums[0] + taken) / self._pairs)[:most]
        least = BELOW * np.sqrt(np.log10(self.count) / self.count)
        none = np.concatenate([np.abs(correlation) < least, np.ones(IN_A_ROW, dtype=bool)])
        m = next(lag for lag in range(most) if none[lag + 1 : lag + 1 + IN_A_ROW].all())
        if m == 0:
            return None
        lags = np.arange(min(2 * m, most))
        parts = np.zeros(_length(rows))
        parts[lags] = np.minimum(1.0, 2.0 - lags / m) * correlation[lags]
        parts[-lags[1:]] = parts[lags[1:]]
        spectrum = np.maximum(np.fft.rfft(parts).real, 0.0)
        return np.asarray(spectrum / _mean(spectrum))

    def answer(self, spectrum: FloatArray) -> FloatArray:
        """Return R A of the columns, shape (k, m, q)."""
        size = _length(len(self.use))
        wave = np.fft.rfft(self.columns, size, axis=0) * spectrum[:, None, None]
        return np.where(self.use[..., None], np.fft.irfft(wave, size, axis=0)[: len(self.use)], 0.0)

    def taken(self, answer: FloatArray, inverse: FloatArray, middle: FloatArray) -> FloatArray:
        """Return the sums of H R + R H - H R H over all pairs of each lag, A^T R A being `middle`."""
        own = self.columns @ inverse
        return _lagged(own, answer) + _lagged(answer, own) - _lagged(own @ middle, own)


def _lagged(left: FloatArray, right: FloatArray | None = None) -> FloatArray:
    """Return the sums of products of rows that are so many apart, shape (k,), of tables of shape (k, m, q)."""
    rows, size = len(left), _length(len(left))
    wave = np.fft.rfft(left, size, axis=0)
    other = wave if right is None else np.fft.rfft(right, size, axis=0)
    return np.asarray(np.fft.irfft((wave.conj() * other).sum(axis=(1, 2)), size)[:rows])
