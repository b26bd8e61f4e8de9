"""The course report's variations of the pendulum, under each time integrator."""

import time
from itertools import product
from typing import Any

import numpy as np

from tripod_sim.errors import StepError
from tripod_sim.scene_file import load_scene
from tripod_sim.simulation import Simulation
from tripod_sim.study.catalogue import Column, Study

BASE = {"dt": 0.005, "k": 1500.0, "m": 1.0, "g": 9.81}
"""Step [s], stiffness [N/m], mass of a node [kg], gravity [m/s²]: where one of them is varied."""

VARIED = {
    "dt": (0.4, 0.005, 1e-5),
    "k": (0.0, 0.1, 1500.0, 5000.0),
    "m": (0.001, 1.0, 5000.0),
    "g": (9.81, 1000.0),
}

SCHEMES = (
    ("semi_implicit_euler", "off"),
    ("semi_implicit_euler", "auto"),
    ("rk4", "auto"),
    ("implicit_euler", ""),
    ("bdf2", ""),
    ("tr_bdf2", ""),
)
"""Time integrators, and how explicit ones divide their steps."""

DURATION, FEWEST, LOOKS = 2.0, 20, 200
"""Simulated time [s] unless that are fewer steps than `FEWEST`; the motion is looked at `LOOKS` times."""

SHARE = 0.5
"""Energy that comes from nothing, as a share of the largest energy of motion and tension: more is not stable."""


def study(*, full: bool) -> Study:
    """Return the study; `full`: all combinations of the values."""
    how = "all combinations" if full else "one value varied at a time"
    cases = tuple(
        {"scheme": scheme, "substeps": substeps or "-", **case}
        for case in _cases(full)
        for scheme, substeps in SCHEMES
    )
    title = f"10 nodes, the first fixed, swing down from the horizontal; {how}"
    return Study(title, COLUMNS, cases, lambda case: measure(**case), version=1)


COLUMNS = (
    Column("scheme", "scheme"),
    Column("substeps", "substeps"),
    Column("dt", "dt [s]", lambda v: f"{v:g}"),
    Column("k", "k [N/m]", lambda v: f"{v:g}"),
    Column("m", "m [kg]", lambda v: f"{v:g}"),
    Column("g", "g [m/s²]", lambda v: f"{v:g}"),
    Column("stable", "stable", lambda v: "yes" if v else "NO"),
    Column("parts", "sub-steps", lambda v: f"{v:g}"),
    Column("amplitude", "amplitude [m]", lambda v: f"{v:.3g}"),
    Column("drift", "energy drift", lambda v: f"{100 * v:+.2g} %"),
    Column("wall", "wall [s/s]", lambda v: f"{v:.2g}"),
)
"""amplitude: the largest distance of the free end from where it began; drift: change of the whole energy over the
weight of the free nodes times the chain's length; wall: time of the machine for each simulated second. Of a run that
overflowed, amplitude and drift are those before it did."""


def _cases(full: bool) -> list[dict[str, float]]:
    if full:
        return [dict(zip(VARIED, values, strict=True)) for values in product(*VARIED.values())]
    cases = [BASE]
    for name, values in VARIED.items():
        cases += [{**BASE, name: value} for value in values if value != BASE[name]]
    return cases


def measure(scheme: str, substeps: str, dt: float, k: float, m: float, g: float) -> dict[str, Any]:
    """Return what one run shows: the values of `COLUMNS` from `stable` on."""
    words = [f"dt={dt}", f"springs.stiffness={k}", f"springs.node_mass={m}", f"gravity.acceleration=[0, 0, -{g}]",
             f"inertia.scheme={scheme}"]  # fmt: skip
    if substeps not in ("", "-"):
        words.append(f"inertia.substeps={substeps}")
    scene = load_scene("pendulum", words)
    simulation = Simulation(scene)
    start = simulation.positions[-1].copy()
    assert scene.springs
    scale = (len(simulation.positions) - 1) * m * g * scene.springs.size
    steps = max(FEWEST, round(DURATION / dt))
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
