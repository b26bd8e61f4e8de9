"""The live estimate of the mesh's error beside the true one: random poses and motions of the shipped Tripod.

The truth is the same scene with quadratic elements (`h20`) on a fine level, same clamp, steps and scheme, so that only
the mesh differs. Poses: every angle anywhere in the servos' range, the slide in proportion to their mean as far as the
working pose, so that the strips stay stretched; gone to from the flat piece, by statics. Moves: those by which
`--accuracy` is judged (`promise_cases.dynamic_case`), about the working pose. Wide motions: from the working pose to a
random one in 0.1 to 0.4 s, each servo on by up to 0.5 rad in 30 to 150 ms, then 0.1 s of rest; there strips hang slack
and snap. The effectivity of a motion is the largest estimate over the largest true error, once with an estimate after
each step, once with those that 16 % of the steps' time allows.

The seed is the date unless given. Each case is a line of a file as soon as it is done; a run that is broken off goes on
there. `python benchmarks/mesh_error.py --write` also writes docs/accuracy.md.
"""

import argparse
import datetime
import json
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
from doc_parts import write_part
from promise_cases import dynamic_case, dynamic_turn, turned

from tripod_sim import Simulation, StepError, load_scene

WORKING = np.array([-1.4965, -1.4965, -1.4965, 0.035])
FOUND = Path("build/mesh_error")
LEAST, MOST = 0.5, 2.0
EVERY = "mesh_error.share=1e6"
POSE, MOVE, WIDE = "poses", "moves", "wide motions"


def simulation(element: str, level: int, *words: str) -> Simulation:
    """Return the Tripod on a mesh."""
    mesh = (f"mesh.element={element}", f"mesh.level={level}")
    return Simulation(load_scene("tripod", [*mesh, "solver.max_turn=0.3", *words]))


def working(element: str, level: int, *words: str) -> Simulation:
    """Return it in the working pose."""
    at = (f"servos.angles={WORKING[:3].tolist()}", f"servos.slide={WORKING[3]}")
    return simulation(element, level, *at, *words)


def pose(rng: np.random.Generator) -> np.ndarray:
    """Return random joints."""
    servos = load_scene("tripod").servos
    assert servos
    angles = rng.uniform(servos.angle_min, servos.angle_max, 3)
    return np.append(angles, np.clip(angles.mean() / WORKING[0], 0.0, 1.0) * WORKING[3])


def move(seed: int, start: np.ndarray, dt: float) -> np.ndarray:
    """Return joints for each step of a move of `promise_cases` from `start`, shape (steps, 4)."""
    turn, ramp = dynamic_turn(seed)
    return np.stack([turned(start, turn, ramp, dt * k) for k in range(1, round(0.12 / dt) + 1)])


def motion(rng: np.random.Generator, dt: float) -> np.ndarray:
    """Return random joints for each step of a wide motion, shape (steps, 4)."""
    there = np.append(rng.uniform(-1.9, -0.4, 3), WORKING[3])
    on = there + np.append(rng.uniform(-0.5, 0.5, 3).clip(-2.1 - there[:3], 0.6 - there[:3]), 0.0)
    first, second = rng.uniform(0.1, 0.4), rng.uniform(0.03, 0.15)
    times = dt * np.arange(1, round((first + second + 0.1) / dt) + 1)
    knots = [0.0, first, first + second]
    return np.stack(
        [np.interp(times, knots, [a, b, c]) for a, b, c in zip(WORKING, there, on, strict=True)], 1
    )


def followed(found: Simulation, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions of the effector [m], and its estimated errors, NaN without, both of shape (steps, 3)."""
    found.reset()
    places, errors = np.full((2, len(way), 3), np.nan)
    for k, joints in enumerate(way):
        report = found.step(joints)
        places[k] = found.state.centres[0]
        if report.mesh_error:
            errors[k] = report.mesh_error.effector
    return places, errors


def largest(vectors: np.ndarray) -> float:
    """Return the largest length."""
    return float(np.linalg.norm(vectors, axis=1).max())


class Case:
    """One mesh against a finer one."""

    def __init__(self, element: str, level: int, truth: int, poses: int, moves: int, motions: int) -> None:
        """`truth`: mesh level of the truth; `poses`, `moves`, `motions`: how many."""
        self.mesh, self.truth = (element, level), ("h20", truth)
        self.kinds = ((POSE, poses, self._poses), (MOVE, moves, self._moves), (WIDE, motions, self._motions))
        self.name = f"{element}, level {level}"

    def run(self, seed: int) -> list[dict[str, Any]]:
        """Return the rows of all cases, made or read."""
        FOUND.mkdir(parents=True, exist_ok=True)
        path = FOUND / f"{seed}-{'-'.join(map(str, self.mesh))}.jsonl"
        rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
        with path.open("a") as out:
            for kind, count, make in self.kinds:
                done = sum(row["kind"] == kind for row in rows)
                made = make(seed, range(done, count)) if done < count else ()
                for k, found in zip(range(done, count), made, strict=False):
                    rows.append({"kind": kind, "case": k, **found})
                    out.write(json.dumps(rows[-1]) + "\n")
                    out.flush()
                    print(self.name, rows[-1], flush=True)
        return rows

    def _poses(self, seed: int, cases: Iterable[int]) -> Iterator[dict[str, Any]]:
        still = ("inertia=off", "damping=off")
        own, true = simulation(*self.mesh, *still, EVERY), simulation(*self.truth, *still)
        for k in cases:
            joints = pose(np.random.default_rng([seed, 0, k]))
            yield {"joints": joints.tolist(), **compared(joints[None], own, true)}

    def _moves(self, seed: int, cases: Iterable[int]) -> Iterator[dict[str, Any]]:
        for k in cases:
            case = dynamic_case(100 * seed + k)
            try:
                own, told = (
                    simulation(*self.mesh, *case.overrides, word) for word in (EVERY, "mesh_error={}")
                )
                true = simulation(*self.truth, *case.overrides)
            except StepError as error:
                yield {"failed": str(error)}
                continue
            yield compared(move(case.seed, own.command, own.scene.dt), own, true, told)

    def _motions(self, seed: int, cases: Iterable[int]) -> Iterator[dict[str, Any]]:
        own, told, true = (
            working(*self.mesh, EVERY),
            working(*self.mesh, "mesh_error={}"),
            working(*self.truth),
        )
        for k in cases:
            yield compared(motion(np.random.default_rng([seed, 1, k]), own.scene.dt), own, true, told)


def compared(
    way: np.ndarray, own: Simulation, true: Simulation, told: Simulation | None = None
) -> dict[str, Any]:
    """Return the largest true error [m] on `way`, the largest estimate, and what the estimate leaves at most.

    With `told`, which estimates as often as it may, also the largest of these.
    """
    try:
        places, errors = followed(own, way)
        reference, _ = followed(true, way)
        seldom = followed(told, way)[1] if told else None
    except StepError as error:
        return {"failed": str(error)}
    miss = reference - places
    found = {"true": largest(miss), "estimate": largest(errors), "left": largest(miss - errors)}
    if seldom is not None:
        found["told"] = largest(seldom)
    return found


CASES = (
    Case("h20", 13, 9, 100, 100, 100),
    Case("h8_modes", 12, 9, 30, 30, 0),
    Case("h8_modes", 8, 9, 30, 30, 0),
    Case("h20", 8, 10, 10, 0, 0),
    Case("h20", 14, 10, 10, 0, 0),
)
"""The default mesh, those that `--accuracy` takes for 5 and 10 %, and finer ones."""


def cost(repeats: int = 7, steps: int = 400) -> list[str]:
    """Return what the estimate makes of the CPU time of a step, at rest and in motion: the least of runs in turns."""
    off, on = (working(*CASES[0].mesh, *words) for words in ((), ("mesh_error={}",)))
    found = []
    for name, turn in (("at rest", 0.0), ("servo 0 swings by 0.3 rad at 2 Hz", 0.3)):
        way = WORKING + np.outer(
            turn * np.sin(4 * np.pi * off.scene.dt * np.arange(1, steps + 1)), [1, 0, 0, 0]
        )
        taken: dict[int, list[float]] = {0: [], 1: []}
        for _ in range(repeats):
            for k, one in enumerate((off, on)):
                one.reset()
                begin = time.thread_time()
                for joints in way:
                    one.step(joints)
                taken[k].append((time.thread_time() - begin) / steps)
        a, b = min(taken[0]), min(taken[1])
        found.append(
            f"{name}: {1e6 * a:.1f} us a step, {1e6 * b:.1f} us with the estimate, {b / a:.3f} times"
        )
    return found


def line(name: str, rows: list[dict[str, Any]], kind: str, key: str = "estimate") -> str:
    """Return a row of the table."""
    good = [row for row in rows if row["kind"] == kind and "true" in row]
    ratios = np.array([row[key] / row["true"] for row in good])
    within = (ratios >= LEAST) & (ratios <= MOST)
    true = 1e3 * np.array([row["true"] for row in good])
    what = kind if kind == POSE else f"{kind}, {'estimated each step' if key == 'estimate' else 'as told'}"
    cells = [
        name, what, str(len(good)), f"{np.median(true):.2g}, at most {true.max():.2g}",
        f"{100 * within.mean():.0f} %", f"{ratios.min():.2f} to {ratios.max():.2f}, median {np.median(ratios):.2f}",
    ]  # fmt: skip
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Run what is missing and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    today = int(datetime.date.today().strftime("%Y%m%d"))
    parser.add_argument("--seed", type=int, default=today, help="of the random numbers (default: the date)")
    parser.add_argument("--only", type=int, nargs="*", help="numbers of the cases, from 0; default: all")
    parser.add_argument("--write", action="store_true", help="write docs/accuracy.md, too")
    parser.add_argument(
        "--cost", action="store_true", help="only what the estimate makes of the time of a step"
    )
    options = parser.parse_args()
    if options.cost:
        print("\n".join(cost()))
        return
    print(f"calibration: 1000 x 1000 product {1e3 * calibration():.1f} ms")
    head = ["mesh", "of", "cases", "true error [mm], median", "effectivity within 0.5 to 2", "effectivity"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for k, case in enumerate(CASES):
        if options.only and k not in options.only:
            continue
        rows = case.run(options.seed)
        for kind, count, _ in case.kinds:
            keys = ("estimate",) if kind == POSE else ("estimate", "told")
            lines += [line(case.name, rows, kind, key) for key in keys if count]
    print("\n".join(lines))
    if options.write:
        note = f"Seed {options.seed}; `python benchmarks/mesh_error.py --write`."
        write_part("accuracy.md", "mesh error", [*lines, "", note])


if __name__ == "__main__":
    main()
