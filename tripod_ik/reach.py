"""The workspace of the effector: a flood over poses of the servos, from the working pose to all connected ones.

The poses are a grid of angles, or of robots with many servos quasi-random samples and the corners of the angle range.
Each pose is reached from a neighbour whose equilibrium is known, so that no pose belongs to another branch; where
det(J) of the position of three servos changes its sign the flood ends. It also ends where the body snaps: in some
corners a strip goes slack, two equilibria exist, and which one a robot is in depends on its way; poses there are
counted, not listed.
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from tripod_graph.names import WORKING_ANGLE
from tripod_host.arrays import FloatArray
from tripod_ik.branch import branch
from tripod_ik.errors import IkError
from tripod_ik.model import StaticModel
from tripod_ik.rotation import roll_pitch
from tripod_ik.state import LinearState
from tripod_ik.tasks import PositionTask
from tripod_sim.errors import SceneError, StepError

GRID_SERVOS: Final = 4
"""Largest number of servos of a grid by default."""

COUNT, COUNT_OF_FOUR, SAMPLES = 11, 7, 2048
"""Default number of angles of each servo in a grid, of four servos, and of samples beyond that."""

SNAP, BEND = 0.005, 0.03
"""A move that misses what the Jacobian predicts by more than SNAP [m] + BEND |δ|² [m/rad²] was no smooth one."""

LONGEST: Final = 0.16
"""Longest turn of a servo in one move [rad]; longer ones are made in parts, since over a long move a snap may hide."""

SEED, STRETCH = 0, 1.5
"""Of the samples; and the factor by which their range is wider than that of the angles before they are clipped to it:
so a third of the angles are at a limit, where the workspace ends, much as in a grid.
"""

SECTORS = 6
"""Directions that a reach all round is looked at in."""


def columns(servos: int) -> tuple[str, ...]:
    """Return the columns of `Reach.table` of a robot with that many servos.

    The margin is the torque limit less the largest torque, and negative where that is passed; the least motion is the
    smallest singular value of the Jacobian of the position, zero at a fold.
    """
    return (
        *(f"servo_{i} [rad]" for i in range(servos)),
        "x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]", "tilt [rad]",
        *(f"torque_{i} [N m]" for i in range(servos)),
        "torque margin [N m]", "least motion [m/rad]",
    )  # fmt: skip


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
        table: One row a pose, shape (m, 2 s + 8) of s servos, see `columns`.
        samples: How many samples were tried besides the corners of the angle range; 0: the poses are a grid.
        tried: Poses that were computed.
        folded: How many of them lie beyond a fold.
        snapped: How many of them the body only gets to with a snap.
        failed: How many of them have no equilibrium.
    """

    table: FloatArray
    samples: int
    tried: int
    folded: int
    snapped: int
    failed: int

    @property
    def servos(self) -> int:
        """Number of servos."""
        return (self.table.shape[1] - 8) // 2

    @property
    def angles(self) -> FloatArray:
        """Of the servos [rad], shape (m, s)."""
        return self.table[:, : self.servos]

    @property
    def position(self) -> FloatArray:
        """Of the effector [m], shape (m, 3)."""
        return self.table[:, self.servos : self.servos + 3]

    @property
    def tilt(self) -> FloatArray:
        """Angle between the effector's normal and the vertical [rad], shape (m,)."""
        return self.table[:, self.servos + 5]

    @property
    def margin(self) -> FloatArray:
        """Torque limit less the largest torque [N m], shape (m,)."""
        return self.table[:, -2]

    @property
    def bearable(self) -> FloatArray:
        """The rows whose torques are below the limit."""
        return self.table[self.margin >= 0]

    @property
    def spacing(self) -> float:
        """Distance to the nearest other position [m] that 95 % of the positions that can be borne stay below.

        The border of the workspace is known no better. Infinite of fewer than two positions.
        """
        from scipy.spatial import KDTree  # noqa: PLC0415 - takes long to import

        points = self.position[self.margin >= 0]
        if len(points) < 2:
            return np.inf
        return float(np.percentile(KDTree(points).query(points, k=2)[0][:, 1], 95))

    def layers(self, count: int = 8) -> list[Layer]:
        """Return `count` layers of equal height over what can be borne, from the lowest."""
        rows, n = self.bearable, self.servos
        if not len(rows):
            return []
        x, y, z, roll, pitch, tilt = rows[:, n : n + 6].T
        edges = np.linspace(z.min(), z.max(), count + 1)
        number = np.clip(np.searchsorted(edges, z, side="right") - 1, 0, count - 1)
        radius, azimuth = np.hypot(x, y), np.arctan2(y, x)
        across = np.arctan2(-roll, pitch)  # where the normal leans to
        found = []
        for i in range(count):
            here = number == i
            if not here.any():
                continue
            margin = rows[here, -2]
            found.append(
                Layer(
                    float(edges[i]), float(edges[i + 1]), int(here.sum()),
                    _all_round(azimuth[here], radius[here]), float(radius[here].max()),
                    _all_round(across[here], tilt[here]), float(tilt[here].max()),
                    (float(margin.min()), float(margin.max())),
                )
            )  # fmt: skip
        return found


class GridFlood:
    """Poses of a grid; each is reached from one beside it.

    Attributes:
        total: Number of poses.
    """

    def __init__(self, start: FloatArray, axis: FloatArray) -> None:
        """Begin at the pose nearest to `start` [rad], shape (s,); `axis`: the angles of each servo [rad]."""
        self._axis = axis
        self.total = len(axis) ** len(start)
        begin = tuple(int(np.argmin(np.abs(axis - angle))) for angle in start)
        self.begin: tuple[int, ...] = begin
        self._todo, self._seen = deque([(begin, begin)]), {begin}

    def moves(self) -> Iterator[tuple[tuple[int, ...], tuple[int, ...], FloatArray]]:
        """Yield the keys of a known pose and of the one to go to from there, and the angles of that [rad]."""
        while self._todo:
            origin, here = self._todo.popleft()
            yield origin, here, self._axis[list(here)]

    def add(self, here: tuple[int, ...]) -> None:
        """Take a pose whose equilibrium is known now."""
        for k, number in enumerate(here):
            for there in ((*here[:k], number + move, *here[k + 1 :]) for move in (-1, 1)):
                if 0 <= there[k] < len(self._axis) and there not in self._seen:
                    self._seen.add(there)
                    self._todo.append((here, there))


class SampleFlood:
    """The corners of the angle range and quasi-random samples in it; each is reached from the nearest known pose.

    Attributes:
        total: Number of poses.
    """

    def __init__(self, start: FloatArray, low: float, high: float, samples: int) -> None:
        """Begin at `start` [rad], shape (s,)."""
        from scipy.stats import qmc  # noqa: PLC0415 - only for many servos

        n = len(start)
        corners = np.array(list(product((low, high), repeat=n)))
        share = np.clip(STRETCH * (qmc.Halton(n, seed=SEED).random(samples) - 0.5) + 0.5, 0.0, 1.0)
        self._angles = np.concatenate([start[None], corners, low + (high - low) * share])
        self.total = len(self._angles)
        self.begin = (0,)
        self._origin = np.zeros(self.total, dtype=np.int64)
        self._distance = np.full(self.total, np.inf)
        self._distance[0] = 0.0
        self._todo = np.ones(self.total, dtype=bool)

    def moves(self) -> Iterator[tuple[tuple[int, ...], tuple[int, ...], FloatArray]]:
        """Yield the keys of a known pose and of the one to go to from there, and the angles of that [rad]."""
        while self._todo.any():
            here = int(np.argmin(np.where(self._todo, self._distance, np.inf)))
            if self._distance[here] == np.inf:  # the pose of the beginning has no equilibrium
                return
            self._todo[here] = False
            yield (int(self._origin[here]),), (here,), self._angles[here]

    def add(self, here: tuple[int, ...]) -> None:
        """Take a pose whose equilibrium is known now."""
        distance = np.linalg.norm(self._angles - self._angles[here[0]], axis=1)
        nearer = distance < self._distance
        self._distance[nearer], self._origin[nearer] = distance[nearer], here[0]


def reach(
    model: StaticModel,
    low: float,
    high: float,
    *,
    count: int | None = None,
    samples: int | None = None,
    torque_max: float,
    progress: Callable[[float], None] | None = None,
) -> Reach:
    """Return what `model` reaches from where it stands.

    Args:
        model: It stands in the pose that the flood begins at.
        low: Smallest angle [rad].
        high: Largest angle [rad].
        count: Angles of each servo; the grid has count^s poses. None: 11, of four servos 7; beyond four, samples.
        samples: Number of quasi-random samples of the angles (scrambled Halton sequence [Halton1960], always the same),
            tried with the corners of the angle range instead of a grid. None: 2048 where a grid is not the default.
        torque_max: Torque limit [N m] that the margin refers to.
        progress: Called with the fraction of the poses that is done.

    Raises:
        IkError: the limits, the count or the samples leave no poses, both are given, or the start is out of the range.
    """
    flood, samples = _flood(model, low, high, count, samples)
    if not torque_max > 0:
        raise IkError(f"torque limit is {torque_max:g} N m; it must be positive")
    task = [PositionTask(np.zeros(3))]
    sign = branch(model.state(), task)
    known = {flood.begin: (model.save(), model.state())}
    rows: list[FloatArray] = []
    tried = folded = snapped = failed = 0
    for origin, here, angles in flood.moves():
        tried += 1
        saved, before = known[origin]
        model.restore(saved)
        try:
            state, smooth = _walk(model, before, angles)
        except (StepError, SceneError):
            failed += 1
            continue
        if progress:
            progress(min(1.0, tried / flood.total))
        if branch(state, task) * sign < 0:
            folded += 1
            continue
        if not smooth:
            snapped += 1
            continue
        known[here] = model.save(), state
        rows.append(_row(state, torque_max))
        flood.add(here)
    table = np.array(rows).reshape(-1, len(columns(len(model.angles))))
    return Reach(table, samples, tried, folded, snapped, failed)


def _flood(
    model: StaticModel, low: float, high: float, count: int | None, samples: int | None
) -> tuple[GridFlood | SampleFlood, int]:
    """Return the poses to try, and how many of them are samples. Raises IkError."""
    start = model.angles
    if count is not None and samples is not None:
        raise IkError(f"count is {count} and samples is {samples}; give one: a grid, or samples")
    if count is None and samples is None:
        if len(start) > GRID_SERVOS:
            samples = SAMPLES
        else:
            count = COUNT_OF_FOUR if len(start) == GRID_SERVOS else COUNT
    if count is not None and not (low < high and count >= 2):
        raise IkError(
            f"angles from {low:g} to {high:g} rad in {count} steps are not a grid; give a lower and a "
            "higher angle and at least 2 steps"
        )
    if samples is not None and not (low < high and samples >= 1):
        raise IkError(
            f"{samples} samples of angles from {low:g} to {high:g} rad cannot be taken; give a lower and a "
            "higher angle and at least 1 sample"
        )
    if (start < low - 1e-9).any() or (start > high + 1e-9).any():
        raise IkError(
            f"the start angles {start.round(4).tolist()} rad must be between {low:g} and {high:g} rad"
        )
    if samples is not None:
        return SampleFlood(start, low, high, samples), samples
    assert count is not None
    return GridFlood(start, np.linspace(low, high, count)), 0


def default_range(model: StaticModel) -> tuple[float, float]:
    """Return the angles [rad] between which the strips are stretched, within the limits of the scene."""
    joints = model.simulation.joints
    if joints is None:
        raise IkError("the scene has no servos, so it has no workspace; add [servos]")
    return float(joints.low.max()), min(float(joints.high.min()), WORKING_ANGLE + 0.9)


def _walk(model: StaticModel, before: LinearState, angles: FloatArray) -> tuple[LinearState, bool]:
    """Return the state at `angles` [rad], shape (s,), reached in parts, and whether no part was a snap.

    Raises StepError, SceneError.
    """
    way, smooth = angles - before.angles, True
    parts = max(1, int(np.ceil(np.abs(way).max() / LONGEST)))
    start, state = before.angles, before
    for part in range(1, parts + 1):
        state = model.move(angles if part == parts else start + part / parts * way)
        smooth = smooth and not _snapped(before, state)
        before = state
    return state, smooth


def _snapped(before: LinearState, after: LinearState) -> bool:
    """Return whether the effector went another way than the Jacobian said."""
    turn = after.angles - before.angles
    miss = after.equilibrium - before.equilibrium - before.jacobian[:3] @ turn
    return bool(np.linalg.norm(miss) > SNAP + BEND * (turn @ turn))


def _row(state: LinearState, torque_max: float) -> FloatArray:
    normal = state.equilibrium_rotation[:, 2]
    roll, pitch = roll_pitch(normal)
    tilt = float(np.arctan2(np.hypot(normal[0], normal[1]), normal[2]))
    margin = torque_max - float(np.abs(state.efforts).max())
    least = float(np.linalg.svd(state.jacobian[:3], compute_uv=False)[-1])
    return np.array([*state.angles, *state.equilibrium, roll, pitch, tilt, *state.efforts, margin, least])


def _all_round(direction: FloatArray, size: FloatArray) -> float:
    """Return the largest `size` in the worst sector of `direction` [rad]; 0 if one has none."""
    number = np.floor((direction + np.pi) / (2 * np.pi) * SECTORS).astype(int) % SECTORS
    largest = np.zeros(SECTORS)
    np.maximum.at(largest, number, size)
    return float(largest.min())
