"""What explicit schemes cost on the Tripod: stability limit, parts of a step, parts a second, simulated time.

The motion is that of `step.py`, from the working pose. An implicit step is timed beside each. CPU time of one thread.
`python benchmarks/explicit.py --help` lists the options.
"""

import argparse
import time

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
from step import SCENE, swing

from tests.scenes import SHARP
from tripod_sim import Simulation, StepError, load_scene

SCHEMES = ("semi_implicit_euler", "explicit_euler", "rk4", "implicit_euler")
DAMPINGS = {"scene's": [], "none": ["damping=off"]}


def measure(level: int, scheme: str, damping: list[str], duration: float) -> tuple[float, float, float]:
    """Return the limit [s], parts and CPU time [s] of a second simulated, NaN where the scheme blew up."""
    words = [*SCENE, *damping, f"mesh.level={level}", f"inertia.scheme={scheme}"]
    simulation = Simulation(load_scene(SHARP, words))
    dt = simulation.scene.dt
    steps, parts, limit = max(1, round(duration / dt)), 0, np.inf
    begin = time.thread_time()
    try:
        for k in range(steps):
            report = simulation.step(swing((k + 1) * dt))
            parts, limit = parts + report.parts, min(limit, report.dt_limit)
    except StepError:  # explicit Euler without damping
        return 0.0, np.nan, np.nan
    taken = time.thread_time() - begin
    return limit, parts / (steps * dt), taken / (steps * dt)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--levels", type=int, nargs="+", default=[1, 2, 3], help="of the mesh (default 1 2 3)"
    )
    parser.add_argument("--duration", type=float, default=0.1, help="simulated [s] (default 0.1)")
    arguments = parser.parse_args()
    print(f"calibration: 1000 x 1000 product in {calibration() * 1e3:.1f} ms")
    head = (
        "level",
        "damping",
        "scheme",
        "limit [us]",
        "parts a step",
        "parts a second",
        "us a part",
        "s a simulated s",
    )
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for level in arguments.levels:
        for damping, words in DAMPINGS.items():
            for scheme in SCHEMES:
                limit, parts, taken = measure(level, scheme, words, arguments.duration)
                shown = f"{limit * 1e6:.2f}" if np.isfinite(limit) else "-"
                row = (str(level), damping, scheme, shown, f"{parts * 0.005:.0f}", f"{parts / taken:.0f}",
                       f"{taken / parts * 1e6:.1f}", f"{taken:.2f}")  # fmt: skip
                print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
