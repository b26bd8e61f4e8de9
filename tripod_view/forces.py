"""Forces on the bodies as arrows, in groups."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tripod_host.arrays import FloatArray
from tripod_view.drawing import Drawing, Node
from tripod_view.player.colour_maps import force_colour

MOST_GROUPS, MOST_ARROWS = 100, 20_000
"""Of a message."""


@dataclass(frozen=True, eq=False)
class Group:
    """Forces of one kind: `points` [m] and `vectors` [unit], shape (k, 3)."""

    name: str
    unit: str
    points: FloatArray
    vectors: FloatArray


class DrawnForces:
    """Draws what it is told; every method is called from the thread of ROS only."""

    def __init__(self, drawing: Drawing) -> None:
        self._drawing = drawing
        self._nodes: dict[tuple[str, str], Node] = {}

    def set(self, groups: Sequence[Group]) -> None:
        """Show these forces instead of those before."""
        now = {(group.name, group.unit): group for group in groups}
        for key in [key for key in self._nodes if key not in now]:
            self._nodes.pop(key).remove()
        for key, group in now.items():
            if key not in self._nodes:
                more: dict[str, Any] = {**vars(group), "colour": force_colour(group.name)}
                self._nodes[key] = self._drawing.add(f"/forces/{group.name}", "arrows", **more)
            self._nodes[key].set("points", group.points)
            self._nodes[key].set("vectors", group.vectors)
