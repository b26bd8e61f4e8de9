"""The poses of rest that a body comes to without a snap: where to look for the closest one, and the way there.

Angles do not tell a pose: near a snap the body has several equilibria at the same ones, and the sheets that these make
hang together elsewhere, where the strips are taut. Nor does det(J) part what cannot be gone to: the body passes a fold
of the forward map without noticing. So the poses are found by a flood over a grid of angles about the model's home,
each pose from a neighbour along the equilibria (`StaticModel.follow`): where the flood comes to, the driven robot does.
"""

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from tripod_ik.arrays import FloatArray
from tripod_ik.merit import limits_passed
from tripod_ik.model import Saved, StaticModel, goes_on
from tripod_ik.row_limits import RowLimit
from tripod_ik.snap import SOFTEST
from tripod_ik.state import LinearState
from tripod_ik.tasks import Task, total_distance
from tripod_sim.errors import SceneError, StepError
from tripod_sim.softness import FIRM

SPACING = 0.2
"""Distance of the grid [rad]: wide enough that all of it is looked at in seconds."""

SHORTEST = 0.05
"""Part of that below which the end of the equilibria is not looked for more closely [rad]. With half of a step no way
leads from the flat piece, and none to all sheets at 12 mm of slide."""

BEYOND = -0.02
"""A pose whose ρ², foretold by its slope (see `SnapLimit`), is below this is beyond a snap: trying would take long."""

SAME = 1e-4
"""Positions of the effector that differ by less [m] belong to one equilibrium, or to a robot and its model."""

APART = 0.25
"""How far poses of one sheet are apart that a search begins at [rad]."""

NEAR = 1.5 * SPACING
"""How far a pose may be from one of the grid that it is looked for from [rad]."""

CALM = 0.15
"""Firmness of a pose on a way that makes it as long again as a firm one."""

DAMPING = 1e-3
"""Of the step by which what a pose is near to is foretold [m/rad]."""


@dataclass(eq=False)
class Pose:
    """A pose of the grid.

    Attributes:
        state: The linearised state.
        saved: What brings the model there.
        neighbours: Numbers of the poses that the body goes to from here by one step of the grid.
    """

    state: LinearState
    saved: Saved
    neighbours: list[int] = field(default_factory=list)


class Atlas:
    """Poses of a model with angles from `low` to `high` [rad], shape (s,) each, that hang together with its home.

    Attributes:
        model: It is left anywhere.
        poses: Those found so far.
    """

    def __init__(
        self, model: StaticModel, low: FloatArray, high: FloatArray, limits: Sequence[RowLimit] = ()
    ) -> None:
        """`limits`: of torques and effector; poses beyond them by more than a step of the grid are left out."""
        self.model, self._low, self._high, self._limits = model, low, high, tuple(limits)
        self._home, home = model.home, model.go_home()
        self.poses = [Pose(home, model.save())]
        self._cells: dict[tuple[int, ...], list[int]] = {(0,) * len(self._home): [0]}
        self._open = {0: (0,) * len(self._home)}

    @property
    def complete(self) -> bool:
        """Whether all poses are found."""
        return not self._open

    def explore(self, cost: Callable[[LinearState], float]) -> Iterator[float]:
        """Look at the neighbours of ever more poses, first of those of the least `cost`.

        Yields:
            The cost of the pose that is next.
        """
        heap = [(cost(self.poses[number].state), number) for number in self._open]
        heapq.heapify(heap)
        while heap:
            least, number = heapq.heappop(heap)
            yield least
            for new in self._spread(number):
                heapq.heappush(heap, (cost(self.poses[new].state), new))

    def _spread(self, number: int) -> Iterator[int]:
        """Find the neighbours of a pose; yield the new ones."""
        cell, here = self._open.pop(number), self.poses[number]
        for i in range(len(cell)):
            for move in (-1, 1):
                there = (*cell[:i], cell[i] + move, *cell[i + 1 :])
                angles = self._home + SPACING * np.array(there)
                known = self._cells.setdefault(there, [])
                if (angles < self._low).any() or (angles > self._high).any():
                    continue
                if any(n in here.neighbours for n in known):
                    continue
                found = self._step(here, angles, known)
                if found is None:
                    continue
                here.neighbours.append(found)
                self.poses[found].neighbours.append(number)
                if found not in known:
                    known.append(found)
                    self._open[found] = there
                    yield found

    def _step(self, here: Pose, angles: FloatArray, known: Sequence[int]) -> int | None:
        """Return the number of the pose that the body goes to from `here`, a new one if need be; None for none."""
        for number in known:
            if goes_on(here.state, self.poses[number].state):
                return number
        rho, slope = here.state.firmness, here.state.firmness_slope
        if rho * (rho + 2 * slope @ (angles - here.state.angles)) < BEYOND:
            return None
        self.model.restore(here.saved)
        try:
            state = self.model.follow(
                angles, shortest=SHORTEST, longest=SPACING / 2 if rho < FIRM else SPACING
            )
        except (StepError, SceneError):
            return None
        for number in known:
            if np.abs(state.equilibrium - self.poses[number].state.equilibrium).max() < SAME:
                return number
        if state.firmness < SOFTEST or limits_passed(state, self._limits) > SPACING:
            return None
        self.poses.append(Pose(state, self.model.save()))
        return len(self.poses) - 1

    def promising(self, missed: Callable[[LinearState], float], count: int) -> list[int]:
        """Return at most `count` poses, apart from each other, of those of which least [m] seems to be `missed`."""
        ranked = sorted((missed(pose.state), number) for number, pose in enumerate(self.poses))
        chosen: list[int] = []
        for _, number in ranked:
            state = self.poses[number].state
            others = (self.poses[other].state for other in chosen)
            if all(
                np.abs(state.angles - o.angles).max() > APART
                or np.abs(state.equilibrium - o.equilibrium).max() > 0.1 * APART
                for o in others
            ):
                chosen.append(number)
            if len(chosen) == count:
                break
        return chosen

    def find(self, state: LinearState, most: int) -> int | None:
        """Bring the model to `state`; return the number of the pose that it came from.

        None where the model has no such equilibrium, or none that hangs together with its home by ways near here: at
        most `most` poses are looked at.
        """

        def apart(other: LinearState) -> float:
            return float(np.abs(other.angles - state.angles).max())

        tried: set[int] = set()
        for count, least in enumerate(chain(self.explore(apart), [np.inf])):
            near = [(apart(pose.state), n) for n, pose in enumerate(self.poses) if n not in tried]
            for distance, number in sorted(near):
                if distance > NEAR:
                    break
                tried.add(number)
                if self._comes_to(state, number):
                    return number
            if count >= most or (tried and least > 1.4 * NEAR):
                break
        return None

    def _comes_to(self, state: LinearState, number: int) -> bool:
        """Return whether the body goes from a pose straight to `state`; the model is there then."""
        self.model.restore(self.poses[number].saved)
        try:
            here = self.model.follow(state.angles, shortest=SHORTEST / 4)
        except (StepError, SceneError):
            return False
        return bool(np.abs(here.equilibrium - state.equilibrium).max() < SAME)

    def path(self, start: int, end: int) -> list[int]:
        """Return the poses on the shortest way from one to another, both included; soft ones make it longer."""
        before, todo = {}, [(0.0, end, end)]
        while start not in before:
            length, number, after = heapq.heappop(todo)
            if number in before:
                continue
            before[number] = after
            for neighbour in self.poses[number].neighbours:
                if neighbour not in before:
                    soft = CALM / self.poses[neighbour].state.firmness
                    heapq.heappush(todo, (length + 1.0 + soft**2, neighbour, number))
        way = [start]
        while way[-1] != end:
            way.append(before[way[-1]])
        return way


class Foretold:
    """What poses miss of `tasks`, see `foretold`; each is looked at once."""

    def __init__(self, tasks: Sequence[Task]) -> None:
        self._tasks = tasks
        self._known: dict[int, tuple[LinearState, float]] = {}  # the state is kept: no other has its id

    def __call__(self, state: LinearState) -> float:
        """Return how near a step brings `state` [m]."""
        if id(state) not in self._known:
            self._known[id(state)] = state, foretold(self._tasks, state)
        return self._known[id(state)][1]


def foretold(tasks: Sequence[Task], state: LinearState) -> float:
    """Return how near [m] a linear step of at most the grid's spacing brings `state` to what `tasks` ask."""
    rows = [task.rows(state) for task in tasks]
    e = np.concatenate([r.weights * r.error for r in rows])
    J = np.concatenate([r.weights[:, None] * r.jacobian for r in rows])
    n = J.shape[1]
    step = np.linalg.solve(J.T @ J + DAMPING**2 * np.eye(n), J.T @ e)
    step = np.clip(step, -SPACING, SPACING)
    return total_distance(tasks, [r.error - r.jacobian @ step for r in rows])
