"""Effect: nodes that never move, or not along some axes."""

from tripod_sim.constraints.held import Holding
from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.errors import SceneError
from tripod_sim.tables.fields import check_axes, check_box
from tripod_sim.tables.sets import Fixed


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
