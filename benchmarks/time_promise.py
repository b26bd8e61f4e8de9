"""What `dt = "auto"` keeps of `time_error.accuracy`, where a run promises it and where it does not.

    python benchmarks/time_promise.py              # 12 scenes of each kind; goes on where it was stopped
    python benchmarks/time_promise.py --report     # the table of the results alone

A seed draws each scene: bodies, masses, heights, speeds, stiffness, friction, and an accuracy of 10, 5 or 2 %. The
reference has fixed steps, far shorter than those of the run. Its own error is how far it is from steps twice as long.
Where that is above a quarter of the accuracy, the motion is chaotic for these steps: the scene is counted apart, and
another is drawn. The error of a run is the largest distance of a node or a corner from the reference, at the ends of
all intervals, over the largest move.

Whether a run promises its accuracy is read from its notes, as a user reads it.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

import tripod_sim
from benchmarks.doc_parts import table_lines, write_part
from benchmarks.stored_rows import store, stored
from tripod_sim import Simulation, StepError, load_scene

ACCURACIES = (0.1, 0.05, 0.02)

KNOWN = 0.25
"""Own error of the reference, in parts of the accuracy, up to which it judges."""

SHIPPED = Path(tripod_sim.__file__).parent / "scenes"


@dataclass(frozen=True)
class Case:
    """One scene.

    Attributes:
        text: Its TOML.
        intervals: How many are looked at; their length is the scene's dt.
        division: Over what an interval is divided for the reference.
        scheme: Of the reference.
        turn: By which the servos turn in `ramp` intervals [rad]; empty without servos.
        ramp: See `turn`.
        tolerance: `solver.tolerance` of the reference without contact [N].
    """

    text: str
    intervals: int
    division: int
    scheme: str = "bdf2"
    turn: tuple[float, ...] = ()
    ramp: int = 1
    tolerance: float = 1e-9


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number in a range, even in its logarithm where that is positive."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))) if low > 0 else rng.uniform(low, high))


def head(dt: float, contact: float = 0.0, **values: float) -> str:
    """Return what all scenes begin with; `contact`: its distance [m], 0 without; `values`: more of its fields."""
    text = f'name = "promise"\ndt = {dt}\nduration = 1.0\n[gravity]\n[inertia]\n'
    if contact:
        text += f"[contact]\ncontact_distance = {contact}\nalarm_distance = {3 * contact}\n"
        text += "".join(f"{name} = {value}\n" for name, value in values.items())
    return text


def obstacle(
    name: str, scale: float = 1.0, position: Sequence[float] = (0.0, 0.0, 0.0), tilt: float = 0.0
) -> str:
    """Return an obstacle of a shipped surface, turned by `tilt` [rad] about Y."""
    turn = [0.0, float(np.sin(tilt / 2)), 0.0, float(np.cos(tilt / 2))]
    return (
        f'[[obstacles]]\nsource = "{SHIPPED / name}"\nscale = {scale}\nposition = {list(map(float, position))}\n'
        f"orientation = {turn}\n"
    )


def rigid(shape: str, mass: float, position: Sequence[float], **more: Any) -> str:
    """Return a rigid body."""
    fields = {"mass": mass, "position": list(map(float, position)), **more}
    return f'[[rigid]]\nshape = "{shape}"\n' + "".join(
        f"{name} = {value}\n" for name, value in fields.items()
    )


def block(low: Sequence[float], size: Sequence[float], cells: Sequence[int], young: float) -> str:
    """Return a soft block with its lowest corner at `low` [m]."""
    x = [[low[k] + size[k] * c for k, c in enumerate(corner)] for corner in BOX]
    return (
        f'[mesh]\nsource = "block"\ncorners = {[list(map(float, c)) for c in x]}\ncells = {list(cells)}\n'
        f"[material]\nyoung = {young}\npoisson = 0.4\ndensity = 1070.0\n"
    )


BOX = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))


def falls(rng: np.random.Generator) -> Case:
    """One or two rigid boxes or balls fall or are thrown on a plate."""
    text = head(0.01, 1e-3, friction=between(rng, 0.1, 0.8)) + obstacle("plate.obj")
    height = 0.0
    for _ in range(rng.integers(1, 3)):
        half = between(rng, 0.02, 0.06)
        height += half + 1e-3 + between(rng, 0.002, 0.02)
        place = [*rng.uniform(-0.005, 0.005, 2), height]
        push = [*rng.uniform(-0.3, 0.3, 2), rng.uniform(-0.3, 0.0)]
        size = {"radius": half} if rng.random() < 0.4 else {"size": [2 * half] * 3}
        shape = "ball" if "radius" in size else "box"
        text += rigid(shape, between(rng, 0.1, 2.0), place, velocity=list(map(float, push)), **size)
        height += half
    return Case(text, 20, 96)


def slides(rng: np.random.Generator) -> Case:
    """A rigid box slides or a ball rolls on a slope of 5 to 35 degrees."""
    tilt, half, gap = np.radians(rng.uniform(5, 35)), between(rng, 0.02, 0.06), between(rng, 0.001, 0.01)
    normal, along = np.array([np.sin(tilt), 0, np.cos(tilt)]), np.array([np.cos(tilt), 0, -np.sin(tilt)])
    push = rng.uniform(-0.5, 1.0) * along + rng.uniform(-0.3, 0.3) * np.array([0, 1.0, 0])
    text = head(0.01, 1e-3, friction=between(rng, 0.05, 0.8)) + obstacle("plate.obj", tilt=tilt)
    size = {"radius": half} if rng.random() < 0.4 else {"size": [2 * half, 2 * half, 2 * half]}
    turn = [0.0, float(np.sin(tilt / 2)), 0.0, float(np.cos(tilt / 2))]
    text += rigid(
        "ball" if "radius" in size else "box", between(rng, 0.1, 1.0), (half + 1e-3 + gap) * normal,
        velocity=push.tolist(), orientation=turn, **size,
    )  # fmt: skip
    return Case(text, 40, 32)


def soft_head(rng: np.random.Generator) -> str:
    """Return what scenes of soft solids that touch begin with."""
    text = head(0.005, 5e-4, friction=between(rng, 0.1, 0.8))
    return text + f"[damping]\nstiffness = {between(rng, 1e-3, 4e-3)}\n"


def blocks(rng: np.random.Generator) -> Case:
    """A soft block falls or is thrown on a plate or a cube."""
    size, gap = rng.uniform(0.03, 0.06, 3) * [1, 1, 0.7], between(rng, 0.002, 0.02)
    text = soft_head(rng) + block([*(-size[:2] / 2), 5e-4 + gap], size, (2, 2, 2), between(rng, 5e4, 5e5))
    push = [*rng.uniform(-0.1, 0.1, 2).tolist(), rng.uniform(-0.5, 0.0)]
    text += f"[[initial_velocity]]\nvelocity = {push}\n"
    cube = rng.random() < 0.5
    text += obstacle("cube.obj", 0.2, (0.0, 0.0, -0.02)) if cube else obstacle("plate.obj")
    return Case(text, 24, 64)


def bars(rng: np.random.Generator) -> Case:
    """A soft bar, clamped at one end, swings down on a plate."""
    text = soft_head(rng) + bar(rng)
    text += obstacle("plate.obj", 1.0, (0.0, 0.0, -between(rng, 0.003, 0.02)))
    return Case(text, 24, 64)


def bar(rng: np.random.Generator) -> str:
    """Return a soft bar that is clamped at one end."""
    size = [between(rng, 0.06, 0.12), rng.uniform(0.01, 0.02), between(rng, 0.008, 0.015)]
    clamp = "[[fixed]]\nlow = [-1e-6, -1.0, -1.0]\nhigh = [1e-6, 1.0, 1.0]\n"
    return block([0, 0, 0], size, (6, 1, 1), between(rng, 5e4, 5e5)) + clamp


def meets(rng: np.random.Generator) -> Case:
    """A rigid ball that spins is thrown along a plate and meets a box."""
    radius, edge = between(rng, 0.02, 0.05), between(rng, 0.04, 0.1)
    speed, gap = between(rng, 0.3, 1.5), between(rng, 0.01, 0.1)
    text = head(0.01, 1e-3, friction=between(rng, 0.1, 0.8)) + obstacle("plate.obj")
    text += rigid(
        "ball", between(rng, 0.1, 1.0), [0.0, 0.0, radius + 1e-3 + rng.uniform(0.0, 0.01)], radius=radius,
        velocity=[speed, 0.0, 0.0], spin=[0.0, float(rng.uniform(-1.0, 1.0) * speed / radius), 0.0],
    )  # fmt: skip
    place = [radius + gap + edge / 2, rng.uniform(-0.2, 0.2) * edge, edge / 2 + 1.01e-3]
    text += rigid("box", between(rng, 0.1, 2.0), place, size=[edge] * 3)
    return Case(text, 25, 96)


def lying(rng: np.random.Generator) -> Case:
    """A rigid ball falls on a soft block."""
    size, radius = rng.uniform(0.03, 0.06, 3) * [1, 1, 0.7], between(rng, 0.005, 0.012)
    text = soft_head(rng) + block([*(-size[:2] / 2), 6e-4], size, (2, 2, 2), between(rng, 5e4, 5e5))
    place = [*rng.uniform(-0.005, 0.005, 2), 6e-4 + size[2] + radius + between(rng, 0.002, 0.02)]
    text += obstacle("plate.obj") + rigid("ball", between(rng, 0.005, 0.05), place, radius=radius)
    return Case(text, 24, 64)


def stacks(rng: np.random.Generator) -> Case:
    """Three rigid boxes fall on a plate and on each other."""
    text, height = (
        head(0.01, 1e-3, friction=between(rng, 0.2, 0.8), tolerance=1e-4) + obstacle("plate.obj"),
        0.0,
    )
    edge = between(rng, 0.05, 0.12)
    for _ in range(3):
        place = [*rng.uniform(-0.1, 0.1, 2) * edge, height + edge / 2 + 1e-3 + between(rng, 5e-4, 0.01)]
        push = [*rng.uniform(-0.1, 0.1, 2).tolist(), 0.0]
        text += rigid("box", between(rng, 0.1, 1.0), place, velocity=push, size=[edge] * 3)
        height = place[2] + edge / 2
    return Case(text, 25, 96)


def net(rng: np.random.Generator, compressed: str = "push", *, touching: bool = True) -> Case:
    """A net of springs that push when compressed falls on a sphere."""
    mass, speed = between(rng, 0.1, 0.5), rng.uniform(-1.5, 0.0)
    place = [*rng.uniform(-0.03, 0.03, 2).tolist(), between(rng, 0.22, 0.27)]
    text = head(0.01, 2e-3 if touching else 0.0, friction=between(rng, 0.0, 0.8))
    text += (
        f'[springs]\nsource = "grid"\nnodes = 6\nsize = 0.7\nposition = {place}\nnode_mass = {mass / 36}\n'
        f"stiffness = {between(rng, 50, 400)}\nshear = {between(rng, 20, 80)}\ndamping = 0.02\n"
        f'compressed = "{compressed}"\n'
    )
    if touching:
        text += (
            f"[[initial_velocity]]\nvelocity = [0.0, 0.0, {speed}]\n[damping]\nmass = 2.0\nstiffness = 0.0\n"
        )
        text += obstacle("sphere.obj")
    else:
        text += "fixed_corners = [2, 3]\n"
    return Case(text, 25, 64)


def robot(rng: np.random.Generator) -> Case:
    """The servos of the Tripod move it, with a ball on it."""
    radius, start = between(rng, 0.006, 0.012), float(rng.uniform(-0.4, 0.0))
    text = head(0.005, 5e-4, friction=between(rng, 0.2, 0.8))
    text += f"[damping]\n[effector]\n[mesh]\nlevel = 1\n[material]\nyoung = {between(rng, 150e3, 400e3)}\n"
    text += f"[servos]\nangles = [{start}, {start}, {start}]\n"
    text += rigid("ball", between(rng, 5e-4, 5e-3), [0.0, 0.0, 0.02 + 1.2 * radius], radius=radius)
    turn = tuple(rng.uniform(-0.3, 0.3, 3).tolist())
    return Case(text, 30, 48, turn=turn, ramp=int(rng.integers(6, 25)))


def bounces(rng: np.random.Generator) -> Case:
    """Rigid balls or boxes fall on a plate and bounce."""
    case = falls(rng)
    return Case(case.text.replace("[contact]", f"[contact]\nrestitution = {rng.uniform(0.2, 0.9)}"), 40, 96)


def free(rng: np.random.Generator) -> Case:
    """A soft bar, clamped at one end, swings and touches nothing."""
    text = head(0.01) + f"[damping]\nstiffness = {between(rng, 2e-4, 4e-3)}\n" + bar(rng)
    return Case(text, 25, 64, scheme="tr_bdf2")


def slack(rng: np.random.Generator) -> Case:
    """A net of springs that go slack hangs by two corners or falls on a sphere."""
    return net(rng, "slack", touching=bool(rng.random() < 0.5))


KINDS = {
    f.__name__: f
    for f in (falls, slides, stacks, meets, bars, blocks, lying, robot, net, bounces, free, slack)
}
"""By name."""

PROMISED = ("falls", "slides", "stacks", "meets", "bars", "net", "free", "slack")
"""Kinds in which a run promises its accuracy: as many scenes as asked for. Of the others a third."""


def play(case: Case, folder: Path, *words: str) -> tuple[np.ndarray, Simulation]:
    """Return positions at the ends of all intervals [m], shape (intervals + 1, n, 3), and the simulation then.

    Raises StepError.
    """
    path = folder / "promise.toml"
    path.write_text(case.text)
    interval = load_scene(path).dt
    simulation = Simulation(load_scene(path, words))
    every, start = round(interval / simulation.scene.dt), simulation.command
    turn = np.append(case.turn, 0.0) if case.turn else np.zeros(len(start))
    rows = [simulation.positions.copy()]
    for k in range(case.intervals * every):
        simulation.step(start + turn * min((k + 1) / (case.ramp * every), 1.0) if case.turn else None)
        if (k + 1) % every == 0:
            rows.append(simulation.positions.copy())
    return np.array(rows), simulation


def error(rows: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest error over the largest move."""
    move = np.linalg.norm(exact - exact[0], axis=2).max()
    return float(np.linalg.norm(rows - exact, axis=2).max() / move)


def reference(case: Case, folder: Path) -> tuple[np.ndarray, float]:
    """Return positions of the reference and its own error. Raises StepError."""
    path = folder / "promise.toml"
    path.write_text(case.text)
    scene, found = load_scene(path), []
    words = [f"solver.tolerance={case.tolerance!r}"]
    if scene.contact:
        words = ["contact.tolerance=1e-5", "contact.max_solves=300"]
    for division in (case.division // 2, case.division):
        step = [f"inertia.scheme={case.scheme}", f"dt={scene.dt / division!r}", "solver.mode=newton", *words]
        found.append(play(case, folder, *step)[0])
    return found[1], error(found[0], found[1])


def promises(simulation: Simulation) -> bool:
    """Return whether the accuracy that is asked for is promised, as the notes tell."""
    return not any("time_error.accuracy" in note for note in simulation.notes)


def measure(kind: str, seed: int, folder: Path) -> dict[str, Any]:
    """Return what one scene makes of an accuracy, ready for JSON."""
    rng = np.random.default_rng([seed, *kind.encode()])
    case, accuracy = KINDS[kind](rng), float(rng.choice(ACCURACIES))
    row: dict[str, Any] = {"kind": kind, "seed": seed, "accuracy": accuracy}
    begin = time.thread_time()
    try:
        exact, row["own"] = reference(case, folder)
        rows, simulation = play(case, folder, "dt=auto", f"time_error.accuracy={accuracy}")
    except StepError as stopped:
        return row | {"stopped": str(stopped)}
    told, move = simulation.report.time_error, np.linalg.norm(exact - exact[0], axis=2).max()
    return row | {
        "error": error(rows, exact),
        "told": float(told.largest / move) if told else np.nan,
        "promised": promises(simulation),
        "seconds": time.thread_time() - begin,
    }


def judged(row: dict[str, Any]) -> bool:
    """Return whether the reference is known well enough to judge a run."""
    return "stopped" not in row and row["own"] <= KNOWN * row["accuracy"]


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the table of the page."""
    heads = (
        "scenes",
        "judged",
        "chaotic",
        "promised",
        "of these kept",
        "others kept",
        "worst error over the accuracy",
    )
    lines = []
    groups = [[kind] for kind in KINDS] + [list(KINDS)]
    for kinds in groups:
        own = [row for row in rows if row["kind"] in kinds]
        known = [row for row in own if judged(row)]
        if not known:
            continue
        name = "all" if len(kinds) > 1 else str(KINDS[kinds[0]].__doc__).rstrip(".")
        given = [row for row in known if row["promised"]]
        kept = [sum(r["error"] <= r["accuracy"] for r in some) for some in (given, known)]
        worst = [
            max((r["error"] / r["accuracy"] for r in known if r["promised"] == promised), default=None)
            for promised in (True, False)
        ]
        words = [f"{w:.2g}{'' if p else ' (not promised)'}" for w, p in zip(worst, (1, 0), strict=True) if w]
        others = f"{kept[1] - kept[0]} of {len(known) - len(given)}"
        lines.append((name, len(known), len(own) - len(known), len(given), kept[0], others, ", ".join(words)))
    return table_lines(heads, lines)


def missing(rows: Sequence[dict[str, Any]], scenes: int) -> tuple[str, int] | None:
    """Return kind and seed of the next scene to measure, of kinds in turns; None where all have enough."""
    todo = []
    for kind in KINDS:
        own = [row for row in rows if row["kind"] == kind]
        wanted = scenes if kind in PROMISED else -(-scenes // 3)
        done = sum(judged(row) and (row["promised"] or kind not in PROMISED) for row in own)
        if done < wanted:
            todo.append((done / wanted, kind, len(own)))
    return min(todo)[1:] if todo else None


def arguments(text: str | None, kinds: str, seed: int, results: str) -> argparse.Namespace:
    """Return the command line of a script that measures random scenes; `kinds`: of which there are so many."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=12, help=f"of each {kinds} (default 12)")
    parser.add_argument("--seed", type=int, default=seed, help="of the first; the others follow")
    parser.add_argument("--results", type=Path, default=Path(results))
    parser.add_argument("--report", action="store_true", help="print the table of the results alone")
    parser.add_argument("--write", action="store_true", help="write the table to docs/time_error.md, too")
    return parser.parse_args()


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__, "kind that may promise", 20261128, "build/time_promise.jsonl")
    rows = stored(options.results)
    if not options.report:
        print(f"calibration: 1000 x 1000 product {1e3 * calibration():.1f} ms", flush=True)
        while found := missing(rows, options.scenes):
            kind, number = found
            rows.append(measure(kind, options.seed + number, options.results.parent))
            store(options.results, rows[-1])
            print(rows[-1], flush=True)
    print("\n".join(["", *table(rows)]))
    if options.write:
        write_part("time_error.md", "promise", table(rows))


if __name__ == "__main__":
    main()
