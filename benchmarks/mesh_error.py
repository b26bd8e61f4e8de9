"""The live error of the effector, of mesh and time steps, beside the true one: random poses and motions of the Tripod.

Poses: every angle anywhere in the servos' range, the slide in proportion to their mean as far as the working pose, so
that the strips stay stretched; gone to from the flat piece, by statics. What the mesh is told to err by, in a new
estimate, is held against the same scene with `h20` on level 10; where it is off by more than 0.2 mm, `h27` on that
level is asked as well, and where those two are as far apart, nothing is known. Moves: those by which `--accuracy` is
judged (`promise_cases.dynamic_case`), about the working pose. Wide motions: from the working pose to a random one in
0.1 to 0.4 s, each servo on by up to 0.5 rad in 30 to 150 ms, then 0.1 s of rest; there strips hang slack and snap.
Motions run with `mesh_error={}` and `time_error={}`, so estimates take 15 % of the steps' time; what both come to is
held against the same scene with `h20` on level 9 and a quarter of the steps, solved exactly. The effectivity of a
motion is the largest error that was told over the largest true error. `soft`: motions in which the stability margin
falls so far that a run says that the mesh errs by more than is told; the last column is of the others.

Cases that others choose come from a file, `--chosen FILE`, a JSON list: {"kind": "pose", "joints": [angles, slide]} and
{"kind": "motion", "knots": [[time, angles, slide], ...]}, straight between knots, the first at time 0, at rest. For
`benchmarks/data/chosen_motions.json` only the robot's ranges were known, nothing of the simulator or the estimate.

The seed is the date unless given. Each case is a line of a file as soon as it is done; a run that is broken off goes on
there. `python benchmarks/mesh_error.py --write` also writes docs/accuracy.md.
"""

import argparse
import datetime
import json
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NoReturn

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
from doc_parts import write_part
from promise_cases import Case as PromiseCase
from promise_cases import dynamic_case, dynamic_turn, turned

from tripod_sim import Simulation, StepError, load_scene
from tripod_sim.stability_margin import REDUCED_MARGIN
from tripod_study.run import LeastStabilityMargin
from tripod_study.summary.errors import effector_error

WORKING = np.array([-1.4965, -1.4965, -1.4965, 0.035])
STILL, FINER = ("h20", 10), ("h20", 9)
"""Meshes of what poses and motions are held against."""

PARTS = 4
"""Into which a step is divided there."""

EXACT = ("solver.mode=newton", "solver.linear=ldl", "solver.tolerance=1e-6")
FOUND = Path("build/mesh_error")
CHOSEN = Path(__file__).parent / "data" / "chosen_motions.json"
LEAST, MOST = 0.5, 2.0
NEAR = 2e-5
"""Less than by what `h20` and `h27` on level 10 differ in the working pose [m]."""

UNSURE = 2e-4
"""How far the two are apart where neither is known to be right [m]."""

PATIENCE = 300
"""Time after which the truth of a case is not known [s]."""

EVERY = "mesh_error.share=1e6"
POSE, MOVE, WIDE = "poses", "moves", "wide motions"
CHOSEN_POSE, CHOSEN_MOTION = "chosen poses", "chosen motions"


def simulation(element: str, level: int, *words: str) -> Simulation:
    """Return the Tripod on a mesh."""
    mesh = (f"mesh.element={element}", f"mesh.level={level}")
    return Simulation(load_scene("tripod", [*mesh, "solver.max_turn=0.3", *words]))


def at(joints: np.ndarray) -> tuple[str, str]:
    """Return the words for a start in a pose."""
    return f"servos.angles={joints[:3].tolist()}", f"servos.slide={joints[3]}"


@dataclass(frozen=True)
class Motion:
    """How the joints go.

    Attributes:
        words: What the scene is overridden with.
        joints: Returns them at a time [s], given those at the start.
        duration: [s]; 0 for a pose, gone to from the flat piece by statics.
    """

    words: tuple[str, ...]
    joints: Callable[[float, np.ndarray], np.ndarray]
    duration: float

    def way(self, start: np.ndarray, dt: float, parts: int = 1) -> np.ndarray:
        """Return the joints at the end of each of `parts` parts of steps of `dt` [s], shape (steps * parts, 4)."""
        count = max(round(self.duration / dt), 1) * parts
        return np.stack([self.joints(dt / parts * k, start) for k in range(1, count + 1)])


def standing(joints: np.ndarray) -> Motion:
    """Return a pose."""
    return Motion(("inertia=off", "damping=off"), lambda _time, _start: joints, 0.0)


def straight(knots: np.ndarray) -> Motion:
    """Return the motion straight between `knots`, rows of time [s] and joints, from rest at the first."""

    def joints(time: float, _: np.ndarray) -> np.ndarray:
        return np.array([np.interp(time, knots[:, 0], column) for column in knots[:, 1:].T])

    return Motion(at(knots[0, 1:]), joints, float(knots[-1, 0]))


def pose(rng: np.random.Generator) -> np.ndarray:
    """Return random joints."""
    servos = load_scene("tripod").servos
    assert servos
    angles = rng.uniform(servos.angle_min, servos.angle_max, 3)
    return np.append(angles, np.clip(angles.mean() / WORKING[0], 0.0, 1.0) * WORKING[3])


def move(case: PromiseCase) -> Motion:
    """Return a move of `promise_cases`, from where its scene begins."""
    turn, ramp = dynamic_turn(case.seed)
    return Motion(case.overrides, lambda time, start: turned(start, turn, ramp, time), 0.12)


def motion(rng: np.random.Generator) -> Motion:
    """Return a random wide motion."""
    there = np.append(rng.uniform(-1.9, -0.4, 3), WORKING[3])
    on = there + np.append(rng.uniform(-0.5, 0.5, 3).clip(-2.1 - there[:3], 0.6 - there[:3]), 0.0)
    first, second = rng.uniform(0.1, 0.4), rng.uniform(0.03, 0.15)
    times = np.array([0.0, first, first + second, first + second + 0.1])
    return straight(np.column_stack([times, [WORKING, there, on, on]]))


def chosen(path: Path) -> dict[str, list[Motion]]:
    """Return the poses and motions of a file."""
    cases = json.loads(path.read_text())
    return {
        CHOSEN_POSE: [standing(np.array(c["joints"], float)) for c in cases if c["kind"] == "pose"],
        CHOSEN_MOTION: [straight(np.array(c["knots"], float)) for c in cases if c["kind"] == "motion"],
    }


@contextmanager
def patience() -> Iterator[None]:
    """Raise TimeoutError within, once it has taken `PATIENCE`."""

    def give_up(*_: object) -> NoReturn:
        raise TimeoutError(f"no solution in {PATIENCE} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def followed(
    found: Simulation, way: np.ndarray, stability_margin: LeastStabilityMargin | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions of the effector [m], shape (steps, 3), and their errors as told [m], NaN without."""
    found.reset()
    places, errors = np.full((len(way), 3), np.nan), np.full(len(way), np.nan)
    for k, joints in enumerate(way):
        report = found.step(joints)
        places[k], errors[k] = found.state.centres[0], effector_error(report)
        if stability_margin:
            stability_margin.look()
    return places, errors


class Case:
    """One mesh."""

    def __init__(self, element: str, level: int, poses: int, moves: int, motions: int) -> None:
        """`poses`, `moves`, `motions`: how many random ones."""
        self.mesh = (element, level)
        self.counts = {POSE: poses, MOVE: moves, WIDE: motions}
        self.name = f"{element}, level {level}"
        self._built = lru_cache(1)(self._pair)

    def random(self, kind: str, seed: int) -> list[Motion]:
        """Return random motions of a kind, or poses."""
        count = range(self.counts[kind])
        if kind == MOVE:
            return [move(dynamic_case(100 * seed + k)) for k in count]
        if kind == POSE:
            return [standing(pose(np.random.default_rng([seed, 0, k]))) for k in count]
        return [motion(np.random.default_rng([seed, 1, k])) for k in count]

    def run(self, kinds: Mapping[str, Sequence[Motion]], name: str) -> list[dict[str, Any]]:
        """Return the rows of all motions, by kind, made or read from the file of this name."""
        FOUND.mkdir(parents=True, exist_ok=True)
        path = FOUND / f"{name}-{'-'.join(map(str, self.mesh))}.jsonl"
        rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
        with path.open("a") as out:
            for kind, motions in kinds.items():
                done = sum(row["kind"] == kind for row in rows)
                for k, given in enumerate(motions[done:], done):
                    rows.append({"kind": kind, "case": k, **self._judged(given)})
                    out.write(json.dumps(rows[-1]) + "\n")
                    out.flush()
                    print(self.name, rows[-1], flush=True)
        return rows

    def _judged(self, given: Motion) -> dict[str, Any]:
        """Return the largest true error of a motion or pose [m], and the largest that was told."""
        try:
            with patience():
                own, true = self._built(given.words, still=not given.duration)
                start, dt, parts = own.command.copy(), own.scene.dt, PARTS if given.duration else 1
                stability_margin = (
                    LeastStabilityMargin(own, round(given.duration / dt)) if given.duration else None
                )
                places, errors = followed(own, given.way(start, dt), stability_margin)
                reference, _ = followed(true, given.way(start, dt, parts))
        except (StepError, TimeoutError) as error:
            return {"failed": str(error)}
        miss = np.linalg.norm(reference[parts - 1 :: parts] - places, axis=1)
        found = {"true": float(miss.max()), "told": float(errors.max())}
        if stability_margin and stability_margin.seen:
            found["stability_margin"] = stability_margin.seen[0]
        if not given.duration and abs(found["true"] - found["told"]) > UNSURE:
            other, _ = followed(simulation("h27", STILL[1], *given.words), given.way(start, dt))
            apart = float(np.linalg.norm(other - reference))
            return {"unknown": apart} if apart > UNSURE else found
        return found

    def _pair(self, words: tuple[str, ...], *, still: bool) -> tuple[Simulation, Simulation]:
        """Return the mesh with its estimates, and the truth."""
        if still:
            return simulation(*self.mesh, *words, EVERY), simulation(*STILL, *words)
        own = simulation(*self.mesh, *words, "mesh_error={}", "time_error={}")
        return own, simulation(*FINER, *words, *EXACT, f"dt={own.scene.dt / PARTS}")


CASES = (Case("h20", 8, 100, 100, 25), Case("h20", 13, 30, 30, 0), Case("h8_modes", 12, 30, 30, 0))
"""The default mesh, and those that `--accuracy` takes for less."""


def cost(repeats: int = 7, steps: int = 1500, block: int = 50) -> list[str]:
    """Return what the estimates make of the CPU time of a step, at rest and in motion: the median of several runs.

    All simulations go the way together, in turns of `block` steps, so that a slow moment of the machine meets them all.
    """
    wanted = ((), ("mesh_error={}",), ("mesh_error={}", "time_error={}"), (EVERY,))
    several = [simulation(*CASES[0].mesh, *at(WORKING), *words) for words in wanted]
    off = several[0]
    found = []
    for name, turn in (("at rest", 0.0), ("servo 0 swings by 0.3 rad at 2 Hz", 0.3)):
        way = WORKING + np.outer(
            turn * np.sin(4 * np.pi * off.scene.dt * np.arange(1, steps + 1)), [1, 0, 0, 0]
        )
        taken = np.zeros((repeats, len(several), steps))
        for run in taken:
            for one in several:
                one.reset()
            for k in range(0, steps, block):
                for times, one in zip(run, several, strict=True):
                    ends = [time.thread_time()]
                    for joints in way[k : k + block]:
                        one.step(joints)
                        ends.append(time.thread_time())
                    times[k : k + block] = np.diff(ends)
        means = taken.mean(axis=2)
        a, (mesh, both) = means[:, 0].min(), np.median(means[:, 1:3] / means[:, :1], axis=0)
        single = taken[:, 3].min(axis=0) - a
        found.append(
            f"{name}: {1e6 * a:.1f} us a step, {mesh:.3f} times with the error of the mesh, {both:.3f} "
            f"with that of mesh and steps; a single estimate {1e3 * float(np.median(single)):.1f} ms, at most "
            f"{1e3 * float(single.max()):.0f}"
        )
    return found


def references() -> list[str]:
    """Return where the effector is in the working pose on meshes of two elements, each finer than the one before."""
    lines = []
    for element in ("h20", "h27"):
        heights = []
        for level in (8, 9, 10):  # of 1, 2 and 3 elements in the place of one
            found = simulation(element, level, *standing(WORKING).words)
            found.reset()
            found.step(WORKING)
            heights.append(1e3 * float(found.state.centres[0, 2]))
        lines.append(f"{element}, levels 8, 9, 10: " + ", ".join(f"{h:.4f}" for h in heights) + " mm")
    return lines


def line_of(name: str, rows: list[dict[str, Any]]) -> str:
    """Return the row of the table for cases of a kind."""
    good = [row for row in rows if "true" in row]
    true, told = (np.array([row[key] for row in good]) for key in ("true", "told"))
    ratios = told / true
    within = (ratios >= LEAST) & (ratios <= MOST)
    soft = np.array([row.get("stability_margin", np.inf) < REDUCED_MARGIN for row in good])
    firm = f"{100 * within[~soft].mean():.0f} %" if not soft.all() else ""
    cells = [
        name, rows[0]["kind"], f"{len(good)} of {len(rows)}",
        f"{1e3 * np.median(true):.2g}, at most {1e3 * true.max():.2g}",
        f"{100 * within.mean():.0f} %", f"{100 * (within | (np.abs(told - true) < NEAR)).mean():.0f} %",
        f"{ratios.min():.2f} to {ratios.max():.2f}, median {np.median(ratios):.2f}",
        f"{soft.sum()}" if "stability_margin" in good[0] else "", firm if soft.any() else "",
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
    parser.add_argument(
        "--chosen", type=Path, default=CHOSEN, help="cases that others choose (default %(default)s)"
    )
    parser.add_argument("--write", action="store_true", help="write docs/accuracy.md, too")
    parser.add_argument(
        "--cost", action="store_true", help="only what the estimate makes of the time of a step"
    )
    parser.add_argument(
        "--reference", action="store_true", help="only how well the reference is known in the working pose"
    )
    options = parser.parse_args()
    if options.reference:
        print("\n".join(references()))
        return
    if options.cost:
        print("\n".join(cost()))
        return
    print(f"calibration: 1000 x 1000 product {1e3 * calibration():.1f} ms")
    head = [
        "mesh", "of", "known", "true error [mm], median", "estimate / true error within 0.5 to 2", "or 0.02 mm off",
        "estimate / true error", "soft", "within 0.5 to 2 of the others",
    ]  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for k, case in enumerate(CASES):
        if options.only and k not in options.only:
            continue
        sets = [(str(options.seed), {kind: case.random(kind, options.seed) for kind in case.counts})]
        if case is CASES[0]:
            sets.append((options.chosen.stem, chosen(options.chosen)))
        for name, kinds in sets:
            rows = case.run(kinds, name)
            for kind, motions in kinds.items():
                if motions:
                    lines.append(line_of(case.name, [r for r in rows if r["kind"] == kind]))
    print("\n".join(lines))
    if options.write:
        note = f"Seed {options.seed}; `python benchmarks/mesh_error.py --write`."
        write_part("accuracy.md", "mesh error", [*lines, "", note])


if __name__ == "__main__":
    main()
