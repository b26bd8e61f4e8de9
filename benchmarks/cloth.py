"""Springs: what a step takes of a chain, of a cloth by direct L D L^T and by conjugate gradients, of one on a sphere.

`chain`: scene `pendulum`, many steps in one call. `cloth`: scene `cloth` (structural and shear springs, slack when
compressed), CPU time of one thread, at several time steps: the longer, the more iterations. Which one the other
simulator's times belong to is not known; 10 ms is its default. Unless asked, a step is one linear solve (`solver.mode =
"one_solve"`, more where that leaves over half of the unbalanced force), as there; `--newton` solves every step to
`solver.tolerance`. `wrapped`: a cloth around a sphere; `benchmarks/contact.py` has more of it. `--agree` compares what
the two solvers find. `python benchmarks/cloth.py --help` lists the options.
"""

import argparse
import time
from itertools import product

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
from contact import wrapped
from pendulum import step_time

from tripod_sim import Simulation, load_scene

ELSEWHERE = {("ldl", 32): 6.5, ("ldl", 64): 45.0, ("cg", 32): 0.7, ("cg", 64): 2.8}
"""Milliseconds a step of another simulator, in C++, where the product takes 30 ms; its 25 iterations are too few."""

TARGETS = {("ldl", 32): 3.0, ("ldl", 64): 18.0, ("cg", 32): 1.5, ("cg", 64): 6.0}
"""Milliseconds aimed at, where the product takes 30 ms."""

PARTS = ("chain", "cloth", "wrapped")

ONE_SOLVE = ["solver.mode=one_solve"]

CHAINS = (("semi_implicit_euler", [], 8.0, 3.0), ("implicit_euler", ONE_SOLVE, 20.0, 12.0))
"""Scheme of the chain, its settings, and for ten nodes the microseconds a step elsewhere and those aimed at."""


def chain(sizes: list[int], steps: int, repeats: int) -> None:
    """Print the time of a step of the chain."""
    print(f"\n{'chain':>22}{'nodes':>7}{'median [us]':>13}{'least [us]':>12}{'elsewhere':>11}{'target':>8}")
    for scheme, words, elsewhere, target in CHAINS:
        found = []
        for n in sizes:
            median, least = step_time(scheme, [f"springs.nodes={n}", *words], steps, repeats)
            found.append(median)
            known = f"{elsewhere:11.1f}{target:8.1f}" if n == 10 else f"{'-':>11}{'-':>8}"
            print(f"{scheme:>22}{n:>7}{median:13.2f}{least:12.2f}{known}", flush=True)
        if len(found) > 1:
            exponent = np.polyfit(np.log(sizes), np.log(found), 1)[0]
            print(f"{scheme:>22}  median grows with the nodes to the power {exponent:.2f}")


def cloth(n: int, linear: str, newton: bool, words: list[str]) -> Simulation:
    """Return the scene with n x n nodes."""
    mode = ["solver.mode=newton"] if newton else ONE_SOLVE
    given = [f"springs.nodes={n}", f"solver.linear={linear}", "solver.linear_tolerance=1e-5", *mode, *words]
    return Simulation(load_scene("cloth", given))


def measure(n: int, linear: str, newton: bool, words: list[str], steps: int) -> dict[str, float]:
    """Return sizes and times [ms] of `steps` steps from the start."""
    start = time.perf_counter()
    simulation = cloth(n, linear, newton, words)
    built = time.perf_counter() - start
    taken, solves, factored, iterations = np.empty(steps), 0, 0, 0
    for k in range(steps):
        begin = time.thread_time()
        report = simulation.step()
        taken[k] = 1e3 * (time.thread_time() - begin)
        solves += report.iterations
        factored += report.factorisations
        iterations += report.linear_iterations
    return {
        "unknowns": simulation.unknowns,
        "build": built,
        "median": float(np.median(taken)),
        "mean": float(taken.mean()),
        "p99": float(np.percentile(taken, 99)),
        "solves": solves / steps,
        "renewed": factored / steps,
        "iterations": iterations / max(solves, 1) if linear == "cg" else 0.0,
    }


def difference(n: int, words: list[str]) -> float:
    """Return the largest difference of positions between the two solvers after 1 s [m], each step solved to 1e-9 N."""
    ends = []
    for linear in ("ldl", "cg"):
        simulation = cloth(n, linear, True, ["solver.tolerance=1e-9", *words])
        simulation.advance(round(1.0 / simulation.scene.dt))
        ends.append(simulation.positions.copy())
    return float(np.abs(ends[0] - ends[1]).max())


def table(options: argparse.Namespace) -> None:
    """Print the times of the cloth."""
    columns = ("unknowns", "median", "mean", "p99", "build", "solves", "renewed", "iterations")
    print(
        f"\n{'solver':>8}{'dt [ms]':>8}{'n':>5}"
        + "".join(f"{c:>12}" for c in columns)
        + f"{'elsewhere':>12}{'target':>8}"
    )
    for linear, dt in product(options.solvers, options.dt):
        found = []
        for n in options.sizes:
            words = [f"dt={dt}", *options.set]
            row = measure(n, linear, options.newton, words, round(options.time / dt))
            found.append(row["median"])
            cells = "".join(f"{row[c]:12.3f}" if c != "unknowns" else f"{row[c]:12d}" for c in columns)
            known = f"{ELSEWHERE.get((linear, n), np.nan):12.1f}{TARGETS.get((linear, n), np.nan):8.1f}"
            print(f"{linear:>8}{1e3 * dt:8.3g}{n:>5}{cells}{known}", flush=True)
        if len(found) > 1:
            exponent = np.polyfit(np.log(np.square(options.sizes)), np.log(found), 1)[0]
            print(f"{linear:>8}  median grows with the nodes to the power {exponent:.2f}")
    print(
        "times in ms (build in s); solves: linear solves a step; renewed: factorisations or new matrices a step;"
    )
    print("iterations: of conjugate gradients, a solve, to a relative residual of 1e-5")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--parts", nargs="+", default=list(PARTS), choices=PARTS, help="what to measure")
    parser.add_argument("--sizes", type=int, nargs="+", default=[16, 32, 64], help="nodes along an edge")
    parser.add_argument("--dt", type=float, nargs="+", default=[0.002, 0.005, 0.01], help="time steps [s]")
    parser.add_argument(
        "--solvers", nargs="+", default=["ldl", "cg"], choices=["ldl", "cg"], help="which to measure"
    )
    parser.add_argument("--time", type=float, default=1.0, help="simulated time of each row (default 1 s)")
    parser.add_argument("--newton", action="store_true", help="solve every step to solver.tolerance")
    parser.add_argument(
        "--agree",
        type=int,
        nargs="*",
        default=[],
        metavar="N",
        help="compare the solvers' results at these sizes",
    )
    parser.add_argument("--set", nargs="*", default=[], metavar="PATH=VALUE", help="overrides of the scene")
    options = parser.parse_args()
    print(f"1000 x 1000 float64 product, one thread: {1e3 * calibration():.1f} ms")
    if "chain" in options.parts:
        chain([10, 100, 1000], 2000, 15)
    if "cloth" in options.parts:
        table(options)
    if "wrapped" in options.parts:
        wrapped([32], 400)
    for n in options.agree:
        print(
            f"n = {n}: after 1 s the two solvers' positions differ by {difference(n, options.set):.1e} m at most"
        )


if __name__ == "__main__":
    main()
