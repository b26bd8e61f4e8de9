"""The pendulum: the course report's variations, under each time integrator."""

import time
from typing import Any

import numpy as np

from tripod_sim.errors import StepError
from tripod_sim.scene.file import load_scene
from tripod_sim.simulation import Simulation
from tripod_study import report as table

SCENE = "pendulum"

BASE = {"dt": 0.005, "k": 1500.0, "m": 1.0, "g": 9.81}
"""Step [s], stiffness [N/m], mass of a node [kg], gravity [m/s²]: where one of them is varied."""

VARIED = {
    "dt": (0.4, 0.005, 1e-5),
    "k": (0.0, 0.1, 1500.0, 5000.0),
    "m": (0.001, 1.0, 5000.0),
    "g": (9.81, 1000.0),
}

REPORTED = (
    ("semi_implicit_euler", "off"),
    ("semi_implicit_euler", "auto"),
    ("rk4", "auto"),
    ("implicit_euler", ""),
    ("bdf2", ""),
    ("tr_bdf2", ""),
)
"""Time integrators, and how explicit ones divide their steps."""

LONGEST, FEWEST, LOOKS = 2.0, 20, 200
"""Simulated time [s] unless that are fewer steps than `FEWEST`; the motion is looked at `LOOKS` times."""

SHARE = 0.5
"""Energy that comes from nothing, as a share of the largest energy of motion and tension: more is not stable."""

COLUMNS = (
    table.Column("scheme", "scheme"),
    table.Column("substeps", "substeps"),
    table.STEP,
    table.STIFFNESS,
    table.Column("m", "m [kg]", lambda v: f"{v:g}"),
    table.GRAVITY,
    table.STABLE,
    table.PARTS,
    table.AMPLITUDE,
    table.DRIFT,
    table.WALL,
)
"""amplitude: of the free end; drift: change of the whole energy over the weight of the free nodes times the chain's
length. Of a run that overflowed, amplitude and drift are those before it did."""


def report(*, full: bool) -> table.Report:
    """Return the table of the course report's variations, under each time integrator; `full`: all combinations."""
    how = "all combinations" if full else "one value varied at a time"
    cases = tuple(
        {"scheme": scheme, "substeps": substeps or "-", **case}
        for case in (table.combined if full else table.one_by_one)(BASE, VARIED)
        for scheme, substeps in REPORTED
    )
    title = f"10 nodes, the first fixed, swing down from the horizontal; {how}"
    return table.Report(title, COLUMNS, cases, lambda case: measure(**case), version=1)


def measure(scheme: str, substeps: str, dt: float, k: float, m: float, g: float) -> dict[str, Any]:
    """Return what one run shows: the values of `COLUMNS` from `stable` on."""
    words = [f"dt={dt}", f"springs.stiffness={k}", f"springs.node_mass={m}", f"gravity.acceleration=[0, 0, -{g}]",
             f"inertia.scheme={scheme}"]  # fmt: skip
    if substeps not in ("", "-"):
        words.append(f"inertia.substeps={substeps}")
    scene = load_scene(SCENE, words)
    simulation = Simulation(scene)
    start = simulation.positions[-1].copy()
    assert scene.springs
    scale = (len(simulation.positions) - 1) * m * g * scene.springs.size
    steps = max(FEWEST, round(LONGEST / dt))
    chunk = max(1, steps // LOOKS)
    stable, reach, largest, growth, parts, done = True, 0.0, 0.0, 0.0, 0, 0
    begin = time.perf_counter()
    try:
        while done < steps:
            report = simulation.advance(min(chunk, steps - done))
            done, parts = simulation.state.step, parts + report.parts
            e = simulation.energies()
            growth = e.kinetic + e.strain + e.gravity
            largest = max(largest, e.kinetic + e.strain)
            reach = max(reach, float(np.linalg.norm(simulation.positions[-1] - start)))
            stable = stable and not report.grew_at and growth <= SHARE * largest + 0.01 * scale
    except StepError:
        stable = False
    wall = time.perf_counter() - begin
    return {
        "stable": stable,
        "parts": parts / done if done else 0.0,
        "amplitude": reach,
        "drift": growth / scale,
        "wall": wall / (done * dt) if done else 0.0,
    }
