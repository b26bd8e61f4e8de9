"""Time of one simulated step: the Tripod at each mesh level and the preset `sofa`, beside a calibration of the machine.

The motion is the demo's: from the working pose, the three servos swing by 0.15 rad with a period of 2 s, a third of a
period apart. CPU time of one thread. `python benchmarks/step.py --help` lists the options.
"""

import argparse
import subprocess
import sys
import time

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

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
COLUMNS = ("elements", "coords", "unknowns", "median", "mean", "p99", "ratio", "first", "solves", "renewed")


def swing(t: float) -> np.ndarray:
    """Return the joints at `t` [s]."""
    phase = 2 * np.pi * t / 2.0 + 2 * np.pi * np.arange(3) / 3
    return np.array([*(-1.4965 + 0.15 * min(t, 1.0) * np.sin(phase)), 0.035])


def measure(scene: str, overrides: list[str], steps: int) -> dict[str, float]:
    """Return sizes and step times [ms] of `scene` with `overrides`."""
    simulation = Simulation(load_scene(scene, [*SCENE, *overrides]))
    dt = simulation.scene.dt
    taken, renewed, solves = np.empty(steps), 0, 0
    for k in range(steps):
        joints = swing((k + 1) * dt)
        begin = time.thread_time()
        report = simulation.step(joints)
        taken[k] = 1e3 * (time.thread_time() - begin)
        renewed += report.factorisations
        solves += report.iterations
    start = time.thread_time()
    for _ in range(20):
        simulation.compliance()
    median, p99 = float(np.median(taken)), float(np.percentile(taken, 99))
    return {
        "elements": len(simulation.mesh.elements),
        "coords": 3 * len(simulation.mesh.nodes),
        "unknowns": simulation.unknowns,
        "first": taken[0],
        "median": median,
        "mean": float(taken.mean()),
        "p99": p99,
        "ratio": p99 / median,
        "solves": solves / steps,
        "renewed": renewed / steps,
        "compliance": 1e3 * (time.thread_time() - start) / 20,
    }


def process_start() -> float:
    """Return the time [s] from the first import to the end of the first step, in a process of its own."""
    found = subprocess.run([sys.executable, "-c", START], check=True, capture_output=True, text=True)
    return float(found.stdout)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", type=int, default=1000, help="steps of each row (default 1000)")
    parser.add_argument(
        "--levels",
        type=int,
        nargs="+",
        default=[1, 2, 3, 4],
        help="mesh levels of `tripod` (default 1 2 3 4)",
    )
    parser.add_argument("--mode", default="one_solve", help="solver.mode: one_solve (default) or newton")
    options = parser.parse_args()
    print(f"1000 x 1000 float64 product, one thread: {1e3 * calibration():.1f} ms")
    print(
        f"solver.mode {options.mode}; CPU time of one thread [ms]; ratio: p99 over median; first: of the first step"
    )
    print("  ".join(f"{c:>10}" for c in ("scene", "level", *COLUMNS, "compliance", "SOFA")))
    rows = [("tripod", level) for level in options.levels] + [("tripod_sofa", level) for level in SOFA]
    for scene, level in rows:
        row = measure(scene, [f"mesh.level={level}", f"solver.mode={options.mode}"], options.steps)
        cells = [scene[-10:], str(level), *(str(row[c]) for c in COLUMNS[:3])]
        cells += [f"{row[c]:.3f}" for c in (*COLUMNS[3:], "compliance")]
        cells.append(f"{SOFA[level]:g}" if scene == "tripod_sofa" else "")
        print("  ".join(f"{c:>10}" for c in cells), flush=True)
    print(
        "solves: linear solves a step; renewed: share of steps with a new factorisation; SOFA: a step there [ms]"
    )
    process_start()
    print(f"second process, first import to end of first step (tripod): {process_start():.2f} s")


if __name__ == "__main__":
    main()
