"""Do the bars of `tripod ik --posterior` hold? Synthetic Tripods that were identified, and poses nobody measured.

Each robot is one of `benchmarks/identify.py`: values of its own, a weight of 100 g, 30 noisy poses from another mesh
and another element. It is identified; then 10 targets are drawn within the range of its poses, the angles that reach
them by the identified model are taken, and the 90 % bars of x, y and z there are held against

- the posterior: 50 robots whose values and amounts of mesh error are drawn from it together, and whose poses are
  computed again with these values (the bars are linear in them);
- the robot itself, computed with its own mesh and values.

Of each target, angles that lead to it are known, since it is where the model stands with them.
Writes a line of JSON for each robot, goes on where it stopped, and prints the table.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.doc_parts import write_part
from benchmarks.identify import MODEL, TRUTHS, drawn, robot, robots, with_values
from tripod_identify.errors import FitError
from tripod_identify.identify import Identified, Wanted, identify
from tripod_identify.intervals import POSE, bars_of, linearised
from tripod_identify.measured import Measured
from tripod_identify.model import plainly, predict
from tripod_identify.parameters import parameters, told
from tripod_sim import StepError

NAMES = ("material.young", "servos.zero", "servos.slide")
TARGETS, DRAWN = 10, 50


def one(seed: int, truth: str, targets: int = TARGETS, drawn_robots: int = DRAWN) -> dict:
    """Return which bars hold for one robot, and how wide they are."""
    try:
        values, data = drawn(seed, truth)
        result = identify(robot(MODEL), data, (), Wanted(NAMES, propose=False))
        return {
            "seed": seed,
            **held(result, values, truth, targets, drawn_robots, np.random.default_rng([seed, 1])),
        }
    except (FitError, StepError) as error:
        return {"seed": seed, "failed": str(error)}


def held(
    result: Identified,
    values: dict[str, float],
    truth: str,
    targets: int,
    drawn_robots: int,
    rng: np.random.Generator,
) -> dict:
    """Return the same for a robot that was identified."""
    posterior, scene = result.posterior, result.told.scene
    share = rng.uniform(0.2, 1.0, targets)
    commands = -1.4 * share[:, None] + rng.uniform(-0.3, 0.3, (targets, 3))
    arms = commands * result.told.gain + result.told.zero
    began = time.process_time()
    at = linearised(scene, posterior, arms, np.full(targets, scene.servos.slide))
    bars = bars_of(at, posterior)
    cpu = (time.process_time() - began) / targets
    expected = bars.poses + bars.mesh + bars.steps
    data = Measured(None, commands, None, POSE, np.zeros((targets, len(POSE))))
    real = predict(with_values(robot(TRUTHS[truth]), values), data, ()) - expected
    made = from_posterior(result, at.columns, data, drawn_robots, rng) - expected
    inside = {"posterior": np.abs(made) <= bars.half, "robot": np.abs(real) <= bars.half}
    return {
        "cpu": cpu,
        **{name: ok.tolist() for name, ok in inside.items()},
        "half": bars.half.tolist(),
        "by_values": bars.by_values.tolist(),
        "uncorrected": (real + expected - bars.poses).tolist(),
        "error": real.tolist(),
    }


def from_posterior(
    result: Identified, columns: np.ndarray, data: Measured, count: int, rng: np.random.Generator
) -> np.ndarray:
    """Return the poses of `count` robots drawn from the posterior, shape (count, k, 6)."""
    posterior, scene = result.posterior, result.told.scene
    a = posterior.amounts
    wanted = parameters(scene, list(posterior.values))
    size = np.array([1.0 if p.log else p.plausible for p in wanted])
    centre = np.array([p.to_u(posterior.values[p.name]) for p in wanted])
    made = []
    for _ in range(count):
        c = a.mean + np.linalg.cholesky(a.covariance) @ rng.standard_normal(len(a.mean))
        u = centre + (np.linalg.cholesky(a.noise) @ rng.standard_normal(len(centre)) - a.follow @ c) / size
        made.append(predict(told(plainly(scene), wanted, u), data, ()) + columns @ c)
    return np.array(made)


def table(rows: list[dict]) -> str:
    """Return the counts in Markdown."""
    done = [r for r in rows if "half" in r]
    count, made = sum(len(r["half"]) for r in done), sum(np.size(r["posterior"]) for r in done) // 6
    half, values = (1e3 * np.concatenate([r[k] for r in done])[:, :3] for k in ("half", "by_values"))
    error, plain = (1e3 * np.concatenate([r[k] for r in done])[:, :3] for k in ("error", "uncorrected"))
    lines = [
        f"{len(done)} robots, {len(rows) - len(done)} without a result; {count} targets, {made} of robots drawn from "
        "their posteriors; "
        f"{np.median([r['cpu'] for r in done]):.2f} s of CPU time for the intervals of one target.",
        "",
        "| | x | y | z | all |",
        "|---|---|---|---|---|",
    ]
    for name, title in (("posterior", "robots drawn from the posterior"), ("robot", "the robot itself")):
        ok = 100 * np.concatenate([np.array(r[name])[..., :3].reshape(-1, 3) for r in done])
        lines.append(
            f"| intervals hold {title} | "
            + " | ".join(f"{v:.0f} %" for v in (*ok.mean(axis=0), ok.mean()))
            + " |"
        )
    for title, sizes in (
        ("half an interval, median [mm]", np.median(half, axis=0)),
        ("of it by values alone [mm]", np.median(values, axis=0)),
        ("error of the model, rms [mm]", np.sqrt((plain**2).mean(axis=0))),
        ("the same with the expected shift [mm]", np.sqrt((error**2).mean(axis=0))),
    ):  # fmt: skip
        lines.append(f"| {title} | " + " | ".join(f"{v:.3f}" for v in sizes) + " | |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", type=int, default=10, help="to be identified")
    parser.add_argument("--targets", type=int, default=TARGETS, help="of each")
    parser.add_argument("--drawn", type=int, default=DRAWN, help="robots from the posterior of each")
    parser.add_argument(
        "--truth", choices=sorted(TRUTHS), default="element", help="what robots are computed with"
    )
    parser.add_argument(
        "--results", type=Path, default=Path("ik_bars.jsonl"), help="kept here, and gone on with"
    )
    parser.add_argument("--write", action="store_true", help="write docs/reality.md, too")
    given = parser.parse_args()
    made = robots(
        given.results, given.robots, lambda seed: one(seed, given.truth, given.targets, given.drawn)
    )
    print(table(made))
    if given.write:
        write_part("reality.md", "bars", table(made).splitlines())


if __name__ == "__main__":
    main()
