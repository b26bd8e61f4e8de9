"""Effect: nodes that never move, or not along some axes."""

from dataclasses import dataclass

from tripod_sim.effect import Described, Draft, Effect, Holding
from tripod_sim.errors import SceneError
from tripod_sim.tables.fields import check_axes, check_box, number
from tripod_sim.tables.sets import Vector


@dataclass(frozen=True)
class Fixed:
    """Nodes that never move, or not along some axes: a set, or those whose undeformed place lies in a box.

    Attributes:
        set: Name of the set; empty: the box.
        low: Smallest corner of the box [m].
        high: Largest corner [m].
        axes: Along which they stay: `xyz`, or fewer, for rollers and planes of symmetry.
    """

    set: str = ""
    low: Vector | None = number(None, unit="m")
    high: Vector | None = number(None, unit="m")
    axes: str = "xyz"


def check(tables: tuple[Fixed, ...], scene: Described) -> None:
    """Raise SceneError if a region is described wrongly."""
    for i, fixed in enumerate(tables):
        box = fixed.low is not None and fixed.high is not None
        if (fixed.low is not None or fixed.high is not None) if fixed.set else not box:
            raise SceneError(f"fixed.{i}: give either set, or low and high (the corners of a box)")
        check_box(f"fixed.{i}", fixed.low, fixed.high)
        check_axes(f"fixed.{i}", fixed.axes)


def hold(tables: tuple[Fixed, ...], draft: Draft) -> None:
    """Name the fixed nodes."""
    draft.fixed += [
        Holding(f"fixed.{i}", draft.sets.held(table.set, table.low, table.high, f"fixed.{i}"), table.axes)
        for i, table in enumerate(tables)
    ]


EFFECT = Effect(Fixed, rank=40, several=True, check=check, hold=hold)
"""One more group of nodes, no code of its own."""
