"""The page as a ROS node: topics in, scene and panel out; what people do on the page in, topics out.

Threads. Everything in this file runs on the executor's thread. The server of the page has a thread of its own;
there, the channels of the panel and of the scene only put an event into the `Inbox`, which wakes the executor by a
guard condition. The executor's thread alone touches `Control`, `TargetHandle` and `Display`, and it alone changes scene
and panel; the server reads `Drawing` and `Channel` under their locks.

While no browser is connected nothing is drawn, the timers rest, and the fast topics are not subscribed. What comes from
the graph wakes nobody: it is taken when a picture is drawn.
"""

import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState
from shape_msgs.msg import Mesh, SolidPrimitive
from std_msgs.msg import String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import BodyState, Field, Forces, IkStatus, RobotStatus, SimStatus

from tripod_graph import diagnostic_keys as keys
from tripod_graph import names
from tripod_graph.command import CommandError
from tripod_graph.control_mode import Speaker, authority_values, clocks, listen
from tripod_graph.diagnostics import Diagnostics, Level, Report
from tripod_graph.executor import Patient
from tripod_graph.joint import Joint, JointError, joint_values, joints_told
from tripod_graph.mode import Decision, Mode
from tripod_graph.parameters import declare
from tripod_graph.qos import LATCHED, NEWEST, RELIABLE, SENSOR
from tripod_graph.range import RangeWatch
from tripod_graph.run import run_node
from tripod_graph.source import new_source
from tripod_graph.timers import set_period
from tripod_host.priority import stand_back
from tripod_view import events
from tripod_view.body import BodyError
from tripod_view.channel import Channel
from tripod_view.control import PERIOD, STALE, Control
from tripod_view.display import Display
from tripod_view.drawing import Drawing
from tripod_view.events import Button, Event, Inbox
from tripod_view.json_text import JsonError, table_of
from tripod_view.messages import (
    ForcesError,
    StatusError,
    ball_radius_of,
    checked_status,
    field_of,
    groups_of,
    maze_of,
    pose_of,
    state_of,
    surface_of,
    target_message,
    trajectory_message,
)
from tripod_view.panel import Panel
from tripod_view.picture import PictureError, picture_of
from tripod_view.pose import PoseError
from tripod_view.rejects import Rejects
from tripod_view.scene import Scene
from tripod_view.server import HOST, PageServer
from tripod_view.settings import PARAMETERS, checked_settings
from tripod_view.stream import Stream
from tripod_view.target import TargetError
from tripod_view.words import is_real

SOONEST = 0.015
"""Shortest time between two commands that follow hands [s]."""

TURNED = ("orientation", "pose")
"""Goals of the inverse kinematics for which it counts how the target is turned."""

OWN_STAMPS = 256
"""Stamps of own targets remembered, to know their echo."""


class ViewNode(Node):
    """Serves the page; see the module."""

    def __init__(self) -> None:
        super().__init__("view")
        settings = checked_settings(declare(self, PARAMETERS, self._adopt))
        self._target, self._rejects = settings.target, Rejects()
        source = new_source(self.get_name(), self.get_namespace())
        self._control = Control(source, settings.limits, settings.move_speed)
        self._range = RangeWatch(settings.limits)
        self._others: tuple[Joint, ...] = ()
        self._fitted: tuple[int, tuple[Joint, ...]] = (settings.limits.count, ())
        self._browsers: set[int] = set()
        self._streams: list[Subscription] = []
        self._shown: dict[int, events.Shows] = {}
        self._extras: dict[str, Subscription] = {}
        self._fields: dict[str, str] = {}
        self._patient = Patient()
        self._sim_joints_at, self._slide = float("-inf"), 0.0  # [m]: the driver does not know it
        self._target_asked = False
        self._simulated = float("-inf"), float("-inf")  # time of the newest body state, and when it came [s]
        self._commanded_at = float("-inf")
        self._own_targets: deque[tuple[int, int]] = deque(maxlen=OWN_STAMPS)

        self._trajectory = self.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)
        self._speaker = Speaker(self, self._control)
        self._target_pose = self.create_publisher(PoseStamped, names.TARGET_POSE, RELIABLE)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._draw_timer = self.create_timer(1 / settings.rate, self._on_draw, clock=steady, autostart=False)
        self._command_timer = self.create_timer(PERIOD, self._on_command, clock=steady, autostart=False)
        self._guard = self.create_guard_condition(self._on_events)
        self._inbox = Inbox(self._guard.trigger)
        self._wishes = self.create_publisher(String, names.SIM_REQUEST, RELIABLE)
        self._recorder, self._ik = (f"{self.get_namespace().rstrip('/')}/{name}" for name in ("record", "ik"))
        self._recorders = {
            Button.RECORD: self.create_client(Trigger, names.RECORD_START),
            Button.STOP_RECORDING: self.create_client(Trigger, names.RECORD_STOP),
        }
        drawing, channel = Drawing(), Channel(self._inbox)
        self._stream = Stream(drawing, self._inbox)
        self._server, self._url = open_page(self, settings.port, channel, self._stream)
        scene = Scene(drawing, settings.geometry, (self._target.low, self._target.high))
        self._display = Display(drawing, scene, Panel(channel))
        self._display.show_range(settings.limits)
        self._subscribe()
        self._diagnostics = Diagnostics(self, self._report)
        self._ready = self.create_timer(0.0, self._on_ready, clock=steady)

    def _on_ready(self) -> None:
        """Say where the page is, once, when the node runs: who reads it may stop it in order."""
        self._ready.cancel()
        self.get_logger().info(f"the page is at {self._url}; its address with the token is printed")
        print(f"page {self._server.url}", flush=True)

    def _adopt(self, values: Mapping[str, Any]) -> None:
        """Take rate and speeds that have changed."""
        settings = checked_settings(values)
        self._control.speed = settings.move_speed
        self._range.adopt(settings.limits)
        self._keep_range()
        set_period(self._draw_timer, 1 / settings.rate)

    def close(self) -> None:
        """Give up control, if it is the page's, and stop serving."""
        try:
            if self._control.in_control:
                self._decide(Mode.STOP)
                self._speaker.wait(0.5)
        finally:
            self._server.close()
            self.destroy_node()

    def _subscribe(self) -> None:
        show = self._display
        listen(self, self._on_decision)
        for kind, topic, callback, qos in (
            (String, names.SIM_PICTURE, self._on_scene, LATCHED),
            (String, names.IK_GOAL, self._on_goal, LATCHED),
            (Mesh, names.MESH, self._on_mesh, LATCHED),
            (Mesh, names.MAZE_MESH, self._on_maze, LATCHED),
            (SolidPrimitive, names.BALL_SHAPE, self._on_ball_shape, LATCHED),
        ):
            self.create_subscription(kind, topic, callback, qos)
        present: dict[str, tuple[type, Callable[[Any], None]]] = {
            names.TARGET_POSE: (PoseStamped, self._on_target_pose),
            names.SIM_STATUS: (SimStatus, self._on_sim_status),
            names.IK_STATUS: (IkStatus, show.keep_ik),
            names.ROBOT_STATUS: (RobotStatus, self._on_robot_status),
        }
        self.create_subscription(
            DiagnosticArray, names.DIAGNOSTICS, self._on_diagnostics, RELIABLE, callback_group=self._patient
        )
        for topic, (kind, keep) in present.items():
            self.create_subscription(kind, topic, keep, NEWEST, callback_group=self._patient)

    def _subscribe_streams(self) -> None:
        """Listen to what comes fast, as often as is drawn: else this would be most of the work of the node."""
        for kind, topic, callback, qos in (
            (BodyState, names.BODY_STATE, self._on_body_state, SENSOR),
            (JointState, names.SIM_JOINT_STATES, self._on_sim_joints, NEWEST),
            (JointState, names.ROBOT_JOINT_STATES, self._on_robot_joints, NEWEST),
            (PoseStamped, names.EFFECTOR_POSE, self._on_effector_pose, NEWEST),
            (PoseStamped, names.SIM_BALL_POSE, self._on_ball_pose, NEWEST),
            (String, names.SIM_FIGURES, self._on_figures, NEWEST),
        ):
            self._streams.append(
                self.create_subscription(kind, topic, callback, qos, callback_group=self._patient)
            )

    def _subscribe_shown(self) -> None:
        """Listen to those fields, and to forces, that some browser shows, and to no others: they cost the simulator."""
        wanted = {
            f"{names.field_topic(name)}": name
            for name in {s.field for s in self._shown.values()} & set(self._fields)
        }
        if any(shows.forces for shows in self._shown.values()):
            wanted[names.FORCES] = ""
        for topic in [topic for topic in self._extras if topic not in wanted]:
            self.destroy_subscription(self._extras.pop(topic))
            if topic == names.FORCES:
                self._display.keep_forces(())
            else:
                self._display.drop_field(topic.rpartition("/")[2])
        for topic, name in wanted.items():
            if topic not in self._extras:
                kind, heard = (Field, partial(self._on_field, name)) if name else (Forces, self._on_forces)
                self._extras[topic] = self.create_subscription(
                    kind, topic, heard, NEWEST, callback_group=self._patient
                )

    # What comes from the graph: checked and kept, drawn later.

    def _on_scene(self, message: String) -> None:
        try:
            picture = picture_of(message.data)
        except PictureError as error:
            self._refuse(names.SIM_PICTURE, error)
            return
        self._display.keep_picture(picture)
        self._fields = {field.name: field.unit for field in picture.fields}
        self._subscribe_shown()

    def _on_figures(self, message: String) -> None:
        try:
            self._display.keep_figures(table_of(message.data))
        except JsonError as error:
            self._refuse(names.SIM_FIGURES, error)

    def _on_sim_status(self, message: SimStatus) -> None:
        try:
            self._display.keep_sim(checked_status(message))
            told = joints_told(
                message.joint_names, message.units, message.lower, message.upper, message.speed
            )
            if told != self._others:
                self._others = told
                self._fit(names.count_servos(message.joint_names))
        except (StatusError, CommandError) as error:
            self._refuse(names.SIM_STATUS, error)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Keep what the recorder and the inverse kinematics of this robot say of themselves."""
        for status in message.status:
            if status.name == self._recorder:
                values = {pair.key: pair.value for pair in status.values}
                self._display.recorder.hear(
                    status.message, values.get(keys.STATE, ""), values.get(keys.PATH, "")
                )
            elif status.name == self._ik:
                self._display.keep_ik_values({pair.key: pair.value for pair in status.values})

    def _on_goal(self, message: String) -> None:
        self._display.let_turn(message.data in TURNED)

    def _on_mesh(self, message: Mesh) -> None:
        try:
            self._display.keep_surface(surface_of(message))
        except BodyError as error:
            self._refuse(names.MESH, error)

    def _on_maze(self, message: Mesh) -> None:
        try:
            self._display.keep_maze(maze_of(message))
        except BodyError as error:
            self._refuse(names.MAZE_MESH, error)

    def _on_ball_shape(self, message: SolidPrimitive) -> None:
        try:
            self._display.keep_ball_shape(ball_radius_of(message))
        except BodyError as error:
            self._refuse(names.BALL_SHAPE, error)

    def _on_body_state(self, message: BodyState) -> None:
        self._display.keep_state(lambda: state_of(message), message.time)
        (before, at), now = self._simulated, time.monotonic()
        if message.time < before and now - at <= STALE:  # reset by anyone; one that crashed was silent
            self._restart()
        self._simulated = message.time, now

    def _on_field(self, name: str, message: Field) -> None:
        if message.unit != (unit := self._fields.get(name)):
            self._refuse(names.field_topic(name), f"unit {message.unit!r:.40}; this field has {unit!r}")
            return
        self._display.keep_field(name, lambda: field_of(message))

    def _on_forces(self, message: Forces) -> None:
        try:
            self._display.keep_forces(groups_of(message))
        except ForcesError as error:
            self._refuse(names.FORCES, error)

    def _on_sim_joints(self, message: JointState) -> None:
        if self._on_joints(names.SIM_JOINT_STATES, message):
            self._sim_joints_at = time.monotonic()

    def _on_robot_joints(self, message: JointState) -> None:
        if time.monotonic() - self._sim_joints_at > STALE:  # the simulator knows the slide too
            self._on_joints(names.ROBOT_JOINT_STATES, message)

    def _on_joints(self, topic: str, message: JointState) -> bool:
        try:
            others = self._others
            if topic == names.ROBOT_JOINT_STATES:  # whose driver may know fewer
                others = tuple(joint for joint in others if joint.name in message.name)
            values = joint_values(message.name, message.position, message.effort, others)
            if names.SLIDE in message.name:
                self._slide = values[-1]
            joints = np.array(values if names.SLIDE in message.name else (*values, self._slide))
            self._fit(names.count_servos(message.name))
        except (JointError, CommandError) as error:
            self._refuse(topic, error)
            return False
        if len(joints) != self._control.limits.size + 1:
            return False
        self._control.measure(joints, time.monotonic())
        efforts = np.asarray(message.effort, float)[: len(joints) - 1]
        if others and len(message.position) >= len(efforts) == len(joints) - 1:
            table = dict(zip(message.name, zip(message.position, message.effort, strict=False), strict=False))
            efforts = np.array([table[j.name][not j.is_effort] for j in self._control.limits.table[:-1]])
        told = len(efforts) == len(joints) - 1 and bool(np.isfinite(efforts).all())
        self._display.keep_torques(efforts if told else None)
        return True

    def _on_effector_pose(self, message: PoseStamped) -> None:
        try:
            pose = pose_of(message)
        except PoseError as error:
            self._refuse(names.EFFECTOR_POSE, error)
            return
        self._display.keep_effector(pose)
        if self._target.ride(pose):
            self._display.touch_target()

    def _on_ball_pose(self, message: PoseStamped) -> None:
        try:
            self._display.keep_ball(pose_of(message))
        except PoseError as error:
            self._refuse(names.SIM_BALL_POSE, error)

    def _on_target_pose(self, message: PoseStamped) -> None:
        stamp = message.header.stamp
        if (stamp.sec, stamp.nanosec) in self._own_targets:
            return
        try:
            target = pose_of(message)
        except PoseError as error:
            self._refuse(names.TARGET_POSE, error)
            return
        if self._target.hear(target):
            self._display.touch_target()

    def _on_robot_status(self, message: RobotStatus) -> None:
        self._display.keep_robot(message)
        if self._sim_joints_at == float("-inf") and len(message.joint_names):
            self._fit(names.count_servos(message.joint_names))
        now = time.monotonic()
        if self._range.hear(message.lower, message.upper, message.speed, now, message.joint_names):
            self._keep_range()

    def _fit(self, servos: int) -> None:
        """Be for a robot with so many servos, and the other joints that the simulator tells."""
        if (servos, self._others) == self._fitted:
            return
        self._fitted = servos, self._others
        self._range.resize(servos, self._others)
        self._keep_range()

    def _keep_range(self) -> None:
        self._control.narrow(self._range.limits)
        self._display.show_range(self._range.limits)
        if self._range.notice:
            self._refuse(names.ROBOT_STATUS, self._range.notice)

    def _on_decision(self, decision: Decision) -> None:
        before = self._control.mode
        try:
            self._control.hear(decision, *clocks(self))
        except ValueError as error:
            self._refuse(names.CONTROL_MODE, error)
        self._mode_changed(before)

    def _refuse(self, where: str, reason: object) -> None:
        self.get_logger().warning(self._rejects.note(where, reason), throttle_duration_sec=5.0)

    # What people do on the page.

    def _on_events(self) -> None:
        for event in self._inbox.drain():
            self._on_event(event)

    def _on_event(self, event: Event) -> None:  # noqa: PLR0912 - one for each kind
        match event:
            case events.Pressed(button):
                self._on_press(button)
            case events.SliderMoved(servo, angle):
                self._control.set_angle(servo, angle)
                self._command_soon()
            case events.JointMoved(joint, shown):
                self._control.set_shown(joint, shown)
                self._command_soon()
            case events.SlideMoved(place):
                self._control.set_slide(place)
                self._command_soon()
            case events.KeysHeld(signs):
                self._control.hold_keys(signs, time.monotonic())
                self._command_soon()
            case events.Wish(text):
                if isinstance(event, events.Reset):
                    self._restart()
                self._wishes.publish(String(data=text))
            case events.Replayed(age, running):
                self._display.replay.show(age, running, time.monotonic())
            case events.Nonsense(what):
                self._refuse("page", what)
            case events.Grabbed(client):
                self._target.grab(client)
                self._display.touch_target()
            case events.Dragged(client, position, quaternion):
                self._on_drag(client, position, quaternion)
            case events.Dropped(client):
                self._on_drop(client)
            case events.Shows():
                self._on_shows(event)
            case events.Joined(client):
                self._browsers.add(client)
                self._on_somebody()
            case events.Left(client):
                self._browsers.discard(client)
                if not self._browsers:
                    self._on_nobody()

    def _on_press(self, button: Button) -> None:
        match button:
            case Button.STOP:
                self._decide(Mode.STOP)
            case Button.TELEOP:
                self._decide(Mode.TELEOP)
            case Button.IK:
                if self._target.position is not None:
                    self._publish_target()  # what is shown is what is followed
                self._decide(Mode.IK)
            case Button.WORKING_POSE:
                self._go("working pose", self._control.working_pose())
            case Button.PARK:
                self._go("park pose", self._control.limits.park)
            case Button.FETCH_TARGET:
                self._fetch_target()
            case Button.RECORD | Button.STOP_RECORDING:
                self._ask_recorder(button)

    def _go(self, name: str, goal: Sequence[float]) -> None:
        if not self._control.streaming:
            self._decide(Mode.TELEOP)
        self._control.go(name, goal, time.monotonic())

    def _restart(self) -> None:
        """Command the start of the scene, which the simulation is in or about to be in; a robot must not go there by
        itself, so it stops.
        """
        if not self._control.in_control or self._control.mode not in (Mode.TELEOP, Mode.IK):
            return
        if is_real(self._display.robot):
            self._decide(Mode.STOP)
            self._control.notice = (
                "The simulation was reset, so the robot was stopped. Take control to move both."
            )
            return
        if self._control.mode is Mode.IK:
            self._decide(Mode.TELEOP)
        self._control.restart(self._display.start)
        self._command_soon()

    def _fetch_target(self) -> None:
        effector = self._display.effector
        if effector is None or self._target.dragging:
            return
        self._target.release()
        self._target.ride(effector)
        self._display.touch_target()
        self._publish_target()

    def _ask_recorder(self, button: Button) -> None:
        """Ask the recorder and show its answer when it comes; nothing waits for it, since it may be lost."""
        client = self._recorders[button]
        if not client.service_is_ready():
            self._display.recorder.text = (
                "no recorder is running: start `tripod record`, or `tripod up --record DIR`"
            )
            return
        self._display.recorder.text = "asked"

        def answered(future: Any) -> None:
            result = future.result()
            begin = button is Button.RECORD
            self._display.recorder.answer(result.message, begin=begin, success=result.success)

        client.call_async(Trigger.Request()).add_done_callback(answered)

    def _on_drag(self, client: int, position: Any, quaternion: Any) -> None:
        try:
            self._target.drag(client, position, quaternion)
            self._target_asked = True
        except TargetError as error:
            self._refuse("page", error)
        self._display.touch_target()

    def _on_drop(self, client: int) -> None:
        self._target.drop(client)
        self._display.touch_target()
        if self._target_asked:
            self._publish_target()

    def _on_shows(self, shows: events.Shows) -> None:
        if shows.field and self._fields and shows.field not in self._fields:
            self._refuse("page", f"there is no field {shows.field!r:.60}")
            shows = replace(shows, field="")
        self._shown[shows.client] = shows
        if not (shows.field or shows.forces):
            del self._shown[shows.client]
        self._subscribe_shown()

    def _on_somebody(self) -> None:
        if not self._streams:
            self._subscribe_streams()
            self._draw_timer.reset()

    def _on_nobody(self) -> None:
        self._draw_timer.cancel()
        while self._streams:
            self.destroy_subscription(self._streams.pop())
        self._display.keep_torques(None)  # steps may follow that nobody hears
        if self._control.in_control:
            self.get_logger().warning(
                "the last browser was closed or does not answer, while the page was in control: the mode is now STOP"
            )
            self._decide(Mode.STOP)
            self._control.notice = (
                "The page lost its connection, so the robot was stopped. Take control to move it."
            )

    # What goes out.

    def _decide(self, mode: Mode) -> None:
        before = self._control.mode
        self._speaker.decide(mode)
        self._mode_changed(before)

    def _mode_changed(self, before: Mode) -> None:
        if before is Mode.IK and self._control.mode is not Mode.IK:
            self._target.release()
        if not self._control.streaming:
            self._command_timer.cancel()
        elif self._command_timer.is_canceled():
            self._command_timer.reset()

    def _command_soon(self) -> None:
        """Command at once what a hand asks for, unless that was done just now: the timer then follows."""
        if self._control.streaming and time.monotonic() - self._commanded_at > SOONEST:
            self._on_command()

    def _on_command(self) -> None:
        self._commanded_at = time.monotonic()
        trajectory = self._control.command(time.monotonic())
        if trajectory is not None:
            self._trajectory.publish(trajectory_message(trajectory, self._control.authority.source))

    def _publish_target(self) -> None:
        if self._target.position is None:
            return
        self._target_asked, stamp = False, self.get_clock().now().to_msg()
        self._own_targets.append((stamp.sec, stamp.nanosec))
        self._target_pose.publish(target_message(self._target.position, self._target.quaternion, stamp))

    def _on_draw(self) -> None:
        if self._range.lapse(time.monotonic()):
            self._keep_range()
        if self._target_asked:  # at the rate of the pictures, however fast the hand is
            self._publish_target()
        if self._display.wants_speed(time.monotonic()):
            self._wishes.publish(String(data='{"do": "figures"}'))
        self._display.recorder.there = self._recorders[Button.RECORD].service_is_ready()
        skipped = self._display.body.skipped
        self._display.draw(self._control, self._target, self._rejects, len(self._browsers))
        self._stream.flush()
        if self._display.body.skipped > skipped:
            text = f"{self._display.body.topic}: {self._display.body.reason}"
            self.get_logger().warning(text, throttle_duration_sec=5.0)

    def _report(self) -> Report:
        body, rejects, lost = self._display.body, self._rejects, self._inbox.lost
        values = {
            "page": self._url,
            "browsers": len(self._browsers),
            "pictures per second": self._display.pictures_per_second if self._browsers else 0.0,
            "skipped body states": body.skipped,
            "last skipped": body.reason,
            **authority_values(self._control.authority.tracker),
            "refused messages": rejects.total,
            "last refused": rejects.last,
            "lost events": lost,
        }
        return Level.WARN if body.skipped or rejects.total or lost else Level.OK, f"page {self._url}", values


def open_page(node: Node, port: int, channel: Channel, stream: Stream) -> tuple[PageServer, str]:
    """Return the server of the page, and the URL without the token, which is in what is printed alone.

    Others may read the log and the topics. Raises OSError.
    """
    server = PageServer(port, channel, stream)
    taken = server.port
    if port not in (0, taken):
        text = f"port {port} is in use: the page is on port {taken}"
        print(text, flush=True)
        node.get_logger().warning(text)
    return server, f"http://{HOST}:{taken}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node; see tripod_graph.run for the exit code."""
    stand_back()
    return run_node("view", ViewNode, arguments)


if __name__ == "__main__":
    sys.exit(main())
