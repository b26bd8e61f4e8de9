"""The target in the scene: a sphere, and a handle by which it is dragged and, where that counts, turned."""

import itertools

import numpy as np
import viser

from tripod_host.arrays import FloatArray
from tripod_view.events import Dragged, Dropped, Grabbed, Inbox
from tripod_view.place import place, send_pose
from tripod_view.pose import Pose

Rgb = tuple[int, int, int]

TARGET: Rgb = (30, 160, 70)
NAME = "/target_handle"


class Handle:
    """Draws what it is told, from the thread of ROS only; what a hand does is put into the inbox."""

    def __init__(self, api: viser.SceneApi, inbox: Inbox, box: tuple[FloatArray, FloatArray]) -> None:
        """`box`: corners within which the target can be dragged [m]."""
        self._api, self._inbox = api, inbox
        self._marker = api.add_icosphere(
            "/target", 0.0042, TARGET, opacity=0.85, visible=False, cast_shadow=False, receive_shadow=False
        )
        self._plate = api.add_cylinder(
            "/target/plate",
            0.0095,
            0.0008,
            TARGET,
            opacity=0.5,
            visible=False,
            cast_shadow=False,
            receive_shadow=False,
        )
        self._box = api.add_line_segments(
            "/target_box", box_edges(*box), TARGET, thickness=1.0, thickness_units="screen", visible=False
        )
        self._turns = False
        self._gizmo = self._add_gizmo()

    def let_turn(self, turns: bool) -> None:
        """Let the handle be turned, or not: whether it is followed how the effector is turned."""
        if turns != self._turns:
            self._turns = turns
            self._gizmo.remove()
            self._gizmo = self._add_gizmo()
            self._plate.visible = turns

    def set(self, pose: Pose, *, dragging: bool) -> None:
        """Put the target at `pose`; the handle follows unless it is dragged: then it is the hand's."""
        place(self._marker, pose)
        self._marker.visible = True
        if self._box.visible != dragging:
            self._box.visible = dragging
        if not dragging:
            place(self._gizmo, pose)
            self._gizmo.visible = True

    def set_box(self, box: tuple[FloatArray, FloatArray]) -> None:
        """Show another box within which the target can be dragged, its corners [m]."""
        self._box.points = box_edges(*box).astype(np.float32)

    def hide(self) -> None:
        """Show no target: the scene has none."""
        self._marker.visible = self._box.visible = self._gizmo.visible = False

    def _add_gizmo(self) -> viser.TransformControlsHandle:
        gizmo = self._api.add_transform_controls(
            NAME, scale=0.03, disable_rotations=not self._turns, depth_test=False, visible=False
        )
        send_pose(gizmo)

        async def on_update(event: viser.TransformControlsEvent) -> None:  # on the server's thread, in order
            client = -1 if event.client_id is None else event.client_id
            if event.phase == "start":
                self._inbox.put(Grabbed(client))
            elif event.phase == "update":
                self._inbox.put(Dragged(client, np.copy(event.target.position), np.copy(event.target.wxyz)))
            else:
                self._inbox.put(Dropped(client))

        gizmo.on_update(on_update)
        return gizmo


def box_edges(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the twelve edges of the box from `low` to `high`, shape (12, 2, 3)."""
    corners = np.array(list(itertools.product((0, 1), repeat=3)))
    pairs = [(a, b) for a, b in itertools.combinations(corners, 2) if np.abs(a - b).sum() == 1]
    return low + np.array(pairs) * (high - low)
