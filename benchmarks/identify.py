"""Do the intervals of `tripod identify` hold? Synthetic Tripods whose values are known, found again from noisy poses.

Each robot has a modulus, zeros of its servos and a slide of its own, drawn at random; it carries a weight of 100 g and
shows 30 poses, computed with another mesh and another element than the model's, with errors of 0.3 mm and 0.5 degrees.
The model begins at the values of the scene `tripod`, on mesh level 13, and is asked for all of these, and for the mass
of piece and weight besides: poses at rest cannot tell all three from each other, since only their ratios count. That
must be said. Counted is how often the 90 % intervals, by noise alone and with what other meshes foretell, hold the
truth; and the CPU time of one identification. Identification compares the model with `h20`, too, of which the robots
are; `--truth tetrahedra` makes them of an element that it does not know (`t10`), `--truth level` with the model's own
on a finer mesh. All these have an error of their own, about as large as the model's. A body of silicone has none:
`--truth fine` halves the edges of the first.

`--motion`: instead of poses each robot shows a motion of 0.8 s, its arms going quickly to four poses where the
disc swings, 100 rows a second, computed with half the model's steps; its damping is asked for, its weight known.

Writes a line of JSON for each robot, goes on where it stopped, and prints the table; `--robots 200` is all of it.
"""

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.doc_parts import write_part
from benchmarks.stored_rows import store, stored
from tripod_host.arrays import FloatArray
from tripod_identify.csv_columns import Channel
from tripod_identify.errors import FitError
from tripod_identify.identify import Wanted, identify
from tripod_identify.measured import Measured
from tripod_identify.model import Told, plainly, predict
from tripod_identify.parameters import parameters, told
from tripod_sim import StepError, load_scene
from tripod_sim.scene import Scene
from tripod_sim.tables.sets import Load, NodeSet

MODEL = ("servos.slide=0.02", "mesh.level=13")
TRUTHS = {
    "element": ("servos.slide=0.02", "mesh.level=8", "mesh.element=h27"),
    "fine": ("servos.slide=0.02", "mesh.level=8", "mesh.element=h27", "mesh.refine=1"),
    "tetrahedra": ("servos.slide=0.02", "mesh.level=8", "mesh.element=t10"),
    "level": ("servos.slide=0.02", "mesh.level=8"),
}
POSES, NOISE = 30, (3e-4, np.radians(0.5))
STANDS, STAND, MOVE, RATE = 4, 0.2, 0.06, 100.0
"""Of a motion: poses, time from one to the next, of it the time that arms take to get there [s]; rows a second."""
FLATTEST = (0.2, 0.65)
"""Least share of the working pose of poses, and of a motion, whose disc shall not snap through while it is flat."""
NAMES = ("material.young", "servos.zero", "servos.slide", "material.mass", "load.0.mass")
NAMES_OF_MOTION = ("material.young", "damping.stiffness", "servos.zero", "servos.slide")
RATIOS = {"material.young", "material.mass", "load.0.mass"}
CHANNELS = tuple(Channel("effector", axis, angle) for angle in (False, True) for axis in range(3))


def robot(words: tuple[str, ...]) -> Scene:
    """Return the Tripod with a weight on its disc."""
    disc = NodeSet("disc", axis=(0.0, 0.0, 1.0), radius=0.0075)
    return replace(load_scene("tripod", words), set=(disc,), load=(Load("disc", mass=0.1, share="even"),))


def with_values(scene: Scene, values: dict[str, float]) -> Told:
    """Return what is assumed of a robot with some values, by name."""
    wanted = parameters(scene, list(values))
    return told(plainly(scene), wanted, np.array([p.to_u(values[p.name]) for p in wanted]))


def drawn(seed: int, truth: str, moving: bool = False) -> tuple[dict[str, float], Measured]:
    """Return the values of a robot, and what it shows."""
    rng = np.random.default_rng(seed)
    values = {"material.young": 250e3 * float(np.exp(0.25 * rng.standard_normal()))}
    values |= {f"servos.zero.{i}": float(0.05 * rng.standard_normal()) for i in range(3)}
    values |= {"servos.slide": 0.02 + float(np.clip(2e-3 * rng.standard_normal(), -4e-3, 4e-3))}
    shown = STANDS if moving else POSES
    share = rng.uniform(FLATTEST[moving], 1.0, shown)
    angles = -1.4 * share[:, None] + rng.uniform(-0.3, 0.3, (shown, 3))
    times, words = None, TRUTHS[truth]
    if moving:
        values |= {"damping.stiffness": 5e-4 * float(np.exp(0.4 * rng.standard_normal()))}
        times, words = np.arange(round(STANDS * STAND * RATE) + 1) / RATE, (*words, "dt=0.001")
        angles = played(angles, times)
    assumed = with_values(robot(words), values)
    data = Measured(times, angles, None, CHANNELS, np.zeros((len(angles), len(CHANNELS))))
    sizes = [NOISE[c.angle] for c in CHANNELS]
    seen = predict(assumed, data, ()) + rng.standard_normal(data.values.shape) * sizes
    return values, replace(data, values=seen)


def played(stands: FloatArray, times: FloatArray) -> FloatArray:
    """Return the commands at `times` that go through poses, quickly and each in its turn, back to the first."""
    knots = np.concatenate([[i * STAND, i * STAND + MOVE] for i in range(len(stands))])
    ends = np.repeat(np.vstack([stands, stands[:1]]), 2, axis=0)[1:-1]
    return np.column_stack([np.interp(times, knots, column) for column in ends.T])


def one(seed: int, truth: str, moving: bool = False) -> dict:
    """Return what is found of a robot."""
    try:
        values, data = drawn(seed, truth, moving)
    except StepError as error:  # no robot: a pose that it cannot take
        return {"seed": seed, "skipped": str(error)}
    start = time.process_time()
    try:
        result = identify(robot(MODEL), data, (), Wanted(NAMES_OF_MOTION if moving else NAMES, propose=False))
    except (FitError, StepError) as error:
        return {"seed": seed, "failed": str(error), "cpu": time.process_time() - start}
    return {
        "seed": seed,
        "cpu": time.process_time() - start,
        "found": {
            f.parameter.name: [
                values.get(f.parameter.name),
                f.value,
                f.low,
                f.high,
                f.true,
                f.true_low,
                f.true_high,
            ]
            for f in result.found
        },
        "untold": {u.parameter.name: u.why for u in result.untold},
        "sigma": result.fit.sigma,
        "explained": result.left.explained,
        "mesh": result.mesh.size if result.mesh else None,
        "step": result.step.size if result.step else None,
        "outliers": len(result.fit.outliers),
    }


def table(rows: list[dict]) -> str:
    """Return the counts as a table in Markdown."""
    done = [r for r in rows if "found" in r]
    skipped, failed = (sum(k in r for r in rows) for k in ("skipped", "failed"))
    times = [r["cpu"] for r in done]
    lines = [
        f"{len(done)} robots; {failed} without a result, {skipped} whose poses had no rest; CPU time of an "
        f"identification {np.median(times):.1f} s median, {max(times):.1f} s at most.",
        "",
        "| value | found in | intervals from noise alone hold | with the error of the mesh | median half width |",
        "|---|---|---|---|---|",
    ]
    every: list[tuple[bool, bool]] = []
    moving = any("damping.stiffness" in r["found"].keys() | r["untold"].keys() for r in done)
    zeros = [f"servos.zero.{i}" for i in range(3)]
    for name in ("material.young", *(["damping.stiffness"] if moving else []), *zeros, "servos.slide"):
        own = [r["found"][name] for r in done if name in r["found"]]
        if not own:
            lines.append(f"| `{name}` | 0 of {len(done)} | - | - | - |")
            continue
        held = [(low <= truth <= high, tlow <= truth <= thigh) for truth, _, low, high, _, tlow, thigh in own]
        every += held
        share = not name.startswith("servos")
        halves = [0.5 * (high - low) / (truth if share else 1e-3) for truth, *_, low, high in own]
        unit, size = ("%", 100) if share else ("mm" if "slide" in name else "mrad", 1)
        shown = f"{size * np.median(halves):.2g} {unit}"
        lines.append(
            f"| `{name}` | {len(own)} of {len(done)} | {_share(held, 0)} | {_share(held, 1)} | {shown} |"
        )
    lines.append(f"| all | | {_share(every, 0)} | {_share(every, 1)} | |")
    if moving:
        return "\n".join(lines)
    named = sum(bool(RATIOS & r["untold"].keys()) for r in done)
    lines += [
        "",
        f"In {named} of {len(done)} the report says that the poses cannot separate modulus, mass and weight.",
    ]
    return "\n".join(lines)


def _share(held: list[tuple[bool, bool]], which: int) -> str:
    return f"{100 * np.mean([h[which] for h in held]):.0f} %"


def robots(results: Path, count: int, one: Callable[[int], dict], first: int = 0) -> list[dict]:
    """Return all rows of the file, to which those of `count` robots from the seed `first` on are added by `one`."""
    rows = stored(results)
    for seed in sorted(set(range(first, first + count)) - {row["seed"] for row in rows}):
        rows.append(one(seed))
        store(results, rows[-1])
        print(f"robot {seed - first + 1} of {count}", flush=True)
    return rows


PARTS = ("poses", "poses more", "tetrahedra", "motion")
"""Of the page."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="seed of the first of them")
    parser.add_argument(
        "--truth", choices=sorted(TRUTHS), default="element", help="what robots are computed with"
    )
    parser.add_argument("--motion", action="store_true", help="a motion of each robot, not poses")
    parser.add_argument(
        "--results", type=Path, default=Path("identify_robots.jsonl"), help="kept here, and gone on with"
    )
    parser.add_argument(
        "--write", metavar="PART", choices=PARTS, help="write this part of docs/reality.md, too: %(choices)s"
    )
    given = parser.parse_args()
    made = table(
        robots(given.results, given.robots, lambda seed: one(seed, given.truth, given.motion), given.first)
    )
    print(made)
    if given.write:
        write_part("reality.md", f"intervals {given.write}", made.splitlines())


if __name__ == "__main__":
    main()
