"""`dt = "auto"` beside fixed dt: CPU time to reach a given error, side by side in one run.

Every case runs under every scheme with a ladder of fixed dt, and with `dt = "auto"` under several tolerances, with a
local and with a global estimate (`time_error.estimate`); the error is the largest distance of a node from a reference,
over all intervals of the motion. `ratio` is the time of an automatic run over the time of the fixed dt that reaches the
same error: on the curve of its own scheme (interpolated in the logarithms of both), and on the best curve of all
schemes. Runs of one case take turns, and the least time of each counts.
`python benchmarks/auto_dt.py --help` lists the options.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
from doc_parts import write_part

from tripod_sim import Simulation, load_scene

WORKING = (-1.4965, -1.4965, -1.4965, 0.035)


@dataclass(frozen=True)
class Case:
    """A motion.

    Attributes:
        scene: Name of the scene.
        words: Its overrides.
        joints: What is asked at a time [s]; None leaves all as it is.
        duration: [s], a multiple of the interval.
        interval: Between two commands, and the times at which errors are measured [s].
        schemes: To compare.
        divisions: Fixed dt are the interval over these.
        tolerances: Of the automatic steps [m].
        reference: Overrides of the reference, and over what the interval is divided there.
    """

    scene: str
    words: tuple[str, ...]
    joints: Callable[[float], np.ndarray] | None
    duration: float
    interval: float
    schemes: tuple[str, ...]
    divisions: tuple[int, ...]
    tolerances: tuple[float, ...]
    reference: tuple[tuple[str, ...], int]


def tripod_step(t: float) -> np.ndarray:
    """Return the joints at `t` [s]: servo 0 turns by 0.3 rad in 30 ms from the working pose."""
    return np.array(WORKING) + np.array([0.3 * min(t / 0.03, 1.0), 0.0, 0.0, 0.0])


CASES = {
    "tripod_step": Case(
        "tripod",
        (f"servos.angles={list(WORKING[:3])}", f"servos.slide={WORKING[3]}", "solver.mode=newton"),
        tripod_step,
        0.2,
        0.01,
        ("implicit_euler", "bdf2", "tr_bdf2"),
        (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64),
        (3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6),
        (("inertia.scheme=tr_bdf2", "solver.tolerance=1e-9"), 320),
    ),
    "pendulum": Case(
        "pendulum",
        (),
        None,
        2.0,
        0.1,
        ("implicit_euler", "bdf2", "tr_bdf2"),
        (5, 10, 20, 40, 80, 160, 320, 640),
        (1e-4, 3e-5, 1e-5, 3e-6, 1e-6),
        (("inertia.scheme=tr_bdf2", "solver.tolerance=1e-10"), 4000),
    ),
    "cloth": Case(
        "cloth",
        ("springs.nodes=12",),
        None,
        1.0,
        0.05,
        ("implicit_euler", "bdf2", "tr_bdf2"),
        (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64),
        (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5),
        (("inertia.scheme=tr_bdf2", "solver.tolerance=1e-9"), 1600),
    ),
}


@dataclass
class Run:
    """One setting of a case.

    Attributes:
        scheme: Its own.
        setting: dt [s], or the tolerance [m].
        estimate: Of an automatic run, `local` or `global`; empty with a fixed dt.
        simulation: Built once.
        error: Largest distance of a node from the reference [m].
        seconds: Least CPU time of the motion [s].
        parts: Steps that it took in all, and how many more were taken back.
    """

    scheme: str
    setting: float
    estimate: str
    simulation: Simulation
    error: float = np.nan
    seconds: float = np.inf
    parts: tuple[int, int] = (0, 0)


def motion(case: Case, simulation: Simulation) -> tuple[np.ndarray, float, tuple[int, int]]:
    """Return positions at all intervals [m], CPU time [s], and parts of steps made and taken back."""
    simulation.reset()
    dt, state = simulation.scene.dt, simulation.state
    every, found, parts, rejected = round(case.interval / dt), [], 0, 0
    taken = 0.0
    for _ in range(round(case.duration / case.interval)):
        start = time.thread_time()
        for _ in range(every if case.joints else 1):
            joints = case.joints(state.time + dt) if case.joints else None
            report = simulation.advance(every) if joints is None else simulation.step(joints)
            parts, rejected = parts + report.parts, rejected + report.rejected
        taken += time.thread_time() - start
        found.append(state.positions.copy())
    return np.array(found), taken, (parts, rejected)


def built(case: Case, *words: str) -> Simulation:
    """Return the simulation of a case with more overrides."""
    return Simulation(load_scene(case.scene, [*case.words, *words]))


def settings(case: Case, mode: Sequence[str]) -> list[Run]:
    """Return all runs of a case, not yet made."""
    runs = []
    for scheme in case.schemes:
        own = (f"inertia.scheme={scheme}", *mode)
        for division in case.divisions:
            dt = case.interval / division
            runs.append(Run(scheme, dt, "", built(case, *own, f"dt={dt!r}")))
        for tolerance in case.tolerances:
            words = (f"dt={case.interval!r}", "dt=auto", f"time_error.tolerance={tolerance!r}")
            for estimate in ("local", "global"):
                simulation = built(case, *own, *words, f"time_error.estimate={estimate}")
                runs.append(Run(scheme, tolerance, estimate, simulation))
    return runs


def time_at(fixed: Sequence[Run], error: float) -> float:
    """Return the CPU time [s] in which fixed dt reach `error` [m], interpolated; NaN below the least error there."""
    best = np.inf
    for a in fixed:
        if a.error <= error:
            best = min(best, a.seconds)
        for b in fixed:
            if b.error < error < a.error and b.seconds > a.seconds:
                share = np.log(a.error / error) / np.log(a.error / b.error)
                if _neighbours(fixed, a, b):
                    best = min(best, a.seconds * (b.seconds / a.seconds) ** share)
    return best if np.isfinite(best) else np.nan


def _neighbours(runs: Sequence[Run], a: Run, b: Run) -> bool:
    """Return whether two fixed dt are neighbours on the ladder of one scheme."""
    ladder = [r for r in runs if r.scheme == a.scheme]
    return b in ladder and abs(ladder.index(a) - ladder.index(b)) == 1


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", nargs="*", default=list(CASES), help=f"of {', '.join(CASES)} (default all)")
    parser.add_argument("--repeats", type=int, default=5, help="runs of each setting (default 5)")
    parser.add_argument("--set", action="append", default=[], help="override of the scene, as of tripod run")
    parser.add_argument("--write", action="store_true", help="write the tables to docs/time_error.md, too")
    options = parser.parse_args()
    if unknown := [c for c in options.cases if c not in CASES]:
        parser.error(f"unknown case {unknown[0]!r}; cases: {', '.join(CASES)}")
    machine = calibration()
    print(f"calibration: 1000 x 1000 product {1e3 * machine:.1f} ms")
    for name in options.cases:
        case = CASES[name]
        words, division = case.reference
        exact, _, _ = motion(case, built(case, *words, f"dt={case.interval / division!r}"))
        half, _, _ = motion(case, built(case, *words, f"dt={2 * case.interval / division!r}"))
        own = np.linalg.norm(exact - half, axis=2).max()
        print(f"\n## {name}\n\nreference: differs by {1e6 * own:.2g} um from twice its dt\n")
        runs = settings(case, options.set)
        for _ in range(options.repeats):
            for run in runs:
                positions, seconds, run.parts = motion(case, run.simulation)
                run.error = float(np.linalg.norm(positions - exact, axis=2).max())
                run.seconds = min(run.seconds, seconds)
        fixed = [r for r in runs if not r.estimate]
        lines = [
            "| scheme | dt or tolerance | error [um] | time [ms] | parts | taken back | ratio, same | ratio, best |",
            "|---|---|---|---|---|---|---|---|",
        ]
        for run in runs:
            of = (
                f"{1e6 * run.setting:g} um, {run.estimate}" if run.estimate else f"{1e3 * run.setting:.4g} ms"
            )
            ratios = ["", ""]
            if run.estimate:
                same = [r for r in fixed if r.scheme == run.scheme]
                ratios = [f"{run.seconds / time_at(front, run.error):.2f}" for front in (same, fixed)]
            lines.append(
                f"| {run.scheme} | {of} | {1e6 * run.error:.3g} | {1e3 * run.seconds:.2f} | {run.parts[0]} | "
                f"{run.parts[1]} | {ratios[0]} | {ratios[1]} |"
            )
        print("\n".join(lines))
        if options.write:
            words = f"; {', '.join(f'`{w}`' for w in options.set)}" if options.set else ""
            write_part(
                "time_error.md", f"auto {name}", [f"Calibration {1e3 * machine:.1f} ms{words}.", "", *lines]
            )


if __name__ == "__main__":
    main()
