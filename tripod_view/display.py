"""What the page shows: the newest of everything is kept when it comes and drawn when the clock says so."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tripod_graph import names
from tripod_graph.command import CommandLimits
from tripod_graph.joint import Joint
from tripod_host.arrays import FloatArray
from tripod_view import words
from tripod_view.body import Body, Surface
from tripod_view.cable import SLACK
from tripod_view.control import Control
from tripod_view.drawing import Drawing
from tripod_view.forces import Group
from tripod_view.panel import Panel
from tripod_view.picture import Picture
from tripod_view.pose import Pose
from tripod_view.recorder import Recorder
from tripod_view.rejects import Rejects
from tripod_view.replay import Moment, Replay
from tripod_view.scene import Scene
from tripod_view.target import TargetHandle
from tripod_view.words import Light, Line

PANEL_PERIOD = 0.1
"""Time between two updates of the panel [s]."""

ASKING = 5.0
"""Time between two questions for figures of this machine [s]."""


@dataclass
class Heard:
    """The newest word of a node and when it came [s]; None before the first."""

    status: Any = None
    at: float | None = None

    def age(self, now: float) -> float | None:
        """Return its age at `now` [s]."""
        return None if self.at is None else now - self.at

    def fresh(self, now: float) -> bool:
        """Return whether it is believed at `now` [s]."""
        return self.at is not None and now - self.at <= words.SILENT


class Display:
    """Draws on scene and panel only what changed since the last picture.

    All times are of `time.monotonic`. Used from the thread of ROS only.

    Attributes:
        body: Mesh and counter of what did not fit it.
        effector: Newest pose of the effector.
        ball: Newest pose of the ball.
        replay: What was drawn in the last half minute.
        pictures_per_second: Body states drawn per second.
        recorder: What is known of the recorder.
    """

    def __init__(self, drawing: Drawing, scene: Scene, panel: Panel) -> None:
        self._drawing, self._scene, self._panel = drawing, scene, panel
        self.body = Body()
        self.replay = Replay()
        self.effector: Pose | None = None
        self.ball: Pose | None = None
        self.pictures_per_second = 0.0
        self.recorder = Recorder()
        self._sim, self._ik, self._robot, self._figures = Heard(), Heard(), Heard(), Heard()
        self._ik_values = Heard()
        self._torques: FloatArray | None = None
        self._servos = 0
        self._table: tuple[Joint, ...] = ()
        self._newest: tuple[Callable[[], tuple[int, FloatArray]], float] | None = None
        self._time = float("-inf")  # of the newest state [s]
        self._nodes: FloatArray | None = None
        self._new_fields: dict[str, Callable[[], tuple[int, FloatArray]]] = {}
        self._new_forces: Sequence[Group] | None = None
        self._drawn_fields = set[str]()
        self._surface_changed = self._effector_changed = self._target_changed = False
        self._maze: Surface | None = None
        self._ball_radius: float | None = None
        self._maze_changed = self._ball_shape_changed = self._ball_changed = False
        self._drawn_joints: FloatArray | None = None
        self._drawn, self._counted_at, self._panel_at = 0, time.monotonic(), float("-inf")
        self._asked_at = float("-inf")
        self._show_scene()

    def keep_picture(self, picture: Picture) -> None:
        """Keep what there is to draw of a scene."""
        self._scene.set_picture(picture)
        self._drawn_joints = None
        self._effector_changed = self._target_changed = True
        if not picture.effector:
            self.effector = None
        self._show_scene()

    def _show_scene(self) -> None:
        scene = self._scene
        self._panel.show_scene(
            scene.picture,
            has_joints=scene.has_joints,
            has_target=scene.has_target,
            known=bool(scene.picture.name),
        )

    def keep_surface(self, surface: Surface) -> None:
        """Keep a mesh; node positions kept before it are forgotten if it differs."""
        if self.body.rebuild(surface):
            self._surface_changed, self._newest, self._nodes = True, None, None
            self.replay.clear()

    def keep_state(self, read: Callable[[], tuple[int, FloatArray]], time: float) -> None:
        """Keep node positions at a simulated time [s]: `read` returns topology id and flat positions [m], when they are
        drawn. Forces that wait to be drawn are forgotten where time goes back: they are from before a reset."""
        if time < self._time:
            self._new_forces = None
        self._newest, self._time = (read, time), time

    def keep_field(self, name: str, read: Callable[[], tuple[int, FloatArray]]) -> None:
        """Keep a field: `read` returns topology id and values, when they are drawn."""
        self._new_fields[name] = read

    def drop_field(self, name: str) -> None:
        """Colour no more by a field."""
        self._new_fields.pop(name, None)
        self._drawn_fields.discard(name)
        self._scene.set_field(name, None)

    def keep_forces(self, groups: Sequence[Group]) -> None:
        """Keep the forces on the bodies; none: nobody wants to see them any more."""
        self._new_forces = groups

    def keep_torques(self, torques: FloatArray | None) -> None:
        """Keep what the joints give in return, torques of servos [N m], shape (n,); None if they are not told."""
        self._torques = torques

    def keep_effector(self, pose: Pose) -> None:
        """Keep the effector's pose."""
        self.effector, self._effector_changed = pose, True

    def keep_maze(self, maze: Surface | None) -> None:
        """Keep the maze, given in the effector's frame, or that there is none."""
        self._maze, self._maze_changed = maze, True

    def keep_ball_shape(self, radius: float | None) -> None:
        """Keep the radius of the ball [m], or that there is none; its pose is then awaited again."""
        self.ball = None
        self._ball_radius, self._ball_shape_changed = radius, True

    def keep_ball(self, pose: Pose) -> None:
        """Keep the ball's pose."""
        self.ball, self._ball_changed = pose, True

    def touch_target(self) -> None:
        """Note that the target or who drags it changed."""
        self._target_changed = True

    def let_turn(self, turns: bool) -> None:
        """Let the target be turned, or not."""
        self._scene.let_turn(turns)
        self._target_changed = True

    def wants_speed(self, now: float) -> bool:
        """Return whether the simulator is to be asked for figures of this machine: seldom, until it has told them."""
        accuracy = self._scene.picture.accuracy
        if accuracy.get("scaled", True) or not accuracy.get("study") or now - self._asked_at < ASKING:
            return False
        self._asked_at = now
        return True

    def keep_sim(self, status: words.SimFields) -> None:
        """Keep a status of the simulator."""
        self._sim = Heard(status, time.monotonic())

    def keep_figures(self, figures: Mapping[str, Any]) -> None:
        """Keep the figures of the simulator."""
        self._figures = Heard(figures, time.monotonic())

    def keep_ik(self, status: words.IkFields) -> None:
        """Keep a status of the inverse kinematics."""
        self._ik = Heard(status, time.monotonic())

    def keep_ik_values(self, values: Mapping[str, str]) -> None:
        """Keep the values in the diagnostics of the inverse kinematics."""
        self._ik_values = Heard(values, time.monotonic())

    def keep_robot(self, status: words.RobotFields) -> None:
        """Keep a status of the driver."""
        self._robot = Heard(status, time.monotonic())
        self._find_robot(names.count_servos(status.joint_names))

    @property
    def robot(self) -> words.RobotFields | None:
        """The newest status of the driver, None while it is not heard."""
        return self._robot.status if self._robot.fresh(time.monotonic()) else None

    @property
    def speed(self) -> float:
        """The chosen speed, simulated over real time; 0: as fast as it can."""
        speed = (self._figures.status or {}).get("speed", 1.0)
        return float(speed) if isinstance(speed, int | float) else 0.0

    @property
    def start(self) -> FloatArray:
        """Joint values at the start of the scene, shape (n + 1,) [rad, m, N, Pa]; empty where they are not known."""
        return np.array(self._scene.picture.start)

    def _find_robot(self, servos: int) -> None:
        if servos and self._scene.find_robot(servos):
            self._drawn_joints = None
            self._effector_changed = self._target_changed = True
            self._show_scene()

    def show_range(self, limits: CommandLimits) -> None:
        """Let the sliders end where the joints may go."""
        self._panel.show_range(limits)
        self._servos, self._table = limits.count, limits.table[:-1]

    def draw(self, control: Control, target: TargetHandle, rejects: Rejects, browsers: int) -> None:
        """Draw a picture; the panel follows every PANEL_PERIOD."""
        now = time.monotonic()
        past = self.replay.moment(now)
        with self._drawing.picture():
            self._take_body()
            target.low, target.high = self._scene.target_box
            self._draw_game()
            if past:
                self._draw_past(past[0])
            else:
                self._draw_present(control.measured(now), now)
            self._draw_fields(past=past is not None)
            if self._target_changed and target.position is not None:
                self._target_changed = False
                self._scene.set_target(Pose(target.position, target.quaternion), dragging=target.dragging)
        if control.synced or now - self._panel_at > PANEL_PERIOD:
            control.synced = False
            self._panel_at = now
            self._count(now)
            self._panel.show_replay(
                self.replay.length(), past[1] if past else None, running=self.replay.running
            )
            self._update_panel(control, target, now)
            self._panel.show_lines("status", self._status_lines(control, rejects, browsers, now))
            self._panel.flush()

    def _take_body(self) -> None:
        """Read the newest node positions, if they fit the mesh."""
        if self._surface_changed and self.body.surface is not None:
            self._surface_changed = False
            self._scene.set_surface(self.body.surface)
        newest, self._newest = self._newest, None
        if newest is None:
            return
        read, time = newest
        if (nodes := self.body.fit(*read())) is not None:
            self._nodes = nodes
            self._drawn += 1
            self._drawing.set_time(time if np.isfinite(time) else 0.0)

    def _draw_present(self, joints: FloatArray | None, now: float) -> None:
        if self._nodes is not None:
            self._scene.set_nodes(self._nodes)
            nodes = self._nodes.astype(np.float32)
            slack = self._slack(joints)
            self._scene.set_slack(slack)
            self.replay.keep(Moment(now, nodes, joints, self.effector, self.ball, slack))
            self._nodes = None
        if joints is not None:
            self._find_robot(self._servos)
            if self._drawn_joints is None or not np.array_equal(joints, self._drawn_joints):
                self._drawn_joints = joints
                self._scene.set_joints(joints[: self._servos], float(joints[-1]))
        if self._effector_changed and self.effector is not None:
            self._effector_changed = False
            self._scene.set_effector(self.effector)
        if self._ball_changed and self.ball is not None:
            self._ball_changed = False
            self._scene.game.place_ball(self.ball)

    def _slack(self, joints: FloatArray | None) -> frozenset[str]:
        """Return the names of joints whose force, commanded or given in return, is none; of servos, too."""
        back = self._torques
        if joints is None or back is None or not len(back) == len(self._table) == len(joints) - 1:
            return frozenset()
        forces = [v if j.is_effort else b for j, v, b in zip(self._table, joints, back, strict=False)]
        return frozenset(j.name for j, force in zip(self._table, forces, strict=True) if force <= SLACK)

    def _draw_past(self, moment: Moment) -> None:
        self._scene.set_slack(moment.slack)
        self._scene.set_nodes(moment.nodes.astype(float))
        if moment.joints is not None:
            self._scene.set_joints(moment.joints[: self._servos], float(moment.joints[-1]))
        if moment.effector is not None:
            self._scene.set_effector(moment.effector)
        if moment.ball is not None:
            self._scene.game.place_ball(moment.ball)
        self._drawn_joints = None  # the present is drawn again
        self._effector_changed = self._ball_changed = True

    def _draw_fields(self, *, past: bool) -> None:
        """Draw fields and forces; those of the past are not known."""
        fields, self._new_fields = self._new_fields, {}
        forces, self._new_forces = self._new_forces, None
        if past:
            for name in self._drawn_fields:
                self._scene.set_field(name, None)
            self._drawn_fields.clear()
            forces = ()
        for name, read in () if past else fields.items():
            if (values := self.body.fit_field(*read())) is not None:
                self._scene.set_field(name, values)
                self._drawn_fields.add(name)
        if forces is not None:
            self._scene.forces.set(forces)

    def _draw_game(self) -> None:
        game = self._scene.game
        if self._maze_changed:
            self._maze_changed = False
            game.set_maze(self._maze)
        if self._ball_shape_changed:
            self._ball_shape_changed = False
            game.set_ball(self._ball_radius)

    def _count(self, now: float) -> None:
        seconds = now - self._counted_at
        if seconds >= 1:
            self.pictures_per_second = self._drawn / seconds
            self._drawn, self._counted_at = 0, now

    def _update_panel(self, control: Control, target: TargetHandle, now: float) -> None:
        panel, effector = self._panel, None if self.effector is None else self.effector.position
        panel.show_mode(words.mode_line(control.authority), control.mode.name, own=control.in_control)
        panel.show_lines("notice", _notices(control, self._scene))
        panel.show_lines("target", words.target_lines(target.position, effector))
        measured = control.measured(now)
        run = words.run_table(self._sim.status, self.robot, self.speed) if self._sim.fresh(now) else None
        lasts = measured is not None or (run is not None and run["state"] == words.PAUSED)
        panel.show_joints(
            control.angles,
            measured,
            control.slide,
            self._torques if lasts else None,
            enabled=control.streaming,
        )
        panel.show_run(run)
        panel.show_figures(self._figures.status if self._figures.fresh(now) else None)
        panel.show_recording(self.recorder)

    def _status_lines(self, control: Control, rejects: Rejects, browsers: int, now: float) -> list[Line]:
        sim, ik, robot, body = self._sim, self._ik, self._robot, self.body
        skipped, refused = (body.skipped, body.reason), (rejects.total, rejects.last)
        lines = [words.silence("Simulator", sim.age(now)) or words.sim_line(sim.status, self.speed)]
        if self._scene.has_target:
            silent = words.ik_silence(ik.age(now), control.mode)
            lines.append(silent or words.ik_line(ik.status))
            if not silent and self._ik_values.fresh(now):
                lines += words.ik_value_lines(self._ik_values.status)
        lines.append(words.robot_silence(robot.age(now)) or words.robot_line(robot.status))
        return [*lines, words.page_line(browsers, self.pictures_per_second, skipped, refused)]


def _notices(control: Control, scene: Scene) -> list[Line]:
    if control.notice:
        return [Line(Light.WATCH, "Note", control.notice)]
    if gone := scene.gone:
        return [
            Line(Light.WATCH, "Note", f"out of sight: the bodies fell {gone:.0f} m; Reset brings them back")
        ]
    if lost := scene.lost:
        who, it = ("a body is", "it") if lost == 1 else (f"{lost} bodies are", "them")
        text = f"out of sight: {who} far away from the others; Reset brings {it} back"
        return [Line(Light.WATCH, "Note", text)]
    return [Line(Light.GOOD, "On the way", f"to the {control.moving}")] if control.moving else []
