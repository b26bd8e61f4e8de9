"""Fields that have no effect, because what is described is of another kind."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tripod_sim.tables.bodies import Material, Mesh, Obstacle, Rigid, Springs
from tripod_sim.tables.fields import tables_in
from tripod_sim.tables.maze import Maze
from tripod_sim.tables.short_forms import joints_of


@dataclass(frozen=True)
class Reads:
    """Which fields of a table count.

    Attributes:
        kind: Field that says what is described.
        by_kind: Fields that a kind reads, of those that not all do; a kind is what the field ends with.
        others: Those that any other kind reads.
    """

    kind: str
    by_kind: Mapping[str, tuple[str, ...]]
    others: tuple[str, ...]


READS = {
    Mesh: Reads(
        "source",
        {
            "y_piece": ("level", "legs"),
            "block": ("corners", "cells", "scale"),
            **dict.fromkeys((".stl", ".obj"), ("scale", "size")),
            **dict.fromkeys((".step", ".stp"), ("size",)),
        },
        ("scale",),
    ),
    Springs: Reads("source", {"chain": ("nodes", "size"), "grid": ("nodes", "size")}, ("scale",)),
    Maze: Reads("source", {".stl": ("scale", "start", "goal")}, ("pitch", "wall", "height", "hole_radius")),
}


def unread(scene: Any) -> list[str]:
    """Return which fields of a scene, and of the tables in it, are given and have no effect, one sentence a cause."""
    found = []
    for path, table in tables_in(scene):
        if isinstance(table, Material) and table.density and (names := _given(path, table, ["mass"])):
            found.append(f"{names}: ignored, because {path}.density is given; leave one out")
        if reads := READS.get(type(table)) or _of_shapes(table):
            kind = getattr(table, reads.kind)
            counted = next(
                (names for end, names in reads.by_kind.items() if kind.endswith(end)), reads.others
            )
            every = dict.fromkeys(
                [name for names in (*reads.by_kind.values(), reads.others) for name in names]
            )
            if names := _given(path, table, [name for name in every if name not in counted]):
                found.append(f"{names}: ignored where {path}.{reads.kind} is {kind!r}; leave it out")
    if scene.servo and (names := _given("servos", scene.servos, ["axis_radius", "clamp_radius"])):
        found.append(f"{names}: ignored, because each servo has its own [[servo]] table; leave it out")
    joints = joints_of(scene)
    if scene.motion and not joints:
        found.append(
            "motion: ignored, because the scene has no servos or other actuators; add some or leave it out"
        )
    if joints and joints.arms and not joints.slides:
        for path in ("servos", "motion"):
            if names := _given(path, getattr(scene, path), ["slide"]):
                found.append(
                    f"{names}: ignored, because no servo slides; set servo.0.inward, ... or leave it out"
                )
    return found


def _of_shapes(table: Any) -> Reads | None:
    """Return what the shapes of rigid bodies and obstacles read; None for another table."""
    if not isinstance(table, Rigid | Obstacle):
        return None
    from tripod_sim.shapes import field_reads  # noqa: PLC0415 - an effect that is absent is not imported

    return Reads("shape", field_reads(), ())


def _given(path: str, table: Any, names: Sequence[str]) -> str:
    """Return which of some fields of a table are not as they would be if nothing were said of them."""
    given = [name for name in names if table and getattr(table, name) != getattr(type(table), name)]
    return ", ".join(f"{path}.{name}" for name in given)
