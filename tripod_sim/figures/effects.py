"""What the effects of a scene cost, and what those would that it does not name, by a stored table.

`benchmarks/effect_costs.py` measures them for each shipped scene and writes `effect_costs.json`. Times are of the
machine that measured; with the time of a product there and here they are told for this one.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from tripod_sim.effects import EFFECTS, meaning
from tripod_sim.scene import Scene

FILE = "effect_costs.json"


@dataclass(frozen=True)
class EffectFigure:
    """What an effect costs.

    Attributes:
        name: Of the effect.
        on: Whether the scene has it.
        meaning: What it is, in one sentence.
        cost: Of a step, or what it would add to one [s]; None where that is not known.
        noise: Of that [s].
        why_not: Why it has no time of its own or cannot be switched on, in one sentence; else empty.
    """

    name: str
    on: bool
    meaning: str
    cost: float | None = None
    noise: float = 0.0
    why_not: str = ""


def effect_figures(source: str, scene: Scene, speed: float | None = None) -> list[EffectFigure]:
    """Return all effects with their costs in a scene, those it has first.

    Args:
        source: Name of the shipped scene, or path of a file, of which nothing is stored.
        scene: As it is simulated.
        speed: CPU time of the product on this machine [s]; None leaves the times of the machine that measured.
    """
    table = stored()
    rows = table["scenes"].get(source, {})
    scale = speed / table["calibration"] if speed and table["calibration"] else 1.0
    found = []
    for name in EFFECTS:
        on = bool(getattr(scene, name))
        row = rows.get(name)
        if row is None or row["on"] != on:
            found.append(EffectFigure(name, on, meaning(name)))
            continue
        cost = None if row["cost"] is None else row["cost"] * scale
        found.append(EffectFigure(name, on, meaning(name), cost, row["noise"] * scale, row["why_not"]))
    return sorted(found, key=lambda f: not f.on)


@cache
def stored() -> dict[str, Any]:
    """Return the stored table: `calibration` [s], and under `scenes`, by scene and effect, on, cost, noise, why_not."""
    text = (resources.files("tripod_sim") / "figures" / FILE).read_text(encoding="utf-8")
    table: dict[str, Any] = json.loads(text)
    return table


def effect_lines(figures: Sequence[EffectFigure]) -> list[tuple[str, str]]:
    """Return the effects that are on, and those that are off, as names and texts for people.

    What is not known costs no question mark: the name stands alone, and one line says who measures it.
    """
    on = ", ".join(f"{f.name} {_microseconds(f)}".rstrip() for f in figures if f.on)
    known = [f for f in figures if not f.on and f.cost is not None]
    more, less = (
        ", ".join(f"{f.name} {_microseconds(f)}" for f in known if _saves(f) == saves)
        for saves in (False, True)
    )
    if any(f.on and f.cost is None and not f.why_not for f in figures):
        on += " (without a time: not stored for this scene; tripod explain SCENE measures it)"
    lines = [("effects", on or "none"), ("would add", more), ("would save", less)]
    return [line for line in lines if line[1]]


def _saves(figure: EffectFigure) -> bool:
    return figure.cost is not None and figure.cost < -figure.noise


def _microseconds(figure: EffectFigure) -> str:
    """Return a cost for people, without a sign; a difference within its noise as at most that, an unknown one not."""
    if figure.cost is None:
        return ""
    cost = abs(figure.cost)
    told = figure.on or cost > figure.noise
    seconds = cost if told else figure.noise
    return ("" if told else "under ") + (
        f"{1e3 * seconds:.3g} ms" if seconds >= 1e-3 else f"{1e6 * seconds:.3g} us"
    )
