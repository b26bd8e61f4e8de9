"""Stability matrix: hard cases times elements times time integrators, as a Markdown table with what each costs.

Each run gets its input in the first step and is then left alone. It passes if no position is NaN or infinite, no
element ends inside out, the energy never again rises above what it was when the input came to rest, and the body is at
rest at the end. `python benchmarks/stability.py --help` lists the options.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before NumPy is loaded
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

import numpy as np  # noqa: E402

from benchmarks.blocks import Block, block, brick  # noqa: E402
from benchmarks.doc_parts import markdown, read_rows, write_part, write_rows  # noqa: E402
from tests.scenes import SHARP  # noqa: E402
from tripod_host.arrays import FloatArray  # noqa: E402
from tripod_sim import Simulation, StepError, load_scene  # noqa: E402
from tripod_sim.integrators.substeps import StepReport  # noqa: E402
from tripod_sim.robot.disc import effector_disc  # noqa: E402

ELEMENTS = ("t4", "t10", "h8", "h8_modes", "h8_mean", "h20", "h20_full", "h27")
SCHEMES = ("implicit_euler", "bdf2", "tr_bdf2")
FLAT, WORKING = (0.0, 0.0, 0.0, 0.0), (-1.5, -1.5, -1.5, 0.035)
STILL = 1e-6
"""A body is at rest when its kinetic energy is less than this share of the energy that it lost on the way."""


@dataclass(frozen=True)
class Case:
    """One hard case of the Tripod.

    Attributes:
        overrides: Of the scene `tripod`.
        joints: Commanded from the first step on [rad, rad, rad, m].
        seconds: Simulated.
        undeformed: Starts flat and stress-free, not in equilibrium with its weight.
        noise: Nodes are displaced at the start by up to this share of the mean length of their elements' edges.
    """

    overrides: tuple[str, ...] = ()
    joints: tuple[float, ...] = WORKING
    seconds: float = 2.0
    undeformed: bool = False
    noise: float = 0.0


TRIPOD = {
    "1.5 rad and 35 mm in one step": Case(),
    "nu 0.499": Case(("material.poisson=0.499",)),
    "dt 0.1 s": Case(("dt=0.1",), seconds=5.0),
    "E 10 MPa": Case(("material.young=1e7",)),
    "gravity x100": Case(("gravity.acceleration=[0, 0, -981]",), FLAT, undeformed=True),
    "noise 50 %, stable neo-Hooke": Case(("material.law=stable_neo_hooke",), FLAT, noise=0.5),
    "noise 50 %, corotational": Case(("material.law=corotational",), FLAT, noise=0.5),
}

BLOCKS = ("soft block 24x4x4", "the same, rotated by 10 degrees", "flat slivers")

CASES = (*TRIPOD, *BLOCKS)


@dataclass(frozen=True)
class Outcome:
    """What one run did.

    Attributes:
        failure: What went wrong; empty if nothing did.
        steps, halvings, iterations, factorisations: Totals.
        mean, worst: CPU time of a step [ms].
        rise: Largest rise of the energy above an earlier value, over the energy lost in the whole run.
        inverted: Share of elements that are inside out at the start.
    """

    failure: str
    steps: int
    halvings: int
    iterations: int
    factorisations: int
    mean: float
    worst: float
    rise: float
    inverted: float


@dataclass(frozen=True)
class Subject:
    """A simulation in the form that the matrix needs."""

    step: Callable[[], StepReport]
    positions: FloatArray
    energies: Callable[[], tuple[float, float]]
    volume_ratio: Callable[[], tuple[int, float]]
    steps: int


def add_noise(simulation: Simulation, share: float) -> None:
    """Move the free nodes at random by up to `share` of the mean edge length of their elements, along each axis."""
    mesh, effector = simulation.mesh, simulation.scene.effector
    assert effector
    corners = mesh.nodes[mesh.elements[:, : mesh.kind.corners]]
    face = [f.loop for f in mesh.kind.faces]
    edges = sorted({tuple(sorted((f[i - 1], f[i]))) for f in face for i in range(len(f))})
    lengths = np.linalg.norm(corners[:, [a for a, _ in edges]] - corners[:, [b for _, b in edges]], axis=2)
    total, count = np.zeros(len(mesh.nodes)), np.zeros(len(mesh.nodes))
    np.add.at(total, mesh.elements, lengths.mean(axis=1)[:, None])
    np.add.at(count, mesh.elements, 1)
    free = np.ones(len(mesh.nodes), dtype=bool)
    free[effector_disc(mesh.nodes, effector)] = False
    for frame in simulation.driven_frames:
        free[frame.nodes] = False
    noise = np.random.default_rng(0).uniform(-share, share, mesh.nodes.shape) * (total / count)[:, None]
    simulation.state.positions[free] += noise[free]


def tripod(case: Case, element: str, scheme: str) -> Subject:
    """Return a case of the Tripod, on mesh level 1."""
    names = ("mesh.level=1", f"mesh.element={element}", f"inertia.scheme={scheme}", *case.overrides)
    simulation = Simulation(load_scene(SHARP, names))
    if case.undeformed:
        simulation._system.start_state(np.zeros(4)).copy_to(simulation.state)
    if case.noise:
        add_noise(simulation, case.noise)
    joints, state, elastic = np.array(case.joints), simulation.state, simulation._system.elastic

    def energies() -> tuple[float, float]:
        e = simulation.energies()
        return e.kinetic, e.kinetic + e.strain + e.gravity

    return Subject(
        lambda: simulation.step(joints),
        state.positions,
        energies,
        lambda: elastic.terms[0].worst_element(state.positions, elastic.of(state.modes, 0)),
        round(case.seconds / simulation.scene.dt),
    )


def soft_block(name: str, element: str, scheme: str) -> Subject:
    """Return a block that is let go and hangs from one end.

    The soft block has 24x4x4 nodes at 0.1 m, 7 kg, E 50 kPa, nu 0.2: it falls until it hangs almost straight down. The
    flat slivers are a layer of elements a thousand times flatter than wide, across a shorter block of E 2 kPa.
    """
    young = 5e4
    if name == "flat slivers":
        young = 2e3
        x = np.array([0.0, 0.1, 0.2, 0.2001, 0.3, 0.4])
        mesh, mass = brick(element, (x, np.arange(4) * 0.1, np.arange(4) * 0.1)), 1.2
    else:
        mesh, mass = brick(element, tuple(0.1 * np.arange(n) for n in (24, 4, 4))), 7.0
    held = np.flatnonzero(mesh.nodes[:, 0] < 1e-9)
    if "rotated" in name:
        c, s = np.cos(np.pi / 18), np.sin(np.pi / 18)
        mesh = replace(mesh, nodes=mesh.nodes @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]).T)
    body: Block = block(
        mesh, young=young, poisson=0.2, mass=mass, held=held, dt=0.05, scheme=scheme, damping=(4.0, 0.005)
    )
    body.warm_up()
    state = body.state
    return Subject(
        body.step,
        state.positions,
        body.energies,
        lambda: body.solid.worst_element(state.positions, body.modes),
        120,
    )


def make(name: str, element: str, scheme: str) -> Subject:
    """Return the subject of one cell of the matrix."""
    if name in TRIPOD:
        return tripod(TRIPOD[name], element, scheme)
    return soft_block(name, element, scheme)


def run(name: str, element: str, scheme: str) -> Outcome:
    """Run one cell of the matrix."""
    subject = make(name, element, scheme)
    inverted = subject.volume_ratio()[1]
    totals, taken, failure = [], [], ""
    halvings = iterations = factorisations = 0
    kinetic = np.inf
    if name in BLOCKS or TRIPOD[name].joints == FLAT:  # nothing is commanded: the start counts, too
        totals.append(subject.energies()[1])
    for k in range(subject.steps):
        begin = time.thread_time()
        try:
            report = subject.step()
        except StepError as error:
            failure = str(error)
            break
        taken.append(1e3 * (time.thread_time() - begin))
        halvings += report.halvings
        iterations += report.iterations
        factorisations += report.factorisations
        if not np.isfinite(subject.positions).all():
            failure = f"step {k + 1}: a position is not finite"
            break
        kinetic, total = subject.energies()
        totals.append(total)
    history = np.array(totals)
    lost = float(history[0] - history[-1]) if len(history) else 0.0
    rise = float((history - np.minimum.accumulate(history)).max() / lost) if lost > 0 else np.inf
    if not failure:
        element_number, ratio = subject.volume_ratio()
        if not ratio > 0:
            failure = f"element {element_number} ends inside out (volume ratio {ratio:.2g})"
        elif (history > history[0] + 1e-6 * abs(lost)).any():
            failure = f"the energy grows by {(history.max() - history[0]) / abs(lost):.1e} of what is lost"
        elif not kinetic < STILL * lost:
            failure = f"still moving: kinetic energy {kinetic:.1e} J of {lost:.1e} J lost"
    return Outcome(
        failure,
        len(taken),
        halvings,
        iterations,
        factorisations,
        float(np.mean(taken)) if taken else 0.0,
        max(taken, default=0.0),
        rise,
        inverted,
    )


ROWS = "stability.csv"


def summary() -> list[str]:
    """Return what the page shows of the table: the default element, and how many cells of a case pass."""
    rows = read_rows(ROWS)
    shown = []
    for name in dict.fromkeys(row["case"] for row in rows):
        own = [row for row in rows if row["case"] == name]
        cells = [row[scheme] for row in own for scheme in SCHEMES]
        passed = sum("fails" not in cell for cell in cells)
        default = next(row for row in own if row["element"] == "h8_modes")
        shown.append(default | {"pass": f"{passed} of {len(cells)}"})
    return markdown(shown, ["case", "steps", "pass", *SCHEMES])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", nargs="+", default=list(CASES), choices=CASES, metavar="CASE", help="rows")
    parser.add_argument("--elements", nargs="+", default=list(ELEMENTS), choices=ELEMENTS, help="of the rows")
    parser.add_argument(
        "--write", action="store_true", help="write docs/stability.csv and docs/verification.md; all elements"
    )
    options = parser.parse_args()
    if options.write and list(options.elements) != list(ELEMENTS):
        parser.error("--write keeps the rows of all elements; leave --elements out")
    head = ["| element | steps | " + " | ".join(SCHEMES) + " |", "|---|---|" + "---|" * len(SCHEMES)]
    print("\n".join("| case " + line if k == 0 else "|---" + line for k, line in enumerate(head)))
    failures, rises = [], dict.fromkeys(SCHEMES, 0.0)
    for name in options.cases:
        lines = []
        for element in options.elements:
            cells, steps = [], 0
            for scheme in SCHEMES:
                found = run(name, element, scheme)
                steps, rises[scheme] = max(steps, found.steps), max(rises[scheme], found.rise)
                mark = "**fails** " if found.failure else ""
                cells.append(f"{mark}{found.mean:.2f} / {found.worst:.0f} ms, {found.halvings}")
                if found.failure:
                    failures.append(f"- {name}, {element}, {scheme}: {found.failure}")
            lines.append(f"| {element} | {steps} | " + " | ".join(cells) + " |")
            print(f"| {name} {lines[-1]}", flush=True)
        if options.write:
            write_rows(ROWS, name, [*head, *lines])
            write_part("verification.md", "stability", summary())
    print("\nCPU time of a step, mean / longest, and how often a part of a step was halved.")
    print("Largest rise of the energy above an earlier value, over the energy lost in the run: ", end="")
    print(", ".join(f"{scheme} {rise:.0e}" for scheme, rise in rises.items()))
    print("\n".join(["", *failures]) if failures else "")


if __name__ == "__main__":
    main()
