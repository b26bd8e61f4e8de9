"""Measure a point of a study by a motion: run it, observe it at equal intervals, reduce what was observed to rows.

`task` is told everything as settings: the scene and its fields, the motion, and which rows it returns. So a study of a
motion is data (`plan_file`), and a change of the motion changes the key of its points.

An *observable* gives one row of numbers at an instant; a *reduction* makes rows of a quantity from those of all
instants. Both are found by name in `OBSERVABLES` and `REDUCTIONS`: whoever measures something new adds a function.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from functools import cache, partial
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError
from tripod_sim.mesh.described import described_mesh
from tripod_sim.mesh.embedding import in_solid
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.scene import Scene
from tripod_sim.scene.script import script_of
from tripod_sim.simulation import Simulation
from tripod_sim.tables.short_forms import joints_of
from tripod_study.motion import Watch, motion, scene_of
from tripod_study.plan import Observed, Settings, Value
from tripod_study.task import Measured

FILE, STATE = "scene.file", "scene.state"
"""The scene, a shipped one or a file, and a digest of its files where it is a user's."""

INTERVAL, SAMPLES, SERVO, SLIDE, ROWS = (
    "watch.interval", "watch.samples", "watch.servo", "watch.slide", "watch.rows",
)  # fmt: skip
"""Time between observations [s], their number, the motion of the servos, and the rows as JSON."""

PROBE_SIZE = "watch.size"
"""Length of an edge [m] of the mesh whose corners stand for a part in all its meshes."""

GIVEN = (FILE, STATE, INTERVAL, SAMPLES, SERVO, SLIDE, ROWS, PROBE_SIZE)
"""What a task is told besides fields of the scene."""

PROBES = 200
"""Nodes of a body that are compared, at most."""

Look = Callable[[], Iterable[float]]
"""Gives one row [SI units]."""


def given(
    scene: str, rows: Mapping[str, str | list[str]], *, duration: float, interval: float, servo: str = "",
    slide: str = "", state: str = "", size: float | None = None,
) -> dict[str, Value]:  # fmt: skip
    """Return what `task` is told of a motion.

    Args:
        scene: Name of a shipped scene or path of a file.
        rows: By name, an observable, or an observable and a reduction.
        duration: Of the motion [s], a multiple of `interval`.
        interval: Between observations [s].
        servo, slide: As `timeline.joint_timelines` reads them; empty: the scene's own motion.
        state: Digest of the scene's files.
        size: As `PROBE_SIZE`; None: the meshes of the body refine each other.

    Raises:
        ValueError: an observable or a reduction is unknown.
    """
    for entry in rows.values():
        _parse(entry)
    words: dict[str, Value] = {STATE: state, SERVO: servo, SLIDE: slide, PROBE_SIZE: size or ""}
    return {
        FILE: scene,
        INTERVAL: interval,
        SAMPLES: max(1, round(duration / interval)),
        ROWS: json.dumps(dict(rows)),
        **{key: word for key, word in words.items() if word},
    }


def task(settings: Settings) -> Measured:
    """Run the motion; cost: CPU time of a simulated second."""
    fields = {k: v for k, v in settings.items() if k not in GIVEN}
    scene, interval = scene_of(str(settings[FILE]), fields), float(settings[INTERVAL])
    rows = {name: _parse(entry) for name, entry in json.loads(str(settings[ROWS])).items()}
    servo, slide = (str(settings[k]) if k in settings else None for k in (SERVO, SLIDE))
    script = script_of(scene, servo, slide)
    start: dict[str, list[float]] = {}

    def watch(simulation: Simulation) -> Watch:
        looks = {
            name: OBSERVABLES[kind](simulation, words, settings) for name, (kind, words, _) in rows.items()
        }
        start.update({name: [float(v) for v in look()] for name, look in looks.items()})
        return lambda: {name: look() for name, look in looks.items()}

    joints, command = joints_of(scene), None
    if joints and script:
        command = partial(script.joints, joints.start)
    measured = motion(script.started(scene), interval * int(settings[SAMPLES]), interval, watch, command)
    times: FloatArray = interval * np.arange(1.0, int(settings[SAMPLES]) + 1)
    series = {name: np.array([start[name], *measured.observed[name]]) for name in rows}
    measured.observed = _reduced(rows, times, series)
    return measured


def rows_of_nodes(settings: Settings, times: FloatArray, positions: FloatArray) -> Observed:
    """Return the rows of a study whose motion something else has computed.

    Args:
        settings: As `task` is told; its observables are `nodes` and `mean`.
        times: Of the observations, from the first after the start on [s], shape (t,).
        positions: Of the nodes at the start and at the times [m], shape (t + 1, n, 3).
    """
    rows = {name: _parse(entry) for name, entry in json.loads(str(settings[ROWS])).items()}
    series = dict[str, FloatArray]()
    for name, (kind, words, _) in rows.items():
        chosen = [int(word) for word in words.split()]
        series[name] = (
            positions.reshape(len(positions), -1) if kind == "nodes" else positions[:, chosen].mean(axis=1)
        )
    return _reduced(rows, times, series)


def _reduced(
    rows: Mapping[str, tuple[str, str, str]], times: FloatArray, series: Mapping[str, FloatArray]
) -> Observed:
    """Return the rows of each quantity from its series, which begins with the start."""
    return {
        name: REDUCTIONS[reduction](times, series[name][0], series[name][1:]).tolist()
        for name, (_, _, reduction) in rows.items()
    }


def _parse(entry: str | list[str]) -> tuple[str, str, str]:
    """Return observable, its words and reduction of an entry. Raises ValueError."""
    text, reduction = (entry, "all") if isinstance(entry, str) else entry
    kind, _, words = text.partition(" ")
    for name, known in ((kind, OBSERVABLES), (reduction, REDUCTIONS)):
        if name not in known:
            raise ValueError(f"{name!r} is unknown; known: {', '.join(known)}")
    return kind, words, reduction


# observables ----------------------------------------------------------------------------------------------------------


def _nodes(simulation: Simulation, words: str, settings: Settings) -> Look:
    """Watch the positions of all nodes."""
    return lambda: simulation.positions.ravel()  # noqa: PLW0108 - the array of positions may be replaced


def _mean(simulation: Simulation, words: str, settings: Settings) -> Look:
    """Watch the mean position of nodes, `mean NODE NODE ...`."""
    chosen = [int(word) for word in words.split()]
    return lambda: simulation.positions[chosen].mean(axis=0)


def _marker(simulation: Simulation, words: str, settings: Settings) -> Look:
    """Watch the mean position of a set of nodes, `marker SET`; of a part, whose meshes differ, how far it moved."""
    number = [m.set for m in simulation.scene.marker].index(words)
    if PROBE_SIZE in settings:
        start = simulation.undeformed(number)
        return lambda: simulation.markers[number] - start
    return lambda: simulation.markers[number]


def _body(simulation: Simulation, words: str, settings: Settings) -> Look:
    """Watch nodes that the mesh has however it is refined; of a part how far fixed places in it moved."""
    if PROBE_SIZE in settings:
        return _places_of_part(simulation, settings)
    probes = _probes(simulation, settings)
    return lambda: simulation.positions[probes].ravel()  # noqa: PLW0108


def _effector(simulation: Simulation, words: str, settings: Settings) -> Look:
    """Watch the position of the effector."""
    return lambda: simulation.effector.position if simulation.effector else ()


def _torques(simulation: Simulation, words: str, settings: Settings) -> Look:
    """Watch the torques of the servos [N m]."""
    return lambda: simulation.efforts


def _ball(simulation: Simulation, words: str, settings: Settings) -> Look:
    """Watch the position of the ball."""
    return lambda: simulation.ball.position if simulation.ball else ()


def _rigid(simulation: Simulation, words: str, settings: Settings) -> Look:
    """Watch the positions of all rigid bodies."""
    return lambda: [c for pose in simulation.rigid for c in pose.position]


def _tips(simulation: Simulation, words: str, settings: Settings) -> Look:
    """Watch the ends of strips 1 and 2 of the silicone piece."""
    tips = tip_nodes(simulation.mesh.nodes)
    return lambda: np.concatenate([simulation.positions[t].mean(axis=0) for t in tips])


OBSERVABLES: dict[str, Callable[[Simulation, str, Settings], Look]] = {
    "nodes": _nodes,
    "mean": _mean,
    "marker": _marker,
    "body": _body,
    "effector": _effector,
    "torques": _torques,
    "ball": _ball,
    "rigid": _rigid,
    "tips": _tips,
}
"""By name: each returns what gives a row, of a simulation, the words after the name, and the point's settings."""


def tip_nodes(nodes: FloatArray) -> list[NDArray[np.int64]]:
    """Return the corner nodes of the end faces of strips 1 and 2 of the silicone piece, which every mesh has."""
    found = []
    for i in (1, 2):
        azimuth = 2 * np.pi * i / 3
        along = nodes[:, :2] @ np.array([np.cos(azimuth), np.sin(azimuth)])
        across = nodes[:, :2] @ np.array([-np.sin(azimuth), np.cos(azimuth)])
        end = along > along.max() - 1e-6
        wide = np.abs(across) > np.abs(across[end]).max() - 1e-6
        high = np.abs(nodes[:, 2]) > np.abs(nodes[:, 2]).max() - 1e-6
        found.append(np.flatnonzero(end & wide & high))
    return found


def is_soft(scene: Scene) -> bool:
    """Return whether a scene has a soft body."""
    return bool(scene.mesh or scene.springs or scene.body)


def _probes(simulation: Simulation, settings: Settings) -> NDArray[np.int64]:
    """Return the nodes that stand for the body: those that its mesh has however it is refined."""
    scene = simulation.scene
    nodes = simulation.mesh.nodes
    if not scene.mesh:
        count = len(nodes) if is_soft(scene) else 0
        return np.unique(np.linspace(0, count - 1, min(count, PROBES)).round().astype(np.int64))
    fields = {k: v for k, v in settings.items() if k not in (*GIVEN, "mesh.element", "mesh.refine")}
    places = _corners(str(settings[FILE]), json.dumps(fields))
    distance, found = cKDTree(nodes).query(places)
    if distance.max() > 1e-6 * np.ptp(places, axis=0).max():
        raise SceneError(
            "the mesh does not contain the nodes of the coarsest one, so their motions cannot be "
            "compared; use meshes that refine each other"
        )
    return np.asarray(found, dtype=np.int64)


def _places_of_part(simulation: Simulation, settings: Settings) -> Look:
    """Watch how far places in a part moved: the same places in each of its meshes."""
    size = float(settings[PROBE_SIZE])
    fields = {k: v for k, v in settings.items() if k not in (*GIVEN, "mesh.element")}
    places = _corners(str(settings[FILE]), json.dumps({**fields, "mesh.size": size}))
    mesh = getattr(simulation.mesh, "soft", simulation.mesh)  # of a body beside rigid ones
    # the surfaces of two meshes of a part are less than an edge apart
    probes = in_solid(places, cast(SolidMesh, mesh), tolerance=size, name="place")
    start = probes.places(mesh.nodes)
    return lambda: np.ravel(probes.places(simulation.positions) - start)


@cache
def _corners(source: str, fields: str) -> FloatArray:
    """Return corners of the scene's mesh with `fields` as JSON [m], shape (k, 3), k <= PROBES."""
    described = scene_of(source, json.loads(fields)).mesh
    assert described
    mesh = described_mesh(described)
    corners = np.unique(np.concatenate([e[:, : kind.corners].ravel() for kind, e in mesh.blocks]))
    some = np.unique(np.linspace(0, len(corners) - 1, min(len(corners), PROBES)).round().astype(np.int64))
    return np.asarray(mesh.nodes[corners[some]])


# reductions -----------------------------------------------------------------------------------------------------------


def _lowest(times: FloatArray, start: FloatArray, rows: FloatArray) -> FloatArray:
    """Return when the point is lowest [s], by the parabola through the lowest of the heights and its neighbours."""
    heights = rows[:, 2]
    i = int(np.clip(np.argmin(heights), 1, len(heights) - 2))
    a, b, c = heights[i - 1 : i + 2]
    return np.array([[times[i] + (times[1] - times[0]) * 0.5 * (a - c) / (a - 2 * b + c)]])


REDUCTIONS: dict[str, Callable[[FloatArray, FloatArray, FloatArray], FloatArray]] = {
    "all": lambda times, start, rows: rows,
    "with_start": lambda times, start, rows: np.vstack([start, rows]),
    "moved": lambda times, start, rows: rows - start,
    "last": lambda times, start, rows: rows[-1:],
    "last_lowest": lambda times, start, rows: rows[-1:, 2::3].min(axis=1, keepdims=True),
    "amplitude": lambda times, start, rows: np.linalg.norm(rows - start, axis=1).max(keepdims=True)[None],
    "time_lowest": _lowest,
}
"""By name: each returns rows, shape (k, m), of times [s], the row at the start (n,) and those at the times (t, n).

`all` as they are; `with_start` with the one at the start before; `moved` since the start; `last` the last;
`last_lowest` the height of the lowest point at the end; `amplitude` the largest distance from the start; `time_lowest`
when the point is lowest."""
