"""The suite's own simulator in the cases of `peers.py`, and the references, which are its converged solutions."""

from importlib import metadata

import numpy as np
from scipy import optimize

from benchmarks import load_cases
from benchmarks import peers_cases as cases
from benchmarks.blocks import block, elastic, lumped
from benchmarks.peers_cases import Prepared, Reference, Setting, height
from tests.scenes import SHARP
from tripod_host.arrays import FloatArray
from tripod_sim import Simulation, load_scene
from tripod_sim.constraints.groups import Groups
from tripod_sim.forces.gravity import GravityForce
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.quasi_static import quasi_static_steps
from tripod_sim.integrators.schemes import EXPLICIT
from tripod_sim.system import System

NAME, MODULE = "tripod", "tripod_sim"
DISTRIBUTION = "tripod"

TOLERANCE = 1e-6
"""Unbalanced force at which a step counts as solved [N]; the bar weighs 0.4 N."""

STATIC = ("inertia=off", "damping=off")


def _meshed(*rows: tuple[str, tuple[int, int, int], bool]) -> list[Setting]:
    return [
        Setting(f"static, {e}, {c[0]} x {c[1]} x {c[2]} cells", {"element": e, "cells": c}, q)
        for e, c, q in rows
    ]


def _swung(*rows: tuple[str, tuple[int, int, int], str, float, bool]) -> list[Setting]:
    return [
        Setting(
            f"{scheme}, dt {1e3 * dt:g} ms, {e}, {c[0]} x {c[1]} x {c[2]} cells",
            {"element": e, "cells": c, "scheme": scheme, "dt": dt},
            q,
        )
        for e, c, scheme, dt, q in rows
    ]


def _cloth(*rows: tuple[str, float, bool]) -> list[Setting]:
    return [
        Setting(
            f"{scheme}, dt {1e3 * dt:g} ms" + (" (divided for stability)" if scheme in EXPLICIT else ""),
            {"overrides": (f"inertia.scheme={scheme}", f"dt={dt}"), "dt": dt},
            q,
        )
        for scheme, dt, q in rows
    ]


def _y(*rows: tuple[str, int, bool]) -> list[Setting]:
    return [
        Setting(f"static, {e}, mesh level {n}", {"overrides": (f"mesh.element={e}", f"mesh.level={n}")}, q)
        for e, n, q in rows
    ]


SETTINGS = {
    "cantilever rest": _meshed(
        ("h8_modes", (5, 1, 1), True), ("h8_modes", (10, 2, 2), False), ("h20", (5, 1, 1), False),
        ("h27", (5, 1, 1), False), ("t4", (10, 2, 2), False), ("t4", (20, 4, 4), False),
    ),
    "cantilever swing": _swung(
        ("h8_modes", (10, 1, 1), "implicit_euler", 5e-3, False),
        ("h8_modes", (10, 1, 1), "implicit_euler", 1e-3, False),
        ("h8_modes", (10, 1, 1), "bdf2", 5e-3, False),
        ("h8_modes", (5, 1, 1), "tr_bdf2", 1e-2, True),
        ("h8_modes", (10, 1, 1), "tr_bdf2", 5e-3, False),
        ("h8_modes", (10, 2, 2), "tr_bdf2", 2e-3, False),
        ("h27", (5, 1, 1), "tr_bdf2", 2e-3, False),
        ("t4", (10, 2, 2), "tr_bdf2", 2e-3, False),
    ),
    "y L1": _y(("h8_modes", 1, True), ("h8_modes", 2, False), ("h8_modes", 4, False), ("h27", 9, False)),
    "y L2": _y(("h8_modes", 1, True), ("h8_modes", 2, False), ("h8_modes", 4, False), ("h27", 9, False)),
    "cloth": _cloth(
        ("implicit_euler", 5e-3, False), ("implicit_euler", 1e-3, False), ("tr_bdf2", 5e-3, False),
        ("tr_bdf2", 2e-3, False), ("semi_implicit_euler", 2e-3, True), ("semi_implicit_euler", 5e-4, False),
        ("rk4", 1e-3, False),
    ),
}  # fmt: skip


def prepare(case: str, options: dict) -> Prepared:
    """Return the model of a case, built and with its kernels loaded."""
    if case == "cantilever rest":
        return _rest(**options)
    if case == "cantilever swing":
        return _swing(**options)
    if case == "cloth":
        return _hang(**options)
    return _pose(case, **options)


def _rest(element: str, cells: tuple[int, int, int], law: str = "neo_hooke") -> Prepared:
    mesh = cases.bar(element, tuple(cells))
    held, tip = cases.bar_ends(mesh.nodes)
    nodes = np.array(mesh.nodes)
    solid = elastic(mesh, cases.YOUNG, cases.POISSON, law)
    gravity = GravityForce(lumped(mesh, cases.MASS)[0], (0.0, 0.0, -cases.GRAVITY), nodes)
    system = System(nodes, [solid], Groups(len(nodes), fixed=held), [gravity])

    def run() -> FloatArray:
        state = system.start_state(np.zeros(1))
        quasi_static_steps(Newton(system, TOLERANCE, 100), 8, 0.1, 0.03).step(state, state.joints.copy(), 0.0)
        return height((state.positions[tip, 2] - mesh.nodes[tip, 2]).mean())

    return Prepared(run, system.unknowns, 0.0)


def _swing(element: str, cells: tuple[int, int, int], scheme: str, dt: float) -> Prepared:
    mesh = cases.bar(element, tuple(cells))
    held, tip = cases.bar_ends(mesh.nodes)
    body = block(
        mesh, young=cases.YOUNG, poisson=cases.POISSON, mass=cases.MASS, held=held, dt=dt, scheme=scheme,
        tolerance=TOLERANCE,
    )  # fmt: skip
    body.warm_up()
    start, every = body.state.copy(), round(cases.SAMPLE["cantilever swing"] / dt)

    def run() -> FloatArray:
        start.copy_to(body.state)
        body.stepper.forget()
        found = []
        for _ in cases.SWING_TIMES:
            for _ in range(every):
                body.step()
            found.append((body.state.positions[tip, 2] - mesh.nodes[tip, 2]).mean())
        return height(np.array(found))

    return Prepared(run, 3 * (len(mesh.nodes) - len(held)), cases.SIMULATED["cantilever swing"])


def _pose(case: str, overrides: tuple[str, ...]) -> Prepared:
    scene = load_scene(SHARP, [*STATIC, *overrides])
    turns = np.zeros(1) if case == "y L1" else np.linspace(0, cases.TURN, 9)[1:]

    def run() -> FloatArray:
        simulation = Simulation(scene)  # it solves for the start pose, so that is part of the work
        for turn in turns:
            simulation.step(np.array([turn, turn, turn, 0.0]))
        return height(simulation.state.centres[0, 2])

    return Prepared(run, Simulation(scene).unknowns, 0.0)


def _hang(overrides: tuple[str, ...], dt: float) -> Prepared:
    simulation = Simulation(load_scene("cloth", overrides))
    every = round(cases.SAMPLE["cloth"] / dt)

    def run() -> FloatArray:
        simulation.reset()
        found = []
        for _ in cases.CLOTH_TIMES:
            simulation.advance(every)
            found.append(cases.cloth_read(simulation.positions))
        return np.array(found)

    return Prepared(run, simulation.unknowns, cases.SIMULATED["cloth"])


def extrapolated(values: list[float], divisions: list[int]) -> tuple[float, float]:
    """Return q0 of q = q0 + C m^-p through three values on edges over m = `divisions`, and how far the finest is off.

    A sharp clamp is singular, so p may be well below 1. Where no p from 0.3 to 8 fits, the finest value and its
    distance from the one before are returned.
    """
    a, b, c = values
    m = np.array(divisions, dtype=float)

    def miss(p: float) -> float:
        return float((a - b) * (m[1] ** -p - m[2] ** -p) - (b - c) * (m[0] ** -p - m[1] ** -p))

    if miss(0.3) * miss(8.0) >= 0:
        return c, abs(c - b)
    p = float(optimize.brentq(miss, 0.3, 8.0))
    limit = c + (c - b) * m[2] ** -p / (m[1] ** -p - m[2] ** -p)
    return float(limit), abs(float(limit) - c)


def reference(case: str) -> Reference:
    """Return the reference of a case; its uncertainty: how far a coarser setting is from it."""
    if case == "cantilever rest":
        sags = [_rest("h27", (5 * m, m, m)).run().item() for m in (2, 3, 4)]
        limit, off = extrapolated(sags, [2, 3, 4])
        change = _rest("h27", (10, 2, 2), "st_venant_kirchhoff").run().item() / sags[0] - 1
        return Reference(
            height(limit), abs(limit), 100 * off / abs(limit),
            "h27, neo-Hooke, limit of edges 1/2, 1/3, 1/4; the law St. Venant-Kirchhoff alone would change it by "
            f"{100 * change:+.2f} %",
        )  # fmt: skip
    if case == "cantilever swing":
        fine = _swing("h27", (10, 2, 2), "tr_bdf2", 1e-3).run()
        coarse = _swing("h27", (7, 2, 2), "tr_bdf2", 2e-3).run()
        return _made(
            fine, coarse, float(np.abs(fine).max()), "h27, 10 x 2 x 2 cells, neo-Hooke, TR-BDF2, dt 1 ms"
        )
    if case == "cloth":
        fine, coarse = (_hang(("inertia.scheme=rk4", f"dt={dt}"), dt).run() for dt in (1e-4, 2e-4))
        return _made(
            fine, coarse, 1.0, "the same springs, RK4, dt 0.1 ms; errors in percent of the edge, 1 m"
        )
    sag = load_cases.REFERENCES["L1 height"]
    if case == "y L1":
        return Reference(height(sag), abs(sag), 0.15, "converged h27, neo-Hooke, checked with CalculiX")
    heights = [_pose("y L2", ("mesh.element=h27", f"mesh.level={n}")).run().item() for n in (8, 9, 10)]
    limit, off = extrapolated(heights, [1, 2, 3])
    travel = abs(limit - sag)
    return Reference(
        height(limit), travel, 100 * off / travel,
        "h27, neo-Hooke, limit of edges 1, 1/2, 1/3; errors in percent of the disc's travel from L1, "
        f"{1e3 * travel:.2f} mm; the sharp clamp is singular, so the limit is known that poorly",
    )  # fmt: skip


def _made(fine: FloatArray, coarse: FloatArray, scale: float, source: str) -> Reference:
    found = Reference(fine, scale, 0.0, source)
    return Reference(fine, scale, found.error(coarse), source)


def version() -> str:
    """Return the version of the suite."""
    try:
        return metadata.version("tripod")
    except metadata.PackageNotFoundError:
        return "of this checkout"
