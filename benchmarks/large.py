"""Time of a step and memory of large meshes, before and after one factorisation served many steps, beside MuJoCo.

    python benchmarks/large.py [--sizes 1k 8k 25k 80k] [--element t4 t10] [--poisson 0.3 0.45 0.49] [--steps 50]
                               [--shape beam block] [--only new old mujoco] [--limit 600] [--hard] [--write]

A beam of 20 x 2 x 2 cm (250 kPa) and a cube of 20 cm (3 kPa), held at one end, fall under their weight from rest, in
steps of 10 ms. `new`: as scenes do by default; `old`: Newton's method with AMD's order, and conjugate gradients beyond
20 million entries of L, as they did before; MuJoCo, if it is installed: flex of linear tetrahedra on the same grid,
integrator `discrete`. Each runs in a process of its own, at most `--limit` [s].

Prints a JSON object each: unknowns; median and 95th percentile of the time of the steps [ms], on all processors (`old`
and MuJoCo on one); iterations and factorisations a step; largest memory [MB]; height of the tip in the end [m]; and a
product of 1000 x 1000 on one [ms], which tells how fast the machine is. `--hard` runs twenty hard cases with 25,000
unknowns instead: jumps of the tip, steps of 0.1 s and more, crushed elements; it prints how far `new` and `old` get and
where the body is then. `--write` puts a table into docs/speed.md.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from itertools import product
from pathlib import Path
from typing import Any

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from benchmarks.doc_parts import write_part
from tests.scenes import held_bar
from tripod_host.threads import processors
from tripod_sim import Simulation, load_scene
from tripod_sim.errors import StepError
from tripod_sim.forces import solid_arrays
from tripod_sim.integrators.newton import Newton
from tripod_sim.linear import choice, ldl_symbolic
from tripod_sim.scene import Scene
from tripod_sim.steps import steppers

CELLS = {
    ("beam", "t4"): {"1k": (36, 2, 2), "8k": (55, 6, 6), "25k": (85, 9, 9), "80k": (158, 12, 12)},
    ("block", "t4"): {"1k": (7, 7, 7), "8k": (13, 13, 13), "25k": (20, 20, 20), "80k": (29, 29, 29)},
    ("beam", "t10"): {"1k": (18, 1, 1), "8k": (27, 3, 3), "25k": (52, 4, 4), "80k": (80, 6, 6)},
    ("block", "t10"): {"1k": (3, 3, 3), "8k": (6, 6, 6), "25k": (10, 10, 10), "80k": (14, 14, 14)},
}
SIZES = {"beam": (0.2, 0.02, 0.02), "block": (0.2, 0.2, 0.2)}
YOUNG = {"beam": 250e3, "block": 3e3}
DENSITY, STEP = 1070.0, 0.01  # as of `held_bar`

HARD = {
    "jump": 'prescribed: turn="0: 0,0,0; 0.01: 0,1.5,0", centre=[0.2,0.01,0.01]',
    "twist": 'prescribed: turn="0: 0,0,0; 0.02: 3,0,0", centre=[0.2,0.01,0.01]',
    "stretch": 'prescribed: move="0: 0,0,0; 0.01: 0.2,0,0"',
    "press": 'prescribed: move="0: 0,0,0; 0.01: -0.1,0,0"',
    "crush": 'prescribed: move="0: 0,0,0; 0.05: -0.18,0,0"',
    "shear": 'prescribed: move="0: 0,0,0; 0.01: 0,0.1,0.1"',
    "long steps": "dt: 0.1",
    "longer steps": "dt: 0.5",
    "flung": "initial_velocity: velocity=[0,0,-20]",
    "spun": "initial_velocity: spin=[60,0,0], centre=[0,0.01,0.01]",
}
"""What happens to the tip of the beam, or to all of it, in addition to its weight."""
HARD_STEPS = 6


def scene_of(
    shape: str, cells: tuple[int, ...], element: str, poisson: float, folder: Path, extra: str = ""
) -> Scene:
    """Return a body held at X = 0 that falls; `extra`: more tables."""
    bar = held_bar(cells, element, size=SIZES[shape], young=YOUNG[shape], poisson=poisson)
    path = folder / "large.toml"
    path.write_text(f'{bar}[[marker]]\nset = "tip"\n{extra}')
    return load_scene(str(path))


def as_before() -> None:
    """Let this process solve as before one factorisation served many steps."""
    steppers._solver_to_tolerance = lambda model, system: Newton(
        system, model.solver.tolerance, model.solver.max_iterations
    )
    ldl_symbolic.DISSECTED = ldl_symbolic.SHARED = solid_arrays.POINTS = 10**12
    choice.LARGE = 20_000_000
    choice.find_spec = lambda package: None  # no multigrid


def ours(shape: str, cells: tuple[int, ...], element: str, poisson: float, steps: int) -> dict[str, Any]:
    """Return the figures of one body."""
    with tempfile.TemporaryDirectory() as folder:
        simulation = Simulation(scene_of(shape, cells, element, poisson, Path(folder)))
    taken, work = [], []
    for _ in range(steps):
        begin = time.perf_counter()
        simulation.step()
        taken.append(time.perf_counter() - begin)
        work.append((simulation.report.iterations, simulation.report.factorisations))
    iterations, factorisations = np.mean(work, axis=0)
    return {
        "unknowns": simulation.system.unknowns, "iterations": round(float(iterations), 2),
        "factorisations": round(float(factorisations), 2), "height": float(simulation.state.positions[:, 2].min()),
        **times(taken),
    }  # fmt: skip


def times(taken: list[float]) -> dict[str, float]:
    """Return median and 95th percentile [ms] of times [s]."""
    return {"median": 1e3 * float(np.median(taken)), "p95": 1e3 * float(np.percentile(taken, 95))}


def mujoco(shape: str, cells: tuple[int, ...], poisson: float, steps: int) -> dict[str, Any]:
    """Return the figures of MuJoCo's flex on the same grid."""
    import mujoco  # noqa: PLC0415 - an extra

    size = SIZES[shape]
    spacing = " ".join(str(length / n) for length, n in zip(size, cells, strict=True))
    count = " ".join(str(n + 1) for n in cells)
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="{STEP}" integrator="discrete"
        solver="Newton" tolerance="1e-6"><flag contact="disable"/></option><size memory="8G"/><worldbody>
        <flexcomp name="soft" type="grid" dim="3" count="{count}" spacing="{spacing}" radius="1e-4"
        mass="{DENSITY * np.prod(size)}" pos="{size[0] / 2} 0 0">
        <elasticity young="{YOUNG[shape]}" poisson="{poisson}" damping="0.01"/>
        <pin gridrange="0 0 0 0 {cells[1]} {cells[2]}"/></flexcomp></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    taken = []
    for _ in range(steps):
        begin = time.perf_counter()
        mujoco.mj_step(model, data)
        taken.append(time.perf_counter() - begin)
    height = float(data.flexvert_xpos[:, 2].min()) + 0.5 * size[2]
    return {
        "unknowns": int(model.nv),
        "height": height,
        "finite": bool(np.isfinite(data.qpos).all()),
        **times(taken),
    }


def hard(name: str, poisson: float) -> dict[str, Any]:
    """Return how a hard case ends: the error in words, or nothing; time [s], halvings and height [m]."""
    table, words = HARD[name].split(": ", 1)
    lines = {
        "prescribed": '[[prescribed]]\nset = "tip"\n' + words.replace('", ', '"\n'),
        "initial_velocity": "[[initial_velocity]]\n" + words.replace("], ", "]\n"),
        "dt": "",
    }
    with tempfile.TemporaryDirectory() as folder:
        cells = CELLS["beam", "t4"]["25k"]
        scene = scene_of("beam", cells, "t4", poisson, Path(folder), lines[table])
        if table == "dt":
            scene = load_scene(str(Path(folder) / "large.toml"), [f"dt={words}"])
        simulation = Simulation(scene)
    begin, failed, done = time.perf_counter(), "", 0
    try:
        for _ in range(HARD_STEPS):
            simulation.step()
            done += 1
    except StepError as error:
        failed = str(error)
    seconds = time.perf_counter() - begin
    return {
        "failed": failed,
        "done": done,
        "seconds": seconds,
        "height": float(simulation.state.positions[:, 2].min()),
    }


def run_one(case: dict[str, Any]) -> dict[str, Any]:
    """Measure one case in this process."""
    cells = tuple(case["cells"])
    if case["who"] == "old":
        as_before()
    if "hard" in case:
        found = hard(case["hard"], case["poisson"])
    elif case["who"] == "mujoco":
        found = mujoco(case["shape"], cells, case["poisson"], case["steps"])
    else:
        found = ours(case["shape"], cells, case["element"], case["poisson"], case["steps"])
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {**found, "memory": round(memory), "product": 1e3 * calibration(3)}


def cases(wanted: argparse.Namespace) -> list[dict[str, Any]]:
    """Return the cases to run."""
    if wanted.hard:
        return [
            {"who": who, "hard": name, "poisson": nu, "shape": "beam", "cells": ()}
            for name, nu, who in product(HARD, (0.3, 0.49), wanted.only)
            if who != "mujoco"
        ]
    found = []
    for size, shape, element, nu in product(wanted.sizes, wanted.shape, wanted.element, wanted.poisson):
        for who in wanted.only:
            if who == "mujoco" and (element != "t4" or nu == 0.49):
                continue
            case = {"who": who, "shape": shape, "element": element, "poisson": nu, "size": size}
            found.append({**case, "cells": CELLS[shape, element][size], "steps": wanted.steps})
    return found


def table(found: list[dict[str, Any]]) -> list[str]:
    """Return a Markdown table of bodies, with the times of each program [ms]."""
    rows: dict[tuple[Any, ...], dict[str, dict[str, Any]]] = {}
    for one in found:
        body = (one["shape"], one["element"], one["poisson"], one["size"])
        rows.setdefault(body, {})[one["who"]] = one
    lines = [
        "| body | element | Poisson's ratio | unknowns | median, 95th percentile [ms] | before [ms] "
        "| memory, before [MB] | MuJoCo [ms] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (shape, element, nu, _), who in rows.items():
        new, old, other = (who.get(name, {}) for name in ("new", "old", "mujoco"))
        memory = f"{new.get('memory', '')}, {old.get('memory', '')}"
        cells = (shape, element, nu, new.get("unknowns", ""), _times(new), _times(old), memory, _times(other))
        lines.append(f"| {' | '.join(map(str, cells))} |")
    product = np.median([one["product"] for one in found if "product" in one])
    return [
        *lines,
        "",
        f"On {processors()} processors, MuJoCo and before on one; there a 1000 x 1000 product took {product:.0f} ms.",
    ]


def hard_table(found: list[dict[str, Any]]) -> list[str]:
    """Return a Markdown table of hard cases: times of all steps [s], or what failed."""
    rows: dict[tuple[Any, ...], dict[str, dict[str, Any]]] = {}
    for one in found:
        rows.setdefault((one["hard"], one["poisson"]), {})[one["who"]] = one
    lines = [
        "| case | what happens | Poisson's ratio | now [s] | before [s] | lowest node [mm] |",
        "|---|---|---|---|---|---|",
    ]
    for (name, nu), who in rows.items():
        both = [who.get(of, {}) for of in ("new", "old")]
        seconds = [
            one.get("failed") or one.get("error") or f"{one.get('seconds', np.nan):.3g}" for one in both
        ]
        heights = ", ".join(f"{1e3 * one.get('height', np.nan):.2f}" for one in both)
        lines.append(f"| {name} | `{HARD[name]}` | {nu} | {' | '.join(seconds)} | {heights} |")
    return lines


def _times(found: dict[str, Any]) -> str:
    """Return median and 95th percentile [ms] in words, or what happened instead."""
    if "median" in found:
        return f"{found['median']:.3g}, {found['p95']:.3g}" + (
            "" if found.get("finite", True) else "; diverged"
        )
    return found.get("error", "")


def main() -> None:
    """Run each case in a process of its own, and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sizes", nargs="+", default=["1k", "8k", "25k", "80k"])
    parser.add_argument("--element", nargs="+", default=["t4", "t10"])
    parser.add_argument("--poisson", nargs="+", type=float, default=[0.3, 0.45, 0.49])
    parser.add_argument("--shape", nargs="+", default=["beam", "block"])
    parser.add_argument("--only", nargs="+", default=["new", "old", "mujoco"])
    parser.add_argument("--steps", type=int, default=50)
    parser.add_argument("--limit", type=float, default=600.0)
    parser.add_argument("--hard", action="store_true")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--case", help=argparse.SUPPRESS)
    wanted = parser.parse_args()
    if wanted.case:
        print(json.dumps(run_one(json.loads(wanted.case))))
        return
    done_cases = []
    for case in cases(wanted):
        try:
            done = subprocess.run(
                [sys.executable, __file__, "--case", json.dumps(case)],
                capture_output=True, text=True, timeout=wanted.limit, check=False,
            )  # fmt: skip
            last = (done.stderr.strip().splitlines() or ["nothing was printed"])[-1]
            found = json.loads(done.stdout) if done.returncode == 0 else {"error": last}
        except subprocess.TimeoutExpired:
            found = {"error": f"not done in {wanted.limit:g} s"}
        print(json.dumps({**case, **found}), flush=True)
        done_cases.append({**case, **found})
    if wanted.write:
        name, made = ("hard", hard_table(done_cases)) if wanted.hard else ("large", table(done_cases))
        write_part("speed.md", name, made)


if __name__ == "__main__":
    main()
