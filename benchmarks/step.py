"""Time of one simulated step: the Tripod at each mesh level and the preset `sofa`, beside a calibration of the machine.

The motion is the demo's: from the working pose, the three servos swing by 0.15 rad with a period of 2 s, a third of a
period apart. CPU time of one thread. The same steps run several times, to the same bits: `median`, `p99` and `ratio`,
p99 over median, are of all steps of all runs as the clock told them; `own` is the ratio where of each step the shortest
time of all runs counts; `machine` is the ratio of a matrix product of the same length that runs after each step: what
of `ratio` is the machine's. `--write` puts a table into docs/speed.md.
"""

import argparse
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from benchmarks.doc_parts import write_part
from tests.scenes import SHARP
from tripod_sim import Simulation, load_scene

SCENE = ("servos.angles=[-1.4965, -1.4965, -1.4965]", "servos.slide=0.035")
SOFA = {5: 5.4, 6: 19.9, 7: 40.8}
"""Step [ms] of SOFA v25.06 on meshes of nearly the same size (519, 1743, 3177 coordinates), on such a machine."""

START = """
import time
begin = time.perf_counter()
from tripod_sim import Simulation, load_scene
simulation = Simulation(load_scene("tripod"))
simulation.step()
print(time.perf_counter() - begin)
"""
COLUMNS = (
    "elements",
    "coords",
    "unknowns",
    "median",
    "mean",
    "p99",
    "ratio",
    "own",
    "machine",
    "first",
    "solves",
    "renewed",
)


def swing(t: float) -> np.ndarray:
    """Return the joints at `t` [s]."""
    phase = 2 * np.pi * t / 2.0 + 2 * np.pi * np.arange(3) / 3
    return np.array([*(-1.4965 + 0.15 * min(t, 1.0) * np.sin(phase)), 0.035])


def spread(taken: np.ndarray) -> float:
    """Return p99 over median."""
    return float(np.percentile(taken, 99) / np.median(taken))


def product(duration: float) -> Callable[[], object]:
    """Return a computation without branches or memory of its own that takes about `duration` [ms] of one thread."""
    a, out = np.eye(64), np.empty((64, 64))
    begin = time.thread_time()
    for _ in range(500):
        np.matmul(a, a, out=out)
    count = max(1, round(500 * duration / (1e3 * (time.thread_time() - begin))))

    def work() -> None:
        for _ in range(count):
            np.matmul(a, a, out=out)

    return work


def measure(scene: str, overrides: list[str], steps: int, repeats: int) -> dict[str, float]:
    """Return sizes and step times [ms] of `scene` with `overrides`."""
    simulation = Simulation(load_scene(scene, [*SCENE, *overrides]))
    dt = simulation.scene.dt
    (taken, fixed), renewed, solves = np.empty((2, repeats, steps)), 0, 0
    work = product(1e3 * step_time(simulation))
    for run, beside in zip(taken, fixed, strict=True):
        simulation.reset()
        for k in range(steps):
            joints = swing((k + 1) * dt)
            begin = time.thread_time()
            report = simulation.step(joints)
            run[k] = 1e3 * (time.thread_time() - begin)
            renewed += report.factorisations
            solves += report.iterations
            begin = time.thread_time()
            work()
            beside[k] = 1e3 * (time.thread_time() - begin)
    start = time.thread_time()
    for _ in range(20):
        simulation.compliance()
    return {
        "elements": simulation.mesh.count,
        "coords": 3 * len(simulation.mesh.nodes),
        "unknowns": simulation.unknowns,
        "first": float(taken[:, 0].max()),
        "median": float(np.median(taken)),
        "mean": float(taken.mean()),
        "p99": float(np.percentile(taken, 99)),
        "ratio": spread(taken),
        "own": spread(taken.min(axis=0)),
        "machine": spread(fixed),
        "solves": solves / taken.size,
        "renewed": renewed / taken.size,
        "compliance": 1e3 * (time.thread_time() - start) / 20,
    }


def step_time(simulation: Simulation) -> float:
    """Return about how long a step takes, CPU time of one thread [s]."""
    begin = time.thread_time()
    for k in range(50):
        simulation.step(swing((k + 1) * simulation.scene.dt))
    return (time.thread_time() - begin) / 50


def process_start() -> float:
    """Return the time [s] from the first import to the end of the first step, in a process of its own."""
    found = subprocess.run([sys.executable, "-c", START], check=True, capture_output=True, text=True)
    return float(found.stdout)


PAGE = (
    "| scene | step | unknowns | median [ms] | 99th percentile [ms] | SOFA [ms] |",
    "|---|---|---|---|---|---|",
)


def page_row(scene: str, level: int, row: dict[str, float]) -> str:
    """Return a row of the table of the page."""
    if scene == "tripod_sofa":
        name = f"`tripod_sofa`, level {level}"
    elif scene == "tripod":
        name = f"`tripod`, level {level}, h20"
    else:
        name = f"`tripod`, level {level}, ideal clamp" + (", draft" if level == 2 else "")
    dt = load_scene(scene).dt
    sofa = f"{SOFA[level]:g}" if scene == "tripod_sofa" else ""
    return (
        f"| {name} | {1e3 * dt:g} ms | {row['unknowns']} | {row['median']:.2f} | {row['p99']:.2g} | {sofa} |"
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", type=int, default=1000, help="steps of each run (default 1000)")
    parser.add_argument("--repeats", type=int, default=5, help="runs of each row (default 5)")
    parser.add_argument(
        "--levels",
        type=int,
        nargs="+",
        default=[1, 2, 3, 4],
        help="mesh levels of `tripod` (default 1 2 3 4)",
    )
    parser.add_argument("--mode", default="one_solve", help="solver.mode: one_solve (default) or newton")
    parser.add_argument("--write", action="store_true", help="write docs/speed.md, too")
    options = parser.parse_args()
    product = calibration()
    print(f"1000 x 1000 float64 product, one thread: {1e3 * product:.1f} ms")
    print(
        f"solver.mode {options.mode}; CPU time of one thread [ms]; ratio: p99 over median, own: of the shortest times, "
        "machine: of a product of that length; first: of the first step, the longest"
    )
    print("  ".join(f"{c:>10}" for c in ("scene", "level", *COLUMNS, "compliance", "SOFA")))
    lines = list(PAGE)
    rows = [
        ("tripod", 8),
        *((SHARP, level) for level in options.levels),
        *(("tripod_sofa", level) for level in SOFA),
    ]
    for scene, level in rows:
        row = measure(
            scene, [f"mesh.level={level}", f"solver.mode={options.mode}"], options.steps, options.repeats
        )
        cells = [Path(scene).stem[-12:], str(level), *(str(row[c]) for c in COLUMNS[:3])]
        cells += [f"{row[c]:.3f}" for c in (*COLUMNS[3:], "compliance")]
        cells.append(f"{SOFA[level]:g}" if scene == "tripod_sofa" else "")
        print("  ".join(f"{c:>10}" for c in cells), flush=True)
        lines.append(page_row(scene, level, row))
    print(
        "solves: linear solves a step; renewed: share of steps with a new factorisation; SOFA: a step there [ms]"
    )
    process_start()
    second = process_start()
    print(f"second process, first import to end of first step (tripod): {second:.2f} s")
    if options.write:
        note = (
            f"One thread; a 1000 x 1000 float64 product took {1e3 * product:.0f} ms beside it. A second process takes "
            f"{second:.1f} s from the first import to the end of its first step."
        )
        write_part("speed.md", "steps", [*lines, "", note])


if __name__ == "__main__":
    main()
