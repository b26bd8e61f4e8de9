"""Fields that have no effect, because what the table describes is of another kind."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tripod_sim.tables.bodies import Mesh, Rigid, Springs
from tripod_sim.tables.fields import tables_in


@dataclass(frozen=True)
class Reads:
    """Which fields of a table count.

    Attributes:
        kind: Field that says what is described.
        by_kind: Fields that a kind reads, of those that not all do.
        others: Those that any other kind reads.
    """

    kind: str
    by_kind: Mapping[str, tuple[str, ...]]
    others: tuple[str, ...]


READS = {
    Mesh: Reads("source", {"y_piece": ("level", "legs"), "block": ("corners", "cells", "scale")}, ("scale",)),
    Springs: Reads("source", {"chain": ("nodes", "size"), "grid": ("nodes", "size")}, ("scale",)),
    Rigid: Reads("shape", {"box": ("size",), "ball": ("radius",)}, ("source", "scale")),
}


def unread(scene: Any) -> list[str]:
    """Return which fields of a dataclass, and of those in it, are given and have no effect, one sentence a table."""
    found = []
    for path, table in tables_in(scene):
        if reads := READS.get(type(table)):
            kind = getattr(table, reads.kind)
            counted = reads.by_kind.get(kind, reads.others)
            every = dict.fromkeys(
                [name for names in (*reads.by_kind.values(), reads.others) for name in names]
            )
            idle = [n for n in every if n not in counted and getattr(table, n) != getattr(type(table), n)]
            if idle:
                names = ", ".join(f"{path}.{name}" for name in idle)
                found.append(f"{names}: without effect where {path}.{reads.kind} is {kind!r}")
    return found
