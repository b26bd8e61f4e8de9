"""How far predicted places and rotations are from measured ones: nothing is fitted but the alignment that is named."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_identify.alignment import Aligned, align, position_groups
from tripod_identify.csv_columns import Channel
from tripod_identify.measured import Measured


@dataclass(frozen=True)
class Spread:
    """Sizes of errors [m or rad]: mean, root mean square, 95 % quantile, largest, and of how many."""

    mean: float
    rms: float
    q95: float
    largest: float
    count: int


@dataclass(frozen=True, eq=False)
class Score:
    """Errors of a prediction.

    Attributes:
        distance: Of places, over the axes that were measured [m]; None without any.
        angle: Of rotations [rad]; None without any.
        channels: Of each number by its label.
        explained: Share of the variance of the measured places about their means that the prediction explains; NaN
            without places, or where these stand still.
        aligned: What was predicted, in the frame of the data.
        residuals: Measured minus predicted [m, rad], shape (k, m).
    """

    distance: Spread | None
    angle: Spread | None
    channels: dict[str, Spread]
    explained: float
    aligned: Aligned
    residuals: FloatArray

    def as_json(self) -> dict[str, Any]:
        """Return the numbers, SI."""
        return {
            "distance": asdict(self.distance) if self.distance else None,
            "angle": asdict(self.angle) if self.angle else None,
            "channels": {name: asdict(spread) for name, spread in self.channels.items()},
            "explained": self.explained,
            "shift": self.aligned.shift.tolist(),
            "turn": self.aligned.turn.tolist(),
        }


def spread(sizes: FloatArray) -> Spread | None:
    """Return mean, root mean square, 95 % quantile and largest of errors, NaN left out; None where none is left."""
    sizes = np.abs(sizes[np.isfinite(sizes)])
    if not sizes.size:
        return None
    return Spread(
        float(sizes.mean()), float(np.sqrt((sizes**2).mean())), float(np.quantile(sizes, 0.95)), float(sizes.max()),
        int(sizes.size),
    )  # fmt: skip


def distances(residuals: FloatArray, channels: tuple[Channel, ...], *, angle: bool = False) -> FloatArray:
    """Return the error of each place, or rotation, of each row, shape (k, sources); NaN where an axis is missing."""
    if angle:
        groups: dict[str, list[int]] = {}
        for j, c in enumerate(channels):
            if c.angle:
                groups.setdefault(c.source, []).append(j)
    else:
        groups = position_groups(channels)
    if not groups:
        return np.zeros((len(residuals), 0))
    return np.column_stack([np.linalg.norm(residuals[:, group], axis=1) for group in groups.values()])


def score(predicted: FloatArray, measured: Measured, kind: str = "none") -> Score:
    """Return the errors of `predicted`, shape (k, m), once aligned. Raises DataError as `align` does."""
    values, channels = measured.values, measured.channels
    aligned = align(predicted, values, channels, kind)
    residuals = values - aligned.values
    each = {c.label: s for c, r in zip(channels, residuals.T, strict=True) if (s := spread(r))}
    places = [j for j, c in enumerate(channels) if not c.angle]
    about = values[:, places] - np.nanmean(values[:, places], axis=0) if places else np.zeros((0, 0))
    total = float(np.nansum(about**2))
    left = float(np.nansum(residuals[:, places] ** 2))
    return Score(
        spread(distances(residuals, channels)),
        spread(distances(residuals, channels, angle=True)),
        each, 1 - left / total if total > 0 else np.nan, aligned, residuals,
    )  # fmt: skip
