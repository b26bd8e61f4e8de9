"""Inverse kinematics in the graph: `sim/compliance` and `target_pose` in, `joint_trajectory` and `ik/status`
out.

In the mode IK each compliance gives one command, so the simulator sets the rate. Without a simulator in the graph the
node asks its own quasi-static model, at the commands that the driver tells. Where there is nothing to
act on (no fresh compliance, the program not solved) nothing is published: the receivers then hold, and park
after a while, instead of being kept awake by a command that nobody stands behind.
"""

import math
import sys
import time
from array import array
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import Compliance, IkStatus, RobotStatus

from tripod_graph import diagnostic_keys as keys
from tripod_graph import names
from tripod_graph.command import CommandLimits
from tripod_graph.control_mode import authority_message, authority_values, clocks, listen
from tripod_graph.diagnostics import Diagnostics, Level, Report
from tripod_graph.executor import Patient
from tripod_graph.joint import Joint
from tripod_graph.mode import Decision, Mode, ModeTracker
from tripod_graph.motion_clock import MotionClock
from tripod_graph.parameters import declare
from tripod_graph.qos import LATCHED, NEWEST, RELIABLE, SENSOR
from tripod_graph.range import RangeWatch
from tripod_graph.run import run_node
from tripod_graph.source import IK, new_source
from tripod_graph.timers import set_period
from tripod_host.arrays import FloatArray
from tripod_host.rotations import quaternion_matrix
from tripod_ik.errors import IkError
from tripod_ik.joint_path import why_closest
from tripod_ik.messages import linear_state, point, trajectory
from tripod_ik.own_model import OwnModel
from tripod_ik.planner_thread import SLID, PlannerThread
from tripod_ik.problem import taut
from tripod_ik.rotation import unit_quaternion
from tripod_ik.row_limits import effort_limits
from tripod_ik.settings import (
    PARAMETERS,
    command_limits,
    expected,
    load_observer,
    model_error,
    scene_of,
    target_box,
    tracker_settings,
)
from tripod_ik.solvable import nothing_to_solve
from tripod_ik.state import LinearState
from tripod_ik.state_sync import StateSync
from tripod_ik.tracker import LONGEST_DT, SMOOTH, Activity, Tracker, TrackerStep
from tripod_ik.tracker_settings import Goal
from tripod_sim.tables.joints import Actuator
from tripod_sim.tables.short_forms import joints_of

WATCH = 0.05  # [s]: how often the age of the compliance is looked at
REPEAT = 0.5  # [s]: how often an unchanged IDLE or STALE is published
FEEDBACK_SILENT = 0.5  # [s]: without a measurement for so long the status says so
LAST_WORD = Duration(seconds=1.0)  # how long the last status waits until all have it
JOINING = "the simulated servos first go to the robot's angles; then the target is followed"
THROTTLE = 2.0  # [s]: shortest time between two log lines about the same kind of message


class IkNode(Node):
    """Commands the joints while the mode is IK; the rules are `Tracker` and `TargetBox`."""

    def __init__(self) -> None:
        super().__init__("ik")
        values = declare(self, PARAMETERS, self._adopt)
        self._scene, self._slide = scene_of(values), values["slide"]
        self._targets = target_box(values, self._scene)
        self._planner_thread = PlannerThread(self._build_planner)
        self._tracker = Tracker(tracker_settings(values), model_error(values), self._planner_thread, SMOOTH)
        joints = joints_of(self._scene)  # replaced by those of the driver or of a compliance message
        self._servos = len(joints.arms) if joints else len(names.SERVOS)
        self._actuators = joints.actuators if joints and joints.others else ()
        self._range_time: float = values["range_time"]
        self._tracker.resize(*self._sizes())
        self._observer, self._expected = load_observer(values, self._scene), expected(values, self._scene)
        self._range = RangeWatch(self._own_limits())
        self._planner_thread.slide = self._slide
        self._roadmap: Any = None
        self._own = OwnModel(self._build_model, joints.spans if joints else np.ones(len(names.SERVOS)))
        self._own_after: float = values["own_model_after"]
        self._own_in_use = False
        self._joining = StateSync()
        self._angles: FloatArray | None = None  # commands of the robot in SI, as the driver tells
        self._angles_at = self._simulator_at = float("-inf")
        self._feedback_at = float("-inf")
        self._stale_after: float = values["stale_after"]
        self._authority, self._source = ModeTracker(), new_source(IK, self.get_namespace())
        self._received = float("-inf")  # when the last usable compliance came, time.monotonic [s]
        self._entered = float("-inf")  # when the mode became IK
        self._interval = 0.0  # between the last two usable compliances [s]
        self._reported = float("-inf")  # when the last status left
        self._activity = Activity.IDLE
        self._message = ""
        self._status = IkStatus(state=IkStatus.IDLE)
        self._solves = self._failures = 0
        self._rejected = {"targets": 0, "compliances": 0, "modes": 0, "joint states": 0, "measurements": 0}
        self._last_target_rejection = self._last_rejection = ""

        self._connect(values)
        self._keep_range()
        self.get_logger().info(self._work())

    def _connect(self, values: Mapping[str, Any]) -> None:
        self._commands = self.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)
        self._statuses = self.create_publisher(IkStatus, names.IK_STATUS, RELIABLE)
        self._goal = self.create_publisher(String, names.IK_GOAL, LATCHED)
        self._goal.publish(String(data=str(self._tracker.settings.goal)))
        listen(self, self._on_decision)
        self.create_subscription(Compliance, names.COMPLIANCE, self._on_compliance, NEWEST)
        later = Patient()  # looked at when a compliance comes, and before it, or a timer
        for kind, topic, callback, qos in (
            (PoseStamped, names.TARGET_POSE, self._on_target, RELIABLE),
            (RobotStatus, names.ROBOT_STATUS, self._on_robot_status, RELIABLE),
            (JointState, names.ROBOT_JOINT_STATES, self._on_joints, NEWEST),
        ):
            self.create_subscription(kind, topic, callback, qos, callback_group=later)
        if values["feedback"] == "pose":
            self.create_subscription(PoseStamped, names.ROBOT_EFFECTOR_POSE, self._on_measured_pose, RELIABLE)
        elif values["feedback"] == "imu":
            self.create_subscription(Imu, names.ROBOT_IMU, self._on_imu, SENSOR)
        self._simulator_at = time.monotonic()
        self._motion = MotionClock(self)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(WATCH, self._on_timer, clock=steady)
        self._own_timer = self.create_timer(1.0 / values["own_model_rate"], self._on_own_timer, clock=steady)
        self._diagnostics = Diagnostics(self, self._report)

    def _work(self) -> str:
        """Return what it does, for who has just started it."""
        reason = nothing_to_solve(self._scene)
        alone = f"not at all: {reason}" if reason else f"by its own model of scene {self._scene.name}"
        return (
            f"{names.JOINT_TRAJECTORY} follows the {self._tracker.settings.goal} of {names.TARGET_POSE} in mode IK, "
            f"by {names.COMPLIANCE}; without a simulator {alone}"
        )

    def _build_model(self, angles: FloatArray) -> Any:
        from tripod_ik.model import StaticModel  # noqa: PLC0415 - beside a simulator it is not needed

        return StaticModel(self._scene, self._slide, angles)

    def _adopt(self, values: Mapping[str, Any]) -> None:
        """Take rates, times, tolerance and gains that have changed."""
        settings = tracker_settings(values)
        self._tracker.adopt(settings)
        self._range_time = values["range_time"]
        self._range.adopt(self._own_limits())
        self._keep_range()
        if correction := self._tracker.correction:
            correction.time, correction.delay = values["feedback_time"], values["feedback_delay"]
        if self._observer:
            self._observer.delay = values["feedback_delay"]
        self._own_after, self._stale_after = values["own_model_after"], values["stale_after"]
        set_period(self._own_timer, 1.0 / values["own_model_rate"])

    def _build_planner(self, slide: float) -> Any:
        from tripod_ik.planner import Planner  # noqa: PLC0415
        from tripod_ik.roadmap import Roadmap  # noqa: PLC0415 - a node that is never in charge needs no model

        if self._roadmap is None or abs(slide - self._roadmap.model.slide) > SLID:
            self._roadmap = Roadmap.of(self._scene, slide, self._planner_thread.tell)
        return Planner(self._roadmap, *self._tracker.reach)

    def close(self) -> None:
        """Say that nothing more will be commanded, and leave the graph."""
        self._own.close()
        self._planner_thread.close()
        if self._expected:
            self._expected.close()
        self._rest(Activity.IDLE, "stopped")
        self._statuses.wait_for_all_acked(LAST_WORD)  # a publisher that is gone sends nothing again
        self.destroy_node()

    # --- what comes in ---

    def _on_decision(self, decision: Decision) -> None:
        wall, now = clocks(self)
        self._look(now)
        before = self._authority.mode
        try:
            self._authority.hear(decision, wall, now)
        except ValueError as error:
            self._reject("modes", str(error))
        self._obey(before)

    def _look(self, now: float) -> None:
        """Command nothing more if the operator in charge is lost."""
        before = self._authority.mode
        self._authority.lapse(now)
        self._obey(before)

    def _obey(self, before: Mode) -> None:
        """Begin or end what the mode in force asks for; `before`: the last one."""
        mode = self._authority.mode
        if mode is Mode.IK and before is not Mode.IK:
            self._entered = time.monotonic()
            self._tracker.start()
            self._joining.begin()
            if self._observer:
                self._observer.reset()
            self.get_logger().info(f"mode IK, by {self._authority.source}")
        elif before is Mode.IK and mode is not Mode.IK:
            self._tracker.target = None  # coming back to IK must not move the robot to where it once was sent
            self._rest(Activity.IDLE, next(self._authority.notices(time.monotonic()), ""))

    def _on_target(self, message: Any) -> None:
        p, q = message.pose.position, message.pose.orientation
        try:
            target = self._targets.check(message.header.frame_id, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
        except IkError as error:
            self._last_target_rejection = str(error)
            self._reject("targets", str(error))
            return
        position, normal = target
        followed = None if self._tracker.settings.goal is Goal.POSITION else normal
        self._tracker.aim(position, followed, self._motion.at(time.monotonic()))

    def _fit(self, servos: int, actuators: tuple[Actuator, ...] = ()) -> None:
        """Resize to `servos` servos, or to the joints `actuators` if some of them are no servos."""
        if (servos, actuators) != (self._servos, self._actuators):
            self._servos, self._actuators = servos, actuators
            self._range.adopt(self._own_limits())
            self._tracker.resize(*self._sizes())
            self._keep_range()

    def _sizes(self) -> tuple[int, int]:
        """Return the number of joints, and of cables among them whose length is commanded."""
        return len(self._actuators) or self._servos, sum(a.pulls for a in self._actuators)

    def _own_limits(self) -> CommandLimits:
        """Return the limits of this node."""
        others = tuple(
            Joint(a.name, a.unit, a.low, a.high, (a.high - a.low) / self._range_time)
            for a in self._actuators[self._servos :]
        )
        return command_limits(self._tracker.settings, self._servos, others)

    @property
    def _joints(self) -> tuple[Joint, ...]:
        """The joints that are commanded, as they are limited now."""
        return self._range.limits.table[:-1]

    @property
    def _spans(self) -> FloatArray:
        """Commands in SI over those of the tracker, see `state`, shape (n,)."""
        return np.array([a.span for a in self._actuators] or [1.0] * self._servos)

    def _on_robot_status(self, message: Any) -> None:
        servos = names.count_servos(message.joint_names)
        if self._received == float("-inf") and servos and len(message.joint_names) == servos:
            self._fit(servos)
        now = time.monotonic()
        if self._range.hear(message.lower, message.upper, message.speed, now, message.joint_names):
            self._keep_range()

    def _keep_range(self) -> None:
        limits, spans = self._range.limits, self._spans
        low, high, speed = (side[:-1] / spans for side in (limits.lower, limits.upper, limits.speed))
        efforts = effort_limits(self._actuators, self._tracker.settings.torque_max)
        self._tracker.narrow(low, high, float(speed.min()), efforts)
        self._planner_thread.forget()
        if self._range.notice:
            self.get_logger().warning(self._range.notice)

    def _on_joints(self, message: Any) -> None:
        found = dict(zip(message.name, message.position, strict=False))
        joints = [(name, False) for name in names.servo_names(max(names.count_servos(found), 1))]
        if self._actuators:
            joints = [(joint.name, joint.is_effort) for joint in self._joints]
        efforts = dict(zip(message.name, message.effort, strict=False))
        commands = np.array([(efforts if e else found).get(name, np.nan) for name, e in joints])
        if np.isfinite(commands).all():
            self._angles, self._angles_at = commands, time.monotonic()
        else:
            told = ", ".join(name for name, _ in joints)
            self._reject("joint states", f"{names.ROBOT_JOINT_STATES} lacks the command of one of {told}")

    def _on_measured_pose(self, message: Any) -> None:
        p, q = message.pose.position, message.pose.orientation
        try:
            if message.header.frame_id != names.WORLD:
                raise IkError(
                    f"the measured pose is given in frame {message.header.frame_id!r}; it must be given in "
                    f"{names.WORLD!r}"
                )
            self._measure(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))
        except IkError as error:
            self._reject("measurements", str(error))

    def _on_imu(self, message: Any) -> None:
        q = message.orientation
        try:
            if message.orientation_covariance[0] == -1:  # REP 145: there is no orientation in it
                raise IkError("the IMU sends no orientation; use one that does, or --set feedback=pose")
            self._measure(None, np.array([q.x, q.y, q.z, q.w]))
        except IkError as error:
            self._reject("measurements", str(error))

    def _measure(self, position: FloatArray | None, quaternion: FloatArray) -> None:
        """Correct the model by what is measured; while nothing is commanded there is nothing to correct."""
        normal = quaternion_matrix(unit_quaternion("measured orientation", quaternion))[:, 2]
        if self._authority.mode is Mode.IK and self._tracker.correction:
            at = self._motion.at(time.monotonic())
            self._tracker.correction.measure(position, normal, at)
            if self._observer:
                self._observer.measure(position, normal, at)
            self._feedback_at = time.monotonic()

    def _robot_angles(self, now: float) -> FloatArray | None:
        """Return the commands that the driver tells, in SI, None where it has not told any lately."""
        return self._angles if now - self._angles_at <= self._stale_after else None

    def _on_own_timer(self) -> None:
        """Ask the own model where no simulator is in the graph and the driver tells the robot's angles."""
        now = time.monotonic()
        if self.count_publishers(names.COMPLIANCE) > 0:
            self._simulator_at, self._own_in_use = now, False
            return
        self._own_in_use = now - self._simulator_at > self._own_after
        angles = self._robot_angles(now)
        if not self._own_in_use or self._authority.mode is not Mode.IK or angles is None:
            return
        try:
            state = self._own.state_at(angles)
            self._check_state(state)
        except IkError as error:
            self._reject("compliances", str(error))
            return
        if state is not None:
            self._fit(names.count_servos(state.joint_names), state.actuators)
            if not state.held:
                self._planner_thread.stand(self._slide, time.monotonic())
            told = self._own.mesh_error
            self._on_state(state, time.monotonic(), told.distance if told else math.nan)

    def _on_compliance(self, message: Any) -> None:
        now = time.monotonic()
        self._look(now)
        if self._authority.mode is not Mode.IK:
            return
        try:
            state = linear_state(message)
            self._check_state(state)
        except IkError as error:
            self._reject("compliances", str(error))
            return
        self._fit(names.count_servos(state.joint_names), state.actuators)
        if not state.held:  # the planner knows servos alone
            self._planner_thread.stand(message.slide, now)
        if not self._joins(state, now):
            self._on_state(state, now, message.effector_mesh_error)

    def _check_state(self, state: LinearState | None) -> None:
        """Raise IkError where the effector lacks the orientation of the goal, or no load can be told of its joints."""
        goal = self._tracker.settings.goal
        if state and goal is not Goal.POSITION and not state.turns:
            raise IkError(
                f"goal is {str(goal)!r}, but the effector is a point or a set, which has no orientation; start with "
                "--set goal=position"
            )
        if state and state.actuators and self._observer:
            others = ", ".join(name for name in state.joint_names if not name.startswith("servo_"))
            raise IkError(
                f"parameter 'observe_load' knows servos only, but the robot has {others}; start with "
                "--set observe_load=false"
            )

    def _joins(self, state: LinearState, now: float) -> bool:
        """Return whether the simulated joints are still on their way to the robot's, and send them there."""
        if now - self._received > self._stale_after:
            self._joining.begin()
        robot = self._robot_angles(now)
        known = robot is not None and len(robot) == len(state.angles)
        there = taut(state, robot / self._spans) if robot is not None and known else None
        if self._joining.place(state.angles, there, now) is None or robot is None:
            return False
        self._received = now
        self._tracker.start()
        self._commands.publish(trajectory(robot, self._joints, self._source))  # slack too: the robot stays
        self._rest_again(Activity.STALE, JOINING, now)
        return True

    def _on_state(self, state: LinearState, now: float, mesh_error: float) -> None:
        """Command what follows from `state`, in which the mesh errs by `mesh_error` [m]; NaN or -1: not known."""
        if now - self._received > self._stale_after:
            self._tracker.start()
        self._interval, over = now - self._received, min(now - self._received, LONGEST_DT)
        self._received = now
        if self._expected:
            self._expected.look(state, self._planner_thread.slide, now)
        if self._observer:
            self._observer.predict(state, self._motion.at(now))
            state = self._observer.loaded(state, self._tracker.correction)
        begin = time.perf_counter()
        step = self._tracker.update(state, self._motion.at(now))
        duration = time.perf_counter() - begin
        self._solves += 1
        if step.result.ok:
            command = step.result.command * self._spans
            self._commands.publish(trajectory(command, self._joints, self._source, over))
        else:
            self._failures += 1
            self.get_logger().error(
                f"no solution: {step.result.status}; the robot stays at the last command",
                throttle_duration_sec=THROTTLE,
            )
        self._publish_step(state, step, duration, mesh_error)

    def _on_timer(self) -> None:
        now = time.monotonic()
        self._look(now)
        if self._range.lapse(now):
            self._keep_range()
        if self._authority.mode is not Mode.IK:
            self._rest_again(Activity.IDLE, next(self._authority.notices(now), ""), now)
            return
        age = now - max(self._received, self._entered)
        if age <= self._stale_after:
            return
        if self._own_in_use:
            reason = self._own_reason(now)
        elif self._received == float("-inf"):
            reason = f"no usable {names.COMPLIANCE} yet: is the simulator running?"
        else:
            reason = f"no usable {names.COMPLIANCE} since {now - self._received:.1f} s"
            if self._interval > self._stale_after:
                reason += (
                    f"; the simulator sends one in {self._interval:.1f} s: set stale_after to more than that, "
                    "or take a coarser mesh"
                )
        if self._last_rejection.startswith("compliances"):
            reason += f"; refused {self._last_rejection}"
        self._rest_again(Activity.STALE, reason, now)

    def _own_reason(self, now: float) -> str:
        """Return why the own model gives nothing."""
        if self._own.failure:
            return f"no simulator runs, and this node has no model of its own: {self._own.failure}"
        if self._robot_angles(now) is None:
            return (
                f"no {names.COMPLIANCE} received yet: is the simulator running? Without one, this node needs "
                f"{names.ROBOT_JOINT_STATES}: is the driver running?"
            )
        return "no simulator runs; the model of this node is moving to the pose of the robot"

    def _reject(self, kind: str, reason: str) -> None:
        self._rejected[kind] += 1
        self._last_rejection = f"{kind}: {reason}"
        self.get_logger().warning(f"refused {self._last_rejection}", throttle_duration_sec=THROTTLE)

    # --- what goes out ---

    def _publish_step(
        self, state: LinearState, step: TrackerStep, duration: float, mesh_error: float
    ) -> None:
        result = step.result
        status = IkStatus()
        status.target = point(step.target)
        status.effector = point(state.effector)
        status.error = step.error
        status.residual = result.residual
        status.tilt_error, status.tilt_residual = step.tilt_error, step.tilt_residual
        status.effector_mesh_error = mesh_error if mesh_error >= 0 else -1.0
        status.command = array("d", result.command * self._spans if result.ok else ())
        status.active_limits = list(result.active_limits)
        status.iterations = result.iterations
        status.solver_status = result.status
        status.solve_time = duration
        self._status = status
        message = ""
        if step.activity is Activity.SOLVER_FAILED:
            message = f"no solution: {result.status}; the robot stays at the last command"
        elif self._tracker.target is None:
            message = "no target yet: the effector stays where it is"
        elif self._tracker.correction and time.monotonic() - self._feedback_at > FEEDBACK_SILENT:
            message = "no measurement comes in: the correction keeps its last value"
        elif step.activity is Activity.SEARCHING:
            message = self._planner_thread.notice
        elif step.activity is Activity.CLOSEST:
            why = why_closest(result.active_limits, step.reason, searched=not state.held)
            message = f"closest pose: {why}"
        self._send(step.activity, message)

    def _rest_again(self, activity: Activity, message: str, now: float) -> None:
        """Publish that nothing is commanded, if that is news or was said `REPEAT` ago."""
        if activity is not self._activity or now - self._reported >= REPEAT:
            self._rest(activity, message)

    def _rest(self, activity: Activity, message: str) -> None:
        """Publish that nothing is commanded: the fields of the last solve stay, without a command and its
        claims.
        """
        self._status.command = array("d")
        self._status.active_limits = []
        self._status.iterations, self._status.solve_time, self._status.solver_status = 0, 0.0, ""
        self._send(activity, message)

    def _send(self, activity: Activity, message: str) -> None:
        status = self._status
        status.header.stamp = self.get_clock().now().to_msg()
        status.header.frame_id = names.WORLD
        status.state, status.message = int(activity), message
        status.rejected_targets = self._rejected["targets"]
        status.last_rejection = self._last_target_rejection
        status.authority = authority_message(self._authority)
        limits = self._range.limits
        status.lower, status.upper = array("d", limits.lower[:-1]), array("d", limits.upper[:-1])
        status.joint_names, status.units = [j.name for j in self._joints], [j.unit for j in self._joints]
        self._statuses.publish(status)
        self._activity, self._message, self._reported = activity, message, time.monotonic()

    def _report(self) -> Report:
        levels = {Activity.STALE: Level.WARN, Activity.SOLVER_FAILED: Level.ERROR}
        values = {
            **authority_values(self._authority),
            keys.STATE: self._activity.name,
            "error [m]": self._status.error,
            "residual [m]": self._status.residual,
            "solve time [s]": self._status.solve_time,
            "model": "own" if self._own_in_use else "simulator",
            "solves": self._solves,
            "solver failures": self._failures,
            **{f"rejected {kind}": count for kind, count in self._rejected.items()},
            "last rejection": self._last_rejection,
        }
        if correction := self._tracker.correction:
            values["correction [m]"] = float(np.linalg.norm(correction.shift))
            values["correction of tilt [rad]"] = float(np.linalg.norm(correction.tilt))
        if self._observer:
            load = self._observer.load
            told = {keys.LOAD: load.force, keys.LOAD_HALF: load.half}
            values |= {name: v if math.isfinite(v) else "not told" for name, v in told.items()}
            if any(load.push):
                values[keys.PUSH] = " ".join(f"{v:.3g}" for v in load.push)
        if self._expected:
            values |= self._expected.values()
        if self._own_in_use and self._own.mesh_error and self._own.mesh_error.reason:
            values["mesh error [m]"] = f"not told: {self._own.mesh_error.reason}"
        return levels.get(self._activity, Level.OK), self._message or self._activity.name.lower(), values


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node; see `tripod_graph.run.run_node` for arguments and exit codes."""
    return run_node("ik", IkNode, arguments)


if __name__ == "__main__":
    sys.exit(main())
