"""Inverse kinematics to the end: relinearised on the quasi-static model until nothing changes.

Where the tracker makes one step for each state that comes in, here the model is at hand: a step that makes things
worse, or that would leave the branch, is taken back and shortened. So the solution depends on the start only through
the branch that the start is on.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from tripod_ik.branch import branch, is_beyond
from tripod_ik.limits import AngleLimit, IntervalLimit, StepLimit
from tripod_ik.model import StaticModel
from tripod_ik.problem import IkProblem, build_ik
from tripod_ik.row_limits import RowLimit
from tripod_ik.solver import IkResult, IkSolver
from tripod_ik.state import LinearState
from tripod_ik.tasks import Task
from tripod_sim.errors import SceneError, StepError

LONGEST_STEP, SHORTEST_STEP = 0.3, 1e-8
"""Step limits [rad]: the first one tried, and the one below which no step helps any more."""


class Outcome(StrEnum):
    """How a solution came about."""

    REACHED = "reached"
    CLOSEST = "closest pose: the target is out of reach"
    UNFINISHED = "not converged"
    FAILED = "not solved"


@dataclass(frozen=True, eq=False)
class Solution:
    """Where the search ended; the model stands there.

    Attributes:
        outcome: REACHED within the tolerance; CLOSEST at a pose that no step betters; UNFINISHED where time or
            iterations ended before; FAILED where the quadratic program was not solved.
        reason: More about the last two, empty otherwise.
        state: The linearised state at the solution: angles, torques, pose of the effector.
        residual: What is missing in all [m], see `tasks.total_distance`.
        residuals: The same by task and unit.
        active_limits: Limits that keep the effector from coming closer.
        kkt: Residual of the optimality conditions of the last quadratic program [rad].
        step: Largest change of an angle that the program at the solution still asks for [rad].
        iterations: Programs solved.
    """

    outcome: Outcome
    reason: str
    state: LinearState
    residual: float
    residuals: Mapping[str, float]
    active_limits: tuple[str, ...]
    kkt: float
    step: float
    iterations: int


class InverseSolver:
    """Solves for poses on one model, with the same limits.

    Attributes:
        model: The robot; each solution starts where it stands and ends where it then stands.
    """

    def __init__(
        self,
        model: StaticModel,
        angles: AngleLimit,
        limits: Sequence[IntervalLimit] = (),
        row_limits: Sequence[RowLimit] = (),
        *,
        tolerance: float = 1e-6,
        accuracy: float = 1e-7,
        max_iterations: int = 200,
        any_branch: bool = False,
    ) -> None:
        """Keep the model and set OSQP up.

        Args:
            model: The robot.
            angles: Hard limits of the angles.
            limits: Further hard limits of the command.
            row_limits: Limits of torques and effector.
            tolerance: What may be missing for REACHED [m].
            accuracy: Step below which the search has converged [rad].
            max_iterations: Programs to solve at most.
            any_branch: Whether a pose on another branch than that of the start will do too.
        """
        self.model = model
        self._limits, self._row_limits = (angles, *limits), tuple(row_limits)
        self._tolerance, self._accuracy = tolerance, accuracy
        self._max_iterations, self._any_branch = max_iterations, any_branch
        n = len(model.angles)
        self._solver = IkSolver(n, rows=sum(limit.size(n) for limit in row_limits))

    def solve(self, tasks: Sequence[Task], *, time_limit: float = np.inf) -> Solution:
        """Return the pose that meets `tasks` best, on the branch of the present pose.

        Args:
            tasks: What to do.
            time_limit: After which no further iteration begins [s].
        """
        model, end = self.model, time.perf_counter() + time_limit
        state, longest = model.state(), LONGEST_STEP
        side = branch(state, tasks)
        iterations, outcome, reason = 0, Outcome.UNFINISHED, ""
        while True:
            problem = build_ik(state, tasks, [*self._limits, StepLimit(longest)], self._row_limits)
            result = self._solver.solve(problem)
            iterations += 1
            step = float(np.abs(result.command - state.angles).max())
            if not result.ok:
                outcome, reason = Outcome.FAILED, result.status
            elif step <= self._accuracy or longest < SHORTEST_STEP:
                outcome = Outcome.REACHED if result.error <= self._tolerance else Outcome.CLOSEST
            elif iterations >= self._max_iterations:
                reason = f"{iterations} iterations, the last step was {step:.2g} rad"
            elif time.perf_counter() >= end:
                reason = f"the time limit of {time_limit:g} s ended after {iterations} iterations"
            else:
                better = self._advance(problem, result, side)
                longest = min(2 * longest, LONGEST_STEP) if better else min(longest, step) / 4
                state = better or state
                continue
            return Solution(
                outcome, reason, state, result.error, _now(problem),
                tuple(n for n in result.active_limits if not n.endswith(" step")), result.kkt, step, iterations,
            )  # fmt: skip

    def _advance(self, problem: IkProblem, result: IkResult, side: float) -> LinearState | None:
        """Move the model to the command; return the state there, or None where that is no progress, and go back."""
        before = self.model.save()
        try:
            state = self.model.move(result.command)
        except (StepError, SceneError):
            self.model.restore(before)
            return None
        same = self._any_branch or not is_beyond(branch(state, problem.tasks), side)
        gain = self._merit(problem, problem.state) - self._merit(problem, state)
        if same and gain >= -1e-12:
            return state
        self.model.restore(before)
        return None

    def _merit(self, problem: IkProblem, state: LinearState) -> float:
        """Return what `problem` minimises, at `state`, with the scales of the problem's own state [rad²]."""
        Se = [r.weights * r.error for r in (task.rows(state) for task in problem.tasks)]
        SJ = np.concatenate([r.weights[:, None] * r.jacobian for r in problem.rows])
        n = len(state.angles)
        mu = sum(r.curvature * float(np.linalg.norm(r.weights**2 * r.error)) for r in problem.rows)
        value = sum(float(e @ e) for e in Se) / (2 * max(float(np.sum(SJ**2)) / n + mu, 1e-18))
        for limit in self._row_limits:
            there, scale = limit.rows(state), np.linalg.norm(limit.rows(problem.state).matrix, axis=1)
            beyond = np.maximum(np.maximum(there.low, -there.high), 0.0)
            value += limit.weight / 2 * float(np.sum((beyond / np.maximum(scale, 1e-9)) ** 2))
        return value


def _now(problem: IkProblem) -> dict[str, float]:
    residuals: dict[str, float] = {}
    for task, rows in zip(problem.tasks, problem.rows, strict=True):
        residuals.update(task.distances(rows.error))
    return residuals
