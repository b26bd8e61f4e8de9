"""The Tripod's rigid parts: rails, servo bodies, arms, the effector's disc. Metres, z up."""

from collections.abc import Sequence

import numpy as np
import viser

from tripod_host.arrays import FloatArray
from tripod_view.arm import ArmGeometry, Pose, Stand, arm_pose, carriage_pose, clamp_corners
from tripod_view.place import place, send_pose

Rgb = tuple[int, int, int]

SERVO_COLOURS: tuple[Rgb, ...] = (
    (214, 64, 69), (31, 119, 180), (148, 90, 190), (214, 130, 20), (30, 140, 110), (120, 90, 60),
)  # fmt: skip
"""One colour a servo, the same in the scene and on the panel; of more servos the first again."""

EFFECTOR: Rgb = (255, 140, 0)
SERVO_BODY: Rgb = (52, 73, 110)
BASE: Rgb = (112, 120, 130)

BODY_SIZE = (0.0230, 0.0225, 0.0122)
"""A small hobby servo, its shaft along y [m]."""

DOT = 0.3
"""Of an effector that is a point or a set: radius of the dot over that of a disc."""

BRACKET = 0.003
"""Thickness of brackets, clamp plates and rails [m]."""


class Robot:
    """Draws what it is told; every method is called from the thread of ROS only."""

    def __init__(
        self, api: viser.SceneApi, geometry: ArmGeometry, servos: Sequence[Stand], *, disc: bool = True
    ) -> None:
        """`servos`: where they stand; of none there is only the effector, once its pose is known; `disc`: its shape."""
        self._api, self._geometry, self._stands = api, geometry, tuple(servos)
        self._carriages: list[viser.FrameHandle] = []
        self._arms: list[viser.FrameHandle] = []
        self._rails: list[viser.FrameHandle] = []
        self._slide = float("nan")
        for i, stand in enumerate(self._stands):
            self._rails.append(self._add_rail(i, stand))
            self._carriages.append(self._add_carriage(i))
            self._arms.append(self._add_arm(i, stand))
        self.set_joints(np.zeros(len(self._stands)), 0.0)
        self._effector = self._add_effector(disc=disc)

    def remove(self) -> None:
        """Take it away."""
        for handle in (*self._rails, *self._carriages, *self._arms, self._effector):
            handle.remove()

    def set_joints(self, angles: FloatArray, slide: float) -> None:
        """Put the arms at `angles` [rad], shape (servos,), and the servo bodies at `slide` [m]; of others none."""
        if len(angles) != len(self._stands):
            return
        for i, stand in enumerate(self._stands):
            if slide != self._slide:
                place(self._carriages[i], carriage_pose(stand, slide))
            place(self._arms[i], arm_pose(stand, float(angles[i]), slide))
        self._slide = slide

    def set_effector(self, pose: Pose) -> None:
        """Put the effector's disc and frame at `pose`."""
        place(self._effector, pose)
        self._effector.visible = True

    def _add_rail(self, i: int, stand: Stand) -> viser.FrameHandle:
        frame = carriage_pose(stand, stand.rail)  # at its inner end
        name = f"/base/{i}"
        handle = self._add_frame(name)
        place(handle, frame)
        length = stand.rail + 0.018
        self._add_box(
            f"{name}/rail",
            BASE,
            (length, BODY_SIZE[1] + 0.004, BRACKET),
            (length / 2, 0, -BODY_SIZE[2] / 2 - BRACKET / 2),
        )
        self._api.add_label(
            f"{name}/label", f"servo {i}", position=(length + 0.01, 0, -0.004), font_screen_scale=0.9
        )
        return handle

    def _add_carriage(self, i: int) -> viser.FrameHandle:
        frame = self._add_frame(f"/servos/{i}")
        self._add_box(f"/servos/{i}/body", SERVO_BODY, BODY_SIZE, (0.0, 0.0, 0.0))
        return frame

    def _add_arm(self, i: int, stand: Stand) -> viser.FrameHandle:
        """A bracket round the servo body: two cheeks on the axis, plates under and over the clamped end."""
        g, name, colour = self._geometry, f"/arms/{i}", SERVO_COLOURS[i % len(SERVO_COLOURS)]
        frame = self._add_frame(name)
        corners = clamp_corners(stand, g)
        inner, outer = corners[0, 0, 0, 0], corners[1, 0, 0, 0]
        lower, upper = corners[0, 0, 0, 2], corners[0, 0, 1, 2]
        tail = BRACKET  # the lower plate reaches over the axis, to the cheeks
        self._add_box(
            f"{name}/lower",
            colour,
            (tail - inner, g.strip_width, BRACKET),
            ((tail + inner) / 2, 0.0, lower - BRACKET / 2),
        )
        self._add_box(
            f"{name}/upper",
            colour,
            (outer - inner, g.strip_width, BRACKET),
            ((outer + inner) / 2, 0.0, upper + BRACKET / 2),
        )
        y = max(g.strip_width, BODY_SIZE[1] + 4 * BRACKET) / 2 - BRACKET / 2
        bottom, top = -2 * BRACKET, lower - BRACKET
        for side, sign in (("left", 1), ("right", -1)):
            self._add_box(
                f"{name}/{side}",
                colour,
                (2 * BRACKET, BRACKET, top - bottom),
                (0.0, sign * y, (top + bottom) / 2),
            )
        return frame

    def _add_effector(self, *, disc: bool) -> viser.FrameHandle:
        g = self._geometry
        frame = self._api.add_frame(
            "/effector",
            axes_length=2 * g.effector_radius,
            axes_radius=0.0005,
            origin_radius=0.0008 if disc else DOT * g.effector_radius,
            origin_color=EFFECTOR,
            visible=False,
        )
        send_pose(frame)
        if not disc:
            return frame
        self._api.add_cylinder(
            "/effector/disc",
            g.effector_radius,
            1.2 * g.thickness,
            EFFECTOR,
            cast_shadow=False,
            receive_shadow=False,
        )
        return frame

    def _add_frame(self, name: str) -> viser.FrameHandle:
        frame = self._api.add_frame(name, show_axes=False)
        send_pose(frame)
        return frame

    def _add_box(self, name: str, colour: Rgb, size: Sequence[float], position: Sequence[float]) -> None:
        self._api.add_box(
            name, colour, tuple(size), position=tuple(position), cast_shadow=False, receive_shadow=False
        )
