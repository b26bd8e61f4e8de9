"""Check that a change leaves results as they were: `python -m tools.same_results FILE.npz [SCENE ...]`.

Steps every shipped scene 200 times with its own motion. The first time it writes where the nodes and the servo torques
are after each tenth step into the file; where the file exists it compares with that, prints the largest difference of
each scene as a share of its size, and ends with 1 if one is above `--tolerance`. `--moved` first moves all nodes at
random by that length: what a scene makes of a difference that means nothing. An interrupted run keeps the scenes that
it has.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim import Simulation, load_scene
from tripod_sim.errors import StepError
from tripod_sim.scene.file import scene_names
from tripod_sim.scene.script import script_of

EVERY = 10
"""Steps from one kept state to the next."""


def states_of(name: str, steps: int, moved: float) -> FloatArray:
    """Return all positions [m] and torques [N m] of each `EVERY`-th step, shape (k, numbers); NaN after a failed step.

    Args:
        name: Of a shipped scene.
        steps: How many.
        moved: Length by which each node is moved first [m].
    """
    scene = load_scene(name)
    script = script_of(scene, None, None)
    simulation = Simulation(script.started(scene) if script else scene)
    if moved:
        away = np.random.default_rng(0).normal(size=simulation.state.positions.shape)
        saved, torques = simulation.save()
        saved.positions += moved * away / np.linalg.norm(away, axis=1, keepdims=True)
        simulation.restore((saved, torques))
    kept = []
    for k in range(steps):
        joints = script.joints(simulation.command, (k + 1) * scene.dt) if script else None
        try:
            simulation.step(joints)
        except StepError:
            kept.append(np.full(simulation.positions.size + simulation.efforts.size, np.nan))
            break
        if k % EVERY == EVERY - 1:
            kept.append(np.append(simulation.positions.ravel(), simulation.efforts))
    return np.array(kept)


def difference(now: FloatArray, before: FloatArray, size: float) -> float:
    """Return the largest difference of positions and torques as a share of `size` [m]; infinite of unlike shapes."""
    if now.shape != before.shape or not np.array_equal(np.isnan(now), np.isnan(before)):
        return float("inf")
    return float(np.nanmax(np.abs(now - before)) / size)


def main() -> int:
    """Run it; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("file", type=Path, help="results, *.npz; written if it does not exist")
    parser.add_argument("scenes", nargs="*", help="shipped scenes; all by default")
    parser.add_argument("--steps", type=int, default=200, help="steps of each scene")
    parser.add_argument(
        "--tolerance", type=float, default=1e-9, help="allowed difference over the size of a scene"
    )
    parser.add_argument("--moved", type=float, default=0.0, help="length by which nodes are moved first [m]")
    options = parser.parse_args()
    before = dict(np.load(options.file)) if options.file.exists() else {}
    kept, unlike = dict(before), []
    for name in options.scenes or scene_names():
        begin = time.perf_counter()
        now = states_of(name, options.steps, options.moved)
        took = f"{time.perf_counter() - begin:.1f} s"
        if name not in before:
            kept[name] = now
            np.savez_compressed(options.file, **kept)
            print(f"{name:<16}written  {took}", flush=True)
            continue
        nodes = Simulation(load_scene(name)).mesh.nodes
        apart = difference(now, before[name], float(np.ptp(nodes, axis=0).max()))
        print(f"{name:<16}{apart:.1e}  {took}", flush=True)
        if not apart <= options.tolerance:
            unlike.append(name)
    if unlike:
        print(f"above {options.tolerance:g} of the size: {', '.join(unlike)}", file=sys.stderr)
    return int(bool(unlike))


if __name__ == "__main__":
    raise SystemExit(main())
