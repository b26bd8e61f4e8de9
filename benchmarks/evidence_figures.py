"""Pictures of the pages of evidence that are drawn from tables on these pages; see `evidence.py`."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.accuracy_overview import NAMES
from benchmarks.doc_parts import table_of

BLUE, ORANGE, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "0.55"


def numbers(cell: str) -> list[float]:
    """Return the numbers of a cell of a table."""
    return [float(text) for text in re.findall(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?", cell)]


def blank(width: float, height: float, columns: int = 1) -> tuple[Any, Any]:
    """Return a figure and its axes, side by side."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - only where a picture is wanted

    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots(1, columns, squeeze=False)[0]
    for ax in axes:
        ax.grid(axis="x", alpha=0.3)
        ax.spines[["top", "right"]].set_visible(False)
    return figure, axes


def saved(figure: Any, path: Path) -> None:
    """Write a figure as PNG."""
    figure.savefig(path, format="png", dpi=100)


def kept(page: str, path: Path) -> None:
    """Draw, of each study and requested accuracy, the errors of the random cases over the request.

    Args:
        page: Text of docs/accuracy.md.
        path: Of the picture.
    """
    rows = table_of(page, "promise")
    figure, (ax,) = blank(9.5, 1.6 + 0.28 * len(rows))
    places = []
    for k, row in enumerate(rows):
        y = k + 0.7 * list(dict.fromkeys(r["study"] for r in rows)).index(row["study"])
        places.append(y)
        asked = numbers(row["requested"])[0]
        median, most, worst = (
            max(numbers(row[name])) / asked
            for name in ("median error [%]", "95 % of cases below [%]", "worst [%]")
        )
        ax.plot([median, most], [y, y], "-", color=BLUE, lw=4, solid_capstyle="butt")
        ax.plot(median, y, "o", color=BLUE, ms=6)
        ax.plot(worst, y, "x", color=ORANGE, ms=6)
    ax.plot([], [], "o", color=BLUE, label="median case")
    ax.plot([], [], "-", color=BLUE, lw=4, label="up to here: 95 % of the cases")
    ax.plot([], [], "x", color=ORANGE, label="worst case")
    ax.axvline(1.0, color="0.2", ls="--", lw=1.3, label="requested accuracy")
    ax.set_xscale("log")
    ax.set_yticks(places, [f"{NAMES[row['study']]}, {row['requested'].replace('%', ' %')}" for row in rows])
    ax.invert_yaxis()
    ax.set_xlabel("error in random cases, divided by the requested accuracy (left of the line: kept)")
    ax.set_title(
        f"Error of the setting that --accuracy picks, {rows[0]['cases']} random cases each", fontsize=12
    )
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    saved(figure, path)


SHOWN = {"h20": BLUE, "h8_modes": GREEN, "t4": ORANGE}
"""Elements in the picture of known solutions."""


def solutions(page: str, path: Path) -> None:
    """Draw how far three elements are from known solutions.

    Args:
        page: Text of docs/verification.md.
        path: Of the picture.
    """
    rows: list[Mapping[str, str]] = [
        *(r for r in table_of(page, "analytic") if not r["case"].startswith(("patch", "rigid", "free"))),
        *({**r, "case": r["problem"]} for r in table_of(page, "external solids")),
    ]
    figure, (ax,) = blank(9.5, 1.4 + 0.36 * len(rows))
    for k, row in enumerate(rows):
        sizes = [max(abs(numbers(row[e])[0]), 0.01) for e in SHOWN]
        ax.plot([min(sizes), max(sizes)], [k, k], "-", color="0.85", lw=1, zorder=0)
        for size, (element, colour) in zip(sizes, SHOWN.items(), strict=True):
            ax.plot(size, k, "o", color=colour, ms=7, label=None if k else LABELS[element])
    ax.axvline(1.0, color="0.2", ls="--", lw=1.2)
    ax.annotate(
        "1 %",
        (1.0, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(3, -2),
        textcoords="offset points",
        va="top",
    )
    ax.set_xscale("log")
    ax.set_yticks(range(len(rows)), [row["case"] for row in rows])
    ax.invert_yaxis()
    ax.set_xlabel("difference from the known solution [%]; smaller ones are drawn at 0.01 %")
    ax.set_title("Known solutions and published problems: three elements", fontsize=12)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    saved(figure, path)


LABELS = {
    "h20": "h20: quadratic hexahedra",
    "h8_modes": "h8_modes: linear, incompatible modes",
    "t4": "t4: linear tetrahedra",
}


INTERVALS = {
    "poses": "poses",
    "poses more": "poses, other robots",
    "tetrahedra": "poses, tetrahedra",
    "motion": "a motion",
}
"""Kinds of robots in the picture of intervals, by the part of the page."""


def measured(page: str, path: Path) -> None:
    """Draw what was simulated beside what was measured, and how often intervals hold the true value.

    Args:
        page: Text of docs/reality.md.
        path: Of the picture.
    """
    figure, (left, right) = blank(12, 4.2, 2)
    pairs = [(row["quantity"], numbers(row["simulated"])[0] / numbers(row["measured"])[0])
             for row in table_of(page, "beam comparison")]  # fmt: skip
    for k, (_, ratio) in enumerate(pairs):
        left.plot([0, 100 * (ratio - 1)], [k, k], "-", color=BLUE, lw=6, solid_capstyle="butt")
    left.axvline(0, color="0.2", lw=1.2)
    left.set_yticks(range(len(pairs)), [name for name, _ in pairs])
    left.set(ylim=(len(pairs) - 0.5, -0.5), xlabel="simulated - measured [%]")
    left.set_title("A silicone beam: two values fitted to one run", fontsize=11)
    for k, part in enumerate(INTERVALS):
        row = next(r for r in table_of(page, f"intervals {part}") if r["value"] == "all")
        share = [numbers(cell)[0] for cell in list(row.values())[2:4]]
        right.plot(share[1], k, "o", color=BLUE, ms=9, label=None if k else "with the error of the mesh")
        right.plot(share[0], k, "o", color=ORANGE, ms=9, mfc="none", label=None if k else "by noise alone")
    right.axvline(90, color="0.2", ls="--", lw=1.2, label="90 % intended")
    right.set_yticks(range(len(INTERVALS)), INTERVALS.values())
    right.set(
        xlim=(40, 100), ylim=(len(INTERVALS) - 0.5, -0.5), xlabel="intervals that hold the true value [%]"
    )
    right.set_title("Identified values of simulated robots: 90 % intervals", fontsize=11)
    figure.legend(loc="outside lower right", ncols=3, fontsize=9, frameon=False)
    saved(figure, path)


def speed(page: str, path: Path) -> None:
    """Draw the time of a step by scene and mesh, over the length of the step.

    Args:
        page: Text of docs/speed.md.
        path: Of the picture.
    """
    rows = table_of(page, "steps")
    figure, (ax,) = blank(9.5, 1.6 + 0.36 * len(rows))
    for k, row in enumerate(rows):
        step = numbers(row["step"])[0]
        median, most = numbers(row["median [ms]"])[0], numbers(row["99th percentile [ms]"])[0]
        ax.plot([median / step, most / step], [k, k], "-", color=BLUE, lw=3)
        ax.plot(
            median / step,
            k,
            "o",
            color=BLUE,
            ms=7,
            label=None if k else "median step, up to the 99th percentile",
        )
        if row["SOFA [ms]"]:
            label = None if any(r["SOFA [ms]"] for r in rows[:k]) else "SOFA, a mesh of that size"
            ax.plot(numbers(row["SOFA [ms]"])[0] / step, k, "D", color=GREY, ms=7, label=label)
    ax.axvline(1.0, color="0.2", ls="--", lw=1.3, label="real time")
    ax.set_xscale("log")
    names = [r["scene"].replace("`", "") for r in rows]
    ax.set_yticks(
        range(len(rows)), [f"{name}, {r['step']} steps" for name, r in zip(names, rows, strict=True)]
    )
    ax.invert_yaxis()
    ax.set_xlabel("computing time of a step, divided by its length")
    ax.set_title("How fast a step is, on one processor core", fontsize=12)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    saved(figure, path)
