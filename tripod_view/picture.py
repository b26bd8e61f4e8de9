"""What there is to draw of a scene beside its meshes, as the simulator describes it; checked. Pure."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tripod_graph.names import servo_names
from tripod_host.arrays import FloatArray
from tripod_view.arm import Stand
from tripod_view.body import BodyError, Surface
from tripod_view.cable import Route
from tripod_view.json_text import JsonError, table_of

LONGEST = 20_000_000
"""Of a description [characters]; a longer one is refused unread."""

MOST = 10_000
"""Entries of any list of parts, points or obstacles."""


class PictureError(ValueError):
    """A description that is refused; the message says where and why."""


@dataclass(frozen=True)
class Part:
    """Nodes of the mesh that are one thing: `count` from `first` on; kind `solid`, `springs` or `rigid`."""

    name: str
    kind: str
    first: int
    count: int


@dataclass(frozen=True)
class FieldPicture:
    """A field that the bodies have; `label`: for people, `signed`: whether its values may have both signs."""

    name: str
    label: str
    unit: str
    signed: bool


@dataclass(frozen=True)
class ServoPicture:
    """The servos of a scene: where they stand, what they may do [m, N m]."""

    arms: tuple[Stand, ...]
    slide_max: float
    stall_torque: float
    ideal: bool


@dataclass(frozen=True)
class MazePicture:
    """Holes (x, y, radius), goal and start of a maze [m], on a floor `height` above the effector's centre."""

    holes: FloatArray
    goal: tuple[float, float, float] | None
    start: tuple[float, float]
    height: float


@dataclass(frozen=True, eq=False)
class Picture:
    """A scene.

    Attributes:
        name, description: For people; empty where no simulator has told any.
        dt: Of its steps [s].
        parts: Of the mesh; none: all of it is one solid.
        obstacles: Surfaces that never move.
        held: Points that never move, in the undeformed body [m], shape (n, 3).
        joints: Names of what is commanded but the slide.
        start: Their values at the start, the slide last [rad, m, N, Pa]; empty where that is not known.
        cables: Through which points they run.
        servos: None where the scene has none.
        effector: Radius of the disc [m]; None for none.
        disc: Whether the effector is a disc, no point or set.
        maze: None for none.
        ball: Whether there is one.
        fields: What colours the bodies on request.
        note: What is not drawn; empty where all is.
        changes: Overrides with which it was started again.
        accuracy: What accuracies cost, as the simulator tells.
        effects: Those of the scene, and those that it could have, as the simulator tells.
    """

    name: str = ""
    description: str = ""
    dt: float = 0.0
    parts: tuple[Part, ...] = ()
    obstacles: tuple[Surface, ...] = ()
    held: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    joints: tuple[str, ...] = ()
    start: tuple[float, ...] = ()
    cables: tuple[Route, ...] = ()
    servos: ServoPicture | None = None
    effector: float | None = None
    disc: bool = True
    maze: MazePicture | None = None
    ball: bool = False
    fields: tuple[FieldPicture, ...] = ()
    note: str = ""
    changes: tuple[str, ...] = ()
    accuracy: dict[str, Any] = field(default_factory=dict)
    effects: tuple[dict[str, Any], ...] = ()

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for pictures that are drawn alike."""
        drawn = (
            self.name,
            self.parts,
            self.joints,
            self.servos,
            self.effector,
            self.disc,
            self.ball,
            self.changes,
        )
        return (*drawn, len(self.obstacles), len(self.held), self.maze is None)


def picture_of(text: str) -> Picture:
    """Return the picture that a `sim/picture` describes. Raises PictureError."""
    if len(text) > LONGEST:
        raise PictureError(f"{len(text)} characters; at most {LONGEST}")
    try:
        return _picture(table_of(text))
    except JsonError as error:
        raise PictureError(str(error)) from None
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise PictureError(f"{type(error).__name__}: {error}") from None


def _picture(table: dict[str, Any]) -> Picture:
    effector = table["effector"]
    servos = _servos(table["servos"]) if table["servos"] else None
    before = servo_names(len(servos.arms)) if servos else ()  # of a recording made before there were others
    return Picture(
        name=str(table["name"]),
        description=str(table["description"]),
        dt=_number(table["dt"]),
        parts=tuple(
            Part(str(p["name"]), str(p["kind"]), int(p["first"]), int(p["count"]))
            for p in _list(table["parts"])
        ),
        obstacles=tuple(_surface(o) for o in _list(table["obstacles"])),
        held=_array(_list(table["held"])).reshape(-1, 3),
        joints=tuple(map(str, _list(table.get("joints", list(before))))),
        start=tuple(map(_number, _list(table.get("start", [])))),
        cables=tuple(map(_cable, _list(table.get("cables", [])))),
        servos=servos,
        effector=_radius(effector) if effector else None,
        disc=not effector or _number(effector.get("height", 1.0)) > 0,
        maze=_maze(table["maze"]) if table["maze"] else None,
        ball=bool(table["ball"]),
        fields=tuple(map(_field, _list(table.get("fields", [])))),
        note=str(table["note"]),
        changes=tuple(map(str, _list(table["changes"]))),
        accuracy=dict(table["accuracy"]),
        effects=tuple(dict(e) for e in _list(table["effects"])),
    )


def _cable(table: dict[str, Any]) -> Route:
    nodes, weights, fixed = (_list(table[name]) for name in ("nodes", "weights", "fixed"))
    return Route(str(table["name"]), np.array(nodes, dtype=np.int64), _array(weights), _array(fixed))


def _field(table: dict[str, Any]) -> FieldPicture:
    name = str(table["name"])
    if not re.fullmatch("[a-z_]{1,40}", name):
        raise PictureError(f"field {name!r:.60}: a name has at most 40 small letters and underscores")
    label = str(table.get("label", name))[:60]
    return FieldPicture(name, label, str(table["unit"]), bool(table["signed"]))


def _radius(table: dict[str, Any]) -> float:
    radius = _number(table["radius"])
    if not radius > 0:
        raise PictureError(f"radius {radius:g} of the effector; it must be positive")
    return radius


def _servos(table: dict[str, Any]) -> ServoPicture:
    arms = tuple(_stand(arm) for arm in _list(table["arms"]))
    return ServoPicture(
        arms, _number(table["slide_max"]), _number(table["stall_torque"]), ideal=bool(table["ideal"])
    )


def _stand(table: dict[str, Any]) -> Stand:
    hub, inward = (_numbers(table[name], 3) for name in ("hub", "inward"))
    quaternion = _numbers(table["quaternion"], 4)
    if not abs(float(np.linalg.norm(quaternion)) - 1) < 1e-3:
        raise PictureError(f"quaternion {list(quaternion)} of a servo has not the length 1")
    length, grip, rail = (_number(table[name]) for name in ("length", "grip", "rail"))
    return Stand(hub, quaternion, inward, length, grip, rail)  # type: ignore[arg-type]


def _numbers(values: Any, count: int) -> tuple[float, ...]:
    if len(_list(values)) != count:
        raise PictureError(f"{len(values)} numbers; {count} are needed")
    return tuple(map(_number, values))


def _maze(table: dict[str, Any]) -> MazePicture:
    goal = tuple(map(_number, table["goal"])) if table["goal"] else None
    x, y = map(_number, table["start"])
    if goal is not None and len(goal) != 3:
        raise PictureError(f"goal {list(goal)}; three numbers are needed")
    return MazePicture(_array(_list(table["holes"])).reshape(-1, 3), goal, (x, y), _number(table["height"]))


def _surface(table: dict[str, Any]) -> Surface:
    vertices = _array(table["vertices"]).reshape(-1, 3)
    triangles = np.array(table["triangles"], dtype=np.uint32).reshape(-1, 3)
    try:
        return Surface(vertices, triangles)
    except BodyError as error:
        raise PictureError(str(error)) from None


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e12:  # NaN, too
        raise PictureError(f"{value!r:.40} is not a finite number")
    return float(value)


def _array(values: Sequence[Any]) -> FloatArray:
    found = np.array(values, dtype=float)
    if not np.isfinite(found).all():
        raise PictureError("a number is not finite")
    return found


def _list(values: Any) -> list[Any]:
    if not isinstance(values, list) or len(values) > MOST:
        raise PictureError(f"a list of at most {MOST} is needed")
    return values
