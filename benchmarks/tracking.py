"""How well the simulated Tripod goes where it is told to, and what that costs.

    python benchmarks/tracking.py [--against CHECKOUT] [--repeats 5]

Three motions about the working pose: the circle of `tests/ik` (10 mm, 2 s), followed by inverse kinematics with the
simulator's own compliance, its error against the circle; the servos swinging by 0.25 rad at 0.5 Hz and by 0.3 rad at
2 Hz, a third of a period apart, the error against the same steps solved to 1e-7 N. Errors are the effector's [mm]: root
mean square, worst, largest change from one step to the next. Mean time of a step: CPU time of one thread, of each step
the shortest of all repeats. With `--against` the same runs alternate with those of another checkout that is set up.
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from tests.ik.tripod_loop import circle, follow
from tests.scenes import SHARP
from tripod_ik.tracker_settings import TrackerSettings
from tripod_sim import Simulation, load_scene

AT_WORK = ("servos.angles=[-1.4965, -1.4965, -1.4965]", "servos.slide=0.035")
EXACT = ("solver.mode=newton", "solver.tolerance=1e-7")
SCENES = {
    "tripod": ("tripod", "mesh.level=12", 3.0),
    "tripod_sharp": (SHARP, "mesh.level=2", 3.0),
    "tripod_sofa 5": ("tripod_sofa", "mesh.level=5", 2.0),
    "tripod_sofa 7": ("tripod_sofa", "mesh.level=7", 2.0),
}
MOTIONS = {"slow": (0.25, 0.5), "fast": (0.3, 2.0)}
"""Amplitude [rad] and frequency [Hz]."""

Row = dict[str, float]


def joints(motion: str, t: float) -> np.ndarray:
    """Return the joints at `t` [s]; the amplitude grows within the first second."""
    amplitude, frequency = MOTIONS[motion]
    phase = 2 * np.pi * (frequency * t + np.arange(3) / 3)
    return np.array([*(-1.4965 + amplitude * min(t, 1.0) * np.sin(phase)), 0.035])


def swing(scene: str, motion: str, words: tuple[str, ...], repeats: int) -> tuple[np.ndarray, Row]:
    """Return the effector's positions [m], shape (steps, 3), and what a step took."""
    name, mesh, seconds = SCENES[scene]
    simulation = Simulation(load_scene(name, [*AT_WORK, mesh, *words]))
    dt = simulation.scene.dt
    steps = round(seconds / dt)
    positions, taken = np.empty((steps, 3)), np.full(steps, np.inf)
    for _ in range(repeats):
        simulation.reset()
        solves = renewed = 0
        for k in range(steps):
            goal = joints(motion, (k + 1) * dt)
            begin = time.thread_time()
            report = simulation.step(goal)
            taken[k] = min(taken[k], time.thread_time() - begin)
            positions[k] = simulation.state.centres[0]
            solves += report.iterations
            renewed += report.factorisations
    return positions, {"mean": 1e3 * taken.mean(), "solves": solves / steps, "renewed": renewed / steps}


def errors(off: np.ndarray) -> Row:
    """Return the figures [mm] of what is missed, shape (steps, 3) [m]."""
    far = 1e3 * np.linalg.norm(off, axis=1)
    jump = 1e3 * np.linalg.norm(np.diff(off, axis=0), axis=1)
    return {"rms": float(np.sqrt(np.mean(far**2))), "worst": float(far.max()), "jump": float(jump.max())}


def measure(run: str, repeats: int) -> Row:
    """Return one row; `run` is circle, circle-newton, or a scene and a motion."""
    if run.startswith("circle"):
        words = ("solver.mode=newton",) if run.endswith("newton") else ()
        found = follow(circle, TrackerSettings(angle_speed=10.0), words, seconds=6.0)
        return errors(found.effector - found.target)
    scene, motion = run.rsplit(" ", 1)
    exact, _ = swing(scene, motion, EXACT, 1)
    positions, row = swing(scene, motion, (), repeats)
    return {**errors(positions - exact), **row}


def other(checkout: Path, run: str, repeats: int) -> Row:
    """Return the row of another checkout, measured by its own Python."""
    command = [
        str(checkout / ".venv/bin/python"),
        str(Path(__file__).resolve()),
        "--one",
        run,
        "--repeats",
        str(repeats),
    ]
    paths = f"{checkout}:{Path(__file__).resolve().parent}"
    done = subprocess.run(
        command, check=True, capture_output=True, text=True, cwd=checkout, env={"PYTHONPATH": paths}
    )
    return dict(json.loads(done.stdout))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--against", type=Path, help="another checkout, set up, to measure beside this one")
    parser.add_argument("--repeats", type=int, default=5, help="runs of each row (default 5)")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        print(json.dumps(measure(given.one, given.repeats)))
        return
    print(f"1000 x 1000 float64 product, one thread: {1e3 * calibration():.1f} ms")
    columns = ("rms", "worst", "jump", "mean", "solves", "renewed")
    print("  ".join(["run".ljust(28), *(c.rjust(7) for c in columns)]))
    runs = ["circle", "circle-newton", *(f"{scene} {motion}" for scene in SCENES for motion in MOTIONS)]
    here = Path(__file__).resolve().parent.parent
    for run in runs:
        rows = {"": other(here, run, given.repeats)} if given.against else {"": measure(run, given.repeats)}
        if given.against:
            rows["other"] = other(given.against.resolve(), run, given.repeats)
        for label, row in rows.items():
            cells = [f"{row[c]:7.4f}" if c in row else " " * 7 for c in columns]
            print("  ".join([f"{run} {label}".ljust(28), *cells]), flush=True)


if __name__ == "__main__":
    sys.exit(main())
