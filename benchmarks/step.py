"""Time of one simulated step for each mesh level, beside a calibration of the machine.

The motion is the demo's: from the working pose, the three servos swing by 0.15 rad with a period of 2 s, a third of a
period apart. CPU time of one thread. `python benchmarks/step.py --help` lists the options.
"""

import argparse
import time

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from tripod_sim import Simulation, load_scene

SCENE = ("servos.angles=[-1.4965, -1.4965, -1.4965]", "servos.slide=0.035")


def swing(t: float) -> np.ndarray:
    """Return the joints at `t` [s]."""
    phase = 2 * np.pi * t / 2.0 + 2 * np.pi * np.arange(3) / 3
    return np.array([*(-1.4965 + 0.15 * min(t, 1.0) * np.sin(phase)), 0.035])


def measure(overrides: list[str], steps: int) -> dict[str, float]:
    """Return sizes and step times [ms] of the scene `tripod` with `overrides`."""
    start = time.perf_counter()
    simulation = Simulation(load_scene("tripod", [*SCENE, *overrides]))
    built = time.perf_counter() - start
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
    return {
        "elements": len(simulation.mesh.elements),
        "unknowns": simulation.unknowns,
        "build": built,
        "first": taken[0],
        "median": float(np.median(taken)),
        "mean": float(taken.mean()),
        "p99": float(np.percentile(taken, 99)),
        "solves": solves / steps,
        "renewed": renewed / steps,
        "compliance": 1e3 * (time.thread_time() - start) / 20,
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", type=int, default=1000, help="steps of each row (default 1000)")
    parser.add_argument(
        "--levels", type=int, nargs="+", default=[1, 2, 3, 4], help="mesh levels (default 1 2 3 4)"
    )
    options = parser.parse_args()
    print(f"1000 x 1000 float64 product, one thread: {1e3 * calibration():.1f} ms")
    print("scene tripod, dt 5 ms; CPU time of one thread [ms]")
    columns = (
        "level",
        "elements",
        "unknowns",
        "median",
        "mean",
        "p99",
        "first",
        "solves",
        "renewed",
        "compliance",
    )
    print("  ".join(f"{c:>10}" for c in columns))
    for level in options.levels:
        row = measure([f"mesh.level={level}"], options.steps)
        cells = [str(level), str(row["elements"]), str(row["unknowns"])] + [
            f"{row[c]:.3f}" for c in columns[3:]
        ]
        print("  ".join(f"{c:>10}" for c in cells))
    print("solves: linear solves a step; renewed: share of steps with a new factorisation")


if __name__ == "__main__":
    main()
