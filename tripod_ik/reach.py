"""What the effector can reach: a flood over a grid of angles, from the working pose to all that hangs together with it.

Each pose is reached from a neighbour whose equilibrium is known, so that no pose belongs to another branch; where
det(J) of the position changes its sign the flood ends. It also ends where the body snaps: in some corners a strip goes
slack, two equilibria exist, and which one a robot is in depends on its way; poses there are counted, not listed.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tripod_graph.names import SERVOS, WORKING_ANGLE
from tripod_host.arrays import FloatArray
from tripod_ik.branch import branch
from tripod_ik.errors import IkError
from tripod_ik.model import StaticModel
from tripod_ik.rotation import roll_pitch
from tripod_ik.state import LinearState
from tripod_ik.tasks import PositionTask
from tripod_sim.errors import SceneError, StepError

COLUMNS = (
    "servo_0 [rad]", "servo_1 [rad]", "servo_2 [rad]", "x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]",
    "tilt [rad]", "torque_0 [N m]", "torque_1 [N m]", "torque_2 [N m]", "torque margin [N m]",
    "least motion [m/rad]",
)  # fmt: skip
"""Columns of `Reach.table`. The margin is the torque limit less the largest torque, and negative where that is passed;
the least motion is the smallest singular value of the Jacobian of the position, zero at a fold.
"""

SNAP, BEND = 0.005, 0.03
"""A move that misses what the Jacobian predicts by more than SNAP [m] + BEND |δ|² [m/rad²] was no smooth one."""

SECTORS = 6
"""Directions that a reach all round is looked at in."""


@dataclass(frozen=True)
class Layer:
    """What can be reached between two heights.

    Attributes:
        low, high: Heights [m].
        poses: How many of the grid are there, with torques below the limit.
        radius: Distance from the axis that is reached in the worst of `SECTORS` directions [m]; 0 if one is empty.
        farthest: Largest distance from the axis [m].
        tilt: The same worst, for the tilt [rad].
        steepest: Largest tilt [rad].
        margin: Smallest and largest torque margin [N m].
    """

    low: float
    high: float
    poses: int
    radius: float
    farthest: float
    tilt: float
    steepest: float
    margin: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Reach:
    """Poses on one branch.

    Attributes:
        table: One row a pose, shape (m, 14), see `COLUMNS`.
        tried: Poses of the grid that were computed.
        folded: How many of them lie beyond a fold.
        snapped: How many of them the body only gets to with a snap.
        failed: How many of them have no equilibrium.
    """

    table: FloatArray
    tried: int
    folded: int
    snapped: int
    failed: int

    @property
    def bearable(self) -> FloatArray:
        """The rows whose torques are below the limit."""
        return self.table[self.table[:, 12] >= 0]

    def layers(self, count: int = 8) -> list[Layer]:
        """Return `count` layers of equal height over what can be borne, from the lowest."""
        rows = self.bearable
        if not len(rows):
            return []
        edges = np.linspace(rows[:, 5].min(), rows[:, 5].max(), count + 1)
        number = np.clip(np.searchsorted(edges, rows[:, 5], side="right") - 1, 0, count - 1)
        found = []
        for i in range(count):
            here = rows[number == i]
            if not len(here):
                continue
            radius, tilt = np.hypot(here[:, 3], here[:, 4]), here[:, 8]
            across = np.arctan2(-here[:, 6], here[:, 7])  # where the normal leans to
            found.append(
                Layer(
                    float(edges[i]), float(edges[i + 1]), len(here),
                    _all_round(np.arctan2(here[:, 4], here[:, 3]), radius), float(radius.max()),
                    _all_round(across, tilt), float(tilt.max()),
                    (float(here[:, 12].min()), float(here[:, 12].max())),
                )
            )  # fmt: skip
        return found


def reach(
    model: StaticModel,
    low: float,
    high: float,
    *,
    count: int = 13,
    torque_max: float,
    progress: Callable[[float], None] | None = None,
) -> Reach:
    """Return what `model` reaches from where it stands.

    Args:
        model: It stands in the pose that the flood begins at.
        low: Smallest angle [rad].
        high: Largest angle [rad].
        count: Angles of each servo; the grid has count³ poses.
        torque_max: Torque limit [N m] that the margin refers to.
        progress: Called with the fraction of the grid that is done.

    Raises:
        IkError: the limits or the count leave no grid, or the start is out of it.
    """
    if len(model.angles) != len(SERVOS):
        raise IkError(
            f"the scene has {len(model.angles)} servos; the workspace can be computed for {len(SERVOS)} "
            "servos only"
        )
    if not (low < high and count >= 2):
        raise IkError(
            f"angles from {low:g} to {high:g} rad in {count} steps are not a grid; give a lower and a "
            "higher angle and at least 2 steps"
        )
    if not torque_max > 0:
        raise IkError(f"torque limit is {torque_max:g} N m; it must be positive")
    axis = np.linspace(low, high, count)
    begin = tuple(int(np.argmin(np.abs(axis - angle))) for angle in model.angles)
    if (model.angles < low - 1e-9).any() or (model.angles > high + 1e-9).any():
        raise IkError(
            f"the start angles {model.angles.round(4).tolist()} rad must be between {low:g} and {high:g} rad"
        )
    task = [PositionTask(np.zeros(3))]
    sign = branch(model.state(), task)
    known = {begin: (model.save(), model.state())}
    todo, seen = deque([(begin, begin)]), {begin}
    rows: list[FloatArray] = []
    folded = snapped = failed = 0
    while todo:
        origin, here = todo.popleft()
        saved, before = known[origin]
        model.restore(saved)
        try:
            state = model.move(axis[list(here)])
        except (StepError, SceneError):
            failed += 1
            continue
        if progress:
            progress(min(1.0, len(seen) / count**3))
        if branch(state, task) * sign < 0:
            folded += 1
            continue
        if _snapped(before, state):
            snapped += 1
            continue
        known[here] = model.save(), state
        rows.append(_row(state, torque_max))
        for k in range(3):
            for move in (-1, 1):
                there = (*here[:k], here[k] + move, *here[k + 1 :])
                if 0 <= there[k] < count and there not in seen:
                    seen.add(there)
                    todo.append((here, there))
    table = np.array(rows).reshape(-1, len(COLUMNS))
    return Reach(table, len(seen), folded, snapped, failed)


def default_range(model: StaticModel) -> tuple[float, float]:
    """Return the angles [rad] between which the strips are stretched, within the limits of the scene."""
    joints = model.simulation.joints
    if joints is None:
        raise IkError("the scene has no servos, so it has no workspace; add [servos]")
    return float(joints.low.max()), min(float(joints.high.min()), WORKING_ANGLE + 0.9)


def _snapped(before: LinearState, after: LinearState) -> bool:
    """Return whether the effector went another way than the Jacobian said."""
    turn = after.angles - before.angles
    miss = after.equilibrium - before.equilibrium - before.jacobian[:3] @ turn
    return bool(np.linalg.norm(miss) > SNAP + BEND * (turn @ turn))


def _row(state: LinearState, torque_max: float) -> FloatArray:
    normal = state.equilibrium_rotation[:, 2]
    roll, pitch = roll_pitch(normal)
    tilt = float(np.arctan2(np.hypot(normal[0], normal[1]), normal[2]))
    margin = torque_max - float(np.abs(state.torques).max())
    least = float(np.linalg.svd(state.jacobian[:3], compute_uv=False)[-1])
    return np.array([*state.angles, *state.equilibrium, roll, pitch, tilt, *state.torques, margin, least])


def _all_round(direction: FloatArray, size: FloatArray) -> float:
    """Return the largest `size` in the worst sector of `direction` [rad]; 0 if one has none."""
    number = np.floor((direction + np.pi) / (2 * np.pi) * SECTORS).astype(int) % SECTORS
    largest = np.zeros(SECTORS)
    np.maximum.at(largest, number, size)
    return float(largest.min())
