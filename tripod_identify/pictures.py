"""Pictures of data and predictions: both over rows or time, and the errors. Needs matplotlib."""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_identify.csv_columns import Channel
from tripod_identify.errors import DataError
from tripod_identify.measured import Measured
from tripod_identify.score import Score, distances

COLOURS = ("#0072b2", "#d55e00", "#009e73")
MOST_PANELS = 8
"""Sources that are drawn, each with its places or rotations."""


def check_matplotlib() -> None:
    """Raise DataError where nothing can be drawn."""
    try:
        import matplotlib  # noqa: F401, PLC0415
    except ImportError:
        raise DataError(
            "pictures need matplotlib: pip install matplotlib, or leave out --report and --plot"
        ) from None


def curves(
    measured: Measured, score: Score, title: str, *, left_out: NDArray[np.bool_] | None = None
) -> bytes:
    """Return a PNG: for each source what was measured and predicted, and below the errors of places.

    Args:
        measured: The data.
        score: Of the prediction.
        title: Over the picture.
        left_out: Rows that were held out of a fit, a mask of shape (k,), shaded.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415 - only where a picture is wanted

    groups = _groups(measured.channels)[:MOST_PANELS]
    figure = Figure(figsize=(10, 0.6 + 2.3 * (len(groups) + 1)), layout="constrained")
    every = figure.subplots(len(groups) + 1, 1, squeeze=False, sharex=True)[:, 0]
    at = measured.times if measured.times is not None else np.arange(1.0, len(measured.values) + 1)
    style = "." if measured.times is None else "-"
    for axes, (label, columns, factor, unit) in zip(every, groups, strict=False):
        for j in columns:
            colour = COLOURS[measured.channels[j].axis]
            axes.plot(
                at,
                factor * measured.values[:, j],
                style,
                color=colour,
                alpha=0.35,
                linewidth=2.5,
                markersize=9,
            )
            axes.plot(
                at, factor * score.aligned.values[:, j], style, color=colour, linewidth=0.9, markersize=3,
                label="xyz"[measured.channels[j].axis],
            )  # fmt: skip
        axes.set_title(f"{label}: measured (broad, pale), predicted", fontsize="medium")
        axes.set(ylabel=f"[{unit}]")
        axes.legend(fontsize="xx-small", ncols=3, loc="upper right")
    away = distances(score.residuals, measured.channels)
    factor, unit = 1e3, "mm"
    if not away.size:
        away, factor, unit = distances(score.residuals, measured.channels, angle=True), 180 / np.pi, "degrees"
    every[-1].plot(at, factor * away, style, color="#555555", linewidth=0.9)
    every[-1].set(ylabel=f"[{unit}]", xlabel="time [s]" if measured.times is not None else "row of the data")
    every[-1].set_title("error", fontsize="medium")
    every[-1].set_ylim(bottom=0)
    for axes in every:
        axes.grid(visible=True, alpha=0.3)
        _shade(axes, at, left_out)
    figure.suptitle(title)
    return _png(figure)


def _shade(axes: Any, at: FloatArray, left_out: NDArray[np.bool_] | None) -> None:
    if left_out is None or not left_out.any():
        return
    half = 0.5 * float(np.median(np.diff(at))) if len(at) > 1 else 0.5
    for x in at[left_out]:
        axes.axvspan(x - half, x + half, color="#e69f00", alpha=0.12, linewidth=0)


def _groups(channels: tuple[Channel, ...]) -> list[tuple[str, list[int], float, str]]:
    """Return what is drawn together: label, columns, factor and unit."""
    found: dict[tuple[str, bool], list[int]] = {}
    for j, c in enumerate(channels):
        found.setdefault((c.source, c.angle), []).append(j)
    return [
        (
            f"{source}, rotation" if angle else source,
            columns,
            180 / np.pi if angle else 1e3,
            "degrees" if angle else "mm",
        )
        for (source, angle), columns in found.items()
    ]


def _png(figure: Any) -> bytes:
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=110)
    return file.getvalue()
