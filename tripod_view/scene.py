"""The 3-D part of the page: silicone, arms, effector, target handle, ground, maze and ball. Metres, z up."""

import itertools
from collections.abc import Sequence

import numpy as np
import viser
from numpy.typing import NDArray

from tripod_view.arm import ARMS, ArmGeometry, Pose, arm_pose, carriage_pose, clamp_corners
from tripod_view.body import Surface
from tripod_view.events import Dragged, Dropped, Grabbed, Inbox
from tripod_view.game import Game

FloatArray = NDArray[np.float64]
Rgb = tuple[int, int, int]

SERVO_COLOURS: tuple[Rgb, ...] = ((214, 64, 69), (31, 119, 180), (148, 90, 190))
"""One colour a servo, the same in the scene and in the plot."""

SILICONE: Rgb = (247, 205, 165)
MESH_LINES: Rgb = (150, 95, 50)
EFFECTOR: Rgb = (255, 140, 0)
TARGET: Rgb = (30, 160, 70)
SERVO_BODY: Rgb = (52, 73, 110)
BASE: Rgb = (112, 120, 130)

BODY_SIZE = (0.0230, 0.0225, 0.0122)
"""A small hobby servo, its shaft along y [m]."""

BRACKET = 0.003
"""Thickness of brackets, clamp plates and rails [m]."""


class Scene:
    """Draws what it is told; every method is called from the thread of ROS only.

    The gizmo of the target calls back on the web server's thread, where the event is put into the inbox.

    Attributes:
        game: Maze and ball.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        inbox: Inbox,
        geometry: ArmGeometry,
        box: tuple[FloatArray, FloatArray],
    ) -> None:
        """`box`: corners within which the target can be dragged [m]."""
        self._api, self._geometry = server.scene, geometry
        self._surface: viser.MeshHandle | None = None
        self._lines: viser.MeshHandle | None = None
        self._show_lines = True
        self._look(server)
        self._ground()
        self._carriages = [self._add_carriage(i) for i in range(ARMS)]
        self._arms = [self._add_arm(i) for i in range(ARMS)]
        self._effector = self._add_effector()
        self.game = Game(self._api, "/effector")
        self._marker, self._gizmo, self._box = self._add_target(box)
        self._listen(inbox)
        self.set_joints(np.zeros(3), 0.0)

    def set_surface(self, surface: Surface) -> None:
        """Show another mesh, undeformed."""
        nodes, triangles = surface.nodes.astype(np.float32), surface.triangles
        self._surface = self._api.add_mesh_simple(
            "/silicone",
            nodes,
            triangles,
            color=SILICONE,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )
        self._lines = self._api.add_mesh_simple(
            "/mesh_lines",
            nodes,
            triangles,
            color=MESH_LINES,
            wireframe=True,
            opacity=0.35,
            visible=self._show_lines,
        )

    def set_nodes(self, positions: FloatArray) -> None:
        """Move the nodes of the mesh to `positions` [m], shape (n, 3)."""
        if self._surface is None or self._lines is None:
            return
        nodes = positions.astype(np.float32)
        self._surface.vertices = nodes
        if self._show_lines:
            self._lines.vertices = nodes

    def show_lines(self, visible: bool) -> None:
        """Show or hide the lines of the mesh; hidden ones cost nothing."""
        if visible == self._show_lines:
            return
        self._show_lines = visible
        if self._lines is not None and self._surface is not None:
            self._lines.vertices = self._surface.vertices
            self._lines.visible = visible

    def set_joints(self, angles: FloatArray, slide: float) -> None:
        """Put the arms at `angles` [rad], shape (3,), and the servo bodies at `slide` [m]."""
        for i in range(ARMS):
            _place(self._carriages[i], carriage_pose(i, slide, self._geometry))
            _place(self._arms[i], arm_pose(i, float(angles[i]), slide, self._geometry))

    def set_effector(self, pose: Pose) -> None:
        """Put the effector's disc and frame at `pose`."""
        _place(self._effector, pose)
        self._effector.visible = True

    def set_target(self, position: FloatArray, *, dragging: bool) -> None:
        """Put the target at `position` [m]; the gizmo follows unless it is dragged: then it is the hand's."""
        self._marker.position = position
        self._marker.visible = True
        if self._box.visible != dragging:
            self._box.visible = dragging
        if not dragging:
            self._gizmo.position = position
            self._gizmo.visible = True

    def _look(self, server: viser.ViserServer) -> None:
        camera = server.initial_camera
        camera.position, camera.look_at, camera.up = (0.22, -0.22, 0.17), (0.0, 0.0, -0.02), (0.0, 0.0, 1.0)
        camera.fov, camera.near, camera.far = np.radians(38), 0.002, 20.0
        self._api.configure_environment_map(None)
        self._api.configure_default_lights(False)
        self._api.add_light_hemisphere(
            "/lights/sky", sky_color=(255, 255, 255), ground_color=(170, 165, 160), intensity=1.6
        )
        self._api.add_light_directional("/lights/key", intensity=1.7, position=(0.6, -0.3, 1.0))
        self._api.add_light_directional("/lights/fill", intensity=0.5, position=(-0.6, 0.7, 0.3))

    def _ground(self) -> None:
        g = self._geometry
        top = -g.axis_depth - BODY_SIZE[2] / 2
        floor = top - BRACKET
        self._api.add_grid(
            "/ground",
            0.4,
            0.4,
            cell_size=0.01,
            section_size=0.05,
            cell_color=(222, 226, 230),
            section_color=(173, 181, 189),
            position=(0.0, 0.0, floor - 0.0005),
            shadow_opacity=0.0,
        )
        self._api.add_label(
            "/ground/scale", "squares: 10 mm", position=(0.105, -0.15, 0.0), font_screen_scale=0.8
        )
        self._api.add_frame(
            "/world",
            axes_length=0.02,
            axes_radius=0.0006,
            origin_radius=0.001,
            position=(-0.15, -0.15, floor),
        )
        for name, tip in (("x", (0.022, 0, 0)), ("y", (0, 0.022, 0)), ("z", (0, 0, 0.022))):
            self._api.add_label(f"/world/{name}", name, position=tip, font_screen_scale=0.8)
        for i in range(ARMS):
            frame = carriage_pose(i, g.axis_radius, g)  # at the centre
            name = f"/base/{i}"
            _place(self._api.add_frame(name, show_axes=False), frame)
            length = g.axis_radius + 0.018
            self._api.add_box(
                f"{name}/rail",
                BASE,
                (length, BODY_SIZE[1] + 0.004, BRACKET),
                position=(length / 2, 0, -BODY_SIZE[2] / 2 - BRACKET / 2),
                cast_shadow=False,
                receive_shadow=False,
            )
            self._api.add_label(
                f"{name}/label", f"servo {i}", position=(length + 0.01, 0, -0.004), font_screen_scale=0.9
            )

    def _add_carriage(self, i: int) -> viser.FrameHandle:
        frame = self._api.add_frame(f"/servos/{i}", show_axes=False)
        self._add_box(f"/servos/{i}/body", SERVO_BODY, BODY_SIZE, (0.0, 0.0, 0.0))
        return frame

    def _add_arm(self, i: int) -> viser.FrameHandle:
        """A bracket round the servo body: two cheeks on the axis, plates under and over the clamped end."""
        g, name, colour = self._geometry, f"/arms/{i}", SERVO_COLOURS[i]
        frame = self._api.add_frame(name, show_axes=False)
        corners = clamp_corners(g)
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

    def _add_effector(self) -> viser.FrameHandle:
        g = self._geometry
        frame = self._api.add_frame(
            "/effector",
            axes_length=2 * g.effector_radius,
            axes_radius=0.0005,
            origin_radius=0.0008,
            visible=False,
        )
        self._api.add_cylinder(
            "/effector/disc",
            g.effector_radius,
            1.2 * g.thickness,
            EFFECTOR,
            cast_shadow=False,
            receive_shadow=False,
        )
        return frame

    def _add_target(
        self, box: tuple[FloatArray, FloatArray]
    ) -> tuple[viser.IcosphereHandle, viser.TransformControlsHandle, viser.LineSegmentsHandle]:
        low, high = box
        marker = self._api.add_icosphere(
            "/target", 0.0042, TARGET, opacity=0.85, visible=False, cast_shadow=False, receive_shadow=False
        )
        gizmo = self._api.add_transform_controls(
            "/target_handle", scale=0.03, disable_rotations=True, depth_test=False, visible=False
        )
        limits = self._api.add_line_segments(
            "/target_box",
            box_edges(low, high),
            TARGET,
            thickness=1.0,
            thickness_units="screen",
            visible=False,
        )
        return marker, gizmo, limits

    def _listen(self, inbox: Inbox) -> None:
        async def on_update(
            event: viser.TransformControlsEvent,
        ) -> None:  # async: on the server's thread, in order
            client = -1 if event.client_id is None else event.client_id
            if event.phase == "start":
                inbox.put(Grabbed(client))
            elif event.phase == "update":
                inbox.put(Dragged(client, np.copy(event.target.position)))
            else:
                inbox.put(Dropped(client))

        self._gizmo.on_update(on_update)

    def _add_box(self, name: str, colour: Rgb, size: Sequence[float], position: Sequence[float]) -> None:
        self._api.add_box(
            name, colour, tuple(size), position=tuple(position), cast_shadow=False, receive_shadow=False
        )


def box_edges(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the twelve edges of the box from `low` to `high`, shape (12, 2, 3)."""
    corners = np.array(list(itertools.product((0, 1), repeat=3)))
    pairs = [(a, b) for a, b in itertools.combinations(corners, 2) if np.abs(a - b).sum() == 1]
    return low + np.array(pairs) * (high - low)


def _place(handle: viser.SceneNodeHandle, pose: Pose) -> None:
    handle.position = pose.position
    handle.wxyz = np.roll(pose.quaternion, 1)
