"""What `dt = "auto"` keeps of an asked accuracy where bodies touch, and what it costs beside fixed steps.

Random cases of `drape` (a coarser cloth, a third of them with a strain limit), `stack` (boxes let fall on each other),
`incline`, `maze` (the ball rolls as the plate tilts) and `silicone_drop`, each of them short, with its first hits.
Masses, friction, heights, speeds, angles and stiffness are drawn by the seed of the case.

1. Reference: `dt = "auto"` at a tenth of the finest accuracy, contact forces found far more exactly. Its own error is
   how far it is from that at twice this accuracy. Fixed steps of BDF2 are the witness: halved, they have to come nearer
   to it; else how far they are from it counts as its own error, where that is larger.
2. `dt = "auto"` at each accuracy, and a ladder of fixed steps of each implicit scheme, from the scene's interval of
   commands down. The error of a run is the largest distance of a point of interest (nodes, corners of rigid bodies, the
   ball, the disc) from the reference at the ends of the intervals, over the largest move of a point of that kind.
3. Where the reference's own error is above half the accuracy the motion is chaotic: no steps can promise where things
   are;
   so it is where the run itself tells that walls decide where the ball is (`time_error.ball` above the accuracy).
   Then the run is held to what does not hang on that: the energy is at no time above that at the start, nothing is
   deeper in something than the contact distance, and what rests in the reference rests.

One line of JSON for each case goes to the results; cases that are there are not made again. CPU time of one thread.

    python benchmarks/contact_accuracy.py --cases 4 --scene stack incline
    python benchmarks/contact_accuracy.py --report
"""

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from benchmarks.doc_parts import table_lines, write_part
from benchmarks.stored_rows import store, stored
from tripod_sim import Simulation, StepError, load_scene

ACCURACIES = (0.1, 0.05, 0.01)
SCHEMES = ("bdf2", "tr_bdf2", "implicit_euler")

LADDER = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
"""Over what the interval is divided for fixed steps."""

FINEST = (0.002, 0.001)
"""Accuracies of the reference, the last, and of what its own error is found with."""

KNOWN = 0.5
"""Own error of the reference, in parts of an accuracy, up to which it judges that."""

EXACTLY = ("contact.tolerance=1e-5", "contact.max_solves=300")
"""How contact forces are found in references: what is left of them moves bodies in short steps."""

PROMISED = 0.95
"""Share of the cases in which a step has to keep the accuracy to count as one that keeps it."""

RESTS = 0.01
"""Root mean square speed at the end, in parts of the largest of the motion, below which a case rests."""


@dataclass(frozen=True)
class Case:
    """One random case.

    Attributes:
        scene: Its name.
        words: Overrides.
        intervals: How many there are.
        division: Over what an interval is divided for the finest fixed steps that witness the reference.
        kick: What is done at the start.
        joints: What is asked at the ends of intervals [s], between which commands go evenly, whatever the steps; None
            leaves all as it is.
    """

    scene: str
    words: tuple[str, ...]
    intervals: int
    division: int
    kick: Callable[[Simulation], None] | None = None
    joints: Callable[[float], np.ndarray] | None = None


def uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number in a range, even in its logarithm where that is positive."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))) if low > 0 else rng.uniform(low, high))


def drape(rng: np.random.Generator) -> Case:
    """A cloth of 7 x 7 nodes falls or is thrown on the sphere."""
    mass, speed = uniform(rng, 0.1, 0.5), uniform(rng, -1.5, 0.0)
    at = [*rng.uniform(-0.03, 0.03, 2).tolist(), uniform(rng, 0.22, 0.27)]
    words = [
        "springs.source=grid", "springs.nodes=7", "springs.size=0.8", f"springs.position={at}",
        f"springs.node_mass={mass / 49}", f"springs.stiffness={uniform(rng, 50, 400)}",
        f"springs.shear={uniform(rng, 20, 80)}", f"contact.friction={uniform(rng, 0.0, 0.8)}",
    ]  # fmt: skip
    if rng.random() < 1 / 3:
        words.append(f"strain_limit={{stretch={uniform(rng, 0.02, 0.1)}}}")

    def kick(simulation: Simulation) -> None:
        simulation.state.velocities[:, 2] = speed

    return Case("drape", tuple(words), 25, 64, kick)


def stack(rng: np.random.Generator) -> Case:
    """Three boxes fall on a plate and on each other, pushed a little."""
    words, height = [f"contact.friction={uniform(rng, 0.1, 0.8)}", "dt=0.01"], 0.0
    pushes = rng.uniform(-0.1, 0.1, (3, 3)) * [1, 1, 0]
    for k in range(3):
        height += 0.051 + uniform(rng, 0.0005, 0.02)
        x, y = rng.uniform(-0.015, 0.015, 2).tolist()
        words += [f"rigid.{k}.position=[{x}, {y}, {height}]", f"rigid.{k}.mass={uniform(rng, 0.1, 1.0)}"]
        height += 0.05

    def kick(simulation: Simulation) -> None:
        simulation.state.rigid.velocities[:] = pushes

    return Case("stack", tuple(words), 30, 64, kick)


def incline(rng: np.random.Generator) -> Case:
    """The block slides, sticks or lands on inclines of 5 to 35 degrees, pushed along or up them."""
    angle, gap = np.radians(rng.uniform(5, 35)), uniform(rng, 0.001, 0.01)
    turn = [0.0, float(np.sin(angle / 2)), 0.0, float(np.cos(angle / 2))]
    normal, along = np.array([np.sin(angle), 0, np.cos(angle)]), np.array([np.cos(angle), 0, -np.sin(angle)])
    push = rng.uniform(-0.5, 1.0) * along + rng.uniform(-0.2, 0.2) * np.array([0, 1.0, 0])
    words = (
        f"obstacles.0.orientation={turn}", f"rigid.0.orientation={turn}",
        f"rigid.0.position={((0.05 + gap) * normal).tolist()}", f"rigid.0.mass={uniform(rng, 0.1, 1.0)}",
        f"contact.friction={uniform(rng, 0.05, 0.8)}",
    )  # fmt: skip

    def kick(simulation: Simulation) -> None:
        simulation.state.rigid.velocities[:] = push

    return Case("incline", words, 100, 32, kick)


def maze(rng: np.random.Generator) -> Case:
    """The plate tilts from the working pose, and the ball rolls until it hits a wall, or a little further."""
    start = np.array([-1.4965, -1.4965, -1.4965, 0.035])
    turn = np.append(rng.uniform(-0.2, 0.2, 3), 0.0)
    ramp = rng.uniform(0.03, 0.1)
    words = (
        "mesh.level=1", f"ball.friction={uniform(rng, 0.1, 0.6)}", f"ball.restitution={uniform(rng, 0.0, 0.6)}",
        f"material.young={uniform(rng, 150e3, 400e3)}", "solver.mode=newton",
    )  # fmt: skip
    return Case("maze", words, 40, 64, None, lambda t: start + turn * min(t / ramp, 1.0))


def silicone_drop(rng: np.random.Generator) -> Case:
    """The silicone piece falls or is thrown on the cube."""
    speed = np.array([*rng.uniform(-0.1, 0.1, 2), uniform(rng, -1.0, 0.0)])
    at = [*rng.uniform(-0.005, 0.005, 2).tolist(), -0.04 - uniform(rng, 0.005, 0.02)]
    words = (
        "mesh.level=1", f"material.young={uniform(rng, 100e3, 500e3)}", f"obstacles.0.position={at}",
        f"contact.friction={uniform(rng, 0.1, 0.8)}", f"damping.stiffness={uniform(rng, 1e-3, 4e-3)}",
    )  # fmt: skip

    def kick(simulation: Simulation) -> None:
        simulation.state.velocities[:] = speed

    return Case("silicone_drop", words, 24, 96, kick)


SCENES = {f.__name__: f for f in (drape, stack, incline, maze, silicone_drop)}


@dataclass
class Run:
    """What one setting made of a case.

    Attributes:
        points: Points of interest at the ends of all intervals [m], one array (intervals + 1, n, 3) for each kind.
        seconds: CPU time of the steps [s].
        parts: Steps, and how many more were taken back.
        grew: Largest energy over that at the start, over the most that has been moved [1].
        deep: How much nearer than the contact distance surfaces came, in contact distances.
        speed: Root mean square speed of the points at the end over the largest.
        apart: Largest `time_error.ball` [m]; 0 where there is none.
    """

    points: list[np.ndarray]
    seconds: float
    parts: tuple[int, int]
    grew: float
    deep: float
    speed: float
    apart: float


def kinds(simulation: Simulation) -> list[np.ndarray]:
    """Return the points of interest [m], by their kinds."""
    ball, effector = simulation.ball, simulation.effector
    if ball is not None and effector is not None:
        nodes = simulation.system.groups.rigid[0]
        return [np.array(ball.position)[None], simulation.state.positions[nodes].copy()]
    return [simulation.positions.copy()]


def play(case: Case, *words: str) -> Run:
    """Return the run of a case with more overrides. Raises StepError."""
    simulation = Simulation(load_scene(case.scene, [*case.words, "motion=off", *words]))
    interval = load_scene(case.scene, case.words).dt
    every = round(interval / simulation.scene.dt)
    if case.kick:
        case.kick(simulation)
        simulation._stepper.forget()
    d = simulation.scene.contact.contact_distance if simulation.scene.contact else 0.0
    free = simulation.scene.servos is None
    energies = [_energy(simulation)]
    rows, seconds, parts, rejected, deep, apart = [kinds(simulation)], 0.0, 0, 0, 0.0, 0.0
    for k in range(case.intervals):
        asked = [case.joints(interval * (k + end)) for end in (0, 1)] if case.joints else None
        begin = time.thread_time()
        for j in range(every):
            report = simulation.step(asked[0] + (j + 1) / every * (asked[1] - asked[0]) if asked else None)
            parts, rejected = parts + report.parts, rejected + report.rejected
            if report.time_error:
                apart = float(np.fmax(apart, report.time_error.ball))
            if report.contact and d:
                deep = max(deep, -report.contact.smallest_gap / d)
        seconds += time.thread_time() - begin
        rows.append(kinds(simulation))
        energies.append(_energy(simulation))
    points = [np.array([row[k] for row in rows]) for k in range(len(rows[0]))]
    e = np.array(energies)
    grew = float(max(0.0, (e.max() - e[0]) / max(np.ptp(e), 1e-12))) if free else 0.0
    speeds = np.sqrt((np.diff(points[0], axis=0) ** 2).sum(axis=2).mean(axis=1))
    slow = float(speeds[-1] / max(speeds.max(), 1e-300))
    return Run(points, seconds, (parts, rejected), grew, deep, slow, apart)


def _energy(simulation: Simulation) -> float:
    e = simulation.energies()
    return e.kinetic + e.strain + e.gravity


def error(run: Run, exact: Run) -> float:
    """Return the largest error of the kinds, each relative to its largest move."""
    found = []
    for a, b in zip(run.points, exact.points, strict=True):
        move = np.linalg.norm(b - b[0], axis=2).max()
        found.append(np.linalg.norm(a - b, axis=2).max() / max(move, 1e-12))
    return float(max(found))


def moved(exact: Run) -> float:
    """Return the largest move of a point [m]."""
    return max(float(np.linalg.norm(b - b[0], axis=2).max()) for b in exact.points)


def reference(case: Case) -> tuple[Run, float]:
    """Return the reference and its own error."""
    interval, exactly = load_scene(case.scene, case.words).dt, () if case.scene == "maze" else EXACTLY
    before, exact = (play(case, "dt=auto", f"time_error.accuracy={a!r}", *exactly) for a in FINEST)
    witnesses = list[float]()
    for division in (case.division // 2, case.division):
        h = interval / division
        words = [f"ball.substep={h / 4!r}"] if case.scene == "maze" else EXACTLY
        witnesses.append(error(play(case, "inertia.scheme=bdf2", f"dt={h!r}", *words), exact))
    own = error(before, exact)
    return exact, own if witnesses[1] < witnesses[0] else max(own, witnesses[1])


def automatic(case: Case, accuracy: float, exact: Run, words: Sequence[str]) -> dict[str, Any]:
    """Return what `dt = "auto"` makes of a case at an accuracy."""
    tolerance = accuracy * moved(exact) / case.intervals
    asked = [w.format(accuracy=accuracy, tolerance=repr(tolerance)) for w in words]
    try:
        run = play(case, "dt=auto", *asked)
    except StepError as stopped:
        return {"stopped": str(stopped)}
    return told(run, exact)


def told(run: Run, exact: Run) -> dict[str, Any]:
    """Return the numbers of a run for the results."""
    return {
        "error": error(run, exact), "seconds": run.seconds, "parts": run.parts[0], "rejected": run.parts[1],
        "grew": run.grew, "deep": run.deep, "speed": run.speed, "apart": run.apart,
    }  # fmt: skip


def fixed(case: Case, exact: Run, own: float) -> list[dict[str, Any]]:
    """Return the ladder of fixed steps of all schemes.

    Each goes down to the finest accuracy, or the reference's error, or to where it takes as long as what reached that.
    """
    interval, rows, most = load_scene(case.scene, case.words).dt, list[dict[str, Any]](), np.inf
    for scheme in SCHEMES:
        for division in LADDER:
            try:
                run = play(case, f"inertia.scheme={scheme}", f"dt={interval / division!r}")
            except StepError:
                continue
            rows.append({"scheme": scheme, "division": division, **told(run, exact)})
            if rows[-1]["error"] <= max(min(ACCURACIES), own):
                most = min(most, run.seconds)
                break
            if run.seconds > most:
                break
    return rows


def measure(scene: str, seed: int, words: Sequence[str]) -> dict[str, Any]:
    """Return the row of a case."""
    case = SCENES[scene](np.random.default_rng([list(SCENES).index(scene), seed]))
    exact, own = reference(case)
    return {
        "scene": scene, "seed": seed, "own": own, "moved": moved(exact),
        "exact": told(exact, exact), "fixed": fixed(case, exact, own),
        "auto": {str(a): automatic(case, a, exact, words) for a in ACCURACIES},
    }  # fmt: skip


def kept(row: dict[str, Any], accuracy: float) -> tuple[bool, bool]:
    """Return whether a case is chaotic at an accuracy, and whether `dt = "auto"` kept what is promised."""
    run, chaotic = row["auto"][str(accuracy)], row["own"] > KNOWN * accuracy
    if "stopped" in run:
        return chaotic, False
    chaotic |= run["apart"] > accuracy * row["moved"]
    if not chaotic:
        return False, bool(run["error"] <= accuracy)
    rests = row["exact"]["speed"] > RESTS or run["speed"] <= 2 * RESTS
    return True, bool(run["grew"] <= accuracy and run["deep"] <= 1.0 and rests)


def cost(row: dict[str, Any], accuracy: float) -> tuple[float, str]:
    """Return the CPU time of `dt = "auto"` over that of the cheapest fixed run of the accuracy, and that run."""
    run = row["auto"][str(accuracy)]
    good = [f for f in row["fixed"] if f["error"] <= accuracy]
    if "stopped" in run or not good or row["own"] > KNOWN * accuracy:
        return np.nan, "none"
    best = min(good, key=lambda f: f["seconds"])
    return run["seconds"] / best["seconds"], f"{best['scheme']}/{best['division']}"


def one_step(rows: Sequence[dict[str, Any]], accuracy: float) -> tuple[str, float, float, float]:
    """Return the cheapest fixed step of any scheme that keeps the accuracy in `PROMISED` of a scene's cases.

    Those count in which the place is judged. Where a ladder ended before a step, since longer ones kept the finest
    accuracy or shorter ones would take too long, the step is taken to keep the accuracy, in a time that goes with the
    number of steps. One that broke off does not keep it.

    Returns:
        Its name, else that of the one that keeps it in most; the share in which it does; its time and that of
        `dt = "auto"` [s].
    """
    own = [r for r in rows if not kept(r, accuracy)[0] and "stopped" not in r["auto"][str(accuracy)]]
    steps = list[tuple[str, float, float]]()
    for scheme in SCHEMES:
        ladders = [{f["division"]: f for f in r["fixed"] if f["scheme"] == scheme} for r in own]
        for division in LADDER:
            good, seconds = 0, 0.0
            for ladder in ladders:
                below = max((d for d in ladder if d <= division), default=None)
                if below is not None:
                    good += max(ladder) < division or (
                        below == division and ladder[below]["error"] <= accuracy
                    )
                    seconds += ladder[below]["seconds"] * division / below
            steps.append((f"{scheme}, dt / {division}", good / max(len(own), 1), seconds))
    enough = [s for s in steps if s[1] >= PROMISED]
    name, share, seconds = min(enough, key=lambda s: s[2]) if enough else max(steps, key=lambda s: s[1])
    return name, share, seconds, sum(r["auto"][str(accuracy)]["seconds"] for r in own)


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the table of the page."""
    heads = (
        *("scene", "accuracy", "cases", "kept [%]", "chaotic", "of these kept", "others kept", "worst error"),
        *(
            "one fixed step, of these kept [%]",
            "cost beside it",
            "cost, sum",
            "median",
            "90 %",
            "at most 1.5 [%]",
        ),
    )
    lines = []
    for scene in [*SCENES, "all"]:
        own = [r for r in rows if scene in (r["scene"], "all")]
        for a in ACCURACIES if own else ():
            ones = [one_step([r for r in own if r["scene"] == s], a) for s in SCENES if scene in (s, "all")]
            one = f"{ones[0][0]}: {100 * ones[0][1]:.3g}" if len(ones) == 1 else ""
            beside = sum(o[3] for o in ones) / sum(o[2] for o in ones)
            judged = [kept(r, a) for r in own]
            known = [(r["auto"][str(a)]["seconds"], c) for r in own if np.isfinite(c := cost(r, a)[0])]
            seconds, costs = np.array(known).reshape(-1, 2).T
            errors = [
                r["auto"][str(a)].get("error", np.inf) for r, (c, _) in zip(own, judged, strict=True) if not c
            ]
            chaos, place = ([ok for c, ok in judged if c == chaotic] for chaotic in (True, False))
            worst = f"{100 * max(errors):.2g} %" if errors else ""
            spread = (
                f"{seconds.sum() / (seconds / costs).sum():.2f}", f"{np.median(costs):.2f}",
                f"{np.quantile(costs, 0.9):.2f}", f"{100 * np.mean(costs <= 1.5):.0f}",
            ) if len(costs) else ("",) * 4  # fmt: skip
            share = f"{100 * np.mean([ok for _, ok in judged]):.3g}"
            counts = (len(own), share, len(chaos), sum(chaos), f"{sum(place)} of {len(place)}")
            lines.append((scene, f"{100 * a:g} %", *counts, worst, one, f"{beside:.2f}", *spread))
    return table_lines(heads, lines)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scene", nargs="*", default=list(SCENES), help="(default all)")
    parser.add_argument("--cases", type=int, default=4, help="of each scene (default 4)")
    parser.add_argument(
        "--seed", type=int, default=0, help="of the first case; the others follow (default 0)"
    )
    parser.add_argument("--results", type=Path, default=Path("build/contact_accuracy.jsonl"))
    parser.add_argument(
        "--set",
        nargs="*",
        default=["time_error.accuracy={accuracy}"],
        help="how the accuracy is asked for: overrides with {accuracy} or {tolerance}, the latter the accuracy times "
        "the largest move of the reference over the number of intervals",
    )
    parser.add_argument("--write", action="store_true", help="write the table to docs/time_error.md, too")
    parser.add_argument("--report", action="store_true", help="print the table of the results alone")
    options = parser.parse_args()
    if unknown := [s for s in options.scene if s not in SCENES]:
        parser.error(f"unknown scene {unknown[0]!r}; scenes: {', '.join(SCENES)}")
    rows = stored(options.results)
    if not options.report:
        print(f"calibration: 1000 x 1000 product {1e3 * calibration():.1f} ms", flush=True)
        for seed in range(options.seed, options.seed + options.cases):
            for scene in options.scene:
                if any((r["scene"], r["seed"]) == (scene, seed) for r in rows):
                    continue
                begin = time.thread_time()
                row = measure(scene, seed, options.set)
                store(options.results, row)
                rows.append(row)
                print(f"{scene} {seed}: own {row['own']:.2g}, "
                      f"{time.thread_time() - begin:.1f} s", flush=True)  # fmt: skip
                for a in ACCURACIES:
                    run = row["auto"][str(a)]
                    (chaotic, ok), (ratio, best) = kept(row, a), cost(row, a)
                    words = run.get("stopped") or (
                        f"error {run['error']:.2g}, {run['parts']} parts, {run['rejected']} back"
                    )
                    print(f"  {100 * a:g} %: {'kept' if ok else 'LOST'}{' (chaotic)' if chaotic else ''}, "
                          f"{words}; cost {ratio:.2f} of {best}", flush=True)  # fmt: skip
    print("\n".join(["", *table(rows)]))
    if options.write:
        write_part("time_error.md", "contact", table(rows))


if __name__ == "__main__":
    main()
