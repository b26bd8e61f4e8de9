"""Inverse kinematics in the graph: `sim/compliance` and `target_pose` in, `joint_trajectory` and `ik/status`
out.

In the mode IK each compliance gives one command, so the simulator sets the rate. Where there is nothing to
act on (no fresh compliance, the program not solved) nothing is published: the receivers then hold, and park
after a while, instead of being kept awake by a command that nobody stands behind.
"""

import sys
import time
from array import array
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import Point, PoseStamped
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from tripod_msgs.msg import Compliance, ControlMode, IkStatus

from tripod_graph import names
from tripod_graph.command import CommandLimits
from tripod_graph.diagnostics import Diagnostics, Level, Report
from tripod_graph.mode import Mode, ModeTracker
from tripod_graph.parameters import Parameter, declare
from tripod_graph.qos import LATCHED_OF_ALL, RELIABLE
from tripod_graph.run import run_node
from tripod_ik.arrays import FloatArray
from tripod_ik.errors import IkError
from tripod_ik.state import LinearState
from tripod_ik.target import TargetBox
from tripod_ik.tracker import Activity, Tracker, TrackerSettings, TrackerStep

_COMMAND, _TRACKER = CommandLimits(), TrackerSettings()

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("angle_min", _COMMAND.angle_min, "smallest servo angle commanded", "rad", low=-3.2, high=3.2),
    Parameter("angle_max", _COMMAND.angle_max, "largest servo angle commanded", "rad", low=-3.2, high=3.2),
    Parameter(
        "angle_speed",
        _TRACKER.angle_speed,
        "largest speed of the commanded angles; keep it below the slew rate of those who follow",
        "rad/s",
        low=0.01,
        high=20.0,
    ),
    Parameter(
        "max_step",
        _TRACKER.step,
        "farthest that a command may be ahead of the present angle",
        "rad",
        low=0.01,
        high=3.2,
    ),
    # An SG90 stalls at 0.18 N m and the working pose alone takes 0.14 N m: near the stall torque the limit would
    # rule out much of the workspace in simulation; the default keeps off only what no such servo comes near.
    Parameter(
        "torque_max",
        _TRACKER.torque_max,
        "torque of a servo that the target must not cause, as far as possible; .inf for none",
        "N m",
        low=0.001,
    ),
    Parameter(
        "weights", [1.0, 1.0, 1.0], "how much x, y and z of the target count; 0 leaves an axis free", low=0.0
    ),
    Parameter(
        "tolerance", _TRACKER.tolerance, "distance up to which the target counts as reached", "m", low=1e-7
    ),
    Parameter("target_low", [-0.15, -0.15, -0.15], "smallest x, y, z of a target that is accepted", "m"),
    Parameter("target_high", [0.15, 0.15, 0.15], "largest x, y, z of a target that is accepted", "m"),
    Parameter("stale_after", 0.2, "age from which on a compliance is not used", "s", low=0.02, high=0.5),
)

NEWEST = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=1
)  # of the states that queued up while this node was busy only the last is the present one
WATCH = 0.05  # [s]: how often the age of the compliance is looked at
REPEAT = 0.5  # [s]: how often an unchanged IDLE or STALE is published
THROTTLE = 2.0  # [s]: shortest time between two log lines about the same kind of message


def linear_state(message: Any) -> LinearState:
    """Return the state in a tripod_msgs/Compliance; raise IkError if it cannot be used."""
    if message.header.frame_id != names.WORLD:
        raise IkError(f"compliance in frame {message.header.frame_id!r}; it must be {names.WORLD!r}")
    joints = tuple(message.joint_names)
    if joints != names.SERVOS:
        raise IkError(f"compliance of joints {list(joints)}; they must be {', '.join(names.SERVOS)}")
    rows = 6 + len(joints)
    if len(message.w) != rows**2:
        raise IkError(f"compliance has {len(message.w)} entries; {len(joints)} joints give {rows**2}")
    p, q = message.effector.position, message.effector.orientation
    return LinearState(
        joint_names=joints,
        angles=message.angles,
        torques=message.torques,
        effector=(p.x, p.y, p.z),  # type: ignore[arg-type]
        rotation=(q.x, q.y, q.z, q.w),  # type: ignore[arg-type]
        equilibrium_offset=message.equilibrium_offset,
        W=[message.w[rows * i : rows * (i + 1)] for i in range(rows)],  # type: ignore[arg-type]
    )


def trajectory(command: FloatArray) -> JointTrajectory:
    """Return the command [rad], shape (3,), as a trajectory: be there now, as fast as your slew rate
    allows.
    """
    point = JointTrajectoryPoint()
    point.positions = array("d", command)
    message = JointTrajectory()
    message.joint_names = list(names.SERVOS)
    message.points = [point]
    return message


class IkNode(Node):
    """Commands the servos while the mode is IK; the rules are `Tracker` and `TargetBox`."""

    def __init__(self) -> None:
        super().__init__("ik")
        values = declare(self, PARAMETERS)
        self._targets = TargetBox(values["target_low"], values["target_high"])
        if len(values["weights"]) != 3:
            raise IkError(f"parameter 'weights' has {len(values['weights'])} values; it needs 3: x, y, z")
        self._tracker = Tracker(
            TrackerSettings(
                angle_min=values["angle_min"],
                angle_max=values["angle_max"],
                angle_speed=values["angle_speed"],
                step=values["max_step"],
                torque_max=values["torque_max"],
                weights=tuple(values["weights"]),
                tolerance=values["tolerance"],
            ),
            len(names.SERVOS),
        )
        self._stale_after: float = values["stale_after"]
        self._mode = ModeTracker()
        self._received = float("-inf")  # when the last usable compliance came, time.monotonic [s]
        self._entered = float("-inf")  # when the mode became IK
        self._reported = float("-inf")  # when the last status left
        self._activity = Activity.IDLE
        self._message = ""
        self._status = IkStatus(state=IkStatus.IDLE)
        self._solves = self._failures = 0
        self._rejected = {"targets": 0, "compliances": 0, "modes": 0}
        self._last_target_rejection = self._last_rejection = ""

        self._commands = self.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)
        self._statuses = self.create_publisher(IkStatus, names.IK_STATUS, RELIABLE)
        self.create_subscription(ControlMode, names.CONTROL_MODE, self._on_mode, LATCHED_OF_ALL)
        self.create_subscription(PoseStamped, names.TARGET_POSE, self._on_target, RELIABLE)
        self.create_subscription(Compliance, names.COMPLIANCE, self._on_compliance, NEWEST)
        self.create_timer(WATCH, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._diagnostics = Diagnostics(self, self._report)

    def close(self) -> None:
        """Say that nothing more will be commanded, and leave the graph."""
        self._rest(Activity.IDLE, "stopped")
        self._statuses.wait_for_all_acked(
            Duration(seconds=0.2)
        )  # a publisher that is gone sends nothing again
        self.destroy_node()

    # --- what comes in ---

    def _on_mode(self, message: Any) -> None:
        stamp = message.header.stamp
        before = self._mode.mode
        try:
            changed = self._mode.update(message.mode, stamp.sec + 1e-9 * stamp.nanosec)
        except ValueError as error:
            self._reject("modes", str(error))
            return
        if not changed:
            return
        if self._mode.mode is Mode.IK:
            self._entered = time.monotonic()
            self._tracker.start()
            self.get_logger().info(f"mode IK, by {message.source or 'an unnamed operator'}")
        elif before is Mode.IK:
            self._tracker.target = None  # coming back to IK must not move the robot to where it once was sent
            self._rest(Activity.IDLE, "")

    def _on_target(self, message: Any) -> None:
        p, q = message.pose.position, message.pose.orientation
        try:
            target = self._targets.check(message.header.frame_id, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
        except IkError as error:
            self._last_target_rejection = str(error)
            self._reject("targets", str(error))
            return
        self._tracker.target = target

    def _on_compliance(self, message: Any) -> None:
        now = time.monotonic()
        if self._mode.mode is not Mode.IK:
            return
        try:
            state = linear_state(message)
        except IkError as error:
            self._reject("compliances", str(error))
            return
        if now - self._received > self._stale_after:
            self._tracker.start()
        self._received = now
        begin = time.perf_counter()
        step = self._tracker.update(state, now)
        duration = time.perf_counter() - begin
        self._solves += 1
        if step.result.ok:
            self._commands.publish(trajectory(step.result.command))
        else:
            self._failures += 1
            self.get_logger().error(
                f"not solved: {step.result.status}; the last command holds", throttle_duration_sec=THROTTLE
            )
        self._publish_step(state, step, duration)

    def _on_timer(self) -> None:
        now = time.monotonic()
        if self._mode.mode is not Mode.IK:
            self._rest_again(Activity.IDLE, "", now)
            return
        age = now - max(self._received, self._entered)
        if age <= self._stale_after:
            return
        if self._received == float("-inf"):
            reason = f"no usable {names.COMPLIANCE} yet: is the simulator running?"
        else:
            reason = f"no usable {names.COMPLIANCE} since {now - self._received:.1f} s"
        if self._last_rejection.startswith("compliances"):
            reason += f"; refused {self._last_rejection}"
        self._rest_again(Activity.STALE, reason, now)

    def _reject(self, kind: str, reason: str) -> None:
        self._rejected[kind] += 1
        self._last_rejection = f"{kind}: {reason}"
        self.get_logger().warning(f"refused of {self._last_rejection}", throttle_duration_sec=THROTTLE)

    # --- what goes out ---

    def _publish_step(self, state: LinearState, step: TrackerStep, duration: float) -> None:
        result = step.result
        status = IkStatus()
        status.target = _point(step.target)
        status.effector = _point(state.effector)
        status.error = step.error
        status.residual = result.residual
        status.command = array("d", result.command if result.ok else ())
        status.active_limits = list(result.active_limits)
        status.iterations = result.iterations
        status.solver_status = result.status
        status.solve_time = duration
        self._status = status
        message = ""
        if step.activity is Activity.SOLVER_FAILED:
            message = f"not solved: {result.status}; the last command holds"
        elif self._tracker.target is None:
            message = "no target yet: the effector is kept where it is"
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
        self._statuses.publish(status)
        self._activity, self._message, self._reported = activity, message, time.monotonic()

    def _report(self) -> Report:
        levels = {Activity.STALE: Level.WARN, Activity.SOLVER_FAILED: Level.ERROR}
        values = {
            "mode": self._mode.mode.name,
            "state": self._activity.name,
            "error [m]": self._status.error,
            "residual [m]": self._status.residual,
            "solve time [s]": self._status.solve_time,
            "solves": self._solves,
            "solver failures": self._failures,
            **{f"rejected {kind}": count for kind, count in self._rejected.items()},
            "last rejection": self._last_rejection,
        }
        return levels.get(self._activity, Level.OK), self._message or self._activity.name.lower(), values


def _point(position: FloatArray) -> Point:
    x, y, z = (float(value) for value in position)
    return Point(x=x, y=y, z=z)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node; see `tripod_graph.run.run_node` for arguments and exit codes."""
    return run_node("ik", IkNode, arguments)


if __name__ == "__main__":
    sys.exit(main())
