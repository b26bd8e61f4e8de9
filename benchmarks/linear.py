"""Time of the linear solvers against the number of unknowns, side by side, beside a calibration of the machine.

Bodies: the Tripod of each mesh level in its working pose; cubes and a thin strip of hexahedra, held at one face.
CPU time of one thread; QDLDL is there for comparison, CHOLMOD if it is installed (`pip install 'tripod[cholmod]'`).
`python benchmarks/linear.py --help` lists the options.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
import qdldl

from tests.scenes import SHARP
from tripod_sim import Simulation, load_scene
from tripod_sim.constraints.groups import Groups
from tripod_sim.forces.solid import Solid
from tripod_sim.linear.cg import ConjugateGradients
from tripod_sim.linear.choice import linear_factory
from tripod_sim.linear.ldl import Ldl
from tripod_sim.materials.lame import lame_constants
from tripod_sim.materials.law import vector
from tripod_sim.mesh.y_piece import LEVELS, y_piece
from tripod_sim.system import System

SCENE = ("inertia=off", "damping=off", "servos.angles=[-1.4965, -1.4965, -1.4965]", "servos.slide=0.035")


class Qdldl:
    """QDLDL's own Python interface, its symbolic analysis reused."""

    def __init__(self, pattern) -> None:
        self._pattern, self._solver = pattern, qdldl.Solver(pattern, upper=True)

    def factor(self) -> bool:
        """Factor the present values; return whether they are positive definite."""
        self._solver.update(self._pattern, upper=True)
        return bool((self._solver.factors()[1] > 0).all())

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return A^-1 b."""
        return self._solver.solve(b)


def tripods(levels: list[int]) -> Iterator[tuple[str, System]]:
    """Yield the Tripod at equilibrium in the working pose, its tangent factored."""
    for level in levels:
        simulation = Simulation(load_scene(SHARP, [*SCENE, f"mesh.level={level}"]))
        system = simulation._system
        system.assemble(simulation.state, project=False)
        system.evaluate(simulation.state)
        system.factor()
        yield f"tripod {level}", system


def boxes(sizes: list[tuple[int, int, int]]) -> Iterator[tuple[str, System]]:
    """Yield boxes of so many elements along X, Y, Z, held at X = 0, undeformed, their tangent factored."""
    kind = y_piece(LEVELS[1]).kind
    for size in sizes:
        shape = tuple(n + 1 for n in size)
        nodes = 5e-3 * np.indices(shape).reshape(3, -1).T.astype(float)
        index = np.arange(len(nodes)).reshape(shape)
        corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
        cells = [index[tuple(slice(a, a + n) for a, n in zip(c, size, strict=True))].ravel() for c in corners]
        elements = np.ascontiguousarray(np.stack(cells, axis=1))
        solid = Solid(nodes, elements, kind, "neo_hooke", vector("neo_hooke", *lame_constants(250e3, 0.45)))
        system = System(nodes, [solid], Groups(len(nodes), fixed=np.flatnonzero(nodes[:, 0] < 1e-9)))
        state = system.start_state(np.zeros(1))
        system.assemble(state, project=False)
        system.evaluate(state)
        system.factor()
        yield "x".join(map(str, size)), system


def timed(call: Callable[[], object]) -> float:
    """Return the median CPU time [ms] of as many calls as fit in about 0.3 s, at least one."""
    call()
    taken, until = [], time.perf_counter() + 0.3
    while not taken or (time.perf_counter() < until and len(taken) < 200):
        start = time.thread_time()
        call()
        taken.append(time.thread_time() - start)
    return 1e3 * float(np.median(taken))


def measure(system: System, tolerance: float) -> dict[str, float]:
    """Return sizes and times [ms] with the present tangent of `system`."""
    pattern, reduction = system.reduction.pattern, system.reduction
    b = np.random.default_rng(0).standard_normal(reduction.unknowns)
    free = reduction.free_count
    blocks = np.append(3 * np.arange(free), 3 * free + 6 * np.arange(reduction.bodies + 1))
    direct = {"ldl": Ldl(pattern), "qdldl": Qdldl(pattern)}
    if find_spec("cvxopt"):
        direct["cholmod"] = linear_factory("cholmod", tolerance)(pattern, blocks)
    found: dict[str, float] = {"unknowns": reduction.unknowns, "entries of L": direct["ldl"].entries}
    answers = {}
    for name, solver in direct.items():
        found[name] = timed(solver.factor)
        found[f"{name} solve"] = timed(lambda solver=solver: solver.solve(b))
        answers[name] = solver.solve(b)
    iterative = ConjugateGradients(pattern, blocks, tolerance)
    iterative.factor()
    found["cg solve"] = timed(lambda: iterative.solve(b))
    answers["cg"] = iterative.solve(b)
    found["iterations"] = iterative.iterations
    size = np.abs(answers["ldl"]).max()
    found["differ by"] = max(float(np.abs(x - answers["ldl"]).max()) / size for x in answers.values())
    return found


COLUMNS = ("qdldl", "ldl", "cholmod", "qdldl solve", "ldl solve", "cholmod solve", "cg solve")


def table(title: str, rows: Iterator[tuple[str, System]], tolerance: float) -> None:
    """Print the times of some bodies and the exponents of unknowns that fit them best."""
    print(
        f"\n{title}\n| body | unknowns | entries of L | "
        + " | ".join(COLUMNS)
        + " | iterations | differ by |"
    )
    print("|" + "---|" * (len(COLUMNS) + 5))
    found = []
    for name, system in rows:
        row = measure(system, tolerance)
        found.append(row)
        times = " | ".join(f"{row[c]:.3f}" if c in row else "-" for c in COLUMNS)
        sizes = f"{row['unknowns']} | {row['entries of L']}"
        print(f"| {name} | {sizes} | {times} | {row['iterations']} | {row['differ by']:.0e} |", flush=True)
    if len(found) > 1:
        n = np.log([row["unknowns"] for row in found])
        fits = [
            f"{np.polyfit(n, np.log([row[c] for row in found]), 1)[0]:.2f}" if c in found[0] else "-"
            for c in COLUMNS
        ]
        print("| exponent | | | " + " | ".join(fits) + " | | |")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--levels", type=int, nargs="*", default=[1, 2, 3, 4], help="of the Tripod's mesh")
    parser.add_argument(
        "--cubes", type=int, nargs="*", default=[4, 6, 8, 10, 14], help="elements along an edge"
    )
    parser.add_argument(
        "--tolerance", type=float, default=1e-8, help="relative residual of conjugate gradients"
    )
    options = parser.parse_args()
    print(f"1000 x 1000 float64 product, one thread: {1e3 * calibration():.1f} ms")
    print("times in ms; a name alone is one factorisation")
    table("Tripod, working pose", tripods(options.levels), options.tolerance)
    table("cubes", boxes([(n, n, n) for n in options.cubes]), options.tolerance)
    table("strip, one layer", boxes([(60, 12, 1)]), options.tolerance)


if __name__ == "__main__":
    main()
