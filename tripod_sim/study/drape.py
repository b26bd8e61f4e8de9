"""The course report's variations of a cloth that falls on a sphere, by both responses to contact."""

import time
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

from tripod_sim.contact.build import body_part, obstacle_parts
from tripod_sim.contact.crossings import Crossings
from tripod_sim.errors import StepError
from tripod_sim.scene_file import load_scene
from tripod_sim.simulation import Simulation
from tripod_sim.springs.build import spring_body
from tripod_sim.study.catalogue import Column, Study

BASE = {"distance": 0.002, "mass": 0.22, "speed": 0.0}
"""Contact distance [m], mass of the cloth [kg], speed at which it is thrown down [m/s]: where one of them is varied."""

VARIED = {
    "distance": (0.0002, 0.002, 0.005),
    "mass": (0.022, 0.22, 2.2),
    "speed": (0.0, 5.0, 50.0),
}

RESPONSES = ("lagrange", "penalty")

NODES, FULL_NODES, SIZE = 9, 21, 0.8
"""Nodes along an edge of the cloth, without and with all combinations; length of the edge [m]."""

DURATION = 10.0
"""Simulated time [s], unless the cloth is at rest before."""

REST, STILL = 1e-8, 0.2
"""Kinetic energy of a cloth at rest [J], and for how long it stays below that before a run ends [s]."""

ALARM = 3.0
"""Alarm distance over contact distance."""

SHARE = 0.01
"""Growth of the whole energy, as a share of the largest that the fall can set free: more is not stable."""

COLUMNS = (
    Column("response", "response"),
    Column("distance", "distance [mm]", lambda v: f"{1e3 * v:g}"),
    Column("mass", "mass [kg]", lambda v: f"{v:g}"),
    Column("speed", "speed [m/s]", lambda v: f"{v:g}"),
    Column("stable", "stable", lambda v: "yes" if v else "NO"),
    Column("tunnelled", "tunnelled", lambda v: "YES" if v else "no"),
    Column("penetration", "penetration [mm]", lambda v: f"{1e3 * v:.3g}"),
    Column("cut", "cut", lambda v: f"{v:.2g}"),
    Column("rest", "at rest after [s]", lambda v: "-" if v is None else f"{v:.2f}"),
    Column("wall", "wall [s/s]", lambda v: f"{v:.2g}"),
)
"""distance: at which surfaces are held; penetration: by how much they came closer than that, at most; tunnelled:
whether anything of the cloth passed through the sphere, or it through the cloth; cut: the largest part of a step that
was given up to prevent that; wall: time of the machine for each simulated second."""


def study(*, full: bool) -> Study:
    """Return the study; `full`: all combinations of the values, with the finer cloth."""
    nodes = FULL_NODES if full else NODES
    how = "all combinations" if full else "one value varied at a time"
    return Study(
        f"Cloth of {nodes} x {nodes} nodes falls on a sphere; {how}", COLUMNS, len(cases(full=full)) * len(RESPONSES),
        _rows(cases(full=full), nodes),
    )  # fmt: skip


def cases(*, full: bool) -> list[dict[str, float]]:
    """Return the settings, by the names of `measure`; `full`: all combinations of the values."""
    if full:
        return [dict(zip(VARIED, values, strict=True)) for values in product(*VARIED.values())]
    found = [BASE]
    for name, values in VARIED.items():
        found += [{**BASE, name: value} for value in values if value != BASE[name]]
    return found


def _rows(settings: list[dict[str, float]], nodes: int) -> Iterator[dict[str, Any]]:
    for case in settings:
        for response in RESPONSES:
            yield {"response": response, **case, **measure(response, case, nodes=nodes)}


def measure(
    response: str, case: dict[str, float], *, nodes: int = NODES, duration: float = DURATION,
    clock: Callable[[], float] = time.perf_counter, overrides: tuple[str, ...] = (),
) -> dict[str, Any]:  # fmt: skip
    """Return what one run shows: the values of `COLUMNS` from `stable` on.

    Args:
        response: Of contact.
        case: `distance` of contact [m], `mass` of the cloth [kg], `speed` at which it is thrown down [m/s].
        nodes: Along an edge of the cloth.
        duration: Simulated time [s], unless the cloth is at rest before.
        clock: What tells the machine's time [s].
        overrides: More settings of the scene.
    """
    distance, mass, speed = case["distance"], case["mass"], case["speed"]
    scene = load_scene(
        "drape",
        [
            "springs.source=grid", f"springs.nodes={nodes}", f"springs.size={SIZE}",
            f"springs.node_mass={mass / nodes**2}", f"contact.response={response}",
            f"contact.contact_distance={distance}", f"contact.alarm_distance={ALARM * distance}", *overrides,
        ],
    )  # fmt: skip
    simulation = Simulation(scene)
    assert scene.contact
    assert scene.springs
    watch = Crossings(body_part(spring_body(scene, scene.springs), scene.contact), obstacle_parts(scene))
    simulation.state.velocities[:, 2] -= speed
    start, scale = _energy(simulation), mass * 9.81 * SIZE + 0.5 * mass * speed**2
    sunk, cut, still, tunnelled, stable, wall = 0.0, 0.0, 0, False, True, 0.0
    for _ in range(round(duration / scene.dt)):
        begin = clock()
        try:
            report = simulation.step()
        except StepError:
            stable = False
            break
        finally:
            wall += clock() - begin
        assert report.contact
        sunk, cut = max(sunk, -report.contact.smallest_gap), max(cut, report.contact.cut)
        tunnelled |= watch.found(simulation.positions, straight=report.contact.parts == 1)
        stable &= _energy(simulation) - start <= SHARE * scale
        still = still + 1 if simulation.energies().kinetic < REST else 0
        if still * scene.dt >= STILL:
            break
    time_passed = simulation.state.time
    return {
        "stable": stable,
        "tunnelled": tunnelled,
        "penetration": sunk,
        "cut": cut,
        "rest": time_passed - (still - 1) * scene.dt if still * scene.dt >= STILL else None,
        "wall": wall / time_passed if time_passed else 0.0,
    }


def _energy(simulation: Simulation) -> float:
    """Return the whole energy [J]."""
    e = simulation.energies()
    return e.kinetic + e.strain + e.gravity
