"""The closest pose that the driven robot comes to without a snap, and the way there."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Self

import numpy as np

from tripod_graph.names import WORKING_POSE
from tripod_ik.arrays import FloatArray
from tripod_ik.atlas import CALM, SAME, SHORTEST, Atlas, foretold
from tripod_ik.inverse import InverseSolver, Outcome, Solution
from tripod_ik.limits import AngleLimit, Motion
from tripod_ik.model import Saved, StaticModel
from tripod_ik.row_limits import RowLimit
from tripod_ik.snap import WITHIN
from tripod_ik.state import LinearState
from tripod_ik.tasks import Task
from tripod_ik.way import NOWHERE, Way
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene

MARGIN = 2e-3
"""Poses that come nearer than the best one does, but for this [m], are looked at in the search for a better one."""

SEEDS = 4
"""How many of them a search begins at."""

PROGRAMS = 80
"""Programs for each of these, at most."""

ITERATIONS = 25
"""Of Newton's method, in a step of the model."""

MOST = 400
"""Poses that one search looks at, at most."""

Found = tuple[Solution, Saved, int]
"""A solution, what brings the model there, and the number of the pose of the atlas that it was found from."""


class Pathfinder:
    """Finds poses of one model, and ways to them. What is found out about the model is remembered.

    Attributes:
        model: Left anywhere.
        count: Programs solved so far, and poses looked at.
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
        self._solver = InverseSolver(
            model, angles, row_limits=row_limits, tolerance=tolerance, max_iterations=PROGRAMS, any_branch=True,
            smooth=True,
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
            home = np.clip(np.array(WORKING_POSE[:3]) * slide / WORKING_POSE[3], angles.low, angles.high)
        model = StaticModel(replace(scene, solver=solver), slide, home)
        return cls(model, angles, row_limits, tolerance=tolerance, progress=progress)

    def closest(self, tasks: Sequence[Task], near: FloatArray) -> Found:
        """Return the pose that meets `tasks` best, and from which pose of the atlas it was found.

        Args:
            tasks: What to do.
            near: Of poses equally good the one nearest to these angles [rad] is taken, shape (s,).
        """
        best: Found | None = None
        tried: set[int] = set()
        for margin in (0.0, MARGIN):  # first downhill from what is known, then all round
            new = True
            while new:
                new = self._grow(tasks, best[0].residual if best else np.inf, margin)
                best = self._polished(tasks, near, tried, best)
                if best[0].outcome is Outcome.REACHED:
                    return best
        assert best
        return best

    def _polished(
        self, tasks: Sequence[Task], near: FloatArray, tried: set[int], best: Found | None
    ) -> Found:
        """Return the best pose that searches from promising ones end in, or `best`; add these to `tried`."""
        for number in self._atlas.promising(tasks, near, SEEDS):
            pose = self._atlas.poses[number]
            if number in tried or (best and foretold(tasks, pose.state) > best[0].residual):
                continue
            tried.add(number)
            self.model.restore(pose.saved)
            found = self._solver.descend(tasks)
            self.count += found.iterations
            if best is None or found.residual < best[0].residual - SAME / 100:
                best = found, self.model.save(), number
            if best[0].outcome is Outcome.REACHED:
                break
        assert best
        return best

    def _grow(self, tasks: Sequence[Task], least: float, margin: float) -> bool:
        """Look at poses that come nearer than `least` [m], or than any known one, but for `margin` [m].

        Returns whether there were new ones.
        """
        before = len(self._atlas.poses)
        least = min(least, *(foretold(tasks, pose.state) for pose in self._atlas.poses), np.inf)
        for count, next_one in enumerate(self._atlas.explore(lambda state: foretold(tasks, state))):
            if next_one > least + margin or count == MOST or (margin == 0.0 and least < self._tolerance):
                break
            least = min(least, next_one)
            self.count += 1
            if self._progress:
                self._progress(self.count, least)
        return len(self._atlas.poses) > before

    def way(self, state: LinearState, tasks: Sequence[Task]) -> Way:
        """Return the way from `state` to the pose that meets `tasks` best; `NOWHERE` where the model does not come to
        `state`.
        """
        start = self._atlas.find(state, MOST // 2)
        if start is None:
            return NOWHERE
        here = self.model.save()
        best, there, number = self.closest(tasks, state.angles)
        poses = [self._atlas.poses[n] for n in self._atlas.path(start, number)]
        stops = [(here, state), *((p.saved, p.state) for p in poses), (there, best.state)]
        way, at = [], 0
        while at < len(stops) - 1:
            after = len(stops) - 1
            while after > at + 1 and not self._is_straight(stops[at], stops[after]):
                after = at + (after - at + 1) // 2
            at = after
            way.append(stops[at][1].angles)
        return Way(np.array(way), best.residual, best.active_limits)

    def _is_straight(self, start: tuple[Saved, LinearState], end: tuple[Saved, LinearState]) -> bool:
        """Return whether the body goes straight from one pose to another, and hardly softer than these."""
        self.model.restore(start[0])
        softest = WITHIN * min(CALM, start[1].firmness, end[1].firmness)
        try:
            found = self.model.follow(end[1].angles, softest=softest, shortest=SHORTEST)
        except (StepError, SceneError):
            return False
        return bool(np.abs(found.equilibrium - end[1].equilibrium).max() < SAME)
