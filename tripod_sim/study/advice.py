"""What a study's numbers say in two sentences: what to take, and which knob pays."""

from collections.abc import Mapping, Sequence
from typing import Any

from tripod_sim.study.front import LEVELS


def advice(result: Mapping[str, Any]) -> list[str]:
    """Return sentences: the cheapest setting for each accuracy, and the knob that costs most if it is set wrongly."""
    points, cost = result["points"], _unit(result["cpu"])
    named: dict[int, list[str]] = {}
    for level, i in result["cheapest"].items():
        if i is not None:
            named.setdefault(i, []).append(level)
    missing = [level for level, i in result["cheapest"].items() if i is None]
    parts = [
        f"{' and '.join(_percent(x) for x in levels)}: {short(points[i]['settings'], result)} "
        f"({points[i]['cpu']:.2g} {cost})"
        for i, levels in named.items()
    ]
    sentences = [f"Cheapest within {'; within '.join(parts)}."] if parts else []
    if missing:
        sentences.append(f"No point is surely within {_percent(missing[0])}.")
    if text := knob_that_pays(result):
        sentences.append(text)
    return sentences


def knob_that_pays(result: Mapping[str, Any]) -> str:
    """Return in a sentence which knob matters most, at the tightest accuracy that two of its values reach.

    For a knob and an accuracy, each value has its cheapest point within; the knob's worth is the ratio of the most to
    the least of these. A value that reaches the accuracy at no price is named instead, if no ratio is 1.5.
    """
    best: tuple[float, str] = (1.5, "")
    for level in reversed(LEVELS):
        for knob in result["knobs"]:
            prices = _prices(result["points"], knob["field"], LEVELS[level])
            if len(prices) < 2:
                continue
            least, most = min(prices, key=prices.__getitem__), max(prices, key=prices.__getitem__)
            ratio = prices[most] / prices[least]
            if ratio > best[0]:
                never = [v for v in knob["values"] if v not in prices]
                tail = f"; {_values(never)} never gets there" if never and len(never) <= 3 else ""
                best = (
                    ratio,
                    f"The knob that pays most is {knob['name']}: within {_percent(level)}, {_value(least)} is "
                    f"{ratio:.2g} times as cheap as {_value(most)}{tail}.",
                )
        if best[1]:
            break
    return best[1]


def _prices(points: Sequence[Mapping[str, Any]], field: str, allowed: float) -> dict[Any, float]:
    """Return the least cost within `allowed` for each value of a field that reaches it."""
    prices: dict[Any, float] = {}
    for p in points:
        if p["bound"] is not None and p["bound"] <= allowed:
            value = p["settings"][field]
            prices[value] = min(p["cpu"], prices.get(value, p["cpu"]))
    return prices


def short(settings: Mapping[str, Any], result: Mapping[str, Any]) -> str:
    """Return a point's settings in few words: knobs that all points share are left out."""
    words = []
    for knob in result["knobs"]:
        if len(knob["values"]) > 1:
            words.append(_word(knob, settings[knob["field"]]))
    return ", ".join(words)


def _word(knob: Mapping[str, Any], value: Any) -> str:
    text = _value(value)
    return text if isinstance(value, str) and value not in {"off", "auto"} else f"{knob['name']} {text}"


def _value(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _values(values: Sequence[Any]) -> str:
    return " or ".join(_value(v) for v in values)


def _percent(level: str) -> str:
    return level.replace("%", " %")


def _unit(cpu: str) -> str:
    return "CPU " + cpu
