"""The closest pose that the driven robot comes to without a snap, and the way there."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Self

import numpy as np

from tripod_graph.names import WORKING_SLIDE
from tripod_ik.arrays import FloatArray
from tripod_ik.atlas import APART, CALM, SAME, SHORTEST, Atlas, Foretold
from tripod_ik.inverse import InverseSolver, Outcome, Solution
from tripod_ik.limits import AngleLimit, Motion
from tripod_ik.model import Saved, StaticModel, working_angles
from tripod_ik.row_limits import RowLimit
from tripod_ik.snap import WITHIN
from tripod_ik.state import LinearState
from tripod_ik.tasks import Task, total_distance
from tripod_ik.way import NOWHERE, Way
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene
from tripod_sim.scene_short import joints_of

MARGIN = 2e-3
"""Of a target that is not met, poses are looked at that are as far from home as it is, and by this farther [m]."""

SEEDS = 20
"""How many of them a search begins at, at most."""

FIRST, PROGRAMS = 15, 80
"""Programs for each of these, and for each that may then end as good as the best one."""

NEARLY = 1e-4
"""Where a linear step misses less [m], a search may meet the target."""

CLOSE = 0.2
"""Part of the distances of other poses up to which two searches have come to one."""

GOOD = 1.3
"""A search that misses at most so many times what the best one does is continued: a snap is come to slowly."""

ITERATIONS = 25
"""Of Newton's method, in a step of the model."""

MOST = 200
"""Poses that are looked at to find the present one, at most."""

ALL = 800
"""Poses that are looked at for one target that is not met, at most."""

LONGEST = 0.1
"""Part of a way that is tried at once [rad]."""

DRAWN = 3
"""Times that a stop of a way is drawn in, at most, by half of what it is off the straight line."""

Stop = tuple[Saved, LinearState]
"""A pose of a way: what brings the model there, and its state."""

Found = tuple[Solution, Saved, int]
"""A solution, what brings the model there, and the number of the pose of the atlas that it was found from."""


class Pathfinder:
    """Finds poses of one model, and ways to them. What is found out about the model is remembered.

    Attributes:
        model: Left anywhere.
        count: Programs solved so far, and poses looked at.
        hurry: Asked during a flood whether it is to end: somebody waits for another answer.
    """

    def __init__(
        self,
        model: StaticModel,
        angles: AngleLimit,
        row_limits: Sequence[RowLimit] = (),
        *,
        tolerance: float = 1e-6,
        progress: Callable[[int, float], None] | None = None,
    ) -> None:
        """Begin at the model's home.

        Args:
            model: The robot; it is left anywhere.
            angles: Limits of the angles.
            row_limits: Of torques and effector.
            tolerance: What may be missing of a target that is met [m].
            progress: Called with the number of programs and poses so far and with what the best one misses [m].
        """
        low, high = angles.interval(Motion(model.go_home(), model.angles, 0.0))
        self._atlas = Atlas(model, low, high, row_limits)
        self.model, self._tolerance, self._progress = model, tolerance, progress
        self.count = 0
        self._trails: dict[int, list[Stop]] = {}
        self.hurry: Callable[[], bool] = lambda: False
        self._solver = InverseSolver(
            model, angles, row_limits=row_limits, tolerance=tolerance, any_branch=True, smooth=True,
        )  # fmt: skip

    @classmethod
    def of(
        cls,
        scene: Scene,
        slide: float,
        angles: AngleLimit,
        row_limits: Sequence[RowLimit] = (),
        *,
        home: FloatArray | None = None,
        tolerance: float = 1e-6,
        progress: Callable[[int, float], None] | None = None,
    ) -> Self:
        """Return the pathfinder of a scene, servo bodies slid in by `slide` [m].

        Without `home`, angles [rad], that of its model depends on `slide` alone, in proportion between the flat and
        the working pose: there the strips are stretched. The model gives up early: what takes many iterations is no
        small step.
        """
        solver = replace(scene.solver, max_iterations=ITERATIONS, max_halvings=0)
        if home is None:
            joints = joints_of(scene)
            count = joints.count if joints else 0  # of none the model refuses the scene
            home = np.clip(working_angles(count) * slide / WORKING_SLIDE, angles.low, angles.high)
        model = StaticModel(replace(scene, solver=solver), slide, home)
        return cls(model, angles, row_limits, tolerance=tolerance, progress=progress)

    def closest(self, tasks: Sequence[Task], near: FloatArray) -> Found:
        """Return the pose that meets `tasks` best, and from which pose of the atlas it was found.

        First the flood goes downhill to where the target may be met. What that leads to need not be the closest pose:
        the sheets of equilibria hang together far from the target. So where it is not met all is flooded that is no
        farther from home than the target, unless `hurry` says so.

        Args:
            tasks: What to do.
            near: Of poses equally good the one nearest to these angles [rad] is taken, shape (s,).
        """
        missed = Foretold(tasks)
        self._trails.clear()
        self._downhill(missed)
        best = self._polished(tasks, missed, near)
        if best[0].outcome is Outcome.REACHED:
            return best
        before = len(self._atlas.poses)
        met = self._all_round(tasks, missed)
        if met or len(self._atlas.poses) == before:
            return met or best
        return self._polished(tasks, missed, near)

    def _polished(self, tasks: Sequence[Task], missed: Foretold, near: FloatArray) -> Found:
        """Return the best pose that searches from promising ones end in."""
        begun: list[Found] = []
        least = np.inf
        for number in self._atlas.promising(missed, SEEDS):
            pose = self._atlas.poses[number]
            if missed(pose.state) > least + MARGIN:
                continue
            begun.append(self._descended(tasks, pose.saved, number, FIRST))
            least = min(least, begun[-1][0].residual)
            if begun[-1][0].outcome is Outcome.REACHED:
                return begun[-1]
        best: Found | None = None
        ended: list[LinearState] = []
        for solution, there, number in begun:
            if solution.residual > GOOD * least or any(_alike(solution.state, other) for other in ended):
                continue
            ended.append(solution.state)
            found = solution, there, number
            if solution.outcome is Outcome.UNFINISHED:
                found = self._descended(tasks, there, number, PROGRAMS)
            better = best[0].residual - found[0].residual if best else np.inf
            nearer = best and np.linalg.norm(found[0].state.angles - near) < np.linalg.norm(
                best[0].state.angles - near
            )
            if better > SAME / 100 or (nearer and better > -SAME / 100):
                best = found
        assert best
        self.model.restore(best[1])
        return best

    def _descended(self, tasks: Sequence[Task], saved: Saved, number: int, most: int) -> Found:
        self.model.restore(saved)
        found = self._solver.descend(tasks, most)
        self.count += found.iterations
        there = self.model.save()
        self._trails[id(there)] = [
            *self._trails.get(id(saved), []),
            *self._solver.trail,
            (there, found.state),
        ]
        return found, there, number

    def _downhill(self, missed: Foretold) -> None:
        """Look at poses that come nearer than any known one, until one may meet the target."""
        least = min(missed(pose.state) for pose in self._atlas.poses)
        for next_one in self._atlas.explore(missed):
            if next_one > least or least < self._tolerance:
                break
            least = next_one
            self._tell(least)

    def _all_round(self, tasks: Sequence[Task], missed: Foretold) -> Found | None:
        """Look at all poses that are no farther from home than the target, but for `MARGIN`; return the first that a
        search meets the target from.
        """
        home, seen = self._atlas.poses[0].state, len(self._atlas.poses)
        least = min(missed(pose.state) for pose in self._atlas.poses)
        asked = [task.rows(home) for task in tasks]
        far = total_distance(tasks, [rows.error for rows in asked]) + MARGIN

        def from_home(state: LinearState) -> float:
            rows = [task.rows(state) for task in tasks]
            return total_distance(tasks, [h.error - r.error for h, r in zip(asked, rows, strict=True)])

        for count, next_one in enumerate(self._atlas.explore(from_home)):
            for number in range(seen, len(self._atlas.poses)):
                pose = self._atlas.poses[number]
                if missed(pose.state) < NEARLY:
                    found = self._descended(tasks, pose.saved, number, FIRST)
                    if found[0].outcome is Outcome.REACHED:
                        return found
            seen = len(self._atlas.poses)
            if next_one > far or count == ALL or self.hurry():
                break
            self._tell(least)
        return None

    def _tell(self, least: float) -> None:
        self.count += 1
        if self._progress:
            self._progress(self.count, least)

    def way(self, state: LinearState, tasks: Sequence[Task], *, hurry: bool = False) -> Way:
        """Return the way from `state` to the pose that meets `tasks` best; `NOWHERE` where the model does not come to
        `state`. It is an `Ask` that answers at once, so that `hurry` is nothing to it.
        """
        start = self._atlas.find(state, MOST)
        if start is None:
            return NOWHERE
        here = self.model.save()
        best, there, number = self.closest(tasks, state.angles)
        poses = [self._atlas.poses[n] for n in self._atlas.path(start, number)]
        stops = [(here, state), *((p.saved, p.state) for p in poses), *self._trails[id(there)]]
        kept, at = [stops[0]], 0
        while at < len(stops) - 1:
            after = len(stops) - 1
            while after > at + 1 and not self._is_straight(stops[at], stops[after]):
                after = at + (after - at + 1) // 2
            at = after
            kept.append(stops[at])
        for i in range(1, len(kept) - 1):
            kept[i] = self._drawn_in(*kept[i - 1 : i + 2])
        return Way(
            np.array([stop.angles for _, stop in kept[1:]]).reshape(-1, len(state.angles)),
            best.residual,
            best.active_limits,
        )

    def _drawn_in(self, before: Stop, stop: Stop, after: Stop) -> Stop:
        """Return a stop nearer to the straight line between its neighbours, where the ways stay as firm: the grid is
        coarse.
        """
        whole = after[1].angles - before[1].angles
        for _ in range(DRAWN):
            here = stop[1].angles
            along = float((here - before[1].angles) @ whole) / max(float(whole @ whole), 1e-12)
            part = min(max(along, 0.0), 1.0)
            self.model.restore(stop[0])
            try:
                state = self.model.follow(
                    0.5 * (here + before[1].angles + part * whole), shortest=SHORTEST / 4
                )
            except (StepError, SceneError):
                break
            nearer = self.model.save(), state
            if not (self._is_straight(before, nearer) and self._is_straight(nearer, after)):
                break
            stop = nearer
        return stop

    def _is_straight(self, start: Stop, end: Stop) -> bool:
        """Return whether the body goes straight from one pose to another, and hardly softer than these."""
        self.model.restore(start[0])
        softest = WITHIN * min(CALM, start[1].firmness, end[1].firmness)
        try:
            found = self.model.follow(end[1].angles, softest=softest, shortest=SHORTEST / 4, longest=LONGEST)
        except (StepError, SceneError):
            return False
        return bool(np.abs(found.equilibrium - end[1].equilibrium).max() < SAME)


def _alike(state: LinearState, other: LinearState) -> bool:
    """Return whether two searches have come to where they go on to the same pose."""
    turn, move = state.angles - other.angles, state.equilibrium - other.equilibrium
    return bool(np.abs(turn).max() < CLOSE * APART and np.abs(move).max() < CLOSE * MARGIN)
