"""What the effector should do: each task gives its error, its Jacobian and its weights.

Tasks add up: the program minimises the sum of their squares, so several of them, with weights, are a compromise. The
Tripod turns three angles, so three rows can be met at once: a position; or roll, pitch and height, with yaw, x and y
left free because nothing drives them (`orientation_tasks`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import hypot, sqrt
from typing import Protocol

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.arrays import frozen
from tripod_ik.errors import IkError
from tripod_ik.rotation import tilt_between
from tripod_ik.state import LinearState

LEVER = 0.0075
"""Radius of the effector [m]: a tilt counts as much as the motion of its rim."""

TILT = "tilt [rad]"
"""Name of what `TiltTask` reports."""


@dataclass(frozen=True, eq=False)
class TaskRows:
    """The rows of one task at one state.

    Attributes:
        error: e, what is missing, in the unit of each row, shape (m,).
        jacobian: J = -de/dα [unit/rad], shape (m, n).
        weights: S, metres that a unit of the error counts, shape (m,), not negative; a row of weight 0 is free.
        curvature: How fast J turns, |d²e/dα²| [unit/rad²]; see `problem.build_ik`.
    """

    error: FloatArray
    jacobian: FloatArray
    weights: FloatArray
    curvature: float


class Task(Protocol):
    """Something that the effector, or the servos, should do."""

    @property
    def metres(self) -> float:
        """Metres that a unit of its distances counts in `total_distance`."""

    def rows(self, state: LinearState) -> TaskRows:
        """Return error, Jacobian and weights at `state`."""

    def distances(self, error: FloatArray) -> Mapping[str, float]:
        """Return what an `error` means, by name with unit, such as {"position [m]": 0.001}; empty if it counts
        for nothing.
        """


@dataclass(frozen=True, eq=False)
class PositionTask:
    """Bring the effector to `target`: three rows, error e = target - equilibrium position.

    Attributes:
        target: Position wanted [m], shape (3,), in the frame `world`.
        weights: S, how much each axis counts, shape (3,), not negative; an axis of weight 0 is free.
        curvature: How fast the Jacobian turns, |d²p/dα²| [m/rad²]. It damps the step by curvature · |S² e|,
            see `problem.build_ik`. Half of the true value still converges; less lets the command jump from
            side to side of an unreachable target, more slows the approach from afar. The simulated Tripod has
            0.014 in its working pose.
        name: Of what is reached.
        place: Of the effector that is brought there, see `LinearState.place`.
    """

    target: FloatArray
    weights: FloatArray = field(default_factory=lambda: np.ones(3))
    curvature: float = 0.03
    name: str = "position"
    place: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "target", frozen("target", self.target, (3,)))
        object.__setattr__(self, "weights", frozen("weights", self.weights, (3,)))
        if self.weights.min() < 0 or self.weights.max() == 0:
            raise IkError(
                f"weights {self.weights.tolist()}: none may be negative, and at least one must be positive"
            )
        _check_curvature(self.curvature, "m/rad²")

    def rows(self, state: LinearState) -> TaskRows:
        """Return e = target - equilibrium position [m] and J, the motion of the equilibrium [m/rad]."""
        position, jacobian = state.place(self.place)
        return TaskRows(self.target - position, jacobian, self.weights, self.curvature)

    @property
    def metres(self) -> float:
        """What a metre counts in `total_distance`: of a further place its weight."""
        return float(self.weights.max()) if self.place else 1.0

    def distances(self, error: FloatArray) -> dict[str, float]:
        """Return the length of `error`, shape (3,), over the axes that count [m]."""
        parts = zip(error.tolist(), self.weights.tolist(), strict=True)
        return {f"{self.name} [m]": hypot(*(e for e, weight in parts if weight > 0))}

    def moved(self, target: FloatArray) -> "PositionTask":
        """Return the same task for another target [m], shape (3,), finite: not checked again."""
        other = object.__new__(PositionTask)
        other.__dict__.update(self.__dict__, target=target)
        return other


@dataclass(frozen=True, eq=False)
class TiltTask:
    """Turn the effector's normal to `normal`: two rows, roll and pitch; yaw is free.

    With u the normal at rest and φ the shortest rotation vector from u to `normal`, the rows are φ along the two
    axes of the disc; the part of a rotation about u itself does not appear. |e| is the angle between both normals,
    and J'e the exact gradient of |e|²/2, however large the angle.

    Attributes:
        normal: Normal wanted, shape (3,), in `world`; made a unit vector.
        lever: Metres that a radian counts, positive: a tilt against a position task, and in reported distances.
        curvature: How fast the Jacobian turns [rad/rad²]; the simulated Tripod has 0.4 in its working pose.
    """

    normal: FloatArray
    lever: float = LEVER
    curvature: float = 0.6

    def __post_init__(self) -> None:
        normal = frozen("normal", self.normal, (3,))
        length = float(np.linalg.norm(normal))
        if not length > 1e-9:
            raise IkError(f"normal {normal.tolist()} has length 0; give a direction")
        object.__setattr__(self, "normal", frozen("normal", normal / length, (3,)))
        if not 0 < self.lever < np.inf:
            raise IkError(f"lever is {self.lever} m; it must be positive and finite")
        _check_curvature(self.curvature, "rad/rad²")

    @property
    def metres(self) -> float:
        """The lever."""
        return self.lever

    def rows(self, state: LinearState) -> TaskRows:
        """Return roll and pitch that are missing [rad], about the disc's own axes, and their Jacobian."""
        R = state.equilibrium_rotation
        disc = R[:, :2].T
        error = disc @ tilt_between(R[:, 2], self.normal)
        return TaskRows(error, disc @ state.jacobian[3:], np.full(2, self.lever), self.curvature)

    def distances(self, error: FloatArray) -> dict[str, float]:
        """Return the angle between the normals [rad]."""
        return {TILT: hypot(*error.tolist())}


@dataclass(frozen=True, eq=False)
class PostureTask:
    """Keep the servos near `angles`: n rows, error e = angles - angles of the state.

    It chooses where the other tasks leave a choice. Where they leave none it pulls them off by about
    (weight / size of their Jacobian)² of what is missing, so keep it small: against a position, of 0.01 m/rad, the
    default costs a ten-thousandth.

    Attributes:
        angles: Of the servos [rad], shape (n,).
        weight: Metres that a radian counts, positive.
    """

    angles: FloatArray
    weight: float = 1e-4

    def __post_init__(self) -> None:
        object.__setattr__(self, "angles", frozen("posture", self.angles, (np.size(self.angles),)))
        if not 0 < self.weight < np.inf:
            raise IkError(f"weight of the posture is {self.weight} m/rad; it must be positive and finite")

    @property
    def metres(self) -> float:
        """1: it has no distances."""
        return 1.0

    def rows(self, state: LinearState) -> TaskRows:
        """Return what is missing to the posture [rad]; J is the identity."""
        n = len(state.angles)
        error = frozen("posture", self.angles, (n,)) - state.angles
        return TaskRows(error, np.eye(n), np.full(n, self.weight), 0.0)

    def distances(self, error: FloatArray) -> dict[str, float]:
        """Return nothing: a posture is a wish, not a goal."""
        return {}


def orientation_tasks(
    normal: FloatArray, height: float, *, lever: float = LEVER
) -> tuple[TiltTask, PositionTask]:
    """Return the tasks for a normal, shape (3,), and a height z [m]: roll, pitch and height; x, y and yaw are free."""
    return (
        TiltTask(normal, lever=lever),
        PositionTask(np.array([0.0, 0.0, height]), np.array([0.0, 0.0, 1.0]), name="height"),
    )


def total_distance(tasks: Sequence[Task], errors: Sequence[FloatArray]) -> float:
    """Return one length [m] for the `errors` of all `tasks`: the root of the sum of squares, tilts by their lever."""
    return total_of(tasks, [task.distances(error) for task, error in zip(tasks, errors, strict=True)])


def total_of(tasks: Sequence[Task], distances: Sequence[Mapping[str, float]]) -> float:
    """Return the same [m], for the `distances` that the tasks make of their errors."""
    total = 0.0
    for task, found in zip(tasks, distances, strict=True):
        total += sum((task.metres * d) ** 2 for d in found.values())
    return sqrt(total)


def _check_curvature(curvature: float, unit: str) -> None:
    if not 0 <= curvature < np.inf:
        raise IkError(f"curvature is {curvature} {unit}; it must be finite and not negative")
