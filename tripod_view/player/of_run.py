"""The film of a run of the simulator, from the arrays that it saves (see `tripod_study.recording`). Pure.

Nothing is simulated or read again: what the arrays do not hold is not shown.
"""

import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tripod_graph.joint import ANSWERS, EFFORT_UNITS, POSITION_UNITS, SHOWN
from tripod_host.arrays import FloatArray
from tripod_view.arm import ArmGeometry, Stand
from tripod_view.cable import TAUT_COLOUR, radius, tube, tube_triangles
from tripod_view.player.colour_maps import force_colour
from tripod_view.player.film import (
    Arrows,
    Colouring,
    Curve,
    Deforming,
    Event,
    Field,
    Film,
    FilmError,
    Piece,
    Rgb,
)
from tripod_view.player.robot import effector_piece, robot_pieces
from tripod_view.player.shapes import Shape, ball, box, disc, joined
from tripod_view.shade import shade

Arrays = Mapping[str, Any]

Fields = Callable[[FloatArray], Sequence[Field]]
"""Returns the fields of all shown points for positions of nodes in some pictures [m], shape (k, n, 3)."""

SILICONE, CLOTH, CHAIN = (240, 190, 140), (92, 148, 206), (92, 148, 206)
RIGID: tuple[Rgb, ...] = ((214, 120, 60), (66, 140, 110), (150, 100, 180), (190, 170, 60), (90, 120, 190))
OBSTACLE, MAZE, GOAL, BALL, BELT = (
    (176, 184, 192),
    (196, 160, 116),
    (60, 170, 80),
    (205, 45, 45),
    (250, 240, 225),
)

DISC_HEIGHT = 0.006
"""Of an effector's disc [m]."""

QUANTITIES = {**POSITION_UNITS, **EFFORT_UNITS}
"""Of actuators that are no servos, by the units of their commands."""

RETURNED = {"m": "tension", "m³": "pressure", "N": "displacement", "Pa": "volume"}
"""What these give in return."""

DOT = 0.3
"""Of an effector that is a point or a set: radius of the dot over that of a disc."""

RATE = 50.0
"""Most pictures a second."""

MOST_PICTURES = 1500
"""Of a film: longer ones have fewer a second."""

MOST_NUMBERS = 3e7
"""Coordinates in all pictures of a film; larger bodies have fewer pictures."""


def pictures(times: FloatArray, corners: int) -> NDArray[np.int64]:
    """Return which steps are shown, evenly spaced and the last one always, of a body with so many corners."""
    count = len(times)
    if not count:
        raise FilmError("time: a film needs at least one step, and the run has none")
    apart = (times[-1] - times[0]) / max(count - 1, 1)
    stride = max(1, int(1 / (RATE * apart) + 1e-9) if apart > 0 else 1)
    most = int(max(2, min(MOST_PICTURES, MOST_NUMBERS / max(3 * corners, 1))))
    stride = max(stride, -(-count // most))
    return np.unique(np.append(np.arange(0, count, stride), count - 1))


STEPS = 0
"""In `SHAPES`: as many as there are times."""

SHAPES: Mapping[str, tuple[int | None, ...]] = {
    "time": (STEPS,), "positions": (STEPS, None, 3), "vertices": (STEPS, None, 3), "energies": (STEPS, 3),
    "effector": (STEPS, 7), "angles": (STEPS, None), "torques": (STEPS, None), "slide": (STEPS,), "ball": (STEPS, 7),
    "rigid": (STEPS, None, 7), "triangles": (None, 3), "bodies": (None,), "arms": (None, 13),
    "still_vertices": (None, 3), "still_triangles": (None, 3), "maze_vertices": (None, 3), "maze_triangles": (None, 3),
    "maze_goal": (4,), "event_times": (None,), "actuator_positions": (STEPS, None), "actuator_efforts": (STEPS, None),
    "cables": (STEPS, None, 3), "cable_points": (None,), "force_counts": (STEPS, None), "force_points": (None, 3),
    "force_vectors": (None, 3), "mesh_error": (STEPS, None),
}  # fmt: skip
"""Shapes of the arrays of numbers; None: any length."""

MOVING = tuple(
    name for name, shape in SHAPES.items() if shape[0] == STEPS and name not in ("time", "force_counts")
)
"""Arrays that have a row for each time, of which only some are read."""

WHOLE = ("triangles", "bodies", "still_triangles", "maze_triangles", "cable_points", "force_counts")
"""Arrays of whole numbers."""


def film_of(
    arrays: Arrays, steps: NDArray[np.int64] | None = None, *, after: float = -np.inf, fields: Fields | None = None,
    colouring: Colouring | None = None,
) -> Film:  # fmt: skip
    """Return the film of a run.

    Args:
        arrays: By name, as `tripod run --out` writes them.
        steps: Which of them are shown; None: `pictures` chooses.
        after: Events up to this time are left out [s].
        fields: By what surfaces may be coloured.
        colouring: By which of them they are at first.

    Raises:
        FilmError: arrays are missing or do not fit each other, or there are no such steps.
    """
    missing = [n for n in ("time", "positions", "triangles", "bodies", "scene", "version") if n not in arrays]
    if missing:
        raise FilmError(
            f"{', '.join(missing)}: missing in this file; it must be written with `tripod run --out` of "
            "this version"
        )
    _check_arrays(arrays)
    count = len(arrays["time"])
    shown = arrays["vertices"] if "vertices" in arrays else arrays["positions"]
    if steps is None:
        steps = pictures(arrays["time"], shown.shape[1])
    steps = np.asarray(steps)
    if steps.dtype.kind != "i" or not steps.size or steps.min() < 0 or steps.max() >= count:
        raise FilmError(f"steps: a film needs at least one, whole numbers from 0 to {count - 1}")
    scene = _scene(str(arrays["scene"]))
    dt = _number(scene, "dt", default=np.nan)
    times = np.asarray(arrays["time"], float)[steps]
    numbers = list(fields(arrays["positions"][steps])) if fields else []
    if "mesh_error" in arrays:
        numbers.append(Field("mesh error", "m", arrays["mesh_error"][steps]))
    return Film(
        title=str(scene.get("name", "run")),
        description=str(scene.get("description", "")),
        source=f"Simulated by tripod {arrays['version']} in steps of {1e3 * dt:.4g} ms; no robot was moved.",
        times=times,
        bodies=(*_bodies(arrays, shown[steps], scene, numbers), *_cables(arrays, shown, steps)),
        pieces=tuple(_pieces(arrays, steps, scene)),
        curves=tuple(_curves(arrays, steps, scene)),
        arrows=tuple(_arrows(arrays, steps, scene)),
        events=tuple(e for e in _events(arrays) if after < e.time <= times[-1] + 1e-9),
        colouring=colouring,
    )


def _check_arrays(arrays: Arrays) -> None:
    """Raise FilmError, which names the array, unless all are of the shapes that a run writes, and in range."""
    count = len(arrays["time"]) if np.ndim(arrays["time"]) else 0
    for name, shape in SHAPES.items():
        if name not in arrays:
            continue
        array, rows = arrays[name], shape[0] == STEPS
        kinds = "iu" if name in WHOLE else "fiu"
        fits = len(array.shape) == len(shape) and array.dtype.kind in kinds
        if fits and rows and len(array) != count:
            raise FilmError(f"{name}: a film needs {count} rows, one for each time")
        if not fits or any(n not in (None, m) for n, m in zip(shape[rows:], array.shape[rows:], strict=True)):
            wanted = ", ".join("any" if n is None else "steps" if n == STEPS else str(n) for n in shape)
            raise FilmError(
                f"{name} has shape {array.shape} and type {array.dtype}; it must have shape ({wanted})"
            )
        if name not in MOVING and not np.isfinite(array).all():
            raise FilmError(f"{name}: a film needs finite numbers")
    nodes = (arrays["vertices"] if "vertices" in arrays else arrays["positions"]).shape[1]
    triangles, bodies = arrays["triangles"], arrays["bodies"]
    if (bad := np.flatnonzero(((triangles < 0) | (triangles >= nodes)).any(axis=1))).size:
        raise FilmError(f"triangles: number {bad[0]} names nodes outside 0 to {nodes - 1}")
    if (bodies < 0).any() or bodies.sum() > nodes:
        raise FilmError(f"bodies: they have {bodies.tolist()[:8]} nodes; there are {nodes}")
    _check_counts(arrays, nodes)


def _check_counts(arrays: Arrays, nodes: int) -> None:
    """Raise FilmError, which names the array, unless those that depend on counts have as many rows as these say."""
    if "mesh_error" in arrays and arrays["mesh_error"].shape[1] != nodes:
        raise FilmError(f"mesh_error: a film needs a number of each of {nodes} nodes")
    if "cables" in arrays:
        counts = arrays.get("cable_points", np.zeros(0, int))
        named = len(arrays.get("cable_names", ())) == len(counts)
        if not named or (counts < 2).any() or counts.sum() != arrays["cables"].shape[1]:
            raise FilmError(
                f"cable_points: a film needs at least 2 of each of cable_names, {arrays['cables'].shape[1]} in all"
            )
    if "force_counts" in arrays:
        counts, total = arrays["force_counts"], len(arrays.get("force_points", ()))
        named = len(arrays.get("force_names", ())) == len(arrays.get("force_units", ())) == counts.shape[1]
        if (
            not named
            or (counts < 0).any()
            or counts.sum() != total
            or len(arrays.get("force_vectors", ())) != total
        ):
            raise FilmError(
                f"force_counts: a film needs one of each step and each of force_names and force_units, {total} in all, "
                "as many as force_points and force_vectors"
            )
    texts = arrays.get("event_texts", np.zeros(0))
    if len(np.shape(texts)) != 1 or len(texts) != len(arrays.get("event_times", ())):
        raise FilmError("event_texts: a film needs one for each of event_times")


def _scene(text: str) -> dict[str, Any]:
    """Return the tables of a scene. Raises FilmError."""
    try:
        scene = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise FilmError(f"scene: a film needs the scene as TOML: {error}") from None
    for name in ("body", "rigid"):
        if not all(isinstance(part, dict) for part in scene.setdefault(name, [])):
            raise FilmError(f"scene: {name} must be a list of tables")
    return scene


def _number(table: Any, *keys: str | int, default: float | None = None) -> float:
    """Return the number that keys name in tables and lists; without a default it must be there. Raises FilmError."""
    value = _entry(table, *keys)
    if value is None and default is not None:
        return default
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise FilmError(f"scene: {'.'.join(map(str, keys))} is {value!r}; a film needs a finite number")
    return value


def _entry(table: Any, *keys: str | int) -> Any:
    """Return what keys name in tables and lists; None where there is no such entry."""
    for key in keys:
        there = key in table if isinstance(table, dict) else isinstance(table, list) and len(table) > int(key)
        if not there:
            return None
        table = table[key]
    return table


def _bodies(
    arrays: Arrays, shown: FloatArray, scene: Mapping[str, Any], fields: Sequence[Field]
) -> list[Deforming]:
    """Return soft and rigid bodies, each with the triangles that have corners of it, and with the `fields` of all."""
    soft = [("silicone", SILICONE)] if "mesh" in scene else []
    soft += [("springs", CLOTH)] if "springs" in scene else []
    soft += [(str(b.get("name")), CLOTH if "springs" in b else SILICONE) for b in scene["body"]]
    kinds = [kind for _, kind in soft]
    soft = [(name, shade(kind, kinds[:i].count(kind))) for i, (name, kind) in enumerate(soft)]
    rigid = max(1, len(soft))  # none is told as a soft body of 0 nodes
    triangles, found = np.asarray(arrays["triangles"]), []
    first = np.cumsum([0, *np.asarray(arrays["bodies"]).tolist()])
    for i, (low, high) in enumerate(pairwise(first.tolist())):
        k = i - rigid
        if low == high or k == len(scene["rigid"]):  # the ball is a piece of its own
            continue
        if k < 0 and i >= len(soft):
            raise FilmError(f"scene: it describes {len(soft)} soft bodies; bodies has nodes of more")
        own = triangles[((triangles >= low) & (triangles < high)).all(axis=1)] - low
        name, colour = soft[i] if k < 0 else (_rigid_names(scene)[k], RIGID[k % len(RIGID)])
        parts = tuple(_on_surface(field, slice(low, high), own) for field in fields)
        found.append(Deforming(name, own, shown[:, low:high], colour, fields=parts))
    return found


def _on_surface(field: Field, part: slice, triangles: NDArray[np.int64]) -> Field:
    """Return a field of one body, where its triangles are: values that nobody sees would take room."""
    values, corners = np.full_like(field.values[:, part], np.nan), np.unique(triangles)
    values[:, corners] = field.values[:, part][:, corners]
    return replace(field, values=values)


def _cables(arrays: Arrays, shown: FloatArray, steps: NDArray[np.int64]) -> list[Deforming]:
    """Return cables as tubes, thin where slack."""
    if "cables" not in arrays:
        return []
    extent = float(np.ptp(shown[np.zeros(1, dtype=np.int64)][0], axis=0).max())
    forces = {name: values if unit == "N" else back for name, unit, values, back in _actuators(arrays, steps)}
    ends = np.cumsum([0, *np.asarray(arrays["cable_points"]).tolist()]).tolist()
    found = []
    for name, (low, high) in zip(arrays["cable_names"].tolist(), pairwise(ends), strict=True):
        radii = radius(extent, forces[name] if name in forces else np.ones(len(steps)))
        nodes = tube(arrays["cables"][steps][:, low:high], radii)
        found.append(Deforming(f"cable {name}", tube_triangles(high - low), nodes, TAUT_COLOUR, through=True))
    return found


def _actuators(arrays: Arrays, steps: NDArray[np.int64]) -> list[tuple[str, str, FloatArray, FloatArray]]:
    """Return of each actuator that is no servo its name, the unit of its command, the commands in `steps`, shape (k,),
    and what it gave in return.
    """
    found = []
    for i, (name, unit) in enumerate(
        zip(arrays.get("actuator_names", ()), arrays.get("actuator_units", ()), strict=False)
    ):
        position, effort = (arrays[f"actuator_{kind}"][steps][:, i] for kind in ("positions", "efforts"))
        pair = (effort, position) if unit in EFFORT_UNITS else (position, effort)
        found.append((str(name), str(unit), *pair))
    return found


def _rigid_names(scene: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of a scene's rigid bodies, such as `ball`, or `box 1` and `box 2`; then that of its own ball."""
    kinds = [str(body.get("shape", "box")) for body in scene["rigid"]]
    counted = [
        f"{kind} {1 + kinds[:i].count(kind)}" if kinds.count(kind) > 1 else kind
        for i, kind in enumerate(kinds)
    ]
    return (*counted, "ball")


def _pieces(arrays: Arrays, steps: NDArray[np.int64], scene: Mapping[str, Any]) -> list[Piece]:
    """Return robot, maze, ball and obstacles, as far as there are any."""
    found: list[Piece] = []
    if "arms" in arrays:
        stands = [_stand(row) for row in np.asarray(arrays["arms"], float)]
        if (angles := arrays["angles"][steps]).shape[1] != len(stands):
            raise FilmError(f"arms: {len(stands)} rows; there are angles of {angles.shape[1]} servos")
        found += robot_pieces(angles, arrays["slide"][steps], stands, ArmGeometry())
    poses = arrays["effector"][steps] if "effector" in arrays else None
    if poses is not None and "maze_vertices" in arrays:
        found.append(Piece("maze", arrays["maze_triangles"], arrays["maze_vertices"], MAZE, poses))
        if "maze_goal" in arrays:
            x, y, z, size = np.asarray(arrays["maze_goal"]).tolist()
            vertices, triangles = disc(size, 0.0004)
            found.append(Piece("goal", triangles, vertices + np.array([x, y, z]), GOAL, poses))
    elif poses is not None:
        found.append(effector_piece(_effector_shape(scene), poses))
    if "ball" in arrays:
        for (vertices, triangles), colour in zip(
            ball(_number(scene, "ball", "radius")), (BALL, BELT), strict=True
        ):
            found.append(Piece("ball", triangles, vertices, colour, arrays["ball"][steps]))
    if "still_vertices" in arrays:
        found.append(Piece("obstacles", arrays["still_triangles"], arrays["still_vertices"], OBSTACLE))
    return found


def _stand(row: FloatArray) -> Stand:
    numbers = row.tolist()
    return Stand(tuple(numbers[:3]), tuple(numbers[3:7]), tuple(numbers[7:10]), *numbers[10:])


def _effector_shape(scene: Mapping[str, Any]) -> Shape:
    """Return what the scene's effector looks like: its first disc, or a dot, or its first platform's box."""
    if parts := [part for part in (scene, *scene["body"]) if "effector" in part]:
        size, table = _number(parts[0], "effector", "radius"), parts[0]["effector"]
        return joined(ball(DOT * size)) if table.get("point") or table.get("set") else disc(size, DISC_HEIGHT)
    return box([_number(scene, "platform", 0, "size", axis) for axis in range(3)])


def _curves(arrays: Arrays, steps: NDArray[np.int64], scene: Mapping[str, Any]) -> list[Curve]:
    """Return what is drawn over time: of a robot its joints, torques and effector, of all others the energies."""
    found = []
    if "angles" in arrays and arrays["angles"].shape[1]:
        servos = tuple(f"servo {i}" for i in range(arrays["angles"].shape[1]))
        found.append(Curve("servo angles", "degrees", servos, np.degrees(arrays["angles"][steps])))
        stall = _number(scene, "servo_dynamics", "stall_torque", default=0.0)
        limits = (stall, -stall) if stall else ()
        found.append(Curve("servo torques", "N m", servos, arrays["torques"][steps], limits))
    others = _actuators(arrays, steps)
    for kind in dict.fromkeys(unit for _, unit, *_ in others):
        names = tuple(name for name, unit, *_ in others if unit == kind)
        sides = [np.stack([row[k] for row in others if row[1] == kind], axis=1) for k in (2, 3)]
        (factor, shown), (back, given) = SHOWN.get(kind, (1.0, kind)), ANSWERS.get(kind, (1.0, ""))
        found.append(Curve(QUANTITIES.get(kind, "command"), shown, names, factor * sides[0]))
        found.append(Curve(RETURNED.get(kind, "answer"), given, names, back * sides[1]))
    if "effector" in arrays:
        found.append(Curve("effector", "mm", ("x", "y", "z"), 1e3 * arrays["effector"][steps][:, :3]))
    if "ball" in arrays:
        found.append(Curve("ball", "mm", ("x", "y", "z"), 1e3 * arrays["ball"][steps][:, :3]))
    if "rigid" in arrays:
        heights = 1e3 * arrays["rigid"][steps][:, :, 2]
        found.append(Curve("heights", "mm", _rigid_names(scene)[: heights.shape[1]], heights))
    if "energies" in arrays:
        joules = arrays["energies"][steps]
        unit, scale = ("J", 1.0) if np.abs(joules).max() >= 1 else ("mJ", 1e3)
        values = np.column_stack([joules.sum(axis=1), joules])
        found.append(Curve("energies", unit, ("total", "kinetic", "strain", "gravity"), scale * values))
    return found


def _with_names(group: str, scene: Mapping[str, Any]) -> str:
    """Return the name of a group of forces with rigid bodies named as the film names them."""
    names = _rigid_names(scene)
    return re.sub(r"\brigid\.(\d+)", lambda found: names[int(found[1])], group)


def _arrows(arrays: Arrays, steps: NDArray[np.int64], scene: Mapping[str, Any]) -> list[Arrows]:
    """Return the forces on the bodies, as far as they were recorded."""
    if "force_counts" not in arrays:
        return []
    counts = np.asarray(arrays["force_counts"], np.int64)
    ends, found = counts.ravel().cumsum().reshape(counts.shape), []
    for g, (name, unit) in enumerate(zip(arrays["force_names"], arrays["force_units"], strict=True)):
        own = counts[steps, g]
        rows = np.repeat(ends[steps, g] - own.cumsum(), own) + np.arange(own.sum())
        points, vectors = arrays["force_points"][rows], arrays["force_vectors"][rows]
        shown, colour = _with_names(str(name), scene), force_colour(str(name))
        found.append(Arrows(shown, str(unit), colour, own, points, vectors))
    return found


def _events(arrays: Arrays) -> list[Event]:
    """Return what happened."""
    pairs = zip(arrays.get("event_times", ()), arrays.get("event_texts", ()), strict=True)
    return [Event(float(time), str(text)) for time, text in pairs]
