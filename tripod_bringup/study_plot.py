"""The picture of a study: error over cost, the front marked; beside it error over the step where orders are fitted."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tripod_host.writing import replaced

COLOURS = {
    "implicit_euler": "#0072b2", "bdf2": "#d55e00", "tr_bdf2": "#009e73", "semi_implicit_euler": "#cc79a7",
    "explicit_euler": "#999933", "rk4": "#e69f00", "static": "#000000",
    "h8_modes": "#332288", "h20": "#117733", "h8_mean": "#44aa99", "h27": "#ddcc77", "t4": "#aa4499", "t10": "#88ccee",
    "h8": "#882255",
}  # fmt: skip
"""Of time integrators and elements, the same in all pictures."""

OTHERS = ("#6699cc", "#cc6677", "#b2a000", "#555555", "#997700", "#ee99aa", "#004488", "#bbbbbb")
"""Of what has none of its own."""

MARKERS = "osD^vP*X"

Result = Mapping[str, Any]


def draw(result: Result, path: Path) -> None:
    """Draw a study into `path`. Raises ModuleNotFoundError without matplotlib."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - only where a picture is wanted

    orders = bool(result["order_knob"])
    figure = Figure(figsize=(12.5 if orders else 8.0, 5.4), layout="constrained")
    axes = figure.subplots(1, 2 if orders else 1, squeeze=False)[0]
    _work_precision(axes[0], result)
    if orders:
        _steps(axes[1], result)
    figure.suptitle(result["title"] + (" (quick)" if result["quick"] else ""), fontsize=11)
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=4 if orders else 3, fontsize=7.5)
    with replaced(path) as file:
        figure.savefig(file, format="png", dpi=110)


def _styles(result: Result) -> dict[Any, tuple[str, str]]:
    """Return colour and marker for each value of the field that groups the points."""
    values = list(dict.fromkeys(p["settings"][result["group"]] for p in result["points"]))
    return {v: (colour_of(v, i), MARKERS[i % len(MARKERS)]) for i, v in enumerate(values)}


def colour_of(value: Any, i: int) -> str:
    """Return the colour of a value, the one of number `i` among those that have none of their own."""
    return COLOURS.get(value, OTHERS[i % len(OTHERS)])


def _height(point: Result) -> float:
    """Return at which error a point is drawn [%]: not below what the reference can tell."""
    return float(100 * max(point["error"], 2 * point["own_error"], 1e-14))


def _work_precision(axes: Any, result: Result) -> None:
    from tripod_study.advice import short  # noqa: PLC0415

    points = [p for p in result["points"] if p["error"] is not None]
    grouping = next(k for k in result["knobs"] if k["field"] == result["group"])
    for value, (colour, marker) in _styles(result).items():
        own = [p for p in points if p["settings"][result["group"]] == value]
        if own:
            axes.loglog(
                [p["cpu"] for p in own], [_height(p) for p in own], marker, color=colour, ms=5, alpha=0.75,
                label=_word(grouping, value),
            )  # fmt: skip
    best = [result["points"][i] for i in result["front"]]
    axes.loglog(
        [p["cpu"] for p in best], [_height(p) for p in best], "-", color="0.2", lw=1.2, label="best settings"
    )
    if points:
        heights, costs = [_height(p) for p in points], [p["cpu"] for p in points]
        axes.set_ylim(min(heights) / 3, max(heights) * 3)
        axes.set_xlim(min(costs) / 3, max(costs) * 2)
    for i, levels in _fastest(result).items():
        _ring(axes, result["points"][i], levels, short(result["points"][i]["settings"], result))
    if missing := [level.rstrip("%") for level, i in result["cheapest"].items() if i is None]:
        axes.plot([], [], " ", label=f"none is surely within {', '.join(missing)} %")
    for k, p in enumerate(p for p in points if p["label"]):
        _note(axes, p, 34 + 18 * k)
    for level in (10, 5, 1, 0.1):
        axes.axhline(level, color="0.8", lw=0.8, zorder=0)
    if result["reference"] and result["reference"]["own_error"]:
        axes.axhspan(1e-12, 200 * result["reference"]["own_error"], color="0.93", zorder=0)
    if not result["cpu"].endswith("solve") and points and max(costs) > 0.5:
        axes.axvline(1.0, color="0.2", lw=1.2, ls="--", zorder=0)
        axes.annotate(
            "real time", (1.0, 1.0), xycoords=("data", "axes fraction"), xytext=(-3, -4), textcoords="offset points",
            rotation=90, ha="right", va="top", fontsize=7.5,
        )  # fmt: skip
    axes.set(
        xlabel=f"computing time [{result['cpu']}]", ylabel=f"error of {result['quantities'][0]['name']} [%]"
    )
    axes.grid(visible=True, which="major", alpha=0.25)
    axes.tick_params(axis="x", which="minor", labelsize=6, labelrotation=45)


def _word(knob: Mapping[str, Any], value: Any) -> str:
    """Return a knob's value for a legend, with the knob's name where it is a number."""
    return value if isinstance(value, str) else f"{knob['name']} {value}"


def _fastest(result: Result) -> dict[int, list[str]]:
    """Return the accuracies [%] for which a point is the fastest, by the point's index, cheapest first."""
    found: dict[int, list[str]] = {}
    for level, i in result["cheapest"].items():
        if i is not None:
            found.setdefault(i, []).append(level.rstrip("%"))
    return found


def _ring(axes: Any, point: Result, levels: Sequence[str], setting: str) -> None:
    """Mark the fastest point within `levels` [%], named in the legend; left of and below the front nothing else is."""
    within = f"{', '.join(levels)} %"
    at = (point["cpu"], _height(point))
    axes.loglog(
        *at, "o", ms=11, mfc="none", mec="0.1", mew=1.3, zorder=4, label=f"fastest within {within}: {setting}"
    )
    axes.annotate(
        within, at, xytext=(-7, -5), textcoords="offset points", ha="right", va="top", fontsize=8,
        fontweight="bold", zorder=5,
    )  # fmt: skip


def _note(axes: Any, point: Result, above: int) -> None:
    """Write a point's label so many points above it, above all markers, with a line that leads to it."""
    low, high = axes.get_xlim()
    right = point["cpu"] > (low * high) ** 0.5
    axes.annotate(
        point["label"], (point["cpu"], _height(point)), xytext=(-20 if right else 20, above),
        textcoords="offset points",
        ha="right" if right else "left", fontsize=8, zorder=5, color="0.1",
        bbox={"facecolor": "white", "edgecolor": "0.6", "lw": 0.6, "alpha": 0.9, "pad": 1.5},
        arrowprops={"arrowstyle": "-", "color": "0.5", "lw": 0.8, "ls": ":", "shrinkA": 0, "shrinkB": 3},
    )  # fmt: skip


def _steps(axes: Any, result: Result) -> None:
    """Draw the error over the order knob, one line for each family that has a fitted order; a colour is named once."""
    knob, name = result["order_knob"], result["order_quantity"]
    styles, named = _styles(result), set[Any]()
    for family in sorted(result["orders"], key=lambda f: str(f["settings"][result["group"]])):
        own = [
            p for p in result["points"]
            if name in p["errors"] and all(p["settings"][k] == v for k, v in family["settings"].items())
        ]  # fmt: skip
        own.sort(key=lambda p: p["settings"][knob])
        value = family["settings"][result["group"]]
        colour, marker = styles[value]
        axes.loglog(
            [p["settings"][knob] for p in own],
            [100 * max(p["errors"][name]["relative"], 1e-12) for p in own],
            marker + "-", color=colour, ms=4, lw=0.9, alpha=0.8,
            label=None if value in named else _orders(value, result),
        )  # fmt: skip
        named.add(value)
    axes.set(
        xlabel=f"length of a time step, {knob} [s]" if knob == "dt" else f"{knob} [s]",
        ylabel=f"error of {name} [%]",
    )
    axes.grid(visible=True, which="major", alpha=0.25)
    if result["orders"]:
        axes.legend(loc="best", fontsize=6.5)


def _orders(value: Any, result: Result) -> str:
    """Return a value of the knob that colours, and the orders that were fitted of it."""
    grouping = next(k for k in result["knobs"] if k["field"] == result["group"])
    orders = [f["order"] for f in result["orders"] if f["settings"][result["group"]] == value]
    ends = dict.fromkeys((f"{min(orders):.1f}", f"{max(orders):.1f}"))
    return f"{_word(grouping, value)}: order {' to '.join(ends)}"
