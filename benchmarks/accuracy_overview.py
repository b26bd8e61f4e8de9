"""What docs/accuracy.md begins with: what an error of 10, 5, 2, 1 and 0.1 % costs in each scene.

One picture and one table, from the studies in tripod_study/studies; for `accuracy_docs.py`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tripod_bringup.study_plot import colour_of
from tripod_host.writing import replaced
from tripod_study.advice import short
from tripod_study.front import cheapest

LEVELS = (10, 5, 2, 1, 0.1)
"""Errors [%]."""

NAMES = {
    "pendulum": "Pendulum of ten nodes",
    "cloth": "Cloth, hung at two corners",
    "drape": "Cloth falls on a sphere",
    "silicone": "Silicone piece, let go",
    "tripod_dynamic": "Tripod in motion",
    "maze": "Ball in the maze",
    "finger_cable": "Finger, two cables",
    "finger_pneumatic": "Finger, six chambers",
    "diamond": "Diamond, four cables",
    "trunk": "Trunk, eight cables",
    "tripod_static": "Tripod at rest",
    "ik": "Inverse kinematics",
}
"""By study."""

SCHEMES = {
    "semi_implicit_euler": "semi-implicit Euler",
    "explicit_euler": "explicit Euler",
    "implicit_euler": "implicit Euler",
    "bdf2": "BDF2",
    "tr_bdf2": "TR-BDF2",
    "rk4": "Runge-Kutta 4",
}
"""Names of time-step methods in a picture, by `inertia.scheme`."""

NEAR = 0.15
"""Two dots nearer than this, in powers of ten, have their words on two sides."""

STATICS = "static"
"""In place of a scheme where there is none."""

HEAD = (
    f"| | {' | '.join(f'{level:g} %' for level in LEVELS)} | default settings: error, cost |",
    "|---|" + "---|" * (len(LEVELS) + 1),
)


@dataclass(frozen=True)
class Price:
    """What an accuracy costs.

    Attributes:
        cost: CPU time of a simulated second, or of a solve [s].
        scheme: Time integrator, or `STATICS`.
        sure: Whether the error and the reference's own error together are within the accuracy, not the error alone.
        setting: That costs it, in words.
    """

    cost: float
    scheme: str
    sure: bool
    setting: str = field(default="", compare=False)


@dataclass(frozen=True)
class Row:
    """What each of `LEVELS` costs in a study, None where no setting is so accurate.

    Attributes:
        name: Of the scene.
        solves: Whether costs are of solves, not of simulated seconds.
        prices: One for each of `LEVELS`.
        default: Error and cost of the scene's default settings.
        own: Relative error of the reference itself, estimated.
    """

    name: str
    solves: bool
    prices: tuple[Price | None, ...]
    default: str = ""
    own: float = 0.0


def of_study(result: Mapping[str, Any]) -> Row:
    """Return the row of a study; an error is the largest of all that it promises."""
    beside = [q["name"] for q in result["quantities"] if q.get("promised")]
    points = [p for p in result["points"] if p["error"] is not None]
    solves = result["cpu"] == "s per solve"

    def largest(p: Mapping[str, Any], *, sure: bool) -> float:
        others = (p["errors"][name]["relative"] + sure * p["errors"][name]["own"] for name in beside)
        return float(max(p["bound"] if sure else p["error"], *others, 0.0))

    def price(level: float) -> Price | None:
        for sure in (True, False):
            k = cheapest([largest(p, sure=sure) for p in points], [p["cpu"] for p in points], level / 100)
            if k is not None:
                p = points[k]
                scheme = STATICS if solves else str(p["settings"].get("inertia.scheme", "implicit_euler"))
                return Price(p["cpu"], scheme, sure, short(p["settings"], result))
        return None

    default = next((p for p in points if p["label"] == "the default"), None)
    return Row(
        NAMES[result["study"]],
        solves,
        tuple(price(level) for level in LEVELS),
        f"{100 * largest(default, sure=False):.2g} %, {amount(default['cpu'])}" if default else "",
        own=(result["reference"] or {}).get("own_error") or 0.0,
    )


def amount(value: float) -> str:
    """Return a time for people, in two digits, in seconds or milliseconds."""
    unit, value = ("s", value) if value >= 0.1 else ("ms", 1e3 * value)
    return f"{float(f'{value:.2g}'):g} {unit}"


def rows_of(results: Sequence[Mapping[str, Any]]) -> list[Row]:
    """Return the rows of all studies."""
    return [of_study(r) for r in results]


def table(rows: Sequence[Row]) -> list[str]:
    """Return the table as Markdown, in motion first."""
    lines = list(HEAD)
    for solves, title in (
        (False, "**In motion: CPU time of a simulated second**"),
        (True, "**At rest: CPU time of a solve**"),
    ):
        lines.append(f"| {title} |" + " |" * (len(LEVELS) + 1))
        for row in rows:
            if row.solves == solves:
                cells = [_cell(price) for price in row.prices]
                lines.append(f"| {row.name} | {' | '.join(cells)} | {row.default} |")
    return lines


def _cell(price: Price | None) -> str:
    if price is None:
        return "-"
    text = amount(price.cost)
    return text if price.sure else f"({text})"


def unsure(rows: Sequence[Row]) -> str:
    """Return in a sentence where the reference's own error decides; empty where it does nowhere."""
    words = [
        f"{row.name} {100 * row.own:.2g} %"
        for row in rows
        if any(price and not price.sure for price in row.prices)
    ]
    if not words:
        return ""
    return (
        "In brackets: the error is within the limit, but the error of the reference itself may add too much: "
        f"{', '.join(words)}."
    )


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw the picture: a line for each scene, a dot for each accuracy, at its price, in the colour of its scheme."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - only where a picture is wanted

    shown = [[row for row in rows if row.solves == solves] for solves in (False, True)]
    figure = Figure(figsize=(10.0, 2.6 + 0.42 * sum(map(len, shown))), layout="constrained")
    panels = figure.subplots(2, 1, height_ratios=[len(s) + 1 for s in shown])
    schemes: dict[str, None] = {}
    for axes, own in zip(panels, shown, strict=True):
        for k, row in enumerate(own):
            _dots(axes, row, k)
            schemes |= dict.fromkeys(p.scheme for p in row.prices if p)
        axes.set_yticks(range(len(own)), [row.name for row in own], fontsize=10)
        axes.set(xscale="log", ylim=(len(own) - 0.4, -0.75))
        low, high = axes.get_xlim()
        axes.set_xlim(low / 1.5, high * 1.5)
        axes.grid(axis="x", alpha=0.25)
        axes.tick_params(axis="y", length=0)
        for side in ("top", "right", "left"):
            axes.spines[side].set_visible(False)
    motion, rest = panels
    motion.axvline(1.0, color="0.2", lw=1.4, ls="--", zorder=0)
    motion.annotate(
        "real time", (1.0, -0.75), xytext=(4, -2), textcoords="offset points", fontsize=9, va="top"
    )
    motion.set_xlabel("in motion: computing time for one simulated second [s], one processor core")
    rest.set_xlabel("at rest: computing time of one solve [s], one processor core")
    for scheme in schemes:
        if scheme != STATICS:
            motion.plot([], [], "o", color=colour_of(scheme, 0), label=SCHEMES.get(scheme, scheme))
    motion.plot(
        [], [], "o", color="0.3", mfc="none", label="(in brackets): reference too uncertain to be sure"
    )
    figure.suptitle("Computing time that an error of 10, 5, 2, 1 or 0.1 % costs", fontsize=12)
    figure.legend(
        loc="outside lower center", ncols=5, fontsize=8.5, title="time-step method", title_fontsize=8.5
    )
    with replaced(path) as file:
        figure.savefig(file, format="png", dpi=110)


def _dots(axes: Any, row: Row, k: int) -> None:
    """Draw the prices of a row on line k; levels of one price share a dot, in brackets those that are not sure."""
    dots: dict[float, list[tuple[str, Price]]] = {}
    for level, price in zip(LEVELS, row.prices, strict=True):
        if price:
            dots.setdefault(price.cost, []).append((f"{level:g}", price))
    if not dots:
        return
    axes.plot([min(dots), max(dots)], [k, k], "-", color="0.8", lw=1.2, zorder=1)
    before, above, places = 0.0, True, [*sorted(dots), float("inf")]
    for after, (at, found) in zip(places[1:], sorted(dots.items()), strict=True):
        sure = [name for name, price in found if price.sure]
        words = [*sure, *(f"({name})" for name, price in found if not price.sure)]
        colour = colour_of(found[0][1].scheme, 0)
        axes.plot(at, k, "o", ms=7, color=colour, mfc=colour if sure else "white", zorder=2)
        above = not above if before and at < before * 10**NEAR else True
        axes.annotate(
            ", ".join(words) + " %", (at, k), xytext=(0, 6 if above else -14), textcoords="offset points",
            ha="right" if above and after < at * 10**NEAR else "center", fontsize=8,
        )  # fmt: skip
        before = at
