"""What the effects of each shipped scene cost a step, and what absent ones would: writes the table that pages show.

It is tripod_sim/figures/effect_costs.json. An effect that a scene has costs what its own stages of a step take (see
`tripod explain`); one that has none, such as obstacles, which contact meets, is told as not known. An absent one costs
the difference between steps with it, with its defaults, and without, measured in turn. `--only SCENE` measures one
scene and keeps the others; run it on a quiet machine: the table keeps the time of a product, by which it is scaled.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
from tripod_sim.effects import EFFECTS, named
from tripod_sim.errors import SceneError, StepError
from tripod_sim.explain.report import Explanation, explain
from tripod_sim.scene_file import scene_names

FILE = Path(__file__).parents[1] / "tripod_sim" / "figures" / "effect_costs.json"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", nargs="*", default=None, metavar="SCENE", help="measure these scenes alone")
    chosen = parser.parse_args().only
    table: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {"scenes": {}}
    now = calibration()
    scale = (
        1.0 if chosen is None else table.setdefault("calibration", now) / now
    )  # kept with the scenes that are kept
    table["calibration"] = now * scale
    for name in scene_names() if chosen is None else chosen:
        try:
            table["scenes"][name] = rows(explain(name), scale)
        except (SceneError, StepError) as error:
            print(f"{name}: {error}", file=sys.stderr)
            continue
        FILE.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
        print(f"{name}: {len(table['scenes'][name])} effects", flush=True)


def rows(found: Explanation, scale: float) -> dict[str, dict[str, Any]]:
    """Return what each effect costs [s], by name, `scale` times what was measured."""
    made: dict[str, dict[str, Any]] = {}
    for name in named(found.scene):
        stages = EFFECTS[name].steps
        own = [s.seconds for s in found.stages if stages and s.name.startswith(stages)]
        why = "" if own else "it has no stage of a step of its own"
        made[name] = {
            "on": True,
            "cost": _short(scale * sum(own)) if own else None,
            "noise": 0.0,
            "why_not": why,
        }
    for cost in found.absent:
        seconds = None if cost.seconds is None else _short(scale * cost.seconds)
        made[cost.effect] = {
            "on": False,
            "cost": seconds,
            "noise": _short(scale * cost.noise),
            "why_not": cost.why_not,
        }
    return made


def _short(seconds: float) -> float:
    return float(f"{seconds:.3g}")


if __name__ == "__main__":
    main()
