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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray

ComplexArray = NDArray[np.complex128]

BELOW = 2.0
"""Times sqrt(log10(n) / n): a correlation that is less is none."""

IN_A_ROW = 5
"""Lags at which there is none, one after the other, where correlations are taken to end."""


GIVEN_BACK = 4
"""Times that what the fit has taken along is given back to the correlations."""


@dataclass(frozen=True, eq=False)
class HacCovariance:
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
    ) -> "HacCovariance":
        """Return what residuals of a motion show.

        Args:
            errors: Residuals, shape (k, m).
            use: Which of them count, shape (k, m).
            angle: Which numbers are rotations, shape (m,).
            columns: A that was fitted, shape (k, m, q), zero where it does not count.
            inverse: M, shape (q, q).
        """
        kinds = [_Kind(errors[:, own], use[:, own], columns[:, own], inverse) for own in (~angle, angle)]
        spectra = [kind.spectrum(0.0) for kind in kinds]
        if all(found is None for found in spectra):
            return cls(None, angle)
        even = np.ones(len(errors) + 1)
        whole = [even if s is None else s for s in spectra]
        for _ in range(GIVEN_BACK):
            answers = [kind.answer(s) for kind, s in zip(kinds, whole, strict=True)]
            middle = np.sum(
                [_rows(kind.columns).T @ _rows(y) for kind, y in zip(kinds, answers, strict=True)], axis=0
            )
            for i, (kind, answer) in enumerate(zip(kinds, answers, strict=True)):
                if spectra[i] is not None:
                    found = kind.spectrum(kind.taken(answer, middle))
                    whole[i] = even if found is None else found
        return cls(np.array(whole), angle)

    def more(self, columns: FloatArray) -> FloatArray:
        """Return A^T (R - 1) A, R being Ω of errors of size one; A of shape (k, m, q), zero where it does not count."""
        q = columns.shape[2]
        found = np.zeros((q, q))
        if self.spectra is None:
            return found
        size, waves = _length(len(columns)), _wave(columns)
        twice = np.full(size // 2 + 1, 2.0)  # each frequency stands for its negative, too
        twice[[0, -1]] = 1.0
        for j, turned in enumerate(self.angle):
            wave = waves[:, j]
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

    def __init__(
        self, errors: FloatArray, use: NDArray[np.bool_], columns: FloatArray, inverse: FloatArray
    ) -> None:
        self.columns, self.use, self.count = columns, use, int(use.sum())
        self._wave = _wave(columns)
        self._taken = _rows(self._wave) @ inverse  # the spectrum of A M
        rows = len(use)
        wave, known = (_wave(np.where(use, x, 0.0)) for x in (errors, 1.0))
        self._sums = _lagged(np.abs(wave) ** 2, rows)
        self._pairs = np.maximum(_lagged(np.abs(known) ** 2, rows).round(), 1.0)

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
        wave = self._wave * spectrum[:, None, None]
        whole = np.fft.irfft(wave, _length(len(self.use)), axis=0)
        return np.where(self.use[..., None], whole[: len(self.use)], 0.0)

    def taken(self, answer: FloatArray, middle: FloatArray) -> FloatArray:
        """Return the sums of H R + R H - H R H over all pairs of each lag, A^T R A being `middle`."""
        other = 2.0 * _rows(_wave(answer)) - self._taken @ middle
        return _lagged((self._taken.conj() * other).real.reshape(len(self._wave), -1), len(self.use))


def _wave(table: FloatArray) -> ComplexArray:
    """Return the spectra of the columns of a table with k rows, filled up with zeros: f rows."""
    return np.fft.rfft(table, _length(len(table)), axis=0)


def _lagged(products: FloatArray, rows: int) -> FloatArray:
    """Return the sums of products of rows that are so many apart, shape (k,), by those of spectra, shape (f, n)."""
    return np.asarray(np.fft.irfft(products.sum(axis=1), _length(rows))[:rows])


def _rows(table: Any) -> Any:
    """Return a table of shape (k, m, q) as one of shape (k m, q)."""
    return table.reshape(-1, table.shape[2])
