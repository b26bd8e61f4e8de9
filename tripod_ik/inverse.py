"""Inverse kinematics to the end: relinearised on the quasi-static model until nothing changes.

Where the tracker makes one step for each state that comes in, here the model is at hand: a step that makes things
worse, or that would leave the branch, is taken back and shortened. Searches begin at the model's home, a fixed pose, as
long as that is on the branch of the present one: so nothing but the target and the branch decides. From a home that is
soft, such as the flat piece, the search keeps off snaps: each step is followed along the equilibria
(`StaticModel.follow`), and stability margin is limited as the tracker does (`SnapThroughLimit`).
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.branch import branch, is_beyond
from tripod_ik.limits import AngleLimit, IntervalLimit, Motion, StepLimit
from tripod_ik.merit import corrected, hard_limits_passed, merit
from tripod_ik.model import Saved, StaticModel
from tripod_ik.problem import IkProblem, build_ik, seen_turning
from tripod_ik.row_limits import RowLimit, tension_limits
from tripod_ik.snap_through import LEAST_MARGIN, SNAP, SnapThroughLimit, longest_step
from tripod_ik.solver import IkResult, IkSolver
from tripod_ik.starts import StartPool
from tripod_ik.state import LinearState
from tripod_ik.tasks import PositionTask, Task, total_distance
from tripod_sim.errors import SceneError, StepError
from tripod_sim.stability_margin import AMPLE_MARGIN

LONGEST_STEP, SHORTEST_STEP = 0.3, 1e-8
"""Step limits [rad]: the first one tried, and the one below which no step helps any more."""

SHARE = 0.5
"""What a step may use of what is left to a snap, see `SnapThroughLimit`."""

CREEPING, CREPT = 30, 0.03
"""A search that meets a snap ends where so many programs bring it closer by less than that share of what is missing: it
creeps along the snap, and from another start it may get around that."""

STALLED, BETTERED = 10, 1e-3
"""A search whose steps are shortened ends at the closest pose where so many programs bring it closer by less than that
share of what is missing: at an end of the equilibria it would go on for ever, in ever smaller steps."""

PASSED = 1e-6
"""A solution keeps its hard limits if it passes none by more than this [rad]: 15 nm of the effector, 2e-7 N m."""

SETTLES = 3
"""Solutions that the body may leave for its other equilibrium before the first of them is taken."""

STRETCHED = 0.9
"""Angles that are farther above those of the model's home [rad] let the strips hang: searches do not begin there."""


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
        outcome: REACHED within the tolerance; CLOSEST at a pose that no step betters, or none by much; UNFINISHED
            where time or iterations ended before; FAILED where the quadratic program was not solved.
        reason: More about the last two, and where a body hangs so slack that it need not be as the solution has it.
        state: The linearised state at the solution: angles, torques, pose of the effector.
        residual: What is missing in all [m], see `tasks.total_distance`.
        residuals: The same by task and unit.
        active_limits: Limits that keep the effector from coming closer.
        kkt: Residual of the optimality conditions of the last quadratic program [rad].
        step: Largest change of an angle that the program at the solution still asks for [rad].
        iterations: Programs solved.
        passed: How far the pose is beyond the hard limits of torques and effector, as an angle [rad]: above 1e-6 where
            no pose that keeps to them was found.
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
    passed: float


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
        max_iterations: int = 300,
        any_branch: bool = False,
        smooth: bool = False,
        progress: Callable[[int, float], None] | None = None,
    ) -> None:
        """Keep the model and set OSQP up.

        Args:
            model: The robot.
            angles: Hard limits of the angles.
            limits: Further hard limits of the command.
            row_limits: Limits of torques and effector.
            tolerance: What may be missing for REACHED [m].
            accuracy: Step below which the search has converged [rad].
            max_iterations: Programs to solve at most, in all that one solution takes.
            any_branch: Whether a pose on another branch than that of the start will do too.
            smooth: Whether to keep off snaps from a firm home, too; else corners that hang slack are searched as well.
            progress: Called with the number of programs solved so far and with what the last one found missing [m].
        """
        self.model = model
        self._angles, self._further, self._row_limits = angles, tuple(limits), tuple(row_limits)
        self._tolerance, self._accuracy = tolerance, accuracy
        self._max_iterations, self._any_branch = max_iterations, any_branch
        stability_margin = _home_stability_margin(model)
        self._snapping = stability_margin >= AMPLE_MARGIN and not smooth
        self._turning = 0.0
        self._pooled = not model.state().held
        self._kept_to = (
            *self._row_limits,
            *tension_limits(model.state()),
            SnapThroughLimit(min(LEAST_MARGIN, stability_margin), share=SHARE),
        )
        n = len(model.angles)
        self._solver = IkSolver(n, rows=sum(limit.size(n) for limit in self._kept_to))
        self._pool: StartPool | None = None
        self._progress, self._count = progress, 0
        self.trail: list[tuple[Saved, LinearState]] = []

    def solve(
        self, tasks: Sequence[Task], *, time_limit: float = np.inf, everywhere: bool = False
    ) -> Solution:
        """Return the pose that meets `tasks` best, on the branch of the present pose.

        Limits leave a set of poses that need not be convex, nor of one piece: the pose that no step betters need not be
        the best one. Where a limit is active, `everywhere` begins again from poses all over the angles allowed, and
        from where the target would be met without limits of torques and effector.

        Args:
            tasks: What to do.
            time_limit: After which no further iteration begins [s].
            everywhere: Whether to look further where a limit is active; of servos alone.
        """
        end = time.perf_counter() + time_limit
        self._count = 0
        side = branch(self.model.state(), tasks)
        found = self._from_home(tasks, side, end, time_limit)
        if not (everywhere and self._pooled) or not self._may_be_elsewhere(tasks, found):
            return found
        best, here = found, self.model.save()
        count = found.iterations
        self.model.go_home()
        for pose in self._starts(tasks, side, end):
            if time.perf_counter() >= end or self._count >= self._max_iterations:
                break
            self.model.restore(pose)
            other = self._settled(tasks, side, end, time_limit)
            count += other.iterations
            if _is_better(other, best):
                best, here = other, self.model.save()
        self.model.restore(here)
        return replace(best, iterations=count)

    def _seen(self, state: LinearState) -> LinearState:
        """Return `state`; from a firm home without what it tells of snaps: slack corners lie beyond these."""
        n = len(state.angles)
        return (
            replace(state, stability_margin=1.0, stability_margin_slope=np.zeros(n))
            if self._snapping
            else state
        )

    def _may_be_elsewhere(self, tasks: Sequence[Task], found: Solution) -> bool:
        """Return whether a limit could hide a better pose.

        Where nothing but a box keeps the effector from a position, it is at the point of the box that is nearest to
        that, and no pose is better. A snap is no limit in this sense: what lies beyond it is another branch.
        """
        active = set(found.active_limits) - {SNAP}
        boxed = all(isinstance(task, PositionTask) for task in tasks) and all(
            name.startswith("effector ") for name in active
        )
        return found.passed > PASSED or bool(active and not boxed)

    def _from_home(self, tasks: Sequence[Task], side: float, end: float, time_limit: float) -> Solution:
        """Solve from the model's home, so that nothing but the target and the branch decides; from here if it is met
        here, if home is on another branch, or if from home it is not reached.
        """
        state, here = self.model.state(), self.model.save()
        met = total_distance(tasks, [task.rows(state).error for task in tasks]) <= self._tolerance
        if met or not (self._any_branch or branch(self.model.go_home(), tasks) * side > 0):
            self.model.restore(here)
            return self._settled(tasks, side, end, time_limit)
        found = self._settled(tasks, side, end, time_limit)
        if found.outcome is Outcome.REACHED or np.array_equal(self.model.home, state.angles):
            return found
        there = self.model.save()
        self.model.restore(here)
        other = self._settled(tasks, side, end, time_limit)
        if _is_better(other, found):
            return other
        self.model.restore(there)
        return found

    def _settled(self, tasks: Sequence[Task], side: float, end: float, time_limit: float) -> Solution:
        """Solve as `_descend`, to a pose in which the body is whatever its way, see `StaticModel.settle`."""
        found, first = self._descend(tasks, side, end, time_limit), self.model.save()
        again, count = found, found.iterations
        for _ in range(SETTLES):
            if not self.model.settle():
                return replace(again, iterations=count)
            if not (self._snapping or self._any_branch or branch(self.model.state(), tasks) * side > 0):
                break  # there the straight way leads to another branch
            again = self._descend(tasks, side, end, time_limit)
            count += again.iterations
        self.model.restore(first)
        reason = (
            found.reason
            or "the body has two equilibria there; which one the robot takes depends on how it gets there"
        )
        return replace(found, reason=reason, iterations=count)

    def descend(self, tasks: Sequence[Task], most: int) -> Solution:
        """Return the pose near the present one that no step betters, on its branch unless any will do, or where `most`
        programs lead to; `trail` has the poses on the way.
        """
        self._count, self._max_iterations = 0, most
        self.trail = []
        return self._descend(tasks, branch(self.model.state(), tasks), np.inf, np.inf)

    def _descend(self, tasks: Sequence[Task], side: float, end: float, time_limit: float) -> Solution:
        """Solve from where the model stands, on the branch of `side`, until `end` on the clock [s]."""
        state, longest = self._seen(self.model.state()), LONGEST_STEP
        outcome, reason, snaps, missing = Outcome.UNFINISHED, "", False, list[float]()
        while True:
            problem = build_ik(
                state,
                tasks,
                [
                    self._angles,
                    *self._further,
                    StepLimit(min(longest, longest_step(state))),
                ],
                self._kept_to,
                turning=self._turning,
            )
            result = self._solver.solve(problem)
            missing.append(result.error)
            snaps = snaps or SNAP in result.active_limits
            self._count += 1
            if self._progress:
                self._progress(self._count, result.error)
            step = float(np.abs(result.command - state.angles).max())
            if not result.ok:
                if longest >= SHORTEST_STEP and self._count < self._max_iterations:
                    longest /= 4
                    continue
                outcome, reason = Outcome.FAILED, result.status
            elif (
                step <= self._accuracy or longest < SHORTEST_STEP or (not snaps and _stalls(missing, result))
            ):
                outcome = Outcome.REACHED if result.error <= self._tolerance else Outcome.CLOSEST
            elif self._count >= self._max_iterations or (snaps and _creeps(missing, CREEPING, CREPT)):
                reason = f"stopped after {self._count} iterations, the last step was {step:.2g} rad"
                if snaps:
                    reason += (
                        ", along poses close to a snap (a jump to another shape); start from another pose"
                    )
            elif time.perf_counter() >= end:
                reason = f"stopped at the time limit of {time_limit:g} s after {len(missing)} iterations"
            else:
                better = self._advance(problem, result, side)
                if better:
                    self._turning = max(self._turning / 2, seen_turning(state, better))
                    self.trail.append((self.model.save(), better))
                longest = min(2 * longest, LONGEST_STEP) if better else min(longest, step) / 4
                state = better or state
                continue
            return Solution(
                outcome, reason, state, result.error, _now(problem),
                tuple(n for n in result.active_limits if not n.endswith(" step")), result.kkt, step, len(missing),
                hard_limits_passed(state, self._row_limits),
            )  # fmt: skip

    def _advance(self, problem: IkProblem, result: IkResult, side: float) -> LinearState | None:
        """Move the model to the command; return the state there, or None where that is no progress, and go back."""
        before, present = self.model.save(), merit(problem, problem.state, self._kept_to)
        state = self._moved(result.command)
        if state and self._is_progress(problem, present, state, side):
            return state
        if state and set(result.active_limits) & set(problem.names):
            step = state.angles - problem.state.angles
            mended = self._solver.solve(corrected(problem, step, state, self._kept_to))
            state = self._moved(mended.command) if mended.ok else None
            if state and self._is_progress(problem, present, state, side):
                return state
        self.model.restore(before)
        return None

    def _moved(self, command: FloatArray) -> LinearState | None:
        """Return the state of the model at `command` [rad], or None where it does not get there."""
        try:
            if self._snapping:
                return self._seen(self.model.move(command))
            return self._seen(self.model.follow(command, longest=LONGEST_STEP / 3, shortest=0.05))
        except (StepError, SceneError):
            return None

    def _is_progress(self, problem: IkProblem, present: float, state: LinearState, side: float) -> bool:
        same = self._any_branch or not is_beyond(branch(state, problem.tasks), side)
        return same and present - merit(problem, state, self._kept_to) >= -1e-12

    def _starts(self, tasks: Sequence[Task], side: float, end: float) -> Iterator[Saved]:
        """Yield poses to begin at: where the target is met without row limits, then the most promising of the pool."""
        start = self.model.save()
        free = InverseSolver(self.model, self._angles, self._further, any_branch=self._any_branch)
        free._descend(tasks, side, end, np.inf)
        yield self.model.save()
        self.model.restore(start)
        if self._pool is None:
            low, high = self._angles.interval(Motion(self.model.state(), self.model.angles, 0.0))
            self._pool = StartPool(
                self.model, low, np.maximum(np.minimum(high, self.model.home + STRETCHED), low)
            )
        yield from self._pool.promising(
            tasks, self._row_limits, lambda s: self._any_branch or branch(s, tasks) * side >= 0, end
        )


def _home_stability_margin(model: StaticModel) -> float:
    here = model.save()
    stability_margin = model.go_home().stability_margin
    model.restore(here)
    return stability_margin


def _stalls(missing: Sequence[float], result: IkResult) -> bool:
    """Return whether steps that would be longer hardly make what is missing [m] less."""
    return any(n.endswith(" step") for n in result.active_limits) and _creeps(missing, STALLED, BETTERED)


def _creeps(missing: Sequence[float], programs: int, share: float) -> bool:
    """Return whether so many programs have made what was found missing [m] less by no more than a share of it."""
    return len(missing) > programs and missing[-1] > (1 - share) * missing[-1 - programs]


def _is_better(solution: Solution, other: Solution) -> bool:
    """Return whether a solution keeps the limits where the other does not, or comes closer; never if it failed."""
    kept, before = solution.passed <= PASSED, other.passed <= PASSED
    closer = solution.residual < other.residual - 1e-9
    return solution.outcome is not Outcome.FAILED and (kept > before or (kept == before and closer))


def _now(problem: IkProblem) -> dict[str, float]:
    residuals: dict[str, float] = {}
    for task, rows in zip(problem.tasks, problem.rows, strict=True):
        residuals.update(task.distances(rows.error))
    return residuals
