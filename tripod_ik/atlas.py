"""The poses of rest that a body comes to without a snap: where to look for the closest one, and the way there.

Angles do not tell a pose: near a snap the body has several equilibria at the same ones, and the sheets that these make
hang together elsewhere, where the strips are taut. Nor does det(J) part what cannot be gone to: the body passes a fold
of the forward map without noticing. So the poses are found by a flood over a grid of angles about the model's home,
each pose from a neighbour along the equilibria (`StaticModel.follow`): where the flood comes to, the driven robot does.
They are found in an order of their own, those whose effector is near home first, and who asks is told of those up to
a distance: so what is answered depends on nothing that was asked before. Of poses that are images of each other
(`StaticModel.symmetries`) one is gone to.
"""

import heapq
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import log

import numpy as np

from tripod_graph.names import WORKING_SLIDE
from tripod_ik.arrays import FloatArray
from tripod_ik.errors import IkError
from tripod_ik.model import Saved, StaticModel, goes_on, image_of, softest_between, working_angles
from tripod_ik.snap import SOFTENING, SOFTEST, WITHIN
from tripod_ik.state import LinearState
from tripod_ik.symmetry import Image, table
from tripod_ik.tracker_settings import TrackerSettings
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene
from tripod_sim.scene_short import joints_of
from tripod_sim.softness import FIRM

SPACING = 0.2
"""Distance of the grid [rad]: wide enough that all of it is looked at in seconds."""

SHORTEST = 0.05
"""Part of that below which the end of the equilibria is not looked for more closely [rad]. With half of a step no way
leads from the flat piece, and none to all sheets at 12 mm of slide."""

BEYOND = -0.04
"""A pose whose ρ², foretold by its slope (see `SnapLimit`), is below this is beyond a snap: trying would take long."""

SAME = 1e-4
"""Positions of the effector that differ by less [m] belong to one equilibrium, or to a robot and its model."""

NEAR = 1.5 * SPACING
"""How far a pose may be from one of the grid that it is looked for from [rad]."""

SPEED, LEAST = TrackerSettings.effector_speed, WITHIN * SOFTEST
"""Of the effector [m/s], and firmness of which nothing may be left, where it is foretold how long a way takes."""

ITERATIONS = 25
"""Of Newton's method, in a step of the model: what takes more is no small one."""

DIGITS = 6
"""Of what is compared to choose one of several: what is equal but for rounding is so, and the first is taken."""

Cell = tuple[int, ...]
"""Angles from home, in steps of the grid."""


@dataclass(eq=False)
class Pose:
    """A pose of the grid.

    Attributes:
        state: The linearised state.
        saved: What brings the model there.
        level: How far the effector has to go from home on the way there [m], at least.
        images: Numbers of its images, in the order of `StaticModel.symmetries`.
        neighbours: Numbers of the poses that the body goes to from here by one step of the grid, and the times [s].
    """

    state: LinearState
    saved: Saved
    level: float
    images: list[int] = field(default_factory=list)
    neighbours: dict[int, float] = field(default_factory=dict)


class Atlas:
    """Poses of a model that hang together with its home.

    Attributes:
        model: It is left anywhere.
        images: Those that all its poses have, the pose itself first.
        poses: Those found so far, home first.
    """

    def __init__(
        self,
        model: StaticModel,
        low: FloatArray,
        high: FloatArray,
        progress: Callable[[int], None] | None = None,
    ) -> None:
        """Begin with the home of `model`.

        Args:
            model: The robot.
            low: Smallest angles of poses [rad], shape (s,).
            high: Largest ones [rad], shape (s,).
            progress: Called with the number of poses that are known, as these become more.
        """
        self.model, self._low, self._high, self._progress = model, low, high, progress
        alike = np.ptp(low) == 0.0 == np.ptp(high)
        self.images: Sequence[Image] = model.symmetries() if alike else model.symmetries()[:1]
        self._products = table(self.images)
        home = model.go_home()
        self._home, self.poses = home.angles, list[Pose]()
        self._cells: dict[Cell, list[int]] = {}
        cell = (0,) * len(self._home)
        self._open = [(0.0, self._add(cell, home, 0.0), cell)]

    @classmethod
    def of(cls, scene: Scene, slide: float, progress: Callable[[int], None] | None = None) -> "Atlas":
        """Return the atlas of a scene, servo bodies slid in by `slide` [m].

        The home of its model depends on `slide` alone, in proportion between the flat and the working pose: there the
        strips are stretched.
        """
        joints, solver = joints_of(scene), replace(scene.solver, max_iterations=ITERATIONS, max_halvings=0)
        if joints is None:
            raise IkError(f"scene {scene.name!r} has no servos: there is nothing to solve for")
        low, high = np.asarray(joints.low, dtype=float), np.asarray(joints.high, dtype=float)
        home = np.clip(working_angles(joints.count) * slide / WORKING_SLIDE, low, high)
        model = StaticModel(replace(scene, solver=solver), slide, home)
        return cls(model, low, high, progress)

    def distance(self, place: FloatArray) -> float:
        """Return how far a place of the effector, shape (3,), is from that at home [m]."""
        return float(np.linalg.norm(place - self.poses[0].state.equilibrium))

    def within(self, reach: float) -> set[int]:
        """Return the poses to which the effector comes from home without going farther than `reach` [m]; find them."""
        while self._open and self._open[0][0] <= reach:
            _, number, cell = heapq.heappop(self._open)
            for new, there in self._spread(number, cell):
                heapq.heappush(self._open, (self.poses[new].level, new, there))
            if self._progress:
                self._progress(len(self.poses))
        return {n for n, pose in enumerate(self.poses) if pose.level <= reach}

    def _add(self, cell: Cell, state: LinearState, level: float) -> int:
        """Add the pose where the model stands, and its images; return its number."""
        saved, numbers = self.model.save(), list[int]()
        for image in self.images:
            there = tuple(cell[i] for i in image.servos)
            seen, known = image.state(state), self._cells.setdefault(there, [])
            same = [n for n in numbers if n in known and _is_same(self.poses[n].state, seen)]
            if not same:
                same = [len(self.poses)]
                self.poses.append(Pose(seen, image_of(saved, image), level))
                known += same
            numbers += same[:1]
        for i, number in enumerate(numbers):
            self.poses[number].images = [numbers[k] for k in self._products[:, i]]
        return numbers[0]

    def _spread(self, number: int, cell: Cell) -> Iterator[tuple[int, Cell]]:
        """Find the neighbours of a pose; yield the new ones that are no images of each other."""
        here = self.poses[number]
        for i in range(len(cell)):
            for move in (-1, 1):
                there = (*cell[:i], cell[i] + move, *cell[i + 1 :])
                angles = self._home + SPACING * np.array(there)
                known = self._cells.setdefault(there, [])
                if not self._low[i] <= angles[i] <= self._high[i] or any(n in here.neighbours for n in known):
                    continue
                before = len(self.poses)
                found = self._step(here, there, angles, known)
                if found is None:
                    continue
                there_and_back = (here, self.poses[found]), (self.poses[found], here)
                for one, other in there_and_back:
                    time = round(duration(one.state, other.state), DIGITS)
                    for a, b in zip(one.images, other.images, strict=True):
                        self.poses[a].neighbours[b] = time
                if found >= before:
                    yield found, there

    def _step(self, here: Pose, cell: Cell, angles: FloatArray, known: Sequence[int]) -> int | None:
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
            if _is_same(state, self.poses[number].state):
                return number
        if state.firmness < SOFTEST:
            return None
        return self._add(cell, state, max(here.level, self.distance(state.equilibrium)))

    def part(self, number: int, other: int) -> None:
        """Take back that the body goes from one pose to another, and from their images to those of that."""
        for a, b in zip(self.poses[number].images, self.poses[other].images, strict=True):
            for one, next_to in ((a, b), (b, a)):
                self.poses[one].neighbours.pop(next_to, None)

    def find(self, state: LinearState, among: Iterable[int]) -> int | None:
        """Bring the model to `state`; return the number of the pose that it came from, one of `among`.

        None where the model has no such equilibrium, or none that it comes to from near here, by poses that are hardly
        softer than it, or than `SOFTEST`.
        """
        softest = WITHIN * min(SOFTEST, max(state.firmness, 0.0))
        far = {n: float(np.abs(self.poses[n].state.angles - state.angles).max()) for n in among}
        near = [(round(distance, DIGITS), n) for n, distance in far.items() if distance <= NEAR]
        for _, _, number in sorted((not goes_on(self.poses[n].state, state), away, n) for away, n in near):
            self.model.restore(self.poses[number].saved)
            try:
                here = self.model.follow(
                    state.angles, softest=softest, shortest=SHORTEST / 4, longest=SPACING / 2
                )
            except (StepError, SceneError):
                continue
            if _is_same(here, state):
                return number
        return None

    def path(self, start: int, end: int, among: Collection[int]) -> list[int]:
        """Return the poses on the quickest way from one to another, both included, by `duration`.

        `among`: poses that it may lead by, all that hang together with `start`.
        """
        before: dict[int, int] = {}
        todo = [(0.0, end, end)]
        while start not in before:
            time, number, after = heapq.heappop(todo)
            if number in before:
                continue
            before[number] = after
            for neighbour in self.poses[number].neighbours:
                if neighbour not in before and neighbour in among:
                    more = self.poses[neighbour].neighbours[number]
                    heapq.heappush(todo, (time + more, neighbour, number))
        way = [start]
        while way[-1] != end:
            way.append(before[way[-1]])
        return way


def duration(before: LinearState, after: LinearState) -> float:
    """Return about how long the straight way from one state to another takes [s].

    The effector is not moved faster than `SPEED`, and what is left of ρ² is used up with the time constant `SOFTENING`.
    """
    first, least = (
        (max(rho, SOFTEST) / LEAST) ** 2 for rho in (before.firmness, softest_between(before, after))
    )
    move = float(np.linalg.norm(after.equilibrium - before.equilibrium)) / SPEED
    return max(move, SOFTENING * log((first - 1.0) / (least - 1.0)))


def _is_same(state: LinearState, other: LinearState) -> bool:
    return bool(np.abs(state.equilibrium - other.equilibrium).max() < SAME)
