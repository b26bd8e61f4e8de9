"""Drives the robot by the keys of this terminal."""

import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration as DurationMessage
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import RobotStatus, SimStatus

from tripod_graph import names
from tripod_graph.command import CommandError, CommandLimits
from tripod_graph.control_mode import Speaker, authority_values, clocks, listen
from tripod_graph.diagnostics import Diagnostics, Level, Report
from tripod_graph.joint import Joint, joints_told
from tripod_graph.limits import limits_from
from tripod_graph.mode import Decision, Mode
from tripod_graph.parameters import ParameterError, declare
from tripod_graph.qos import RELIABLE
from tripod_graph.range import RangeWatch
from tripod_graph.run import REFUSED, run_node
from tripod_graph.source import new_source
from tripod_graph.trajectory import point_of
from tripod_host.arrays import FloatArray
from tripod_teleop.drive import Drive
from tripod_teleop.escape import KeyParser
from tripod_teleop.joints import JointWatch
from tripod_teleop.keys import HELP, KEYS, Act, Move
from tripod_teleop.operate import Operator, Toss
from tripod_teleop.screen import range_text, status_line
from tripod_teleop.settings import LIMITS, PARAMETERS
from tripod_teleop.terminal import Terminal, TerminalError
from tripod_teleop.waiter import KeyWaiter

SEND_PERIOD = 0.05
"""Time between two set-points [s]; each tells where the joints should be when the next one comes."""
KEY_PERIOD = 0.02
"""Time between two looks for keys [s], besides those when keys come."""
JUMP_TIME = 0.01
"""Time that a jump gives the joints [s]."""
LINE_PERIOD = 0.1
"""Time between two drawings of the status line [s]."""
AT_ONCE = (Act.CATCH, Act.THROW)
"""What is answered by a set-point as soon as a key that begins to move a servo is."""
ROBOT_SILENT = 1.0
"""A driver that has not told its state for so long [s] is not quoted."""
GOODBYE = 0.5
"""Longest time for the last STOP to arrive [s]."""


class TeleopNode(Node):
    """Carries keys and messages to an `Operator`, and what it decides to the graph."""

    def __init__(self, terminal: Terminal) -> None:
        super().__init__("teleop")
        values = declare(self, PARAMETERS, self._adopt)
        limits = operator_limits(values)
        drive = Drive(limits, speed=values["speed"], hold=values["hold"], pose_time=values["pose_time"])
        toss = Toss(*(checked_angles(name, values[name], limits) for name in ("catch", "throw")))
        source = new_source(self.get_name(), self.get_namespace())
        self._range = RangeWatch(limits)
        self._fitted: tuple[int, tuple[Joint, ...]] = (limits.count, ())
        self._operator = Operator(source, drive, toss)
        self._watch, self._parser, self._terminal = JointWatch(), KeyParser(), terminal
        self._rejected, self._last_rejection = 0, ""
        self._idle, self._idle_at = "", float("-inf")
        self._command = self.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)
        self._speaker = Speaker(self, self._operator)
        listen(self, self._on_decision)
        self.create_subscription(RobotStatus, names.ROBOT_STATUS, self._on_robot_status, RELIABLE)
        self.create_subscription(SimStatus, names.SIM_STATUS, self._on_sim_status, RELIABLE)
        for topic, hear in (
            (names.SIM_JOINT_STATES, self._watch.hear_sim),
            (names.ROBOT_JOINT_STATES, self._watch.hear_robot),
        ):
            self.create_subscription(JointState, topic, self._joint_taker(topic, hear), RELIABLE)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # a paused simulation clock must not hold up a STOP
        self.create_timer(KEY_PERIOD, self._on_keys, clock=steady)
        self._sending = self.create_timer(SEND_PERIOD, self._send, clock=steady)
        self.create_timer(LINE_PERIOD, self._on_line, clock=steady)
        self._waiter = KeyWaiter(terminal, self.create_guard_condition(self._on_keys).trigger)
        self._diagnostics = Diagnostics(self, self._report)
        terminal.enter()
        self._waiter.start()
        terminal.print(f"Keys, with or without Ctrl:\n{HELP}")

    def _adopt(self, values: Mapping[str, Any]) -> None:
        """Take speeds and times that have changed."""
        self._range.adopt(operator_limits(values))
        drive = self._operator.drive
        drive.speed, drive.hold, drive.pose_time = values["speed"], values["hold"], values["pose_time"]
        self._keep_range()

    def close(self) -> None:
        """Announce STOP and give the terminal back, the latter whatever becomes of the former."""
        self._waiter.stop()
        try:
            self._speaker.decide(Mode.STOP)
            self._speaker.wait(GOODBYE)
        finally:
            self._terminal.restore()

    def _on_keys(self) -> None:
        try:
            keys = self._parser.feed(self._terminal.read())
        except TerminalError as error:
            self.get_logger().error(str(error))
            self._leave()
            return
        finally:
            self._waiter.taken()
        soon = any(self._changes_motion(key) for key in keys)
        for key in keys:
            self._on_key(key)
        if soon:
            self._send()
            self._sending.reset()

    def _changes_motion(self, key: str) -> bool:
        """Return whether `key` is to be answered at once: it jumps, or moves a servo as it did not move so far."""
        intent = KEYS.get(key)
        if isinstance(intent, Move):
            meant = self._operator.meant(intent)
            return not self._operator.drive.is_pressed(meant, time.monotonic())
        return intent in AT_ONCE

    def _on_key(self, key: str) -> None:
        intent = KEYS.get(key)
        if intent is None:
            self._operator.notice = f"{key} does nothing here; ? shows the keys"
        elif intent is Act.HELP:
            self._terminal.print(HELP)
        elif intent is Act.QUIT:
            self._leave()
        else:
            wall, now = clocks(self)
            decision = self._operator.act(intent, self._watch.joints(now), wall, now)
            if decision is not None:
                self._speaker.say(decision)

    def _send(self) -> None:
        """Publish where the joints should be when the next set-point comes, if they are to be driven."""
        now = time.monotonic()
        joints = self._operator.setpoint(self._watch.joints(now), now, SEND_PERIOD)
        if joints is not None:
            duration = JUMP_TIME if self._operator.drive.at_once else SEND_PERIOD
            self._command.publish(self._command_message(joints, duration))

    def _on_line(self) -> None:
        if self._range.lapse(time.monotonic()):
            self._keep_range()
        operator = self._operator
        self._terminal.show(
            status_line(
                operator.mode,
                operator.decider,
                self._watch.joints(time.monotonic()),
                driving=operator.is_driving,
                motion=operator.drive.motion,
                notice=operator.notice or self._watch.trouble or self._why_idle(),
                servos=operator.drive.limits.count,
                others=operator.drive.limits.others,
            )
        )

    def _why_idle(self) -> str:
        """Return why the robot does not do what these keys command, as the driver says; empty if it does."""
        fresh = time.monotonic() - self._idle_at < ROBOT_SILENT
        return f"robot: {self._idle}" if self._idle and fresh and self._operator.is_driving else ""

    def _on_robot_status(self, message: RobotStatus) -> None:
        self._idle = "" if message.state == RobotStatus.ACTIVE else message.message
        self._idle_at = time.monotonic()
        if not (self._watch.servos or self._watch.others) and len(message.joint_names):
            told = joints_told(
                message.joint_names, message.units, message.lower, message.upper, message.speed
            )
            self._watch.others = told
            self._fit(names.count_servos(message.joint_names), told)
        now = time.monotonic()
        if self._range.hear(message.lower, message.upper, message.speed, now, message.joint_names):
            self._keep_range()

    def _on_sim_status(self, message: SimStatus) -> None:
        told = joints_told(message.joint_names, message.units, message.lower, message.upper, message.speed)
        if told == self._watch.others:
            return
        try:
            self._watch.others = told
            self._fit(names.count_servos(message.joint_names), told)
        except CommandError as error:
            self._reject(names.SIM_STATUS, error)

    def _fit(self, servos: int, others: tuple[Joint, ...]) -> None:
        """Be for a robot with so many servos, and other joints."""
        if (servos, others) == self._fitted:
            return
        self._fitted = servos, others
        self._range.resize(servos, others)
        self._operator.drive.fit(self._range.limits)
        self._operator.chosen = min(self._operator.chosen, max(0, self._range.limits.size - 1))
        self._keep_range()

    def _keep_range(self) -> None:
        limits = self._operator.drive.limits = self._range.limits
        whose = "the driver's range" if self._range.narrowed else "own limits"
        self._terminal.print(self._range.notice or f"{range_text(limits)} ({whose})")

    def _on_decision(self, decision: Decision) -> None:
        try:
            self._operator.hear(decision, *clocks(self))
        except ValueError as error:
            self._reject(names.CONTROL_MODE, error)

    def _joint_taker(
        self, topic: str, hear: Callable[[Sequence[str], Sequence[float], float, Sequence[float]], None]
    ) -> Callable[[JointState], None]:
        def take(message: JointState) -> None:
            try:
                hear(message.name, message.position, time.monotonic(), message.effort)
                self._fit(self._watch.servos, self._watch.others)
            except ValueError as error:
                self._reject(topic, error)

        return take

    def _reject(self, topic: str, error: ValueError) -> None:
        self._rejected += 1
        self._last_rejection = f"{topic}: {error}"

    def _command_message(self, joints: FloatArray, duration: float) -> JointTrajectory:
        table = self._operator.drive.limits.table[: len(joints)]
        point = point_of(joints, table)
        point.time_from_start = DurationMessage(nanosec=round(1e9 * duration))
        message = JointTrajectory(joint_names=[joint.name for joint in table], points=[point])
        message.header.frame_id = self._operator.authority.source
        return message

    @staticmethod
    def _leave() -> None:
        signal.raise_signal(signal.SIGINT)  # `run_node` ends in order

    def _report(self) -> Report:
        operator = self._operator
        values: dict[str, Any] = {
            **authority_values(operator.authority.tracker),
            "driving": operator.is_driving,
            "rejected messages": self._rejected,
            "last rejection": self._last_rejection,
        }
        if self._watch.joints(time.monotonic()) is None:
            return Level.WARN, "waiting for joint angles", values
        return Level.OK, "driving" if operator.is_driving else "watching", values


def operator_limits(values: Mapping[str, Any]) -> CommandLimits:
    """Return the limits that the parameters set; raise CommandError if they contradict each other."""
    return limits_from({name: values[name] for name in LIMITS})


def checked_angles(name: str, angles: list[float], limits: CommandLimits) -> tuple[float, ...]:
    """Return the angles of parameter `name` [rad]; raise ParameterError unless they may be commanded."""
    if not angles:
        raise ParameterError(f"parameter '{name}' is empty; give an angle for each servo, or one for all")
    try:
        replace(limits, park=()).of(len(angles)).check(np.array([*angles, 0.0]), f"parameter '{name}'")
    except CommandError as error:
        raise ParameterError(str(error)) from None
    return tuple(angles)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node on this terminal; returns its exit code."""
    try:
        terminal = Terminal()
    except TerminalError as error:
        print(error, file=sys.stderr)
        return REFUSED
    with terminal:
        return run_node("teleop", lambda: TeleopNode(terminal), arguments)


if __name__ == "__main__":
    sys.exit(main())
