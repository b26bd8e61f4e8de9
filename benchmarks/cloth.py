"""The cloth: time of an implicit step by direct L D L^T and by conjugate gradients, and whether their results agree.

Scene `cloth` (structural and shear springs, slack when compressed), CPU time of one thread, at several time steps: the
longer, the more iterations. Which one the other simulator's times belong to is not known; 10 ms is its default. Unless
asked, a step is one linear solve (`solver.mode = "one_solve"`, more where that leaves over half of the unbalanced
force), as there; `--newton` solves every step to `solver.tolerance`.
`python benchmarks/cloth.py --help` lists the options.
"""

import argparse
import time
from itertools import product

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from tripod_sim import Simulation, load_scene

ELSEWHERE = {("ldl", 32): 6.5, ("ldl", 64): 45.0, ("cg", 32): 0.7, ("cg", 64): 2.8}
"""Milliseconds a step of another simulator, in C++, where the product takes 30 ms; its 25 iterations are too few."""


def cloth(n: int, linear: str, newton: bool, words: list[str]) -> Simulation:
    """Return the scene with n x n nodes."""
    mode = ["solver.mode=newton"] if newton else ["solver.mode=one_solve", "solver.share=0.5"]
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


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
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
    columns = ("unknowns", "median", "mean", "p99", "build", "solves", "renewed", "iterations")
    print(
        f"{'solver':>8}{'dt [ms]':>8}{'n':>5}" + "".join(f"{c:>12}" for c in columns) + f"{'elsewhere':>12}"
    )
    for linear, dt in product(options.solvers, options.dt):
        found = []
        for n in options.sizes:
            words = [f"dt={dt}", *options.set]
            row = measure(n, linear, options.newton, words, round(options.time / dt))
            found.append(row["median"])
            cells = "".join(f"{row[c]:12.3f}" if c != "unknowns" else f"{row[c]:12d}" for c in columns)
            print(
                f"{linear:>8}{1e3 * dt:8.3g}{n:>5}{cells}{ELSEWHERE.get((linear, n), float('nan')):12.1f}",
                flush=True,
            )
        if len(found) > 1:
            exponent = np.polyfit(np.log(np.square(options.sizes)), np.log(found), 1)[0]
            print(f"{linear:>8}  median grows with the nodes to the power {exponent:.2f}")
    print(
        "times in ms (build in s); solves: linear solves a step; renewed: factorisations or new matrices a step;"
    )
    print("iterations: of conjugate gradients, a solve, to a relative residual of 1e-5")
    for n in options.agree:
        print(
            f"n = {n}: after 1 s the two solvers' positions differ by {difference(n, options.set):.1e} m at most"
        )


if __name__ == "__main__":
    main()
