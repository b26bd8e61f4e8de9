"""The poses of rest that a body comes to without a snap: where to look for the closest one, and the way there.

Angles do not tell a pose: near a snap the body has several equilibria at the same ones, and the sheets that these make
hang together elsewhere, where the strips are taut. Nor does det(J) part what cannot be gone to: the body passes a fold
of the forward map without noticing. So the poses are found by a flood over a grid of angles about the model's home,
each pose from a neighbour along the equilibria (`StaticModel.follow`): where the flood comes to, the driven robot does.
They are found in an order of their own, those whose effector is near home first, and who asks is told of those up to
a distance: so what is answered depends on nothing that was asked before. Of poses that are images of each other
(`StaticModel.symmetries`) one is gone to, and a firm one that is known is not gone to again where it is foretold.
"""

import heapq
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.errors import IkError
from tripod_ik.model import Saved, StaticModel, foretold_miss, image_of
from tripod_ik.roadmap_path import DIGITS, Poses, RoadmapPaths, ShortestPaths
from tripod_ik.snap_through import LEAST_MARGIN, WITHIN
from tripod_ik.state import LinearState
from tripod_ik.symmetry import Image, table
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene
from tripod_sim.stability_margin import AMPLE_MARGIN
from tripod_sim.tables.short_forms import joints_of

SPACING = 0.2
"""Distance of the grid [rad]: wide enough that all of it is looked at in seconds."""

SHORTEST = 0.025
"""Part of that below which the end of the equilibria is not looked for more closely [rad]. With half of a step no way
leads from the flat piece, and none to all sheets at 12 mm of slide; with a quarter the poses found at
35 mm depend on the steps of Newton's method, 644 or 800; from 0.025 down to 0.012 there are 827."""

BEYOND = -0.04
"""A pose whose predicted ρ² (see `SnapThroughLimit`) is below this is beyond a snap-through: trying would take long."""

SAME = 1e-4
"""Positions of the effector that differ by less [m] belong to one equilibrium, or to a robot and its model."""

NEAR = 1.5 * SPACING
"""How far a pose may be from one of the grid that it is looked for from [rad]."""

FAR, TRIES = 1.2, 4
"""How far a pose may be that a state beyond the known ones is looked for from [rad], and so many poses near, and so
many far ones, at most: it is found from the first or second one, or hardly ever."""

DOUBT = 0.02
"""How much that a straight way misses [m] counts as a second more of it: it may be none."""

ITERATIONS, AT_ONCE = 25, 1.01 * SPACING
"""Of Newton's method, in a step of the model: what takes more is no small one; and the turn of the servos [rad] that is
made in one: from a firm pose to the next one of the grid."""

Cell = tuple[int, ...]
"""Angles from home, in steps of the grid."""


@dataclass(eq=False)
class Pose:
    """A pose of the grid.

    Attributes:
        state: The linearised state.
        saved: What brings the model there.
        level: How far the effector has to go from home on the way there [m], at least.
        cell: Where it is in the grid.
        images: Numbers of its images, in the order of `StaticModel.symmetries`.
        neighbours: Numbers of the poses that the body goes to from here by one step of one servo.
    """

    state: LinearState
    saved: Saved
    level: float
    cell: Cell
    images: list[int] = field(default_factory=list)
    neighbours: set[int] = field(default_factory=set)


class Roadmap:
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
        self._roads: tuple[int, RoadmapPaths] | None = None
        cell = (0,) * len(self._home)
        self._open = [(0.0, self._add(cell, home, 0.0), cell)]

    @classmethod
    def of(cls, scene: Scene, slide: float, progress: Callable[[int], None] | None = None) -> "Roadmap":
        """Return the roadmap of a scene, servo bodies slid in by `slide` [m]; its home is that of `StaticModel`."""
        joints = joints_of(scene)
        solver = replace(scene.solver, max_iterations=ITERATIONS, max_halvings=0, max_turn=AT_ONCE)
        if joints is None:
            raise IkError(
                f"scene {scene.name!r} has no servos, so inverse kinematics has nothing to solve; add [servos]"
            )
        return cls(StaticModel(replace(scene, solver=solver), slide), joints.low, joints.high, progress)

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
                self.poses.append(Pose(seen, image_of(saved, image), level, there))
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
                for a, b in zip(here.images, self.poses[found].images, strict=True):
                    self.poses[a].neighbours.add(b)
                    self.poses[b].neighbours.add(a)
                if found >= before:
                    yield found, there

    def _step(self, here: Pose, cell: Cell, angles: FloatArray, known: Sequence[int]) -> int | None:
        """Return the number of the pose that the body goes to from `here`, a new one if need be; None for none."""
        rho, slope = here.state.stability_margin, here.state.stability_margin_slope
        if rho * (rho + 2 * slope @ (angles - here.state.angles)) < BEYOND:
            return None
        if (number := self._goes_on_to(here.state, known)) is not None:
            return number
        self.model.restore(here.saved)
        try:
            state = self.model.follow(
                angles, shortest=SHORTEST, longest=SPACING / 2 if rho < AMPLE_MARGIN else SPACING
            )
        except (StepError, SceneError):
            return None
        for number in known:
            if _is_same(state, self.poses[number].state):
                return number
        if state.stability_margin < LEAST_MARGIN:
            return None
        return self._add(cell, state, max(here.level, self.distance(state.equilibrium)))

    def _goes_on_to(self, here: LinearState, known: Sequence[int]) -> int | None:
        """Return which of the poses known in a cell beside `here` need not be gone to, None for none or for several."""
        found = [n for n in known if _is_foretold(here, self.poses[n].state)]
        return found[0] if len(found) == 1 else None

    def near(
        self,
        state: LinearState,
        among: Iterable[int],
        ways: ShortestPaths | None = None,
        within: float = NEAR,
    ) -> list[tuple[float, int]]:
        """Return the poses of `among` with angles `within` [rad] of those of `state`, and about how long it takes [s]
        to come there by each.

        The quickest is first. `ways`: to these poses, if not from there. What a straight way misses, as the
        Jacobians foretell it, counts, too.
        """
        near = [n for n in among if np.abs(self.poses[n].state.angles - state.angles).max() <= within + 1e-9]
        poses = Poses([*(self.poses[n].state for n in near), state])
        here, there = np.arange(len(near)), np.full(len(near), len(near))
        times = poses.durations(here, there) + poses.misses(here, there) / DOUBT
        found = ((time + (ways.time(n) if ways else 0.0), n) for time, n in zip(times, near, strict=True))
        return sorted((round(float(time), DIGITS), n) for time, n in found if time < np.inf)

    def comes_to(self, state: LinearState, number: int) -> bool:
        """Bring the model from a pose to `state`; return whether there is a way.

        That is by poses that are hardly softer than it, or than `LEAST_MARGIN`.
        """
        self.model.restore(self.poses[number].saved)
        least_margin = WITHIN * min(LEAST_MARGIN, max(state.stability_margin, 0.0))
        try:
            here = self.model.follow(
                state.angles, least_margin=least_margin, shortest=SHORTEST / 2, longest=SPACING / 2
            )
        except (StepError, SceneError):
            return False
        return _is_same(here, state)

    def find(self, state: LinearState, among: Iterable[int]) -> int | None:
        """Bring the model to `state`; return the number of the pose that it came from, one of `among`.

        None where the model has no such equilibrium, or none that it comes to from there. Poses near it come first; of
        those that are farther away a few are tried.
        """
        tried = self.near(state, among)[:TRIES]
        if (found := next((number for _, number in tried if self.comes_to(state, number)), None)) is not None:
            return found
        known = {number for _, number in tried}
        far = [number for _, number in self.near(state, among, within=FAR) if number not in known]
        return next((number for number in far[:TRIES] if self.comes_to(state, number)), None)

    @property
    def roads(self) -> RoadmapPaths:
        """ShortestPaths between the poses known so far."""
        if self._roads is None or self._roads[0] != len(self.poses):
            cells, neighbours = [p.cell for p in self.poses], [p.neighbours for p in self.poses]
            self._roads = len(self.poses), RoadmapPaths([p.state for p in self.poses], cells, neighbours)
        return self._roads[1]


def _is_foretold(here: LinearState, there: LinearState) -> bool:
    """Return whether both are firm, and foretold by the Jacobians to half of what equilibria differ by."""
    return (
        min(here.stability_margin, there.stability_margin) >= AMPLE_MARGIN
        and foretold_miss(here, there) < SAME / 2
    )


def _is_same(state: LinearState, other: LinearState) -> bool:
    return bool(np.abs(state.equilibrium - other.equilibrium).max() < SAME)
