"""The reduced model beside the full one: errors at poses that it has not seen and in a fast move, and times.

    python benchmarks/reduced.py [--cases 2 3 4 3:h20] [--write docs/reduced.md]

A case is a mesh level and, after a colon, an element. Static errors are those at poses drawn as the training draws its
own, from another seed, in millimetres and in percent of the range over which the effector moves between them. The move
is that of servo 0 by 0.3 rad in 30 ms from the working pose; errors in percent of the effector's travel. Times are CPU
times of one thread; full and reduced model make their steps by turns.
"""

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
from step import SCENE, swing

from tripod_sim import Simulation, load_scene
from tripod_sim.build import build
from tripod_sim.errors import StepError
from tripod_sim.reduced.store import key, remember
from tripod_sim.reduced.train import basis_of
from tripod_sim.reduced.training import Snapshots, poses, take
from tripod_sim.scene import Scene

SEED = 12345
BEGIN, END = "<!-- measured -->", "<!-- end of measured -->"
COLUMNS = (
    "modes", "tolerance", "unknowns", "elements", "effector [mm]", "max", "[%]", "nodes max [mm]", "torque [mN m]",
    "Jacobian [%]", "move max [%]", "rms [%]", "step [ms]", "p99", "static [ms]", "compliance [ms]",
)  # fmt: skip


@dataclass
class Truth:
    """What the full model does.

    Attributes:
        joints, positions, effector, torques, jacobian: At the poses.
        moved: Effector's positions in the fast move [m].
    """

    joints: np.ndarray
    positions: np.ndarray
    effector: np.ndarray
    torques: np.ndarray
    jacobian: np.ndarray
    moved: np.ndarray


def static(scene: Scene) -> Simulation:
    servos = replace(scene.servos, angles=(0.0, 0.0, 0.0), slide=0.0)
    return Simulation(replace(scene, inertia=None, damping=None, servos=servos))


def jacobian(simulation: Simulation) -> np.ndarray:
    """Return d effector / d angles [m / rad]."""
    w = simulation.compliance().w
    return w[:3, 6:] @ np.linalg.inv(w[6:, 6:])


def visit(simulation: Simulation, joints: np.ndarray) -> tuple[Truth, float]:
    """Return what a static model does at `joints`, and the mean time of its solves [ms]; a pose that fails is NaN."""
    found, spent = [], 0.0
    nodes = simulation.positions.shape
    for j in joints:
        begin = time.thread_time()
        try:
            simulation.step(j)
        except StepError:
            found.append(
                (np.full(nodes, np.nan), np.full(3, np.nan), np.full(3, np.nan), np.full((3, 3), np.nan))
            )
            continue
        spent += time.thread_time() - begin
        row = (
            simulation.positions.copy(),
            simulation.effector.position,
            simulation.torques.copy(),
            jacobian(simulation),
        )
        found.append(row)
    columns = (np.array(part) for part in zip(*found, strict=True))
    return Truth(joints, *columns, moved=np.zeros((0, 3))), 1e3 * spent / len(joints)


def fast_move(scene: Scene) -> np.ndarray:
    """Return where the effector is after each step of the fast move [m]."""
    simulation = Simulation(replace(scene, dt=0.0025, solver=replace(scene.solver, mode="newton")))
    start, found = simulation.command, []
    for k in range(80):
        simulation.step(start + np.array([0.3 * min(1.0, (k + 1) / 12), 0, 0, 0]))
        found.append(simulation.effector.position)
    return np.array(found)


def step_times(simulations: list[Simulation], steps: int) -> np.ndarray:
    """Return the times of the steps of each [ms], shape (simulations, steps); they step by turns."""
    taken = np.empty((len(simulations), steps))
    for k in range(steps):
        joints = swing((k + 1) * simulations[0].scene.dt)
        for row, simulation in zip(taken, simulations, strict=True):
            begin = time.thread_time()
            simulation.step(joints)
            row[k] = 1e3 * (time.thread_time() - begin)
    return taken


def compliance_time(simulation: Simulation) -> float:
    begin = time.thread_time()
    for _ in range(20):
        simulation.compliance()
    return 1e3 * (time.thread_time() - begin) / 20


def reduced_row(
    scene: Scene, full: Scene, snapshots: Snapshots, truth: Truth, steps: int
) -> tuple[list[str], list[float]]:
    """Return the row of a reduced scene, and median and p99 of the full model's steps beside it."""
    parts = build(full)
    basis = basis_of(scene, snapshots)
    remember(key(scene, parts), basis)
    seen, solve = visit(static(scene), truth.joints)
    moved = fast_move(scene)
    both = [Simulation(full), Simulation(scene)]
    taken = step_times(both, steps)
    reach = np.ptp(truth.effector, axis=0)
    off = 1e3 * np.linalg.norm(seen.effector - truth.effector, axis=1)
    nodes = 1e3 * np.linalg.norm(seen.positions - truth.positions, axis=2).max(axis=1)
    torque = 1e3 * np.abs(seen.torques - truth.torques)
    turn = np.abs(seen.jacobian - truth.jacobian).max(axis=(1, 2)) / np.abs(truth.jacobian).max(axis=(1, 2))
    travel = np.linalg.norm(truth.moved - truth.moved[0], axis=1).max()
    error = 100 * np.linalg.norm(moved - truth.moved, axis=1) / travel
    row = [
        str(scene.reduced.modes), f"{scene.reduced.tolerance:g}", str(both[1].unknowns),
        f"{int((basis.weights > 0).sum())} of {len(basis.weights)}",
        f"{np.nanmean(off):.4f}", f"{np.nanmax(off):.3f}", f"{np.nanmean(off) / 10 / np.linalg.norm(reach):.2g}",
        f"{np.nanmax(nodes):.3f}", f"{np.nanmax(torque):.2f}", f"{100 * np.nanmax(turn):.2g}",
        f"{error.max():.2g}", f"{np.sqrt((error**2).mean()):.2g}",
        f"{np.median(taken[1]):.3f}", f"{np.percentile(taken[1], 99):.3f}", f"{solve:.1f}",
        f"{compliance_time(both[1]):.2f}",
    ]  # fmt: skip
    return row, [float(np.median(taken[0])), float(np.percentile(taken[0], 99)), compliance_time(both[0])]


def table(case: str, settings: list[tuple[int, float]], steps: int, held_out: int) -> list[str]:
    """Return the lines of the table of one case."""
    level, _, element = case.partition(":")
    words = [*SCENE, f"mesh.level={level}", *([f"mesh.element={element}"] if element else [])]
    full = load_scene("tripod", words)
    base = load_scene("tripod", [*words, "reduced={}"])
    begin = time.thread_time()
    snapshots = take(base, lambda _: None)
    training = time.thread_time() - begin
    model = static(full)
    wanted = poses(replace(base.reduced, seed=SEED, samples=held_out), base.servos)
    truth, solve = visit(model, wanted)
    truth.moved = fast_move(full)
    rows, beside = [], []
    for modes, tolerance in settings:
        scene = replace(base, reduced=replace(base.reduced, modes=modes, tolerance=tolerance))
        row, times = reduced_row(scene, full, snapshots, truth, steps)
        rows.append(row)
        beside.append(times)
    median, p99, compliance = np.median(beside, axis=0)
    elements = len(model._system.solid.elements)
    first = ["full", "", str(model.unknowns), str(elements), *[""] * 8, f"{median:.3f}", f"{p99:.3f}"]
    first += [f"{solve:.1f}", f"{compliance:.2f}"]
    kind = full.mesh.element
    reached = np.isfinite(truth.effector[:, 0]).sum()
    return [
        "", f"Level {level}, `{kind}`: snapshots in {training:.1f} s, {reached} of {held_out} poses held out.", "",
        "| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS),
        *("| " + " | ".join(row) + " |" for row in [first, *rows]),
    ]  # fmt: skip


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--cases", nargs="+", default=["2", "3", "4", "3:h20"], help="levels, or level:element"
    )
    parser.add_argument("--modes", type=int, nargs="+", default=[5, 10, 20, 40], help="numbers of shapes")
    parser.add_argument(
        "--tolerances", type=float, nargs="+", default=[0.0, 0.01, 0.03, 0.1], help="with 20 shapes"
    )
    parser.add_argument("--steps", type=int, default=600, help="steps timed")
    parser.add_argument("--poses", type=int, default=30, help="poses held out")
    parser.add_argument("--write", type=Path, help="document whose measured part the tables replace")
    options = parser.parse_args()
    settings = [(modes, 0.03) for modes in options.modes]
    settings += [(20, t) for t in options.tolerances if (20, t) not in settings]
    lines = [f"1000 x 1000 float64 product, one thread: {1e3 * calibration():.1f} ms."]
    print(lines[0])
    for case in options.cases:
        found = table(case, settings, options.steps, options.poses)
        print("\n".join(found), flush=True)
        lines += found
    if options.write:
        text = options.write.read_text()
        before, rest = text.split(BEGIN)
        options.write.write_text(f"{before}{BEGIN}\n" + "\n".join(lines) + f"\n{END}" + rest.split(END)[1])


if __name__ == "__main__":
    main()
