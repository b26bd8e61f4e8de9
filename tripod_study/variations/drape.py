"""The cloth that falls on a sphere: the course report's variations, by both responses to contact."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from tripod_sim.contact.contact_build import obstacle_parts
from tripod_sim.contact.crossings import Crossings
from tripod_sim.errors import StepError
from tripod_sim.mesh.surfaces import Part
from tripod_sim.scene import Scene
from tripod_sim.scene.file import load_scene
from tripod_sim.simulation import Simulation
from tripod_sim.springs.net import spring_net
from tripod_study import report as table

SCENE = "drape"

BASE = {"distance": 0.002, "mass": 0.22, "speed": 0.0, "dt": 0.01, "k": 100.0, "g": 9.81, "limit": 0.0}
"""Contact distance [m], mass of the cloth [kg], speed at which it is thrown down [m/s], step [s], stiffness along edges
[N/m], gravity [m/s²], limit of strains (0: none): where one of them is varied."""

VARIED = {
    "distance": (0.0002, 0.002, 0.005),
    "mass": (0.081, 0.22, 2.2, 81.0, 405_000.0),
    "speed": (0.0, 5.0, 50.0),
    "dt": (0.4, 0.01, 0.005, 1e-5),
    "k": (0.0, 0.1, 100.0, 1500.0, 5000.0),
    "g": (9.81, 1000.0),
    "limit": (0.0, 0.02),
}

"""Masses of 1 g, 1 kg and 5 t a node, steps, stiffness and gravity are those of the report's pendulum."""

CURED = {"mass": 81.0, "limit": 0.02}
"""The heavy cloth that stretches like rubber, with a limit of strains."""

COMBINED = {"distance": VARIED["distance"], "mass": (0.081, 0.22, 2.2), "speed": VARIED["speed"]}
"""What the full study varies in all combinations; the other values stay those of `BASE`."""

RESPONSES = ("lagrange", "penalty")

EDGE, FULL_EDGE, SIZE = 9, 21, 0.8
"""Nodes along an edge of the cloth, without and with all combinations; length of the edge [m]."""

LONGEST, MOST_STEPS = 10.0, 20_000
"""Simulated time [s], unless the cloth is at rest before or that are more steps."""

REST, STILL = 1e-8, 0.2
"""Kinetic energy of a cloth at rest [J], and for how long it stays below that before a run ends [s]."""

ALARM = 3.0
"""Alarm distance over contact distance."""

SHARE = 0.01
"""Growth of the whole energy, as a share of the largest that the fall can set free: more is not stable."""

COLUMNS = (
    table.Column("response", "response"),
    table.Column("nodes", "n"),
    table.Column("distance", "d [mm]", lambda v: f"{1e3 * v:g}"),
    table.Column("mass", "m [kg]", lambda v: f"{v:g}"),
    table.Column("speed", "v [m/s]", lambda v: f"{v:g}"),
    table.STEP,
    table.STIFFNESS,
    table.GRAVITY,
    table.Column("limit", "limit", lambda v: f"{100 * v:g} %" if v else "-"),
    table.STABLE,
    table.PARTS,
    table.AMPLITUDE,
    table.DRIFT,
    table.Column("stretch", "stretch", lambda v: f"{100 * v:.3g} %"),
    table.Column("penetration", "penetration [mm]", lambda v: f"{1e3 * v:.3g}"),
    table.Column("cut", "cut", lambda v: f"{v:.2g}"),
    table.Column("tunnelled", "tunnelled", lambda v: "YES" if v else "no"),
    table.Column("rest", "at rest [s]", lambda v: f"{v:.2f}"),
    table.WALL,
)
"""n: nodes along an edge; d: contact distance; m: mass of the cloth; v: speed at which it is thrown down; k: stiffness
along edges; limit: of strains; amplitude: of any node; drift: change of the whole energy over the largest that the fall
can set free; stretch: of the longest spring, at most; penetration: by how much surfaces came closer than the contact
distance, at most; cut: the largest part of a step that was given up to let nothing pass; tunnelled: whether anything of
the cloth passed through the sphere, or it through the cloth; at rest: since when."""


def crossings_of(scene: Scene) -> Crossings:
    """Return what finds where the springs of a scene, which have triangles, pass through its obstacles."""
    assert scene.springs
    assert scene.contact
    net, none = spring_net(scene.springs), np.zeros((0, 2), dtype=np.int64)
    part = Part(net.nodes, net.triangles, none, self_contact=scene.contact.self_contact)
    return Crossings(part, obstacle_parts(scene.obstacles))


def report(*, full: bool) -> table.Report:
    """Return the table of the course report's variations, by both responses to contact.

    `full`: all combinations of distance, mass and speed, with the finer cloth.
    """
    nodes = FULL_EDGE if full else EDGE
    how = "all combinations of distance, mass and speed" if full else "one value varied at a time"
    rows = tuple(
        {"response": response, "nodes": nodes, **case} for case in cases(full=full) for response in RESPONSES
    )
    return table.Report(
        f"A cloth falls on a sphere; {how}", COLUMNS, rows, lambda case: measure(**case), version=1
    )


def cases(*, full: bool) -> list[dict[str, float]]:
    """Return the settings, by the names of `measure`; `full`: all combinations of the values."""
    return table.combined(BASE, COMBINED) if full else [*table.one_by_one(BASE, VARIED), {**BASE, **CURED}]


def measure(
    *, response: str, distance: float, mass: float, speed: float, dt: float, k: float, g: float, limit: float,
    nodes: int = EDGE, duration: float = LONGEST, clock: Callable[[], float] = time.perf_counter,
    overrides: tuple[str, ...] = (),
) -> dict[str, Any]:  # fmt: skip
    """Return what one run shows: the values of `COLUMNS` from `stable` on.

    Args:
        response: Of contact.
        distance, mass, speed, dt, k, g, limit: See `BASE`; springs across cells and bending springs are as many times
            softer than those along edges as in the scene.
        nodes: Along an edge of the cloth.
        duration: Simulated time [s], unless the cloth is at rest before.
        clock: What tells the machine's time [s].
        overrides: More settings of the scene.
    """
    scene = load_scene(
        SCENE,
        [
            "springs.source=grid", f"springs.nodes={nodes}", f"springs.size={SIZE}", f"dt={dt}",
            f"springs.node_mass={mass / nodes**2}", f"contact.response={response}",
            f"springs.stiffness={k}", f"springs.shear={0.3 * k}", f"springs.bending={0.01 * k}",
            f"gravity.acceleration=[0, 0, -{g}]", *([f"strain_limit.stretch={limit}"] if limit else []),
            f"contact.contact_distance={distance}", f"contact.alarm_distance={ALARM * distance}", *overrides,
        ],
    )  # fmt: skip
    simulation = Simulation(scene)
    assert scene.contact
    assert scene.springs
    body = spring_net(scene.springs)
    watch = crossings_of(scene)
    simulation.state.velocities[:, 2] -= speed
    first, start, scale = simulation.positions.copy(), _energy(simulation), mass * (g * SIZE + 0.5 * speed**2)
    sunk, cut, reach, longest, still, parts = 0.0, 0.0, 0.0, 0.0, 0, 0
    tunnelled, stable, wall, drift = False, True, 0.0, 0.0
    for _ in range(min(round(duration / dt), MOST_STEPS)):
        begin = clock()
        try:
            report = simulation.step()
        except StepError:
            stable = False
            break
        finally:
            wall += clock() - begin
        assert report.contact
        parts += report.contact.parts
        sunk, cut = max(sunk, -report.contact.smallest_gap), max(cut, report.contact.cut)
        x = simulation.positions
        tunnelled |= watch.found(x, straight=report.contact.parts == 1)
        reach = max(reach, float(np.linalg.norm(x - first, axis=1).max()))
        length = np.linalg.norm(x[body.ends[:, 1]] - x[body.ends[:, 0]], axis=1)
        longest = max(longest, float((length / body.rest_length).max()) - 1)
        drift = (_energy(simulation) - start) / scale
        stable &= drift <= SHARE
        still = still + 1 if simulation.energies().kinetic < REST else 0
        if still * dt >= STILL:
            break
    time_passed, steps = simulation.state.time, simulation.state.step
    return {
        "stable": stable,
        "parts": parts / steps if steps else 0.0,
        "amplitude": reach,
        "drift": drift,
        "stretch": longest,
        "penetration": sunk,
        "cut": cut,
        "tunnelled": tunnelled,
        "rest": time_passed - (still - 1) * dt if still * dt >= STILL else None,
        "wall": wall / time_passed if time_passed else 0.0,
    }


def _energy(simulation: Simulation) -> float:
    """Return the whole energy [J]."""
    e = simulation.energies()
    return e.kinetic + e.strain + e.gravity
