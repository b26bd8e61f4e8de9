"""The live estimate of the mesh's error beside the true one: random poses and motions of the Tripod.

The truth is the same scene with quadratic elements (`h20`) on a fine level, same clamp, steps and scheme, so that only
the mesh differs. Poses: every angle anywhere in the servos' range, the slide in proportion to their mean as far as the
working pose, so that the strips stay stretched; gone to from the flat piece, by statics. Motions: from the working pose
to a random one in 0.1 to 0.4 s, each servo on by up to 0.5 rad in 30 to 150 ms, then 0.1 s of rest; the effectivity of
a motion is the largest estimate over the largest true error, once with an estimate after each step, once with those
that 20 % of the steps' time allows.

The seed is the date unless given. Each case is a line of a file as soon as it is done; a run that is broken off goes on
there. `python benchmarks/mesh_error.py --write` also writes docs/accuracy.md.
"""

import argparse
import datetime
import json
import time
from pathlib import Path
from typing import Any

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
from doc_parts import write_part

from tests.scenes import SHARP
from tripod_sim import Simulation, StepError, load_scene

WORKING = np.array([-1.4965, -1.4965, -1.4965, 0.035])
FOUND = Path("build/mesh_error")
LEAST, MOST = 0.5, 2.0
EVERY = "mesh_error.share=1e6"


def simulation(element: str, level: int, clamp: str, *words: str) -> Simulation:
    """Return the Tripod on a mesh."""
    mesh = (f"mesh.element={element}", f"mesh.level={level}", f"clamp.stiffness={clamp}")
    return Simulation(load_scene(SHARP, [*mesh, "solver.max_turn=0.3", *words]))


def in_motion(element: str, level: int, clamp: str, *words: str) -> Simulation:
    """Return it in the working pose, in motion."""
    at = (f"servos.angles={WORKING[:3].tolist()}", f"servos.slide={WORKING[3]}")
    return simulation(element, level, clamp, *at, *words)


def pose(rng: np.random.Generator) -> np.ndarray:
    """Return random joints."""
    servos = load_scene(SHARP).servos
    assert servos
    angles = rng.uniform(servos.angle_min, servos.angle_max, 3)
    return np.append(angles, np.clip(angles.mean() / WORKING[0], 0.0, 1.0) * WORKING[3])


def motion(rng: np.random.Generator, dt: float) -> np.ndarray:
    """Return random joints for each step of a motion, shape (steps, 4)."""
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
    """One mesh and clamp against a finer one."""

    def __init__(self, element: str, level: int, clamp: str, truth: int, poses: int, motions: int) -> None:
        self.mesh, self.truth, self.poses, self.motions = (
            (element, level, clamp),
            ("h20", truth, clamp),
            poses,
            motions,
        )
        self.name = f"{element}, level {level}, clamp {clamp}"

    def run(self, seed: int) -> list[dict[str, Any]]:
        """Return the rows of all cases, made or read."""
        FOUND.mkdir(parents=True, exist_ok=True)
        path = FOUND / f"{seed}-{'-'.join(map(str, self.mesh))}.jsonl"
        rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
        with path.open("a") as out:
            for kind, count in (("pose", self.poses), ("motion", self.motions)):
                done = sum(row["kind"] == kind for row in rows)
                made = self._poses(seed, done, count) if kind == "pose" else self._motions(seed, done, count)
                for row in made:
                    rows.append(row)
                    out.write(json.dumps(row) + "\n")
                    out.flush()
                    print(self.name, row, flush=True)
        return rows

    def _poses(self, seed: int, done: int, count: int) -> Any:
        if done >= count:
            return
        still = ("inertia=off", "damping=off")
        own, true = simulation(*self.mesh, *still, EVERY), simulation(*self.truth, *still)
        for k in range(done, count):
            joints = pose(np.random.default_rng([seed, 0, k]))
            try:
                places, errors = followed(own, joints[None])
                reference, _ = followed(true, joints[None])
            except StepError as error:
                yield {"kind": "pose", "case": k, "joints": joints.tolist(), "failed": str(error)}
                continue
            e, t = largest(errors), largest(reference - places)
            left = largest(reference - places - errors)
            yield {
                "kind": "pose",
                "case": k,
                "joints": joints.tolist(),
                "true": t,
                "estimate": e,
                "left": left,
            }

    def _motions(self, seed: int, done: int, count: int) -> Any:
        if done >= count:
            return
        own, told = in_motion(*self.mesh, EVERY), in_motion(*self.mesh, "mesh_error={}")
        true = in_motion(*self.truth, "solver.mode=newton")
        for k in range(done, count):
            way = motion(np.random.default_rng([seed, 1, k]), own.scene.dt)
            try:
                places, errors = followed(own, way)
                _, seldom = followed(told, way)
                reference, _ = followed(true, way)
            except StepError as error:
                yield {"kind": "motion", "case": k, "failed": str(error)}
                continue
            t = reference - places
            ratios = np.linalg.norm(errors, axis=1) / np.linalg.norm(t, axis=1)
            yield {
                "kind": "motion", "case": k, "true": largest(t), "estimate": largest(errors),
                "left": largest(t - errors), "told": largest(seldom),
                "instants": float(((ratios >= LEAST) & (ratios <= MOST)).mean()),
            }  # fmt: skip


CASES = (
    Case("h8_modes", 2, "1.4e10", 9, 100, 100),
    Case("h20", 8, "1.4e10", 10, 10, 0),
)


def cost(repeats: int = 7, steps: int = 400) -> list[str]:
    """Return what the estimate makes of the CPU time of a step, at rest and in motion: the least of runs in turns."""
    off, on = (in_motion("h8_modes", 2, "1.4e10", *words) for words in ((), ("mesh_error={}",)))
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
    mine = [row for row in rows if row["kind"] == kind]
    good = [row for row in mine if "true" in row]
    ratios = np.array([row[key] / row["true"] for row in good])
    within = (ratios >= LEAST) & (ratios <= MOST)
    true = 1e3 * np.array([row["true"] for row in good])
    what = {
        "pose": "poses",
        "motion": "motions, estimated each step" if key == "estimate" else "motions, as told",
    }[kind]
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
        lines += [line(case.name, rows, "pose")]
        if case.motions:
            lines += [line(case.name, rows, "motion"), line(case.name, rows, "motion", "told")]
    print("\n".join(lines))
    if options.write:
        note = f"Seed {options.seed}; `python benchmarks/mesh_error.py --write`."
        write_part("accuracy.md", "mesh error", [*lines, "", note])


if __name__ == "__main__":
    main()
