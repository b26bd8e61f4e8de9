"""Meshes of the Tripod graded for one thing: where the effector is. And what steps on them cost and err.

    python benchmarks/graded_mesh.py --search h20        # the way of refinement, printed
    python benchmarks/graded_mesh.py --search h8_modes
    python benchmarks/graded_mesh.py --directions h20    # which elements of level 8 the error in motion is of, printed
    python benchmarks/graded_mesh.py --write             # the front in motion and at rest, into docs/accuracy.md

The search begins with a coarse grid and goes on until the worst error is 0.5 % or a step has more than `MOST` unknowns.
Each time all gradings are tried 1.5 times as strong and as weak, which costs nothing, and the best is kept, while it
gains; then one more element along each of the grid's directions, and the one is taken that lowers the error most for
each unknown. The error is the goal's own, held against `h20` on level 9, root mean square over poses and move, not an
estimate: a solution takes a tenth of a second.

Compliant clamp of 1.4e10 N/m³. Errors at rest: the effector's position in six poses, the worst, of the largest
distance of two; and of the move from the working pose by servo 0, of that move. In motion: servo 0 by 0.3 rad in 30 ms
from the working pose, the effector's move over 120 ms, the worst, of the largest move, against `h20` on level 9 with
TR-BDF2 of 0.5 ms.
"""

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from benchmarks.doc_parts import write_part
from tripod_bringup.study_plans import plan
from tripod_sim import SceneError, Simulation, StepError
from tripod_sim.mesh import y_piece
from tripod_sim.mesh.y_piece import LEVELS, YLevel
from tripod_sim.scene.script import script_of
from tripod_study import watch
from tripod_study.motion import scene_of
from tripod_study.plan import Settings
from tripod_study.tripod_poses import POSES

CLAMP: Settings = {"clamp.stiffness": 1.4e10}
MOST, ENOUGH = 1500, 0.005
"""Unknowns and relative error at which the search ends."""

STEEPEST = 3.0
"""What the ratio of neighbouring lengths of no grading exceeds."""

SHORTEST = {"h20": 1.4e-3, "h8_modes": 2.7e-3}
"""Least length in the clamped end [m]. Shorter ones of `h20` crease at the clamp's edge in motion, and steps then ask
for five to ten times as many tangents. Shorter ones of `h8_modes`, half as long as thick, lose their stability where
they are pressed: their modes buckle [WriggersReese1996], and the effector stands millimetres off."""

COARSEST = YLevel(2, 1, 2, 1.5)
COUNTS = ("across", "inner", "along", "layers", "clamped")
GRADINGS = {"grading": "along", "inner_grading": "inner", "clamped_grading": "clamped"}
"""Which count a grading goes with."""

REFERENCE: Settings = {"mesh.element": "h20", "mesh.level": 9}
MESHES = (
    ("sharp", "h8_modes", 2),
    *(("compliant", "h8_modes", level) for level in (2, 8, 12)),
    *(("compliant", "h20", level) for level in (13, 8)),
)
"""Clamp, element, level; the first is the draft's."""

STEPS = (
    ("implicit_euler", 0.005),
    ("bdf2", 0.002),
    ("bdf2", 0.001),
    ("tr_bdf2", 0.005),
    ("tr_bdf2", 0.002),
    ("tr_bdf2", 0.001),
)
BUDGET, PRODUCT = 0.5, 0.030
"""CPU time of a simulated second [s] where a product of 1000 x 1000 takes the second [s]."""


@dataclass(frozen=True)
class Row:
    """One setting: relative errors at rest (position, move) and in motion, pose at worst [m], times [s]."""

    mesh: str
    unknowns: int
    scheme: str
    dt: float
    position: float
    move: float
    moving: float
    apart: float
    cpu: float
    worst: float


WORK = 3
"""Which of the poses is the working pose; the next one has servo 0 moved by 0.3 rad."""


def poses(settings: Settings) -> tuple[np.ndarray, int]:
    """Return the effector in all poses, the flat piece first, shape (6, 3) [m]; and the unknowns."""
    base = {**plan("tripod_static", quick=False).base, **CLAMP, "solver.max_turn": 0.3, **settings}
    simulation = Simulation(scene_of("tripod", base))
    found = [simulation.state.centres[0].copy()]
    for chain in POSES:
        simulation.reset()
        for joints in chain[1:]:
            simulation.step(np.array(joints))
            found.append(simulation.state.centres[0].copy())
    return np.array(found), simulation.unknowns


def travel(exact: np.ndarray) -> float:
    """Return the largest distance of two poses [m]."""
    return float(np.linalg.norm(exact[:, None] - exact[None], axis=2).max())


def errors_at_rest(found: np.ndarray, exact: np.ndarray) -> tuple[float, float]:
    """Return the relative errors of position, the worst, of the travel, and of the move, of the move itself."""
    worst = np.linalg.norm(found - exact, axis=1).max()
    move, true = (p[WORK + 1] - p[WORK] for p in (found, exact))
    return float(worst / travel(exact)), float(np.linalg.norm(move - true) / np.linalg.norm(true))


def graded(element: str, level: YLevel, exact: np.ndarray) -> tuple[float, float, int]:
    """Return the goal's error on a grid, root mean square and worst, and its unknowns; infinite without a solution."""
    y_piece.LEVELS[1] = level  # of this process
    try:
        found, unknowns = poses({"mesh.element": element, "mesh.level": 1})
    except (SceneError, StepError):
        return np.inf, np.inf, MOST
    off = np.linalg.norm(found - exact, axis=1) / travel(exact)
    worst, move = errors_at_rest(found, exact)
    return float(np.sqrt(np.mean([*off**2, move**2]))), max(worst, move), unknowns


def shortest(level: YLevel) -> float:
    """Return the length of the shortest element in the clamped end [m]."""
    shape = y_piece.YShape()
    lengths = level.clamped_grading ** np.arange(level.clamped, dtype=float)
    return float((shape.tip_radius - shape.clamp_radius) * lengths.min() / lengths.sum())


def regraded(element: str, level: YLevel) -> Iterator[YLevel]:
    """Yield the grid with each of its gradings 1.5 times as strong and as weak, over the whole of its length."""
    for name, count in GRADINGS.items():
        if (n := getattr(level, count)) > 1:
            for factor in (1.5, 1 / 1.5):
                ratio = getattr(level, name) * factor ** (1 / (n - 1))
                changed = replace(level, **{name: ratio})
                if 1 / STEEPEST <= ratio <= STEEPEST and shortest(changed) >= SHORTEST[element]:
                    yield changed


def refined(element: str, level: YLevel) -> Iterator[YLevel]:
    """Yield the grid with one more element along each of its directions, graded as much over the whole.

    Where that makes elements of the clamped end too short, it is graded less.
    """
    for count in COUNTS:
        n = getattr(level, count)
        same = {
            name: getattr(level, name) ** ((n - 1) / n)
            for name, of in GRADINGS.items()
            if of == count and n > 1
        }
        finer = replace(level, **{count: n + 1}, **same)
        while finer.clamped_grading > 1 and shortest(finer) < SHORTEST[element]:
            finer = replace(finer, clamped_grading=max(1.0, finer.clamped_grading / 1.1))
        if shortest(finer) >= SHORTEST[element]:
            yield finer


def search(element: str) -> None:
    """Print the way from the coarsest grid."""
    exact = poses(REFERENCE)[0]
    level = COARSEST
    error, worst, unknowns = graded(element, level, exact)
    while True:
        while True:
            tried = [(*graded(element, x, exact), x) for x in regraded(element, level)]
            best = min(tried, key=lambda x: x[0], default=None)
            if best is None or best[0] > 0.98 * error:
                break
            error, worst, unknowns, level = best
        words = ", ".join(f"{name} {value:.3g}" for name, value in vars(level).items())
        print(
            f"{element}: {unknowns} unknowns, {100 * error:.2f}, worst {100 * worst:.2f} %: {words}",
            flush=True,
        )
        if worst <= ENOUGH:
            return
        tried = [(*graded(element, x, exact), x) for x in refined(element, level)]
        tried = [x for x in tried if unknowns < x[2] <= MOST and np.isfinite(x[0])]
        if not tried:
            return
        error, worst, unknowns, level = max(tried, key=lambda x: np.log(error / x[0]) / (x[2] - unknowns))


def motion(settings: Settings, repeats: int) -> tuple[np.ndarray, int, float, float]:
    """Return the effector every 10 ms, shape (13, 3) [m], unknowns, CPU time of a simulated second, worst step [s]."""
    study = plan("tripod_dynamic", quick=False)
    base = {**study.base, **CLAMP, "solver.mode": "one_solve", **settings}
    simulation = Simulation(scene_of("tripod", base))
    dt = simulation.scene.dt
    every = round(float(study.given[watch.INTERVAL]) / dt)
    steps = every * int(study.given[watch.SAMPLES])
    script, start = script_of(simulation.scene, str(study.given[watch.SERVO])), simulation.command
    taken = np.full(steps, np.inf)
    for _ in range(repeats):
        simulation.reset()
        found = [simulation.state.centres[0].copy()]
        for k in range(steps):
            joints = script.joints(start, (k + 1) * dt)
            begin = time.thread_time()
            simulation.step(joints)
            taken[k] = min(taken[k], time.thread_time() - begin)
            if (k + 1) % every == 0:
                found.append(simulation.state.centres[0].copy())
    return (
        np.array(found),
        simulation.unknowns,
        float(taken.sum() / (steps * dt)),
        float(taken.max()),
    )


def directions(element: str) -> None:
    """Print the error of the move on level 8, and with one more element along each direction of its grid."""
    steps: Settings = {"inertia.scheme": "tr_bdf2", "dt": 0.0005}
    exact = motion({**REFERENCE, **steps}, 1)[0]
    named = [("level 8", LEVELS[8]), *zip(COUNTS, refined(element, LEVELS[8]), strict=True)]
    for name, level in named:
        y_piece.LEVELS[1] = level  # of this process
        found, unknowns, *_ = motion({"mesh.element": element, "mesh.level": 1, **steps}, 1)
        print(f"{name}: {unknowns} unknowns, {100 * error_of_move(found, exact):.2f} %", flush=True)


def error_of_move(found: np.ndarray, exact: np.ndarray) -> float:
    """Return the relative error of a motion from its start, the worst instant."""
    scale = np.linalg.norm(exact - exact[0], axis=1).max()
    return float(np.linalg.norm((found - found[0]) - (exact - exact[0]), axis=1).max() / scale)


def front(repeats: int) -> list[str]:
    """Return the table of all settings: cost, errors; marked those that nothing beats in both."""
    exact_poses = poses(REFERENCE)[0]
    exact = motion({**REFERENCE, "inertia.scheme": "tr_bdf2", "dt": 0.0005}, 1)[0]
    rows: list[Row] = []
    products: list[float] = []
    for clamp, element, level in MESHES:
        mesh: Settings = {"mesh.element": element, "mesh.level": level}
        if clamp == "sharp":
            mesh["clamp"] = "off"
        position, move = errors_at_rest(poses(mesh)[0], exact_poses)
        for scheme, dt in STEPS:
            products.append(calibration())
            found, unknowns, cpu, worst = motion({**mesh, "inertia.scheme": scheme, "dt": dt}, repeats)
            off = error_of_move(found, exact)
            apart = np.linalg.norm(found - exact, axis=1).max()
            cpu *= PRODUCT / products[-1]
            name = f"{element}, level {level}{'' if clamp == 'compliant' else ', sharp clamp'}"
            rows.append(Row(name, unknowns, scheme, dt, position, move, off, float(apart), cpu, worst))
            print(rows[-1], flush=True)
    lines = [
        "| mesh | unknowns | scheme, dt [ms] | at rest: position, move [%] | in motion: move [%] | pose [mm] "
        "| CPU s per simulated s | worst step [ms] | |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        beaten = any(other.moving < r.moving and other.cpu < r.cpu for other in rows)
        lines.append(
            f"| {r.mesh} | {r.unknowns} | {r.scheme}, {1e3 * r.dt:g} | {100 * r.position:.2f}, {100 * r.move:.2f} "
            f"| {100 * r.moving:.2f} | {1e3 * r.apart:.2f} | {r.cpu:.3g} | {1e3 * r.worst:.1f} "
            f"| {'' if beaten else 'front'} |"
        )
    best = min((r for r in rows if r.cpu <= BUDGET), key=lambda r: r.moving)
    return [
        *lines,
        "",
        f"The most exact in motion within {BUDGET:g} CPU s: {best.mesh}, `{best.scheme}` with {1e3 * best.dt:g} ms: "
        f"{100 * best.moving:.1f} % in motion, {100 * best.position:.1f} % at rest.",
        "",
        f"CPU times of one thread, of each step the least of {repeats} runs, scaled to a product of 1000 x 1000 of "
        f"{1e3 * PRODUCT:g} ms (here {1e3 * min(products):.0f} to {1e3 * max(products):.0f} ms),",
        "worst steps not. The first mesh is the draft's, whose clamp is another model. "
        "`python benchmarks/graded_mesh.py --write`.",
    ]


def main() -> None:
    """Search, or measure the front."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--search", metavar="ELEMENT", help="refine for h20 or h8_modes; print the way")
    parser.add_argument(
        "--directions", metavar="ELEMENT", help="refine level 8 along each direction; print errors"
    )
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--write", action="store_true", help="put the table into docs/accuracy.md")
    words = parser.parse_args()
    if words.search:
        search(words.search)
        return
    if words.directions:
        directions(words.directions)
        return
    lines = front(words.repeats)
    print("\n".join(lines))
    if words.write:
        write_part("accuracy.md", "front", lines)


if __name__ == "__main__":
    main()
