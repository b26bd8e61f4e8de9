"""What docs/accuracy.md begins with: what 10, 5, 2, 1 and 0.1 % cost, of each study and of the other simulators.

One picture and one table, from what is stored: the studies in tripod_sim/studies and the rows of docs/peers.json, whose
times are scaled to the machine of the studies by the product that both are calibrated with; for `accuracy_docs.py`.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks import peers
from benchmarks.peers_report import cost
from tripod_bringup.study_plot import colour_of
from tripod_host.writing import replaced
from tripod_sim.study.advice import short
from tripod_sim.study.front import cheapest

LEVELS = (10, 5, 2, 1, 0.1)
"""Errors [%]."""

NAMES = {
    "pendulum": "Pendulum of ten nodes",
    "cloth": "Cloth, hung at two corners",
    "drape": "Cloth falls on a sphere",
    "silicone": "Silicone, let go",
    "tripod_dynamic": "Tripod in motion",
    "maze": "Ball in the maze",
    "tripod_static": "Tripod at rest",
    "ik": "Inverse kinematics",
}
"""By study."""

CASES = {
    "cantilever swing": "Cantilever swings",
    "cloth": "Cloth, the same for all",
    "cantilever rest": "Cantilever sags",
    "y L1": "Tripod's silicone sags",
    "y L2": "Tripod's silicone turned",
}
"""Of peers.py."""

MOTIONS = ("cantilever swing", "cloth")
"""Those with a simulated time."""

NEAR = 0.15
"""Two dots nearer than this, in powers of ten, have their words on two sides."""

STATICS = "static"
"""In place of a scheme where there is none."""

HEAD = (
    f"| | {' | '.join(f'{level:g} %' for level in LEVELS)} | the default errs by, and costs |",
    "|---|" + "---|" * (len(LEVELS) + 1),
)


@dataclass(frozen=True)
class Price:
    """What an accuracy costs.

    Attributes:
        cost: CPU time over simulated time, or of a solve [s].
        scheme: Time integrator, or `STATICS`.
        sure: Whether the error and what the reference may err are within it together, not the error alone.
        setting: That costs it, in words.
    """

    cost: float
    scheme: str
    sure: bool
    setting: str = field(default="", compare=False)


@dataclass(frozen=True)
class Row:
    """What each of `LEVELS` costs of a problem, None where nothing is so exact.

    Attributes:
        name: Of the problem, and of the simulator where it is not this one alone.
        solves: Whether costs are of solves, not of simulated seconds.
        prices: One for each of `LEVELS`.
        default: What the scene as it is errs by, and costs; empty where nothing is the default.
        peer: Another simulator than this one.
        own: What the reference may err, relative.
    """

    name: str
    solves: bool
    prices: tuple[Price | None, ...]
    default: str = ""
    peer: str = ""
    own: float = 0.0


def of_study(result: Mapping[str, Any]) -> Row:
    """Return the row of a study; an error is the largest of all that it promises."""
    beside = [q["name"] for q in result["quantities"] if q.get("promised")]
    points = [p for p in result["points"] if p["error"] is not None]
    solves = result["cpu"] == "s per solve"

    def largest(p: Mapping[str, Any], *, sure: bool) -> float:
        others = (p["errors"][name]["relative"] + sure * p["errors"][name]["own"] for name in beside)
        return float(max(p["bound"] if sure else p["error"], *others, 0.0))

    def scheme(p: Mapping[str, Any]) -> str:
        return STATICS if solves else str(p["settings"].get("inertia.scheme", "implicit_euler"))

    default = next((p for p in points if p["label"] == "the default"), None)
    return Row(
        NAMES[result["study"]],
        solves,
        _prices(
            points,
            lambda p, sure: largest(p, sure=sure),
            lambda p: p["cpu"],
            scheme,
            lambda p: short(p["settings"], result),
        ),
        f"{100 * largest(default, sure=False):.2g} %: {amount(default['cpu'], solves)}" if default else "",
        own=(result["reference"] or {}).get("own_error") or 0.0,
    )


def of_peers(stored: Mapping[str, Any], product: float) -> list[Row]:
    """Return the rows of the cases of peers.py, one for each simulator.

    Args:
        stored: The file of peers.py.
        product: CPU time of the product that costs are scaled to [s].
    """
    rows = [peers.Row(**row) for row in stored["rows"]]
    found = []
    for case, title in CASES.items():
        solves = case not in MOTIONS
        own = 0.01 * (stored["references"].get(case) or {"uncertainty": 0.0})["uncertainty"]
        for peer in peers.PEERS:
            good = [r for r in rows if (r.case, r.peer) == (case, peer) and r.error is not None]
            prices = _prices(
                good,
                lambda r, sure, own=own: 0.01 * r.error + sure * own,
                lambda r: (cost(r) or 0.0) * product / r.calibration,
                lambda r, solves=solves: STATICS if solves else r.setting.partition(",")[0],
                lambda r: r.setting,
            )
            other = "" if peer == "tripod" else peer
            found.append(Row(f"{title}: {peer}", solves, prices, peer=other, own=own))
    return found


def _prices(
    points: Sequence[Any],
    error: Callable[[Any, bool], float],
    price: Callable[[Any], float],
    scheme: Callable[[Any], str],
    setting: Callable[[Any], str],
) -> tuple[Price | None, ...]:
    """Return the least price of each of `LEVELS`: surely within it, else by the error alone."""
    costs = [price(p) for p in points]
    found: list[Price | None] = []
    for level in LEVELS:
        for sure in (True, False):
            k = cheapest([error(p, sure) for p in points], costs, level / 100)
            if k is not None:
                break
        found.append(None if k is None else Price(costs[k], scheme(points[k]), sure, setting(points[k])))
    return tuple(found)


def amount(value: float, solves: bool) -> str:
    """Return a cost for people, in two digits: of a solve in milliseconds, else as times real time."""
    value *= 1e3 if solves else 1.0
    text = f"{value:.2g}" if value < 99.5 else f"{value:.0f}"
    text = f"{float(text):.0e}" if 0 < value < 1e-5 else f"{float(text):.7f}".rstrip("0").rstrip(".")
    return f"{text} ms" if solves else text


def rows_of(results: Sequence[Mapping[str, Any]]) -> list[Row]:
    """Return all rows, studies first."""
    product = median(r["machine"]["calibration"] for r in results)
    stored = json.loads(peers.STORE.read_text(encoding="utf-8"))
    return [*(of_study(r) for r in results), *of_peers(stored, product)]


def table(rows: Sequence[Row]) -> list[str]:
    """Return the table as Markdown, in motion first; simulators that reach no level of a problem have no row."""
    lines = list(HEAD)
    for solves, title in (
        (False, "**In motion: CPU time over simulated time; 1 is real time, 0.1 ten times as fast**"),
        (True, "**At rest: CPU time of a solve**"),
    ):
        lines.append(f"| {title} |" + " |" * (len(LEVELS) + 1))
        for row in rows:
            if row.solves == solves and any(row.prices):
                cells = [_cell(price, solves) for price in row.prices]
                lines.append(f"| {row.name} | {' | '.join(cells)} | {row.default} |")
    return lines


def _cell(price: Price | None, solves: bool) -> str:
    if price is None:
        return "-"
    text = amount(price.cost, solves)
    return text if price.sure else f"({text})"


def missing(rows: Sequence[Row]) -> str:
    """Return in a sentence which simulators reach no level of a problem; empty where all reach one."""
    left: dict[str, list[str]] = {}
    for row in rows:
        if not any(row.prices):
            problem, _, peer = row.name.partition(": ")
            left.setdefault(peer, []).append(problem)
    if not left:
        return ""
    words = "; ".join(f"{peer} ({', '.join(problems)})" for peer, problems in left.items())
    return f"Not within {LEVELS[0]} % at any setting: {words}."


def unsure(rows: Sequence[Row]) -> str:
    """Return in a sentence where what the reference may err decides; empty where it does nowhere."""
    words = [
        f"{row.name} {100 * row.own:.2g} %"
        for row in rows
        if any(price and not price.sure for price in row.prices)
    ]
    if not words:
        return ""
    return (
        "In brackets: a setting whose error is within that, but not together with what the reference itself may err, "
        f"so that nobody can count on it ({', '.join(words)})."
    )


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw the picture: a line for each problem, a dot for each accuracy, at its price, in the colour of its scheme."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - only where a picture is wanted

    shown = [[row for row in rows if row.solves == solves and any(row.prices)] for solves in (False, True)]
    figure = Figure(figsize=(10.5, 1.9 + 0.36 * sum(map(len, shown))), layout="constrained")
    panels = figure.subplots(2, 1, height_ratios=[len(s) + 1 for s in shown])
    schemes: dict[str, None] = {}
    for axes, own in zip(panels, shown, strict=True):
        for k, row in enumerate(own):
            _dots(axes, row, k)
            schemes |= dict.fromkeys(p.scheme for p in row.prices if p and not row.peer)
        axes.set_yticks(range(len(own)), [row.name for row in own], fontsize=8.5)
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
        "real time", (1.0, -0.75), xytext=(4, -2), textcoords="offset points", fontsize=8.5, va="top"
    )
    motion.set_xlabel("in motion: CPU time over simulated time; left of the line is faster than real time")
    rest.set_xlabel("at rest: CPU time of a solve [s]")
    for scheme in schemes:
        motion.plot([], [], "o", color=colour_of(scheme, 0), label=scheme)
    motion.plot([], [], "D", color="0.55", label="another simulator")
    motion.plot([], [], "o", color="0.3", mfc="none", label="(level): within it by the error alone")
    figure.suptitle("What an error of 10, 5, 2, 1 and 0.1 % costs", fontsize=12)
    figure.legend(loc="outside lower center", ncols=4, fontsize=8)
    with replaced(path) as file:
        figure.savefig(file, format="png", dpi=110)


def _dots(axes: Any, row: Row, k: int) -> None:
    """Draw the prices of a row on line k; levels of one price share a dot, in brackets those that are not sure."""
    dots: dict[float, list[tuple[str, Price]]] = {}
    for level, price in zip(LEVELS, row.prices, strict=True):
        if price:
            dots.setdefault(price.cost, []).append((f"{level:g}", price))
    axes.plot([min(dots), max(dots)], [k, k], "-", color="0.8", lw=1.2, zorder=1)
    before, above = 0.0, True
    for at, found in sorted(dots.items()):
        sure = [name for name, price in found if price.sure]
        words = [*sure, *(f"({name})" for name, price in found if not price.sure)]
        colour = "0.55" if row.peer else colour_of(found[0][1].scheme, 0)
        axes.plot(
            at, k, "D" if row.peer else "o", ms=6.5, color=colour, mfc=colour if sure else "white", zorder=2
        )
        above = not above if before and at < before * 10**NEAR else True
        axes.annotate(
            ", ".join(words), (at, k), xytext=(0, 5 if above else -12), textcoords="offset points", ha="center",
            fontsize=7.5,
        )  # fmt: skip
        before = at
