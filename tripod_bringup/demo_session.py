"""The script of the demo as a rule: what to publish next, given what was heard. Pure."""

import math
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from tripod_bringup.demo_target import DemoTarget
from tripod_graph.mode import Mode
from tripod_graph.names import working_pose
from tripod_host.arrays import FloatArray


class Phase(Enum):
    """Where the script is."""

    WAIT = "waiting for the chain"
    MOVE = "moving to the working pose"
    SETTLE = "letting the effector come to rest"
    TRACK = "following the circle"
    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True)
class Heard:
    """What the session knows of the chain.

    Attributes:
        linked: Whether everybody who must hear the session is connected and alive.
        joints: Simulated joint values: angles [rad] and the slide [m], NaN before the first.
        effector: Simulated effector position [m], NaN before the first.
        robot: Where the robot's servos are [rad]; empty before that is known.
    """

    linked: bool = False
    joints: FloatArray = field(default_factory=lambda: np.full(1, np.nan))
    effector: tuple[float, float, float] = (math.nan,) * 3
    robot: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def complete(self) -> bool:
        """Whether the script can begin."""
        return self.linked and bool(np.isfinite(self.joints).all() and np.isfinite(self.effector).all())


@dataclass(frozen=True)
class Action:
    """What to publish now.

    Attributes:
        mode: A control mode to announce.
        pose: Joint values [rad, m] to command, to be reached in `move_time` [s].
        move_time: See `pose`.
        target: Effector target x, y, z [m].
    """

    mode: Mode | None = None
    pose: tuple[float, ...] | None = None
    move_time: float = 0.0
    target: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class SessionTimes:
    """Durations of the script [s].

    Attributes:
        track: How long the targets last; None: until told otherwise.
        link: Longest wait for the chain.
        move: From park to working pose.
        arrive: Longest wait for the joints to be there after `move`.
        settle: Rest before the circle.
    """

    track: float | None = 20.0
    link: float = 60.0
    move: float = 3.0
    arrive: float = 4.0
    settle: float = 1.0


class DemoSession:
    """Working pose by TELEOP, a circle by IK, STOP.

    Attributes:
        phase: Where the script is.
        failure: Why it failed, empty otherwise.
        target: The target as a function of time since `track_start`; None before.
        track_start: When the targets began [s], in the caller's time; None before.
    """

    ANGLE_TOLERANCE = 0.03  # [rad]
    SLIDE_TOLERANCE = 0.001  # [m]

    def __init__(self, times: SessionTimes, shape: DemoTarget | None = None) -> None:
        """`shape`: the circle to follow; its centre is replaced by the effector position found."""
        self.times = times
        self.phase, self.failure = Phase.WAIT, ""
        self.target: DemoTarget | None = None
        self.track_start: float | None = None
        self._shape = DemoTarget((0.0, 0.0, 0.0)) if shape is None else shape
        self._since: float | None = None
        self._commands = 0
        self._robot = np.zeros(0)  # where its servos were at the first command

    @property
    def finished(self) -> bool:
        """Whether nothing more will be published."""
        return self.phase in (Phase.DONE, Phase.FAILED)

    def step(self, now: float, heard: Heard) -> Action:
        """Return what to publish at `now` [s], the caller's steady time; call it at a regular rate."""
        if self._since is None:
            self._since = now
        elapsed = now - self._since
        match self.phase:
            case Phase.WAIT:
                return self._wait(now, elapsed, heard)
            case Phase.MOVE:
                return self._move(now, elapsed, heard)
            case Phase.SETTLE:
                return self._settle(now, elapsed, heard)
            case Phase.TRACK:
                return self._track(now, elapsed)
        return Action()

    def _enter(self, phase: Phase, now: float) -> None:
        self.phase, self._since = phase, now

    def _fail(self, reason: str, now: float) -> Action:
        self.failure = reason
        self._enter(Phase.FAILED, now)
        return Action(mode=Mode.STOP)

    def _wait(self, now: float, elapsed: float, heard: Heard) -> Action:
        if heard.complete:
            self._enter(Phase.MOVE, now)
            return Action(mode=Mode.TELEOP)
        if elapsed > self.times.link:
            return self._fail(f"the chain was not complete after {self.times.link:g} s", now)
        return Action()

    def _move(self, now: float, elapsed: float, heard: Heard) -> Action:
        if elapsed < 0.3 + min(self._commands, 1) * self.times.move:  # the mode travels on another topic
            return Action()
        servos = len(heard.joints) - 1
        pose = working_pose(servos)
        off = np.abs(heard.joints - pose)
        if self._commands == 1 and self._is_deaf(heard.robot, pose):
            self._commands += 1
            self._enter(Phase.MOVE, now - 0.3)
            return Action(pose=pose, move_time=self.times.move)
        if self._commands and (off <= [self.ANGLE_TOLERANCE] * servos + [self.SLIDE_TOLERANCE]).all():
            self._enter(Phase.SETTLE, now)
        elif elapsed > 0.3 + self.times.move + self.times.arrive:
            joints = ", ".join(f"{value:.4f}" for value in heard.joints)
            return self._fail(
                f"the simulated joints stayed at {joints} and did not reach the working pose", now
            )
        elif (
            self._commands < 2
        ):  # again where the first ended on the way, this process having been silent too long
            if not self._commands:
                self._robot = heard.robot
            self._commands += 1
            return Action(pose=pose, move_time=self.times.move)
        return Action()

    def _is_deaf(self, robot: FloatArray, pose: tuple[float, ...]) -> bool:
        """Return whether the servos have not stirred: a driver that was just found may not hear the first command."""
        if not len(robot) or len(robot) != len(self._robot):
            return False
        stood = (np.abs(robot - self._robot) <= self.ANGLE_TOLERANCE).all()
        return bool(stood and (np.abs(robot - pose[: len(robot)]) > self.ANGLE_TOLERANCE).any())

    def _settle(self, now: float, elapsed: float, heard: Heard) -> Action:
        if elapsed < self.times.settle:
            return Action()
        self.target = replace(self._shape, centre=heard.effector)
        self.track_start = now
        self._enter(Phase.TRACK, now)
        return Action(mode=Mode.IK, target=self.target(0.0))

    def _track(self, now: float, elapsed: float) -> Action:
        if self.times.track is not None and elapsed >= self.times.track:
            self._enter(Phase.DONE, now)
            return Action(mode=Mode.STOP)
        return Action(target=self.target(elapsed) if self.target else None)
