"""Plays a motion of the joints to all who follow: mode REPLAY, a slow way to the first pose, then the motion."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import RobotStatus, SimStatus

from tripod_graph import names
from tripod_graph.authority import OperatorAuthority
from tripod_graph.control_mode import Speaker, clocks, listen
from tripod_graph.joint import Joint
from tripod_graph.mode import Decision, Mode
from tripod_graph.qos import RELIABLE
from tripod_graph.source import name_of, new_source
from tripod_graph.trajectory import point_of
from tripod_graph.transport import Transport
from tripod_host.arrays import FloatArray
from tripod_play.errors import PlayError
from tripod_play.joint_path import JointPath, ramp_time

PERIOD = 0.1
"""Time between two trajectories [s]."""

AHEAD = 0.4
"""How far a trajectory reaches [s]: what the robot still does when this program is killed."""

SPACING = 0.02
"""Time between its points [s]."""

NEAR, NEAR_SHARE = 0.03, 0.02
"""Distance from the first pose at which the motion begins [rad]; packets have whole degrees at the coarsest. The same
of other joints, as a share of their range."""

PATIENCE = 10.0
"""Time within which a driver must be heard, and within which the servos arrive after a ramp [s]."""

DEAF = 1.0
"""A motion ends when the robot has not followed it for so long [s]: it was told to stop, or is gone."""

SOON = 1.0
"""Time within which a driver that runs is heard [s]."""

NO_DRIVER = "start `tripod up`, `tripod driver` or `tripod sim`"
"""What to do where neither driver nor simulator is heard."""

MOVING = (RobotStatus.READY, RobotStatus.ACTIVE, RobotStatus.HOLDING, RobotStatus.PARKED)
SIMULATING = (SimStatus.RUNNING, SimStatus.HOLDING, SimStatus.PARKED)


@dataclass(frozen=True)
class Follower:
    """What the driver, or the simulator, says of itself.

    Attributes:
        able: Whether it can move now.
        follows: Whether it follows a trajectory now.
        message: Why it cannot move, or does not follow.
        joints: Its joints, without the slide.
    """

    able: bool
    follows: bool
    message: str
    joints: tuple[Joint, ...]


class ReplayNode(Node):
    """Commands the robot as a recording, or a script, has it.

    Attributes:
        done: Why it has ended, empty while it has not.
        duration: Time of the last pose in the recording [s].
        failed: Whether it ended before the end of the motion.
    """

    def __init__(
        self,
        path: JointPath,
        *,
        start: float = 0.0,
        rate: float = 1.0,
        name: str = "",
        simulated: Sequence[float] | None = None,
    ) -> None:
        """Join the graph; nothing moves before all is checked.

        Args:
            path: The motion.
            start: Where it begins, in the recording [s].
            rate: Recorded time over time.
            name: Of the node where another is in this process, for whom `__node:=` is meant; "": `bag_play`, or
                what `__node:=` names it.
            simulated: Go by the simulator, whose slew rates [rad/s] these are, instead of by the driver. None: go by
                the driver, or, if none is heard for `SOON`, by the simulator without such a limit.
        """
        # Arguments of a node go before those of its process.
        fixed = ["--ros-args", "-r", f"__node:={name}"] if name else None
        super().__init__(name or "bag_play", cli_args=fixed)
        self.done, self.duration, self.failed = "", path.end, False
        self._path, self._start, self._rate = path, start, rate
        self._authority = OperatorAuthority(new_source(name or "bag_play", self.get_namespace()))
        self._follower: Follower | None = None
        self._joints: tuple[Joint, ...] = ()  # the follower's in the order of the path, once they are checked
        self._simulated = simulated
        self._here: FloatArray | None = None
        self._since = time.monotonic()
        self._arrival: float | None = None  # on the way to the first pose: when it should be reached
        self._ramp: tuple[FloatArray, float] | None = None  # where and when that way began
        self._deaf_since: float | None = None
        self._played_at = self._over_at = float("-inf")
        self._transport: Transport | None = None  # once the motion plays
        self._commands = self.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)
        self._speaker = Speaker(self, self._authority)
        listen(self, self._on_decision)
        self._has_driver, self._by_simulator = False, simulated is not None
        if simulated is None:
            self.create_subscription(RobotStatus, names.ROBOT_STATUS, self._on_driver, RELIABLE)
            self.create_subscription(
                JointState, names.ROBOT_JOINT_STATES, lambda m: self._on_joints(m, of_driver=True), RELIABLE
            )
        self.create_subscription(SimStatus, names.SIM_STATUS, self._on_simulator, RELIABLE)
        self.create_subscription(
            JointState, names.SIM_JOINT_STATES, lambda m: self._on_joints(m, of_driver=False), RELIABLE
        )
        self.create_timer(PERIOD, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def paused(self) -> bool:
        """Whether it stands still."""
        return bool(self._transport and self._transport.paused)

    @property
    def waiting(self) -> str:
        """What the motion waits for, empty once it plays."""
        if self._transport:
            return ""
        if self._ramp:
            return "going to the first pose"
        late = time.monotonic() - self._since > SOON
        return f"waiting for a driver or a simulator: {NO_DRIVER}" if late else "looking for a driver"

    @property
    def place(self) -> float:
        """Place in the recording [s]."""
        return min(self._transport.place(time.monotonic()), self.duration) if self._transport else self._start

    def toggle(self) -> None:
        """Pause where the robot is, or go on."""
        if self._transport:
            self._transport.toggle(time.monotonic())

    def step(self) -> None:
        """While paused: play one period more."""
        if self._transport and self._transport.paused:
            self._transport.move(self.place + self._rate * PERIOD, time.monotonic())

    def close(self) -> None:
        """Leave the graph and say so: everything holds, then parks."""
        self._speaker.leave(self._authority)
        self.destroy_node()

    def _on_decision(self, decision: Decision) -> None:
        try:
            self._authority.hear(decision, *clocks(self))
        except ValueError as error:
            self.get_logger().warning(str(error))

    def _on_driver(self, m: RobotStatus) -> None:
        if not self._has_driver:
            self._has_driver, self._here = True, None
            if self._ramp is not None and not self.done:
                self._end(
                    "a driver joined after the motion was checked for the simulator only: play it again"
                )
        able, follows = m.state in MOVING, m.state == RobotStatus.ACTIVE
        why = f"the driver cannot move: {m.message or ('it holds' if able else 'no robot is connected')}"
        self._hear(able, follows, why, m, m.speed)

    def _on_simulator(self, m: SimStatus) -> None:
        if self._has_driver:
            return
        self._by_simulator = self._by_simulator or time.monotonic() - self._since >= SOON
        if not self._by_simulator:
            return
        able, follows = m.state in SIMULATING, m.state == SimStatus.RUNNING
        why = f"the simulator cannot move: {m.message or ('it holds' if able else 'it is paused')}"
        self._hear(able, follows, why, m, self._simulated or [math.inf] * len(m.lower))

    def _hear(
        self, able: bool, follows: bool, why: str, m: RobotStatus | SimStatus, speed: Sequence[float]
    ) -> None:
        named = m.joint_names or names.servo_names(len(m.lower))
        units = m.units or ["rad"] * len(named)
        rows = zip(named, units, m.lower, m.upper, speed, strict=False)
        self._follower = Follower(able, follows, why, tuple(Joint(*row) for row in rows))
        if follows:
            self._deaf_since = None
        elif self._deaf_since is None:
            self._deaf_since = time.monotonic()

    def _on_joints(self, message: JointState, *, of_driver: bool) -> None:
        if of_driver != self._has_driver:
            return
        if self._follower is None:
            return
        found = dict(zip(message.name, message.position, strict=False))
        efforts = dict(zip(message.name, message.effort, strict=False))
        found |= {j.name: efforts.get(j.name, math.nan) for j in self._follower.joints if j.is_effort}
        here = np.array([found.get(name, math.nan) for name in self._path.names])
        if np.isfinite(here).all():
            self._here = here

    def _on_timer(self) -> None:
        now = time.monotonic()
        if self.done:
            return
        if self._ramp is None:
            self._begin(now)
        elif not self._authority.held:
            tracker = self._authority.tracker
            by = name_of(tracker.source) or "nobody"
            self._end(f"mode is {self._authority.mode.name}, by {by}: another operator has taken over")
        elif self._transport is None:
            self._approach(now)
        else:
            self._play(self._transport, now)

    @property
    def refused(self) -> bool:
        """Whether it ended before anything moved."""
        return self.failed and self._ramp is None

    def _end(self, why: str) -> None:
        self.done, self.failed = why, True

    def _begin(self, now: float) -> None:
        """Check everything before anything moves."""
        follower = self._follower
        if follower is None or not follower.joints or self._commands.get_subscription_count() == 0:
            if now - self._since > PATIENCE:
                self._end(f"no driver and no simulator is running here: {NO_DRIVER}")
            return
        if not follower.able:
            self._end(follower.message)
            return
        tracker = self._authority.tracker
        if tracker.mode is Mode.REPLAY and not tracker.lost:
            self._end(f"{name_of(tracker.source)} is already playing: stop it first")
            return
        try:
            self._joints = self._path.check(follower.joints, start=self._start, rate=self._rate)
        except PlayError as error:
            self._end(str(error))
            return
        first = self._path.at(self._start)
        size = self._path.size
        here = first[:size] if self._here is None else self._here
        self._ramp = (np.concatenate([here, first[size:]]), now)
        self._arrival = now + ramp_time(here, first, self._joints)
        self._speaker.decide(Mode.REPLAY)

    def _approach(self, now: float) -> None:
        assert self._ramp
        assert self._arrival is not None
        here, began = self._ramp
        first = self._path.at(self._start)
        if now < self._arrival:
            grid = np.arange(now, now + AHEAD, SPACING)
            share = np.clip((grid - began) / (self._arrival - began), 0.0, 1.0)[:, None]
            self._send(grid - now, here + share * (first - here))
            return
        self._send(np.zeros(1), first[None])
        near = [NEAR if joint.unit == "rad" else NEAR_SHARE * joint.span for joint in self._joints]
        if self._here is not None and (np.abs(self._here - first[: len(near)]) < near).all():
            self._transport, self._played_at = Transport(self._start, self._rate, now), now
        elif now > self._arrival + PATIENCE + 2 * (self._arrival - began):
            pose = ", ".join(j.shown(value) for j, value in zip(self._joints, first, strict=False))
            self._end(
                f"the robot did not reach the first pose, {pose}; check that the driver is active and nothing blocks it"
            )

    def _play(self, transport: Transport, now: float) -> None:
        grid = np.arange(0.0, AHEAD, SPACING)
        if (
            self._deaf_since is not None
            and self._follower
            and now > max(self._deaf_since, self._played_at) + DEAF
        ):
            self._end(self._follower.message)
            return
        place = transport.place(now)
        if place < self.duration:
            self._over_at = now + AHEAD
        elif now >= self._over_at:  # the last trajectory before the end was followed to its end
            self.done = f"played {self.duration - self._start:.2f} s of motion"
            return
        places = np.full(1, place) if transport.paused else place + self._rate * grid
        self._send(grid[: len(places)], np.array([self._path.at(p) for p in places]))

    def _send(self, times: FloatArray, joints: FloatArray) -> None:
        """Command poses, shape (n, joints), at times from now [s]."""
        slide = Joint(names.SLIDE, "m", 0.0, 0.0, 0.0)
        table = (*self._joints, slide)[: joints.shape[1]]
        message = JointTrajectory(joint_names=[joint.name for joint in table])
        message.header.frame_id = self._authority.source
        for row, time_from_start in zip(joints, times, strict=True):
            point = point_of(row, table)
            point.time_from_start = Duration(seconds=float(time_from_start)).to_msg()
            message.points.append(point)
        self._commands.publish(message)
