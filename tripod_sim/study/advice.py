"""What a study's numbers say in two sentences: what to take, and which knob pays."""

from collections.abc import Mapping, Sequence
from typing import Any

from tripod_sim.study.front import LEVELS


def advice(result: Mapping[str, Any]) -> list[str]:
    """Return sentences: the cheapest setting for each accuracy, and which knob pays against its default."""
    points, cost = result["points"], _unit(result["cpu"])
    named: dict[int, list[str]] = {}
    for level, i in result["cheapest"].items():
        if i is not None:
            named.setdefault(i, []).append(level)
    missing = [level for level, i in result["cheapest"].items() if i is None]
    parts = [
        f"within {' and '.join(_percent(x) for x in levels)}: {short(points[i]['settings'], result)} "
        f"({points[i]['cpu']:.2g} {cost})"
        for i, levels in named.items()
    ]
    if missing:
        parts.append(f"no setting is surely within {_percent(missing[0])}")
    first = "; ".join(parts)
    sentences = [f"Cheapest {first}." if named else f"{first[:1].upper()}{first[1:]}."]
    if text := knob_that_pays(result):
        sentences.append(text)
    return sentences


def knob_that_pays(result: Mapping[str, Any]) -> str:
    """Return in a sentence which knobs to turn, at the tightest accuracy that any setting reaches.

    Those whose default reaches it at no price; if there are none, the one whose best value saves most against its
    default, if that is a factor of 1.2 or more.
    """
    level = next((x for x in reversed(LEVELS) if result["cheapest"][x] is not None), None)
    if level is None:
        return ""
    best = result["points"][result["cheapest"][level]]["settings"]
    needed, gains = [], []
    for knob in result["knobs"]:
        prices = _prices(result["points"], knob["field"], LEVELS[level])
        value, default = best[knob["field"]], result["default"][knob["field"]]
        if value == default:
            continue
        if default not in prices:
            needed.append(
                f"{knob['name']} {_value(value)} (the default, {_value(default)}, never gets there)"
            )
        else:
            gains.append((prices[default] / prices[value], knob["name"], value, default))
    if needed:
        return f"Within {_percent(level)} it takes {' and '.join(needed)}."
    if gains and max(g[0] for g in gains) >= 1.2:
        ratio, name, value, default = max(gains, key=lambda g: g[0])
        return (
            f"The knob that pays most is {name}: within {_percent(level)}, {_value(value)} is {ratio:.2g} times as "
            f"cheap as the default, {_value(default)}."
        )
    return ""


def _prices(points: Sequence[Mapping[str, Any]], field: str, allowed: float) -> dict[Any, float]:
    """Return the least cost within `allowed` for each value of a field that reaches it."""
    prices: dict[Any, float] = {}
    for p in points:
        if p["bound"] is not None and p["bound"] <= allowed:
            value = p["settings"][field]
            prices[value] = min(p["cpu"], prices.get(value, p["cpu"]))
    return prices


def short(settings: Mapping[str, Any], result: Mapping[str, Any]) -> str:
    """Return a point's settings in few words: what the study is about, and what is not as by default."""
    always = {result["group"], result["order_knob"], "mesh.level"}
    words = [
        _word(knob, settings[knob["field"]])
        for knob in result["knobs"]
        if len(knob["values"]) > 1
        and (knob["field"] in always or settings[knob["field"]] != result["default"][knob["field"]])
    ]
    return ", ".join(words)


def _word(knob: Mapping[str, Any], value: Any) -> str:
    text = _value(value)
    return text if isinstance(value, str) and value not in {"off", "auto"} else f"{knob['name']} {text}"


def _value(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _percent(level: str) -> str:
    return level.replace("%", " %")


def _unit(cpu: str) -> str:
    return "CPU " + cpu
