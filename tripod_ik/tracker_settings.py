"""How the tracker moves the robot: what of a target counts, limits, and the tasks that they make."""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.errors import IkError
from tripod_ik.limits import AngleLimit, SpeedLimit, StepLimit
from tripod_ik.row_limits import EffectorBox
from tripod_ik.tasks import LEVER, PositionTask, Task, TiltTask, orientation_tasks

UP = np.array([0.0, 0.0, 1.0])


class Goal(StrEnum):
    """What of a target pose is followed."""

    POSITION = "position"
    ORIENTATION = "orientation"
    POSE = "pose"


@dataclass(frozen=True)
class TrackerSettings:
    """How the tracker moves the robot.

    Attributes:
        angle_min: Smallest servo angle [rad].
        angle_max: Largest servo angle [rad].
        angle_speed: Largest speed of a commanded angle [rad/s].
        effector_speed: Largest speed of the resting effector that commands ask for [m/s]; a body that swings is up to
            2.6 times as fast.
        step: Farthest that a command may be from the present angle [rad].
        torque_max: Largest torque of a servo [N m]; infinite for none.
        box: Smallest and largest x, y, z of the effector at rest [m]; None for no box.
        hard: Whether torques and box are hard limits; else they are soft.
        weights: How much each axis of the target counts.
        tolerance: Distance from the target [m] up to which it counts as reached.
        goal: POSITION; ORIENTATION: roll, pitch and height; POSE: position and tilt, a compromise.
        lever: Metres that a radian of tilt counts.
        lead: How far ahead of itself a moving target is aimed at [s]: the time that the robot takes to answer.
    """

    angle_min: float = -2.1
    angle_max: float = 0.6
    angle_speed: float = 3.0
    effector_speed: float = 0.06
    step: float = 0.5
    torque_max: float = 0.3
    box: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    hard: bool = False
    weights: tuple[float, float, float] = (1.0, 1.0, 1.0)
    tolerance: float = 1e-4
    goal: Goal = Goal.POSITION
    lever: float = LEVER
    lead: float = 0.0

    def __post_init__(self) -> None:
        AngleLimit(self.angle_min, self.angle_max)
        SpeedLimit(self.angle_speed)
        StepLimit(self.step)
        if not self.effector_speed > 0:
            raise IkError(f"effector_speed is {self.effector_speed} m/s; it must be positive")
        if not self.torque_max > 0:
            raise IkError(f"torque_max is {self.torque_max} N m; it must be positive")
        if self.box is not None:
            EffectorBox(np.array(self.box[0]), np.array(self.box[1]))
        if not self.tolerance > 0:
            raise IkError(f"tolerance is {self.tolerance} m; it must be positive")
        if not 0 <= self.lead <= 0.5:
            raise IkError(f"lead is {self.lead} s; allowed: 0 to 0.5 s")
        try:
            object.__setattr__(self, "goal", Goal(self.goal))
        except ValueError:
            raise IkError(f"goal is {self.goal!r}; allowed: {', '.join(Goal)}") from None
        self.tasks(np.zeros(3), UP)

    @cached_property
    def _position(self) -> PositionTask:
        return PositionTask(np.zeros(3), np.array(self.weights))

    def tasks(self, position: FloatArray, normal: FloatArray) -> tuple[Task, ...]:
        """Return what brings the effector to `position` [m] and `normal`, shape (3,) each, as far as the goal says."""
        if self.goal is Goal.ORIENTATION:
            return orientation_tasks(normal, float(position[2]), lever=self.lever)
        task = self._position.moved(position)
        return (task,) if self.goal is Goal.POSITION else (task, TiltTask(normal, lever=self.lever))
