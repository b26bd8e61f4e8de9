"""Inverse kinematics of cables, chambers, forces and servos: random reachable targets, beside SciPy's search.

    python benchmarks/ik_actuators.py [--targets 100] [--beside 20] [--scene cables tensions chambers mixed]

Commands drawn evenly from the ranges are simulated; where the effector rests is a target. `solve_once` starts from the
pose of the start, and so does L-BFGS-B over the commands with the simulation inside (derivatives by differences).
`--scene` also takes a file. A target is met if less than 0.01 mm is missing.

Prints a line for each target to stderr as it is solved, then one JSON object a scene: targets that are met; those that
end at a closest pose, and the largest residual of the optimality conditions there [rad]; largest distance of the met
[m]; medians of linearisations and of the time of each [s]; of SciPy: how many it meets, median time [s], and how many
of these targets are met by ours.
"""

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from scipy.optimize import minimize

sys.path.insert(0, str(Path(__file__).parents[1]))

from tripod_ik.model import StaticModel
from tripod_ik.solve_once import solve_once
from tripod_sim import load_scene
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene
from tripod_sim.tables.short_forms import joints_of

ROOT = Path(__file__).parents[1]
MET = 1e-5
"""What may be missing of a target that is met [m]."""
FINGER = str(ROOT / "examples" / "tendon_finger.toml")
REST = ("motion=off", "inertia=off", "damping=off", 'effector={set="tip"}')


def cables(places: tuple[tuple[float, float], ...], rest: str) -> str:
    """Return the tables of cables along the finger at places (y, z) [m]."""
    tables = []
    for k, (y, z) in enumerate(places):
        points = ", ".join(f"[{x}, {y}, {z}]" for x in (0.0, 0.03, 0.06, 0.099))
        tables.append(
            f'{{name="cable_{k}", {rest}, via=[{{body="world", points=[[-0.01, {y}, {z}]]}}, {{points=[{points}]}}]}}'
        )
    return f"cable=[{', '.join(tables)}]"


def write_trunk(path: Path) -> None:
    """Write a beam of 10 cm of bricks with three sealed tubes about its axis."""
    cells = np.array([10, 7, 5])
    i, j, k = np.indices(cells + 1)
    points = np.stack([i, j, k], axis=-1).reshape(-1, 3) / cells * [0.1, 0.021, 0.015]
    node = np.arange(i.size).reshape(i.shape)
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    x, y, z = cells
    bricks = np.stack([node[a : a + x, b : b + y, c : c + z].ravel() for a, b, c in corners], axis=1)
    place = np.indices(cells).reshape(3, -1).T
    tube = np.any([(place[:, 1:] == at).all(axis=1) for at in ((1, 1), (5, 1), (3, 3))], axis=0)
    hole = tube & (place[:, 0] > 0) & (place[:, 0] < x - 1)
    used, numbers = np.unique(bricks[~hole], return_inverse=True)
    meshio.Mesh(points[used], [("hexahedron", numbers.reshape(-1, 8))]).write(path)


def scene_of(name: str, folder: Path) -> Scene:
    """Return a scene of this benchmark, or of a file."""
    around = ((0.01, 0.003), (0.01, 0.012), (0.003, 0.0075), (0.017, 0.0075))
    if name == "cables":
        return load_scene(FINGER, [cables(around, "range=[-0.012, 0.012]"), *REST])
    if name == "tensions":
        return load_scene(FINGER, [cables(around, 'command="tension", range=[0, 4]'), *REST])
    if name == "chambers":
        write_trunk(folder / "trunk.vtk")
        chambers = ", ".join(f'{{name="air_{k}", cavity={k}, range=[0, 8e3]}}' for k in range(3))
        mesh = f'mesh={{source="{folder / "trunk.vtk"}"}}'
        return load_scene(FINGER, ["cable=off", "material.young=60e3", mesh, f"chamber=[{chambers}]", *REST])
    if name == "mixed":
        cable = (
            'cable=[{name="tendon", range=[0, 0.006], via=[{points=[[0.0, -0.006, 0.0]]}, '
            '{body="world", points=[[0.01, 0.02, -0.03]]}]}]'
        )
        push = 'force=[{name="push", set="all", direction=[1, 0, 1], range=[-0.3, 0.3]}]'
        words = [
            "mesh.level=1",
            "servos.slide=0.035",
            "servos.angles=[-0.8, -0.8, -0.8]",
            "inertia=off",
            "damping=off",
        ]
        return load_scene("tripod", [*words, "motion=off", "servos.angle_min=-1.3", cable, push])
    return load_scene(name, ["motion=off", "inertia=off", "damping=off"])


def targets_of(model: StaticModel, low: np.ndarray, high: np.ndarray, count: int) -> list[np.ndarray]:
    """Return where the effector rests at `count` random commands; those without an equilibrium are left out."""
    found: list[np.ndarray] = []
    random = np.random.default_rng(7)
    while len(found) < count:
        model.go_home()
        try:
            found.append(model.move(random.uniform(low, high)).equilibrium.copy())
        except (StepError, SceneError):
            continue
    return found


def beside(model: StaticModel, low: np.ndarray, high: np.ndarray, target: np.ndarray) -> tuple[float, float]:
    """Return what L-BFGS-B misses [m] and how long it takes [s]."""
    model.go_home()
    slide, missing = model.slide, [np.inf]

    def value(commands: np.ndarray) -> float:
        try:
            model.simulation.step(np.append(np.clip(commands, low, high) * model.spans, slide))
        except StepError:
            return 1e6
        effector = model.simulation.effector
        assert effector
        missing.append(float(np.linalg.norm(effector.position - target)))
        return 1e6 * missing[-1] ** 2

    begin = time.perf_counter()
    options = {"maxiter": 200, "ftol": 1e-14, "gtol": 1e-8, "eps": 1e-5}
    minimize(value, model.home, method="L-BFGS-B", bounds=list(zip(low, high, strict=True)), options=options)
    return min(missing), time.perf_counter() - begin


def measure(scene: Scene, count: int, compared: int) -> dict[str, Any]:
    """Return the figures of one scene."""
    joints = joints_of(scene)
    assert joints
    model = StaticModel(scene, joints.slide)
    low, high = joints.low / joints.spans, joints.high / joints.spans
    targets = targets_of(model, low, high, count)
    found = []
    for t in targets:
        found.append(solve_once(scene, t.tolist(), slide=joints.slide, torque_max=np.inf, tolerance=MET))
        answer = found[-1]
        done = f"{scene.name}: target {len(found)} of {count}: {1000 * answer['error']:.4f} mm off"
        print(f"{done}, {answer['seconds']:.1f} s", file=sys.stderr, flush=True)
    met = [f for f in found if f["error"] < MET]
    closest = [f for f in found if f["error"] >= MET]
    others = [beside(model, low, high, t) for t in targets[:compared]]
    return {
        "scene": scene.name, "joints": joints.count, "targets": count, "met": len(met), "closest": len(closest),
        "kkt": max((f["kkt"] for f in closest), default=0.0), "outcomes": sorted({f["outcome"] for f in closest}),
        "farthest_closest": max((f["error"] for f in closest), default=0.0),
        "largest": max((f["error"] for f in met), default=0.0),
        "linearisations": float(np.median([f["iterations"] for f in found])),
        "seconds_each": float(np.median([f["seconds"] / f["iterations"] for f in found])),
        "compared": len(others), "scipy_met": sum(m < MET for m, _ in others),
        "scipy_seconds": float(np.median([s for _, s in others])) if others else None,
        "ours_met": sum(f["error"] < MET for f in found[: len(others)]),
        "ours_seconds": float(np.median([f["seconds"] for f in found[: len(others)]])) if others else None,
    }  # fmt: skip


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--targets", type=int, default=100)
    parser.add_argument("--beside", type=int, default=20)
    parser.add_argument("--scene", nargs="+", default=["cables", "tensions", "chambers", "mixed"])
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in wanted.scene:
            figures = measure(scene_of(name, Path(folder)), wanted.targets, wanted.beside)
            print(json.dumps({"name": name, **figures}), flush=True)


if __name__ == "__main__":
    main()
