"""The curves of a film as one picture, with matplotlib."""

from pathlib import Path
from typing import Any

from tripod_host.writing import replaced
from tripod_view.player.film import Film
from tripod_view.player.robot import SERVO_COLOURS

COLOURS = (*(tuple(c / 255 for c in rgb) for rgb in SERVO_COLOURS), "#2a9d5c", "#e08a00", "0.35")


def write_plot(film: Film, path: Path) -> None:
    """Draw the curves over time, the events marked, as PNG.

    Raises:
        ModuleNotFoundError: there is no matplotlib.
        OSError: `path` cannot be written.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415 - only where a picture is wanted

    rows = max(len(film.curves), 1)
    figure = Figure(figsize=(7.5, 1.2 + 1.9 * rows), layout="constrained")
    axes = figure.subplots(rows, 1, squeeze=False, sharex=True)[:, 0]
    for axis, curve in zip(axes, film.curves, strict=False):
        for k, name in enumerate(curve.names):
            axis.plot(film.times, curve.values[:, k], color=COLOURS[k % len(COLOURS)], lw=1.3, label=name)
        _lines(axis, film, curve.limits)
        axis.set_ylabel(f"{curve.title} [{curve.unit}]")
        if len(curve.names) > 1:
            axis.legend(fontsize=8, loc="upper right", ncols=min(len(curve.names), 3))
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("time [s]")
    figure.suptitle(film.title)
    with replaced(path) as file:
        figure.savefig(file, format="png", dpi=120)


def _lines(axis: Any, film: Film, limits: tuple[float, ...]) -> None:
    """Draw limits across, where they are near, and events down."""
    low, high = axis.get_ylim()
    for limit in limits:
        if low - (high - low) < limit < high + (high - low):
            axis.axhline(limit, color="0.6", ls="--", lw=1)
    for event in film.events:
        axis.axvline(event.time, color="0.5", ls=":", lw=1)
