"""What a score says: rows for people, and the report."""

import math
from collections.abc import Sequence

from tripod_identify.lack_of_fit import LackOfFit
from tripod_identify.measured import Measured
from tripod_identify.page import Page
from tripod_identify.pictures import curves
from tripod_identify.score import Score, Spread

HEAD = ("", "mean", "rms", "95 %", "largest", "of")


def spread_cells(spread: Spread, *, angle: bool) -> list[str]:
    """Return mean, rms, 95 % and largest in mm or degrees, and the count."""
    factor = math.degrees(1) if angle else 1e3
    return [f"{factor * v:.3f}" for v in (spread.mean, spread.rms, spread.q95, spread.largest)] + [
        str(spread.count)
    ]


def score_rows(score: Score) -> list[list[str]]:
    """Return the table of a score, in mm and degrees, under `HEAD`."""
    rows = []
    if score.distance:
        rows.append(["place [mm]", *spread_cells(score.distance, angle=False)])
    if score.angle:
        rows.append(["rotation [degrees]", *spread_cells(score.angle, angle=True)])
    for label, spread in score.channels.items():
        angle = label.rpartition(".")[2].startswith("r")
        rows.append([f"{label} [{'degrees' if angle else 'mm'}]", *spread_cells(spread, angle=angle)])
    return rows


def left_rows(left: LackOfFit, *, angle: bool) -> list[list[str]]:
    """Return what the rest is made of, name and root mean square in mm or degrees."""
    size, unit = (math.degrees(1), "degrees") if angle else (1e3, "mm")
    rows = [["all that is left", f"{size * left.rms:.4f} {unit}"]]
    if math.isfinite(left.chance):
        rows.append(["of it, follows the commands or time", f"{size * left.systematic:.4f} {unit}"])
        rows.append(["of it, scatter", f"{size * left.scatter:.4f} {unit}"])
    return rows


def alignment_line(score: Score, kind: str) -> str:
    """Return what was taken away before."""
    shift = ", ".join(f"{1e3 * v:.3f}" for v in score.aligned.shift)
    turn = ", ".join(f"{math.degrees(v):.3f}" for v in score.aligned.turn)
    if kind == "none":
        return "nothing was fitted, nothing aligned"
    turned = f", turn {turn} degrees" if kind == "rigid" else ""
    return f"aligned by {kind} before ({shift} mm{turned}); nothing else was fitted"


def score_report(
    title: str, command: str, measured: Measured, score: Score, left: LackOfFit, kind: str, notes: Sequence[str]
) -> tuple[str, bytes]:  # fmt: skip
    """Return the report as HTML, and its picture as PNG."""
    page = Page(title)
    page.code(command)
    for note in notes:
        page.warn(note)
    what = "a motion" if measured.times is not None else "poses at rest"
    page.say(f"{len(measured.values)} rows, {what}; {alignment_line(score, kind)}.")
    page.table(HEAD, score_rows(score))
    if math.isfinite(score.explained):
        page.say(f"The scene explains {100 * score.explained:.2f} % of the variance of the measured places.")
    page.table(("what is left", "root mean square"), left_rows(left, angle=not score.distance))
    picture = curves(measured, score, title)
    page.picture(picture, "measured and predicted numbers, and their distance")
    return page.text, picture
