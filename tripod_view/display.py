"""What the page shows: the newest of everything is kept when it comes and drawn when the clock says so."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tripod_graph.command import CommandLimits
from tripod_view import words
from tripod_view.body import Body, Surface
from tripod_view.control import Control
from tripod_view.history import History
from tripod_view.panel import Panel
from tripod_view.pose import Pose
from tripod_view.rejects import Rejects
from tripod_view.scene import Scene
from tripod_view.server import PageServer
from tripod_view.target import TargetHandle
from tripod_view.words import Light, Line

FloatArray = NDArray[np.float64]

PANEL_PERIOD = 0.2
"""Time between two updates of texts and plots [s]."""


@dataclass
class Heard:
    """The newest status of a node and when it came [s]; None before the first."""

    status: Any = None
    at: float | None = None

    def age(self, now: float) -> float | None:
        """Return its age at `now` [s]."""
        return None if self.at is None else now - self.at


class Display:
    """Draws on scene and panel only what changed since the last picture.

    All times are of `time.monotonic`. Used from the thread of ROS only.

    Attributes:
        body: Mesh and counter of what did not fit it.
        effector: Newest pose of the effector.
        ball: Newest pose of the ball.
        pictures_per_second: Body states drawn per second.
    """

    def __init__(self, server: PageServer, scene: Scene, panel: Panel) -> None:
        self._server, self._scene, self._panel = server, scene, panel
        self.body = Body()
        self.effector: Pose | None = None
        self.ball: Pose | None = None
        self.pictures_per_second = 0.0
        self._sim, self._ik, self._robot = Heard(), Heard(), Heard()
        self._angles, self._factor = History(3), History(1)
        self._newest: Callable[[], tuple[int, FloatArray]] | None = None
        self._surface_changed = self._effector_changed = self._target_changed = False
        self._maze: Surface | None = None
        self._ball_radius: float | None = None
        self._maze_changed = self._ball_shape_changed = self._ball_changed = False
        self._drawn_joints: FloatArray = np.full(4, np.nan)
        self._drawn, self._counted_at, self._panel_at = 0, time.monotonic(), float("-inf")

    def keep_surface(self, surface: Surface) -> None:
        """Keep a mesh; node positions kept before it are forgotten if it differs."""
        if self.body.rebuild(surface):
            self._surface_changed, self._newest = True, None

    def keep_state(self, read: Callable[[], tuple[int, FloatArray]]) -> None:
        """Keep node positions: `read` returns topology id and flat positions [m], when they are drawn."""
        self._newest = read

    def keep_joints(self, joints: FloatArray) -> None:
        """Keep joint values, shape (4,) [rad, rad, rad, m], for the plot."""
        self._angles.add(time.monotonic(), joints[:3])

    def keep_effector(self, pose: Pose) -> None:
        """Keep the effector's pose."""
        self.effector, self._effector_changed = pose, True

    def keep_maze(self, maze: Surface | None) -> None:
        """Keep the maze, given in the effector's frame, or that there is none."""
        self._maze, self._maze_changed = maze, True

    def keep_ball_shape(self, radius: float | None) -> None:
        """Keep the radius of the ball [m], or that there is none; its pose is then awaited anew."""
        self.ball = None
        self._ball_radius, self._ball_shape_changed = radius, True

    def keep_ball(self, pose: Pose) -> None:
        """Keep the ball's pose."""
        self.ball, self._ball_changed = pose, True

    def touch_target(self) -> None:
        """Note that the target or who drags it changed."""
        self._target_changed = True

    def keep_sim(self, status: words.SimFields) -> None:
        """Keep a status of the simulator."""
        self._sim = Heard(status, time.monotonic())
        if np.isfinite(status.real_time_factor):
            self._factor.add(time.monotonic(), (status.real_time_factor,))

    def keep_ik(self, status: words.IkFields) -> None:
        """Keep a status of the inverse kinematics."""
        self._ik = Heard(status, time.monotonic())

    def keep_robot(self, status: words.RobotFields) -> None:
        """Keep a status of the driver."""
        self._robot = Heard(status, time.monotonic())

    def show_range(self, limits: CommandLimits) -> None:
        """Let the sliders end where the joints may go."""
        self._panel.show_range(limits)

    def draw(self, control: Control, target: TargetHandle, rejects: Rejects, browsers: int) -> None:
        """Draw a picture; texts and plots follow every PANEL_PERIOD."""
        now = time.monotonic()
        with self._server.atomic():
            self._draw_body()
            self._draw_robot(control, now)
            self._draw_game()
            if self._target_changed and target.position is not None:
                self._target_changed = False
                self._scene.set_target(target.position, dragging=target.dragging)
        self._panel.enable_sliders(control.streaming)
        if control.synced:
            control.synced = False
            self._panel.set_sliders(control.angles)
        if now - self._panel_at > PANEL_PERIOD:
            self._panel_at = now
            self._count(now)
            self._update_panel(control, target, now)
            self._panel.show_status(self._status_lines(control, rejects, browsers, now))

    def _draw_body(self) -> None:
        if self._surface_changed and self.body.surface is not None:
            self._surface_changed = False
            self._scene.set_surface(self.body.surface)
        read, self._newest = self._newest, None
        if read is None:
            return
        nodes = self.body.fit(*read())
        if nodes is not None:
            self._scene.set_nodes(nodes)
            self._drawn += 1

    def _draw_robot(self, control: Control, now: float) -> None:
        joints = control.measured(now)
        if joints is not None and not np.array_equal(joints, self._drawn_joints):
            self._drawn_joints = joints
            self._scene.set_joints(joints[:3], float(joints[3]))
        if self._effector_changed and self.effector is not None:
            self._effector_changed = False
            self._scene.set_effector(self.effector)

    def _draw_game(self) -> None:
        game = self._scene.game
        if self._maze_changed:
            self._maze_changed = False
            game.set_maze(self._maze)
        if self._ball_shape_changed:
            self._ball_shape_changed = False
            game.set_ball(self._ball_radius)
        if self._ball_changed and self.ball is not None:
            self._ball_changed = False
            game.place_ball(self.ball)

    def _count(self, now: float) -> None:
        seconds = now - self._counted_at
        if seconds >= 1:
            self.pictures_per_second = self._drawn / seconds
            self._drawn, self._counted_at = 0, now

    def _update_panel(self, control: Control, target: TargetHandle, now: float) -> None:
        panel, effector = self._panel, None if self.effector is None else self.effector.position
        panel.show_mode(words.mode_line(control.mandate))
        panel.show_notice(_notices(control))
        panel.show_target(words.target_lines(target.position, effector))
        self._scene.show_lines(panel.mesh_lines)
        panel.plot_angles(self._angles.series(now))
        panel.plot_factor(self._factor.series(now))

    def _status_lines(self, control: Control, rejects: Rejects, browsers: int, now: float) -> list[Line]:
        sim, ik, robot, body = self._sim, self._ik, self._robot, self.body
        skipped, refused = (body.skipped, body.reason), (rejects.total, rejects.last)
        return [
            words.silence("Simulator", sim.age(now)) or words.sim_line(sim.status),
            words.ik_silence(ik.age(now), control.mode) or words.ik_line(ik.status),
            words.silence("Robot", robot.age(now)) or words.robot_line(robot.status),
            words.page_line(browsers, self.pictures_per_second, skipped, refused),
        ]


def _notices(control: Control) -> list[Line]:
    if control.notice:
        return [Line(Light.WATCH, "Not done", control.notice)]
    return [Line(Light.GOOD, "On the way", f"to the {control.moving}")] if control.moving else []
