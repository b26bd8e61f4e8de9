"""`dt = "auto"` beside fixed dt: CPU time to reach a given error, side by side in one run.

Every case runs under every scheme with a ladder of fixed dt (explicit ones undivided, as far as they are stable), with
`dt = "auto"` alone, and with `dt = "auto"` and a named scheme, with a local and with a global estimate
(`time_error.estimate`), each under several tolerances. The error is the largest distance of a node from a reference,
over all intervals of the motion. `ratio` is the time of an automatic run over the time of the fixed dt that reaches
the same error, interpolated in the logarithms of both: on the curve of its own scheme, and on the best curve of all.
The verdict is of `dt = "auto"` alone: for every error between the least and the largest of the fixed dt, the time in
which the tolerances of the table reach it over that in which the fixed dt of any scheme do, both interpolated alike;
and the same where neither is interpolated but the cheapest run that reaches the error counts.
Runs of one case take turns, and the least time of each counts.
`python benchmarks/auto_dt.py --help` lists the options.
"""

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
from doc_parts import markdown, read_rows, write_part, write_rows

from tests.scenes import SHARP
from tripod_sim import Simulation, load_scene
from tripod_sim.integrators.schemes import EXPLICIT

WORKING = (-1.4965, -1.4965, -1.4965, 0.035)

BOUND = 1.3
"""Asked of the verdict."""


@dataclass(frozen=True)
class Case:
    """A motion.

    Attributes:
        scene: Name of the scene.
        words: Its overrides.
        joints: What is asked at a time [s]; None leaves all as it is.
        duration: [s], a multiple of the interval.
        interval: Between two commands, and the times at which errors are measured [s].
        fixed: Over what the interval is divided for the fixed dt of each scheme.
        tolerances: Of automatic steps whose scheme is chosen, too [m].
        named: The same where the scheme is named, for all implicit ones [m].
        reference: Overrides of the reference, and over what the interval is divided there.
        turns: How many times as often it is repeated, being short.
        brief: Whether its verdict alone is kept.
    """

    scene: str
    words: tuple[str, ...]
    joints: Callable[[float], np.ndarray] | None
    duration: float
    interval: float
    fixed: Mapping[str, tuple[int, ...]]
    tolerances: tuple[float, ...]
    named: tuple[float, ...]
    reference: tuple[tuple[str, ...], int]
    turns: int = 1
    brief: bool = False


def turn(angles: Sequence[float], seconds: float, start: Sequence[float]) -> Callable[[float], np.ndarray]:
    """Return the joints at a time [s]: servos turn by `angles` [rad] in `seconds` from the joints `start`."""
    return lambda t: np.array(start) + np.array([*angles, 0.0]) * min(t / seconds, 1.0)


def swing(t: float) -> np.ndarray:
    """Return the joints at `t` [s]: servos 0 and 2 swing at 5 and 8 Hz, commanded every 10 ms."""
    times = np.arange(0.0, 0.31, 0.01)
    first = np.interp(t, times, 0.15 * np.sin(2 * np.pi * 5 * times))
    return np.array(WORKING) + np.array(
        [first, 0.0, np.interp(t, times, 0.1 * np.sin(2 * np.pi * 8 * times)), 0.0]
    )


IMPLICIT = ("implicit_euler", "bdf2", "tr_bdf2")
COARSE = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
CHAIN = (5, 7, 10, 14, 20, 28, 40, 80, 160, 320, 640, 1280, 2560)
CLOTH = (80, 112, 128, 144, 160, 192, 256, 384, 512, 768, 1024, 2048)

POSE = (f"servos.angles={list(WORKING[:3])}", f"servos.slide={WORKING[3]}")
STEP = (0.3, 0.0, 0.0)

CASES = {
    "tripod_step": Case(
        SHARP,
        (*POSE, "solver.mode=newton"),
        turn(STEP, 0.03, WORKING),
        0.2,
        0.01,
        dict.fromkeys(IMPLICIT, COARSE),
        tuple(np.geomspace(4e-3, 3e-7, 36).round(8).tolist()),
        (3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6),
        (("inertia.scheme=tr_bdf2", "solver.mode=newton", "solver.tolerance=1e-9"), 320),
    ),
    "pendulum": Case(
        "pendulum",
        (),
        None,
        2.0,
        0.1,
        {**dict.fromkeys(IMPLICIT, CHAIN[:6:2] + CHAIN[6:11]), "semi_implicit_euler": CHAIN, "rk4": CHAIN},
        tuple(float(f"{x:.1e}") for x in np.geomspace(1e-1, 1e-11, 31)),
        (1e-4, 3e-5, 1e-5, 3e-6, 1e-6),
        (("inertia.scheme=rk4", "inertia.substeps=off"), 10_000),
        10,
    ),
    "cloth": Case(
        "cloth",
        ("springs.nodes=12",),
        None,
        1.0,
        0.05,
        {**dict.fromkeys(IMPLICIT, COARSE), "semi_implicit_euler": CLOTH, "rk4": CLOTH},
        (1e-2, 1e-3, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 3e-8, 1e-8, 1e-9, 3e-10),
        (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5),
        (("inertia.scheme=rk4", "inertia.substeps=off"), 4000),
    ),
}

FLAT = (0.0, 0.0, 0.0, 0.0)


def other(words: tuple[str, ...], joints: Callable[[float], np.ndarray]) -> Case:
    """Return a case like `tripod_step` of another motion or solver, of which the verdict is enough."""
    return replace(CASES["tripod_step"], words=words, joints=joints, brief=True)


CASES |= {
    "tripod_one_solve": other(POSE, turn(STEP, 0.03, WORKING)),
    "tripod_back": other((*POSE, "solver.mode=newton"), turn((0.0, -0.25, 0.0), 0.02, WORKING)),
    "tripod_together": other((*POSE, "solver.mode=newton"), turn((0.12, 0.12, 0.12), 0.05, WORKING)),
    "tripod_swing": other((*POSE, "solver.mode=newton"), swing),
    "tripod_flat": other(("solver.mode=newton",), turn((-0.4, 0.0, 0.0), 0.03, FLAT)),
}


@dataclass
class Run:
    """One setting of a case.

    Attributes:
        scheme: Its own; `auto` where that is chosen.
        setting: dt [s], or the tolerance [m].
        estimate: Of an automatic run, `local` or `global`, or `auto`; empty with a fixed dt.
        simulation: Built once.
        error: Largest distance of a node from the reference [m].
        times: CPU time of the motion, each time it was made [s].
        parts: Steps that it took in all, and how many more were taken back.
    """

    scheme: str
    setting: float
    estimate: str
    simulation: Simulation
    error: float = np.nan
    times: list[float] = field(default_factory=list)
    parts: tuple[int, int] = (0, 0)

    @property
    def seconds(self) -> float:
        """Least CPU time of the motion [s]."""
        return min(self.times)

    @property
    def name(self) -> str:
        """The setting in words."""
        if not self.estimate:
            return f"{1e3 * self.setting:.4g} ms"
        return f"{1e6 * self.setting:g} um" + (f", {self.estimate}" if self.estimate != "auto" else "")


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


def settings(case: Case, mode: Sequence[str], *, named: bool) -> list[Run]:
    """Return all runs of a case, not yet made; `named`: also automatic ones with a scheme."""
    runs = []
    for scheme, divisions in case.fixed.items():
        own = (f"inertia.scheme={scheme}", *mode)
        if scheme in EXPLICIT:
            own = (*own, "inertia.substeps=off")
        for division in divisions:
            dt = case.interval / division
            simulation = built(case, *own, f"dt={dt!r}")
            if dt < getattr(simulation._stepper, "limit", np.inf):
                runs.append(Run(scheme, dt, "", simulation))
    automatic = (*mode, f"dt={case.interval!r}", "dt=auto")
    for tolerance in case.tolerances:
        simulation = built(case, *automatic, f"time_error.tolerance={tolerance!r}")
        runs.append(Run("auto", tolerance, "auto", simulation))
    for scheme in IMPLICIT if named else ():
        for tolerance in case.named:
            words = (*automatic, f"inertia.scheme={scheme}", f"time_error.tolerance={tolerance!r}")
            for estimate in ("local", "global"):
                simulation = built(case, *words, f"time_error.estimate={estimate}")
                runs.append(Run(scheme, tolerance, estimate, simulation))
    return runs


def cheapest(runs: Sequence[Run], error: float, *, between: bool = True) -> tuple[float, str]:
    """Return the CPU time [s] in which `runs` reach `error` [m], and which of them.

    `between`: whether it is interpolated between neighbours on a ladder. NaN below the least error.
    """
    best = (np.inf, "none")
    for i, a in enumerate(runs):
        if a.error <= error:
            best = min(best, (a.seconds, f"{a.scheme} {a.name}"))
            continue
        for b in runs[max(0, i - 1) : i + 2] if between else ():
            if (b.scheme, b.estimate) == (a.scheme, a.estimate) and b.error < error and b.seconds > a.seconds:
                share = np.log(a.error / error) / np.log(a.error / b.error)
                seconds = float(a.seconds * (b.seconds / a.seconds) ** share)
                best = min(best, (seconds, f"{a.scheme} {a.name} to {b.name}"))
    return best if np.isfinite(best[0]) else (np.nan, "none")


ROWS, VERDICTS = "time_error_auto.csv", "time_error_verdicts.csv"
TOLD = {
    "tripod_step": "servo 0 by 0.3 rad in 30 ms",
    "tripod_one_solve": "the same in one-solve mode",
    "tripod_back": "servo 1 back by 0.25 rad in 20 ms",
    "tripod_together": "all servos by 0.12 rad in 50 ms",
    "tripod_swing": "servos 0 and 2 swing at 5 and 8 Hz",
    "tripod_flat": "from the flat pose, servo 0 by -0.4 rad in 30 ms",
    "pendulum": "the pendulum, 2 s",
    "cloth": "a cloth of 12 x 12 nodes, 1 s",
}
"""The cases in the words of the page."""


def verdict(automatic: Sequence[Run], fixed: Sequence[Run]) -> dict[str, str]:
    """Return by how much `dt = "auto"` alone is slower than the best fixed dt, by the columns of the page."""
    least = max(min(r.error for r in runs) for runs in (automatic, fixed))
    most = max(r.error for r in fixed)
    rows, steps = [], []
    for error in np.geomspace(1.0001 * least, most, 400):
        (own, by), (best, of) = cheapest(automatic, error), cheapest(fixed, error)
        rows.append((own / best, error, by, of))
        own, best = (cheapest(runs, error, between=False)[0] for runs in (automatic, fixed))
        steps.append(own / best)
    ratio, error, by, of = max(rows)
    ratios = [row[0] for row in rows]
    within = np.mean(np.array(ratios) <= BOUND)
    return {
        "worst": f"{ratio:.2f}",
        "median": f"{np.median(ratios):.2f}",
        f"within {BOUND} [%]": f"{100 * within:.0f}",
        "errors [um]": f"{1e6 * least:.2g} to {1e6 * most:.2g}",
        "worst at [um]": f"{1e6 * error:.3g}",
        "there": by,
        "against": of,
        "worst, not interpolated": f"{max(steps):.2f}",
        "median, not interpolated": f"{np.median(steps):.2f}",
    }


def table(runs: Sequence[Run]) -> list[str]:
    """Return the rows of a case."""
    fixed = [r for r in runs if not r.estimate]
    lines = [
        "| scheme | dt or tolerance | error [um] | time [ms] | parts | taken back | ratio, same | ratio, best |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for run in runs:
        ratios = ["", ""]
        if run.estimate:
            same = [r for r in fixed if r.scheme == run.scheme]
            found = [run.seconds / cheapest(front, run.error)[0] for front in (same, fixed)]
            ratios = [f"{ratio:.2f}" if np.isfinite(ratio) else "" for ratio in found]
        lines.append(
            f"| {run.scheme} | {run.name} | {1e6 * run.error:.3g} | {1e3 * run.seconds:.2f} | {run.parts[0]} | "
            f"{run.parts[1]} | {ratios[0]} | {ratios[1]} |"
        )
    return lines


def summary() -> list[str]:
    """Return the verdicts as the page shows them."""
    rows = {row["case"]: row for row in read_rows(VERDICTS)}
    columns = ["worst", "median", f"within {BOUND} [%]", "errors [um]", "worst, not interpolated"]
    shown = [{"motion": words} | rows[case] for case, words in TOLD.items() if case in rows]
    return markdown(shown, ["motion", *columns])


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", nargs="*", default=list(CASES), help=f"of {', '.join(CASES)} (default all)")
    parser.add_argument("--repeats", type=int, default=7, help="runs of each setting (default 7)")
    parser.add_argument("--set", action="append", default=[], help="override of the scene, as of tripod run")
    parser.add_argument("--default", action="store_true", help='of automatic runs only `dt = "auto"` alone')
    parser.add_argument("--write", action="store_true", help="write docs/time_error.md and its tables, too")
    options = parser.parse_args()
    if unknown := [c for c in options.cases if c not in CASES]:
        parser.error(f"unknown case {unknown[0]!r}; cases: {', '.join(CASES)}")
    if options.repeats < 1:
        parser.error(f"--repeats is {options.repeats}; it must be at least 1")
    machine = calibration()
    print(f"calibration: 1000 x 1000 product {1e3 * machine:.1f} ms")
    for name in options.cases:
        case = CASES[name]
        words, division = case.reference
        exact, _, _ = motion(case, built(case, *words, f"dt={case.interval / division!r}"))
        half, _, _ = motion(case, built(case, *words, f"dt={2 * case.interval / division!r}"))
        own = np.linalg.norm(exact - half, axis=2).max()
        told = f"Reference: {words[0].partition('=')[2]}, dt {1e3 * case.interval / division:g} ms; it differs by "
        told += f"{1e6 * own:.2g} um from twice its dt. Calibration {1e3 * machine:.1f} ms"
        told += f"; {', '.join(f'`{w}`' for w in options.set)}." if options.set else "."
        print(f"\n## {name}\n\n{told}\n", flush=True)
        runs = settings(case, options.set, named=not (options.default or case.brief))
        for _ in range(options.repeats * case.turns):
            for run in runs:
                positions, seconds, run.parts = motion(case, run.simulation)
                run.error = float(np.linalg.norm(positions - exact, axis=2).max())
                run.times.append(seconds)
        found = verdict([r for r in runs if r.scheme == "auto"], [r for r in runs if not r.estimate])
        lines = table(runs)
        print("\n".join([*lines, "", *(f"{what}: {value}" for what, value in found.items())]), flush=True)
        if options.write:
            found |= {
                "reference's own error [um]": f"{1e6 * own:.2g}",
                "calibration [ms]": f"{1e3 * machine:.1f}",
            }
            write_rows(VERDICTS, name, markdown([found], list(found)))
            if not case.brief:
                write_rows(ROWS, name, lines)
            write_part("time_error.md", "auto", summary())


if __name__ == "__main__":
    main()
