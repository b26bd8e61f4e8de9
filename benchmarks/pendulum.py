"""The pendulum: errors and orders of all time integrators against DOP853, and the time of a step, beside a calibration.

`python benchmarks/pendulum.py --help` lists the options.
"""

import argparse
import time

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
from scipy.integrate import solve_ivp

from tripod_sim import Simulation, load_scene

STARTS = {
    "explicit_euler": 3200,
    "semi_implicit_euler": 1600,
    "rk4": 200,
    "implicit_euler": 3200,
    "bdf2": 800,
    "tr_bdf2": 400,
}
"""Steps of the coarsest run of each scheme."""

NODES, SIZE, MASS, STIFFNESS, DAMPING, DRAG, END = 4, 0.6, 0.2, 400.0, 0.5, 0.2, 0.4


SOLVED_STEPS = (0.005, 0.01)
"""Of the comparison of one linear solve with solved stages [s]."""


def reference() -> np.ndarray:
    """Positions at END by DOP853 with tolerances of 1e-12, on equations written here."""
    rest = SIZE / (NODES - 1)

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        x, v = y.reshape(2, NODES, 3)
        f = np.tile([0.0, 0.0, -9.81 * MASS], (NODES, 1)) - DRAG * MASS * v
        for i in range(NODES - 1):
            d, w = x[i + 1] - x[i], v[i + 1] - v[i]
            length = np.linalg.norm(d)
            pull = (STIFFNESS * (length - rest) + DAMPING * (d @ w) / length) * d / length
            f[i] += pull
            f[i + 1] -= pull
        f[0] = 0.0
        return np.concatenate([v, f / MASS]).ravel()

    start = np.zeros((2, NODES, 3))
    start[0, :, 0] = np.linspace(0, SIZE, NODES)
    done = solve_ivp(rate, (0.0, END), start.ravel(), method="DOP853", rtol=1e-12, atol=1e-12)
    return done.y[: 3 * NODES, -1].reshape(NODES, 3)


def error(scheme: str, steps: int, exact: np.ndarray) -> float:
    """Return the largest error of a coordinate at END [m]."""
    words = [
        f"springs={{source='chain', nodes={NODES}, size={SIZE}, node_mass={MASS}, stiffness={STIFFNESS}, "
        f"damping={DAMPING}, fixed_corners=[0]}}",
        f"damping={{mass={DRAG}, stiffness=0.0}}",
        "solver.tolerance=1e-12",
        f"inertia={{scheme='{scheme}', substeps='off'}}",
        f"dt={END / steps}",
    ]
    simulation = Simulation(load_scene("pendulum", words))
    simulation.advance(steps)
    return float(np.abs(simulation.positions - exact).max())


def step_time(scheme: str, words: list[str], count: int, repeats: int) -> tuple[float, float]:
    """Return the CPU time of a step, many in one call [µs]: the median over `repeats` calls and the smallest."""
    simulation = Simulation(load_scene("pendulum", [f"inertia.scheme={scheme}", *words]))
    simulation.advance(count)
    taken = []
    for _ in range(repeats):
        start = time.thread_time()
        simulation.advance(count)
        taken.append(1e6 * (time.thread_time() - start) / count)
    return float(np.median(taken)), min(taken)


def apart(scene: str, scheme: str, dt: float) -> float:
    """Return how far a body is after 2 s with one linear solve a stage from where it is with solved stages [m]."""
    ends = []
    for mode in ("newton", "one_solve"):
        words = [f"inertia.scheme={scheme}", f"dt={dt}", f"solver.mode={mode}"]
        simulation = Simulation(load_scene(scene, words))
        simulation.advance(round(2.0 / dt))
        ends.append(simulation.positions.copy())
    return float(np.linalg.norm(ends[1] - ends[0], axis=1).max())


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", type=int, default=2000, help="steps in one timed call (default 2000)")
    parser.add_argument("--repeats", type=int, default=15, help="timed calls (default 15)")
    options = parser.parse_args()
    print(f"1000 x 1000 float64 product, one thread: {1e3 * calibration():.1f} ms")
    print(f"\nchain of {NODES} nodes, damped, {END} s: largest error [m] against DOP853 (1e-12), and order")
    exact = reference()
    for scheme, steps in STARTS.items():
        errors = [error(scheme, n, exact) for n in (steps, 2 * steps, 4 * steps)]
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        cells = "  ".join(
            f"{e:.2e} ({n})" for e, n in zip(errors, (steps, 2 * steps, 4 * steps), strict=True)
        )
        print(f"{scheme:<20}  {cells}  order {orders[0]:.2f}, {orders[1]:.2f}")
    print("\nscene pendulum (10 nodes), dt 5 ms: CPU time of a step [µs], many steps in one call")
    rows = [
        ("semi_implicit_euler", [], ""),
        ("rk4", [], ""),
        ("implicit_euler", ["solver.mode=newton"], "newton to 1e-8 N"),
        ("implicit_euler", ["solver.mode=one_solve"], "one linear solve"),
        ("bdf2", [], "newton to 1e-8 N"),
        ("tr_bdf2", [], "newton to 1e-8 N"),
    ]
    for scheme, words, how in rows:
        median, least = step_time(scheme, words, options.steps, options.repeats)
        print(f"{scheme:<20}  {how:<18}  median {median:6.2f}  least {least:6.2f}")
    print("\none linear solve a stage: largest distance [m] from steps that are solved, 2 s")
    print("  ".join([f"{'':<26}", *(f"dt {1e3 * dt:g} ms" for dt in SOLVED_STEPS)]))
    for scene in ("pendulum", "cloth"):
        for scheme in ("implicit_euler", "bdf2", "tr_bdf2"):
            cells = (f"{apart(scene, scheme, dt):8.2g}" for dt in SOLVED_STEPS)
            print(f"{scene:<10}{scheme:<16}  {'  '.join(cells)}", flush=True)


if __name__ == "__main__":
    main()
