"""Poses to begin a search at: all over the angles allowed, the promising ones first."""

import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.merit import hard_limits_passed
from tripod_ik.model import Saved, StaticModel
from tripod_ik.row_limits import RowLimit
from tripod_ik.state import LinearState
from tripod_ik.tasks import Task, total_distance
from tripod_sim.errors import SceneError, StepError

POSES = 5
"""Angles of each servo: the pool has POSES³ poses."""

STARTS, APART = 6, 0.25
"""How many of them are begun at, and how far apart these are at least [rad]."""

METRES = 0.05
"""Distance that a radian beyond a hard limit counts, where starts are chosen [m]."""


class StartPool:
    """Poses of a model with angles from `low` to `high` [rad], shape (s,) each; computed when first asked for."""

    def __init__(self, model: StaticModel, low: FloatArray, high: FloatArray) -> None:
        self._model, self._axes = model, np.linspace(low, high, POSES).T
        self._poses: list[tuple[LinearState, Saved]] = []
        self._complete = False

    def promising(
        self,
        tasks: Sequence[Task],
        limits: Sequence[RowLimit],
        allowed: Callable[[LinearState], bool],
        end: float = np.inf,
    ) -> list[Saved]:
        """Return at most `STARTS` poses: near to what `tasks` ask, within `limits` or not far beyond.

        Args:
            tasks: What to do.
            limits: Of torques and effector.
            allowed: Tells of a pose whether it may be begun at.
            end: When to stop computing poses, on the clock `time.perf_counter` [s].
        """
        if not self._complete:
            self._poses.clear()
            self._poses.extend(self._spread(end))
            self._complete = time.perf_counter() < end
        ranked = []
        for state, pose in self._poses:
            if allowed(state):
                errors = [task.rows(state).error for task in tasks]
                ranked.append(
                    (total_distance(tasks, errors) + METRES * hard_limits_passed(state, limits), state, pose)
                )
        ranked.sort(key=lambda found: found[0])
        chosen: list[tuple[FloatArray, Saved]] = []
        for _, state, pose in ranked:
            if len(chosen) < STARTS and all(np.abs(state.angles - a).max() > APART for a, _ in chosen):
                chosen.append((state.angles, pose))
        return [pose for _, pose in chosen]

    def _spread(self, end: float) -> Iterator[tuple[LinearState, Saved]]:
        """Yield all poses that have an equilibrium, each reached from its neighbour."""
        for i, a in enumerate(self._axes[0]):
            for j, b in enumerate(self._axes[1][:: 1 if i % 2 == 0 else -1]):
                for c in self._axes[2][:: 1 if (i * POSES + j) % 2 == 0 else -1]:
                    if time.perf_counter() >= end:
                        return
                    try:
                        yield self._model.move(np.array([a, b, c])), self._model.save()
                    except (StepError, SceneError):
                        continue
