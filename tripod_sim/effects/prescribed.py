"""Effect: nodes that move along timelines."""

from dataclasses import dataclass

import numpy as np

from tripod_sim.constraints.held import Holding
from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.errors import SceneError
from tripod_sim.tables.fields import check_axes, number
from tripod_sim.tables.sets import Vector
from tripod_sim.tables.timeline import parse_timeline


@dataclass(frozen=True)
class Prescribed:
    """Nodes that move along a timeline: a node X stands at centre + R(turn) (X - centre) + move.

    Attributes:
        set: Name of the set.
        move: Displacement over time [s], [m], from zero: `0: 0,0,0; 1: 0,0,0.01`; linear in between, then as at last.
        turn: Rotation vector over time [s], [rad], likewise.
        centre: Of the rotation [m].
        axes: Along which they are moved; along the others they are free.
    """

    set: str
    move: str = ""
    turn: str = ""
    centre: Vector = number((0.0, 0.0, 0.0), unit="m")
    axes: str = "xyz"


def check(tables: tuple[Prescribed, ...], scene: Described) -> None:
    """Raise SceneError if a motion is described wrongly."""
    for i, moved in enumerate(tables):
        check_axes(f"prescribed.{i}", moved.axes)
        if not (moved.move or moved.turn):
            raise SceneError(
                f"prescribed.{i} has neither move nor turn; give one of them, or hold the set still with "
                "[[fixed]]"
            )
        for name, unit in (("move", "m"), ("turn", "rad")):
            if text := getattr(moved, name):
                line = parse_timeline(text, 3, f"prescribed.{i}.{name}", unit)
                if line.at(0.0).any():
                    raise SceneError(
                        f"prescribed.{i}.{name} is {line.at(0.0).tolist()} at 0 s; the body starts undeformed: begin "
                        "with '0: 0,0,0;'"
                    )


def hold(tables: tuple[Prescribed, ...], draft: Draft) -> None:
    """Name the nodes, and say where they go."""
    from tripod_sim.constraints.prescribed import Motion
    from tripod_sim.constraints.prescribed import Prescribed as Motions

    motions = []
    for i, table in enumerate(tables):
        nodes = draft.sets.nodes(table.set, f"prescribed.{i}.set")
        draft.moved.append(Holding(f"prescribed.{i}", nodes, table.axes))
        lines = [
            parse_timeline(text or "0: 0,0,0", 3, f"prescribed.{i}.{name}", unit)
            for name, text, unit in (("move", table.move, "m"), ("turn", table.turn, "rad"))
        ]
        axes = tuple(map("xyz".index, table.axes))
        motions.append(Motion(nodes, axes, draft.rest[nodes], np.array(table.centre), *lines))
    draft.prescribed = Motions(motions)


EFFECT = Effect(
    Prescribed,
    rank=50,
    several=True,
    check=check,
    modules=("constraints.prescribed",),
    words=('prescribed=[{set="all", axes="x", move="0: 0,0,0; 1: 0.001,0,0"}]',),
    hold=hold,
)
