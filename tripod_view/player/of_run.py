"""The film of a run of the simulator, from the arrays that it leaves behind (`tripod_sim.recording` tells them). Pure.

Nothing is simulated or read again: what the arrays do not hold is not shown.
"""

import tomllib
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_view.arm import ArmGeometry, Stand
from tripod_view.player.film import Curve, Deforming, Event, Film, FilmError, Piece, Rgb
from tripod_view.player.robot import effector_piece, robot_pieces
from tripod_view.player.shapes import Shape, ball, box, disc
from tripod_view.shade import shade

Arrays = Mapping[str, Any]

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
        raise FilmError("time: a film needs at least one step; the run made none")
    apart = (times[-1] - times[0]) / max(count - 1, 1)
    stride = max(1, int(1 / (RATE * apart) + 1e-9) if apart > 0 else 1)
    most = int(max(2, min(MOST_PICTURES, MOST_NUMBERS / max(3 * corners, 1))))
    stride = max(stride, -(-count // most))
    return np.unique(np.append(np.arange(0, count, stride), count - 1))


MOVING = ("positions", "vertices", "energies", "effector", "angles", "torques", "slide", "ball", "rigid")
"""Arrays that have a row for each time."""


def film_of(arrays: Arrays, steps: NDArray[np.int64] | None = None, *, after: float = -np.inf) -> Film:
    """Return the film of a run.

    Args:
        arrays: By name, as `tripod run --out` writes them.
        steps: Which of them are shown; None: `pictures` chooses.
        after: Events up to this time are left out [s].

    Raises:
        FilmError: arrays are missing or do not fit each other, or there are no such steps.
    """
    missing = [n for n in ("time", "positions", "triangles", "bodies", "scene", "version") if n not in arrays]
    if missing:
        raise FilmError(
            f"{', '.join(missing)}: not in this file; a recording that `tripod run --out` of this version has "
            "written is needed"
        )
    count = len(arrays["time"])
    if other := [n for n in MOVING if n in arrays and len(arrays[n]) != count]:
        raise FilmError(f"{', '.join(other)}: a film needs {count} rows, one for each time")
    shown = arrays["vertices"] if "vertices" in arrays else arrays["positions"]
    if steps is None:
        steps = pictures(arrays["time"], shown.shape[1])
    steps = np.asarray(steps)
    if steps.dtype.kind != "i" or not steps.size or steps.min() < 0 or steps.max() >= count:
        raise FilmError(f"steps: a film needs at least one, whole numbers from 0 to {count - 1}")
    try:
        scene = tomllib.loads(str(arrays["scene"]))
    except tomllib.TOMLDecodeError as error:
        raise FilmError(f"scene: a film needs the scene as TOML: {error}") from None
    times = np.asarray(arrays["time"], float)[steps]
    return Film(
        title=str(scene.get("name", "run")),
        description=str(scene.get("description", "")),
        source=f"Simulated by tripod {arrays['version']} in steps of {1e3 * float(scene.get('dt', np.nan)):.4g} ms; "
        "no robot was moved.",
        times=times,
        bodies=tuple(_bodies(arrays, shown[steps], scene)),
        pieces=tuple(_pieces(arrays, steps, scene)),
        curves=tuple(_curves(arrays, steps, scene)),
        events=tuple(e for e in _events(arrays) if after < e.time <= times[-1] + 1e-9),
    )


def _bodies(arrays: Arrays, shown: FloatArray, scene: Mapping[str, Any]) -> list[Deforming]:
    """Return soft and rigid bodies, each with the triangles that have corners of it."""
    soft = [("silicone", SILICONE)] if "mesh" in scene else []
    soft += [("springs", CLOTH)] if "springs" in scene else []
    soft += [(str(b["name"]), CLOTH if "springs" in b else SILICONE) for b in scene.get("body", [])]
    kinds = [kind for _, kind in soft]
    soft = [(name, shade(kind, kinds[:i].count(kind))) for i, (name, kind) in enumerate(soft)]
    rigid = max(1, len(soft))  # none is told as a soft body of 0 nodes
    triangles, found = np.asarray(arrays["triangles"]), []
    first = np.cumsum([0, *np.asarray(arrays["bodies"]).tolist()])
    for i, (low, high) in enumerate(pairwise(first.tolist())):
        k = i - rigid
        if low == high or k == len(scene.get("rigid", ())):  # the ball is a piece of its own
            continue
        own = triangles[((triangles >= low) & (triangles < high)).all(axis=1)] - low
        name, colour = soft[i] if k < 0 else (f"rigid.{k}", RIGID[k % len(RIGID)])
        found.append(Deforming(name, own, shown[:, low:high], colour))
    return found


def _pieces(arrays: Arrays, steps: NDArray[np.int64], scene: Mapping[str, Any]) -> list[Piece]:
    """Return robot, maze, ball and obstacles, as far as there are any."""
    found: list[Piece] = []
    if "arms" in arrays:
        stands = [_stand(row) for row in np.asarray(arrays["arms"], float)]
        found += robot_pieces(arrays["angles"][steps], arrays["slide"][steps], stands, ArmGeometry())
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
        for (vertices, triangles), colour in zip(ball(scene["ball"]["radius"]), (BALL, BELT), strict=True):
            found.append(Piece("ball", triangles, vertices, colour, arrays["ball"][steps]))
    if "still_vertices" in arrays:
        found.append(Piece("obstacles", arrays["still_triangles"], arrays["still_vertices"], OBSTACLE))
    return found


def _stand(row: FloatArray) -> Stand:
    if row.shape != (13,):
        raise FilmError(f"arms: a row has shape {row.shape}; a servo has 13 numbers")
    numbers = row.tolist()
    return Stand(tuple(numbers[:3]), tuple(numbers[3:7]), tuple(numbers[7:10]), *numbers[10:])


def _effector_shape(scene: Mapping[str, Any]) -> Shape:
    """Return what the scene's effector looks like: its first disc, or where there is none, its first platform's box."""
    discs = [part["effector"] for part in (scene, *scene.get("body", [])) if "effector" in part]
    return disc(discs[0]["radius"], DISC_HEIGHT) if discs else box(scene["platform"][0]["size"])


def _curves(arrays: Arrays, steps: NDArray[np.int64], scene: Mapping[str, Any]) -> list[Curve]:
    """Return what is drawn over time: of a robot its joints, torques and effector, of all others the energies."""
    found = []
    if "angles" in arrays and arrays["angles"].shape[1]:
        servos = tuple(f"servo {i}" for i in range(arrays["angles"].shape[1]))
        found.append(Curve("servo angles", "degrees", servos, np.degrees(arrays["angles"][steps])))
        stall = scene.get("servo_dynamics", {}).get("stall_torque")
        limits = (stall, -stall) if stall else ()
        found.append(Curve("servo torques", "N m", servos, arrays["torques"][steps], limits))
    if "effector" in arrays:
        found.append(Curve("effector", "mm", ("x", "y", "z"), 1e3 * arrays["effector"][steps, :3]))
    if "rigid" in arrays:
        heights = 1e3 * arrays["rigid"][steps, :, 2]
        names = tuple(f"rigid.{i}" for i in range(heights.shape[1]))
        found.append(Curve("heights", "mm", names, heights))
    if "energies" in arrays:
        joules = arrays["energies"][steps]
        unit, scale = ("J", 1.0) if np.abs(joules).max() >= 1 else ("mJ", 1e3)
        found.append(Curve("energies", unit, ("kinetic", "strain", "gravity"), scale * joules))
    return found


def _events(arrays: Arrays) -> list[Event]:
    """Return what happened."""
    pairs = zip(arrays.get("event_times", ()), arrays.get("event_texts", ()), strict=True)
    return [Event(float(time), str(text)) for time, text in pairs]
