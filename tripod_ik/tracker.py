"""Following a target: from each new state to the next command, with what must be remembered in between.

Pure: the caller gives the time.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from tripod_ik.arrays import FloatArray, frozen
from tripod_ik.errors import IkError
from tripod_ik.limits import AngleLimit, SpeedLimit, StepLimit
from tripod_ik.problem import build_ik
from tripod_ik.row_limits import TorqueLimit
from tripod_ik.solver import IkResult, IkSolver
from tripod_ik.state import LinearState
from tripod_ik.tasks import PositionTask

LONGEST_DT = 0.1
"""Time between commands [s] that the speed limit grants at most: after a gap the robot does not leap."""

STUCK = 0.1
"""A step that is to remove less than this part of the error, with no limit on step or speed active, is at the
end.
"""


class Activity(IntEnum):
    """Values of tripod_msgs/IkStatus.state."""

    IDLE = 0
    TRACKING = 1
    CLOSEST = 2
    STALE = 3
    SOLVER_FAILED = 4


@dataclass(frozen=True)
class TrackerSettings:
    """How the tracker moves the robot.

    Attributes:
        angle_min: Smallest servo angle [rad].
        angle_max: Largest servo angle [rad].
        angle_speed: Largest speed of a commanded angle [rad/s].
        step: Farthest that a command may be from the present angle [rad].
        torque_max: Largest torque of a servo, soft [N m]; infinite for none.
        weights: How much each axis of the target counts.
        tolerance: Distance from the target [m] up to which it counts as reached.
    """

    angle_min: float = -2.1
    angle_max: float = 0.6
    angle_speed: float = 3.0
    step: float = 0.5
    torque_max: float = 0.3
    weights: tuple[float, float, float] = (1.0, 1.0, 1.0)
    tolerance: float = 1e-4

    def __post_init__(self) -> None:
        AngleLimit(self.angle_min, self.angle_max)
        SpeedLimit(self.angle_speed)
        StepLimit(self.step)
        PositionTask(np.zeros(3), np.array(self.weights))
        if not self.torque_max > 0:
            raise IkError(f"torque_max is {self.torque_max} N m; it must be positive")
        if not self.tolerance > 0:
            raise IkError(f"tolerance is {self.tolerance} m; it must be positive")


@dataclass(frozen=True, eq=False)
class TrackerStep:
    """One step of the tracker.

    Attributes:
        activity: TRACKING, CLOSEST or SOLVER_FAILED; send `result.command` unless it is the last.
        target: What is being followed [m], shape (3,).
        error: Distance from the target to the effector as it is, not at rest [m].
        result: What inverse kinematics gave.
    """

    activity: Activity
    target: FloatArray
    error: float
    result: IkResult


class Tracker:
    """Turns states into commands that bring the effector to the target.

    The first command after `start` equals the present angles, and without a target the tracker keeps the
    effector where it would come to rest: beginning to track moves nothing. A servo found above the torque
    limit is not moved to relieve it: what it bears then is its limit, until it is once below `torque_max`.
    """

    def __init__(self, settings: TrackerSettings, n: int = 3) -> None:
        """`n`: number of servos."""
        self.settings = settings
        self._limits = (
            AngleLimit(settings.angle_min, settings.angle_max),
            StepLimit(settings.step),
            SpeedLimit(settings.angle_speed),
        )
        self._limited = bool(np.isfinite(settings.torque_max))
        self._solver = IkSolver(n, rows=n if self._limited else 0)
        self._target: FloatArray | None = None
        self._kept: FloatArray | None = None
        self.start()

    @property
    def target(self) -> FloatArray | None:
        """The target [m], shape (3,); None while there is none, then the tracker keeps the effector where it
        is.
        """
        return self._target

    @target.setter
    def target(self, target: FloatArray | None) -> None:
        self._target = None if target is None else frozen("target", target, (3,))

    def start(self) -> None:
        """Begin anew from the angles of the next state."""
        self._previous: FloatArray | None = None
        self._torque: FloatArray | None = None
        self._time = 0.0
        self._kept = None

    def update(self, state: LinearState, now: float) -> TrackerStep:
        """Return the next command for `state`, received at `now` [s] of the caller's steady clock."""
        settings = self.settings
        dt = 0.0 if self._previous is None else min(max(0.0, now - self._time), LONGEST_DT)
        if self._kept is None:
            self._kept = state.equilibrium
        target = self._kept if self._target is None else self._target
        task = PositionTask(target, np.array(settings.weights))
        torque = [TorqueLimit(self._torque_ceiling(state))] if self._limited else []
        problem = build_ik(state, [task], self._limits, torque, previous=self._previous, dt=dt)
        result = self._solver.solve(problem)
        self._previous, self._time = result.command, max(self._time, now)
        error = task.distances(target - state.effector)["position [m]"]
        return TrackerStep(self._activity(result), target, error, result)

    def _torque_ceiling(self, state: LinearState) -> FloatArray:
        found, maximum = np.abs(state.torques), self.settings.torque_max
        self._torque = np.where(found <= maximum, maximum, found if self._torque is None else self._torque)
        return self._torque

    def _activity(self, result: IkResult) -> Activity:
        if not result.ok:
            return Activity.SOLVER_FAILED
        on_the_way = (
            any(name.endswith((" speed", " step")) for name in result.active_limits)
            or result.residual < (1 - STUCK) * result.error
        )
        return (
            Activity.TRACKING
            if result.residual <= self.settings.tolerance or on_the_way
            else Activity.CLOSEST
        )
