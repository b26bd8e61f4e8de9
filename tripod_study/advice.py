"""What a study's numbers say in a few sentences: what to take, what `--accuracy` takes, and which knob pays."""

from collections.abc import Mapping, Sequence
from typing import Any

from tripod_study.accuracy.margins import margins
from tripod_study.front import LEVELS


def advice(result: Mapping[str, Any]) -> list[str]:
    """Return sentences: the cheapest setting for each accuracy, what `--accuracy` takes, and which knob pays."""
    sentences = [*_cheapest(result), *_promised(result)]
    own = (result.get("reference") or {}).get("own_error")
    if own and own > max(LEVELS.values()):
        closer = " Leave out --quick for a more accurate one." if result["quick"] else ""
        sentences.append(
            f"The reference itself may have an error of {_size(own)}.{closer} If that stays, the motion is "
            "chaotic or can end in several ways: shorten it (--duration), or name by [[marker]] a place that can be "
            "predicted."
        )
    if text := knob_that_pays(result):
        sentences.append(text)
    return sentences


def _cheapest(result: Mapping[str, Any]) -> list[str]:
    """Return which setting is the cheapest for each accuracy, and for which there is none."""
    points, cost = result["points"], "CPU " + result["cpu"]
    named: dict[int, list[str]] = {}
    for level, i in result["cheapest"].items():
        if i is not None:
            named.setdefault(i, []).append(level)
    sentences = [
        f"For an error of at most {_levels(levels)} the cheapest setting is {short(points[i]['settings'], result)}: it "
        f"takes {points[i]['cpu']:.2g} {cost}."
        for i, levels in named.items()
    ]
    missing = [level for level, i in result["cheapest"].items() if i is None]
    if missing:
        bounds = [p["bound"] for p in points if p["bound"] is not None]
        best = f"; the most accurate setting has an error of up to {_size(min(bounds))}" if bounds else ""
        sentences.append(f"No setting here has an error of at most {_percent(missing[0])}{best}.")
    return sentences


def _promised(result: Mapping[str, Any]) -> list[str]:
    """Return why `--accuracy` takes a setting with a smaller error than it is given; nothing where none counts."""
    if all(i is None for i in result["cheapest"].values()):
        return []
    quantities = [q for k, q in enumerate(result["quantities"]) if k == 0 or q["promised"]]
    factors = margins(result["study"], len(quantities))
    command = "ik" if result["study"] == "ik" else "run"
    cases = "poses" if result["cpu"] == "s per solve" else "motions"
    others = [f", {factor:g} for {q['what']}" for factor, q in zip(factors[1:], quantities[1:], strict=True)]
    return [
        f"`tripod {command} --accuracy` takes a more accurate setting than these: errors in other {cases} may be "
        f"{factors[0]:g} times as large (this is the margin{''.join(others)}), so for 5 % it wants at most "
        f"{5 / factors[0]:.2g} % here."
    ]


def knob_that_pays(result: Mapping[str, Any]) -> str:
    """Return in a sentence which knobs to turn, at the tightest accuracy that any setting reaches.

    The cheapest setting within it is held against its twins, which have one knob at its default: those that miss the
    accuracy say which knobs it takes; if there are none, the dearest says which knob saves most, if by a factor of 1.2
    or more. The knob that groups the points counts as taken, too, if no point with its default gets there.
    """
    level = next((x for x in reversed(LEVELS) if result["cheapest"][x] is not None), None)
    if level is None:
        return ""
    points, allowed = result["points"], LEVELS[level]
    best = points[result["cheapest"][level]]
    needed, gains = [], []
    for knob in result["knobs"]:
        field, name = knob["field"], knob["name"]
        value, default = best["settings"][field], result["default"][field]
        if value == default:
            continue
        twin = next((p for p in points if p["settings"] == {**best["settings"], field: default}), None)
        others = [p for p in points if p["settings"][field] == default]
        if twin and twin["bound"] is not None:
            if twin["bound"] > allowed:
                needed.append(
                    f"{name} {_value(value)} (with {_value(default)} the error may be {_size(twin['bound'])})"
                )
            else:
                gains.append((twin["cpu"] / best["cpu"], name, value, default))
        elif field == result["group"] and all(p["bound"] is None or p["bound"] > allowed for p in others):
            needed.append(
                f"{name} {_value(value)} (no setting with {name} {_value(default)} is accurate enough)"
            )
    if needed:
        return f"An error of at most {_percent(level)} needs {' and '.join(needed)}."
    if gains and max(g[0] for g in gains) >= 1.2:
        ratio, name, value, default = max(gains, key=lambda g: g[0])
        return (
            f"What saves most time is {name}: for an error of at most {_percent(level)}, {name} {_value(default)} "
            f"takes {ratio:.2g} times as long as {name} {_value(value)}."
        )
    return ""


def short(settings: Mapping[str, Any], result: Mapping[str, Any]) -> str:
    """Return a point's settings in few words: what the study is about, and what is not as by default."""
    always = {result["group"], "mesh.level", "dt"}
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


def _size(error: float) -> str:
    """Return a relative error as people write it, such as `230 %`."""
    return f"{float(f'{100 * error:.3g}'):g} %"


def _levels(levels: Sequence[str]) -> str:
    """Return accuracies in words, such as `10, 5 and 1 %`."""
    *first, last = [level.rstrip("%") for level in levels]
    return f"{', '.join(first)} and {last} %" if first else f"{last} %"


def _percent(level: str) -> str:
    return level.replace("%", " %")
