"""The target in the scene: a sphere, and a handle by which it is dragged and, where that counts, turned."""

import itertools

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_view.drawing import Drawing, Rgb
from tripod_view.player.shapes import ball, disc, joined
from tripod_view.pose import Pose

TARGET: Rgb = (30, 160, 70)


class Handle:
    """Draws what it is told, from the thread of ROS only."""

    def __init__(self, drawing: Drawing, box: tuple[FloatArray, FloatArray]) -> None:
        """`box`: corners within which the target can be dragged [m]."""
        self._marker = drawing.mesh("/target", *joined(ball(0.0042)), TARGET, fits=False)
        self._plate = drawing.mesh("/target/plate", *disc(0.0095, 0.0008), TARGET, fits=False)
        self._box = drawing.add("/target_box", "lines", vertices=box_edges(*box), colour=TARGET)
        self._gizmo = drawing.add("/target_handle", "handle", turns=False)
        self._plate.visible = False
        self.hide()

    def let_turn(self, turns: bool) -> None:
        """Let the handle be turned, or not: whether it is followed how the effector is turned."""
        self._gizmo.set("turns", turns)
        self._plate.visible = turns

    def set(self, pose: Pose, *, dragging: bool) -> None:
        """Put the target at `pose`; the handle follows unless it is dragged: then it is the hand's."""
        self._marker.place(pose)
        self._marker.visible = True
        self._box.visible = dragging
        if not dragging:
            self._gizmo.place(pose)
            self._gizmo.visible = True

    def set_box(self, box: tuple[FloatArray, FloatArray]) -> None:
        """Show another box within which the target can be dragged, its corners [m]."""
        self._box.set("vertices", box_edges(*box))

    def hide(self) -> None:
        """Show no target: the scene has none."""
        self._marker.visible = self._box.visible = self._gizmo.visible = False


def box_edges(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the twelve edges of the box from `low` to `high`, shape (24, 3), the ends of each."""
    corners = np.array(list(itertools.product((0, 1), repeat=3)))
    pairs = [(a, b) for a, b in itertools.combinations(corners, 2) if np.abs(a - b).sum() == 1]
    return (low + np.array(pairs) * (high - low)).reshape(-1, 3)
