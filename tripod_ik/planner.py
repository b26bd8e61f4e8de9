"""The closest pose that the driven robot comes to without a snap, and the way there."""

from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.inverse import InverseSolver, Outcome, Solution
from tripod_ik.joint_path import NO_PATH, JointPath
from tripod_ik.limits import AngleLimit, Motion, StepLimit
from tripod_ik.merit import limits_passed
from tripod_ik.model import Saved
from tripod_ik.problem import build_ik
from tripod_ik.roadmap import SAME, SHORTEST, SPACING, Roadmap
from tripod_ik.roadmap_path import DIGITS, quickest, time_of
from tripod_ik.row_limits import RowLimit, TorqueLimit
from tripod_ik.snap_through import LEAST_MARGIN, WITHIN, longest_step
from tripod_ik.solver import IkSolver
from tripod_ik.state import LinearState
from tripod_ik.symmetry import Image
from tripod_ik.tasks import PositionTask, Task, TiltTask, total_distance
from tripod_sim.errors import SceneError, StepError

DAMPING = 1e-3
"""Of the step by which what a pose is near to is foretold [m/rad]."""

PROMISING, SEEDS = 80, 16
"""Poses of which a quadratic program foretells what they are near to, and of these where searches begin, at most."""

BEND = 0.03
"""How fast Jacobians turn [m/rad²], see `tasks.PositionTask`; by half of that times its square a step may miss less."""

CHUNK, PROGRAMS, LEAST = 5, 200, 80
"""Programs that a search solves at once, those of an answer, at most, and what is left of these to a second search, at
least."""

APART, OFF = 0.1, 5e-4
"""Poses whose angles [rad] and effectors [m] differ by less are on the way to the same one."""

GAIN = 1e-4
"""Part of what is missing that a search has to gain by so many programs to go on."""

FARTHEST, EVERY = 0.013, 4
"""Poses are looked at that are so far from home [m], from where a search goes on by itself. To one that is farther the
model comes by every fourth pose of the robot's trail."""

DETOUR, GAINED = 8e-3, 2e-3
"""No way takes the effector so much farther from what it is to do than where it begins [m], unless that brings it
closer by so much more [m]: a robot does not throw itself about for the little that a pose on a far sheet is closer.
"""

LONGEST = 0.1
"""Part of a way that is tried at once [rad]."""

CALM = 0.22
"""Stability margin that a straight way may always come down to where its ends are firmer: a softer one takes longer
than one round it.
"""

CUT, WORTH = 2, 0.04
"""Stops that are left out after the beginning of a way and before its end, at most, and time that this is to save
[s]: about what it takes to try it.
"""

Promise = tuple[float, float]
"""What a step may miss [m], and the square of how much longer it is than what is trusted near a snap: of steps that may
miss nothing the least daring is gone first.
"""

Stop = tuple[Saved, LinearState]
"""A pose of a way: what brings the model there, and its state."""


HERE = -1
"""In place of the number of a pose of the roadmap: where the robot is."""


@dataclass(frozen=True, eq=False)
class Found:
    """The end of a search.

    Attributes:
        solution: The pose.
        number: The pose of the roadmap that the search began at; `HERE`: where the robot is.
        trail: The poses from there to the end, in this order.
    """

    solution: Solution
    number: int
    trail: tuple[Stop, ...]


class Planner:
    """Finds poses of an roadmap, and ways to them. What it answers depends on nothing that it was asked before.

    Attributes:
        model: Left anywhere.
        count: Programs solved so far.
    """

    def __init__(
        self,
        roadmap: Roadmap,
        angles: AngleLimit,
        row_limits: Sequence[RowLimit] = (),
        *,
        tolerance: float = 1e-6,
        progress: Callable[[int, float], None] | None = None,
    ) -> None:
        """Look in `roadmap`.

        Args:
            roadmap: Poses of the robot; its model is left anywhere.
            angles: Limits of the angles.
            row_limits: Of torques and effector.
            tolerance: What may be missing of a target that is met [m].
            progress: Called with the number of programs so far and with what the best one misses [m].
        """
        self._roadmap, self.model, self._progress = roadmap, roadmap.model, progress
        self._angles, self._row_limits = angles, tuple(row_limits)
        home = roadmap.poses[0].state
        self._low, self._high = angles.interval(Motion(home, home.angles, 0.0))
        self._tolerance = tolerance
        self._symmetric = np.ptp(self._low) == 0.0 == np.ptp(self._high) and all(
            isinstance(limit, TorqueLimit) and np.ptp(limit.maximum) == 0.0 for limit in self._row_limits
        )
        self.count = 0
        n = len(home.angles)
        self._foretell = IkSolver(n, rows=sum(limit.size(n) for limit in self._row_limits))
        self._solver = InverseSolver(
            roadmap.model, angles, row_limits=row_limits, tolerance=tolerance, any_branch=True, smooth=True,
        )  # fmt: skip
        self._excess: dict[int, float] = {}

    def _beyond(self, number: int) -> float:
        """Return how far a pose is beyond the limits [rad]."""
        if number not in self._excess:
            state = self._roadmap.poses[number].state
            angles = max((self._low - state.angles).max(), (state.angles - self._high).max())
            self._excess[number] = max(0.0, float(angles), limits_passed(state, self._row_limits))
        return self._excess[number]

    def prepare(self) -> None:
        """Find the poses that every answer looks at: what takes long of the first one."""
        self._roadmap.within(FARTHEST)
        _ = self._roadmap.roads

    def around(self, state: LinearState, trail: Sequence[LinearState] = ()) -> tuple[list[int], list[Stop]]:
        """Bring the model to `state`; return the poses that hang together with that, by poses within the limits, the
        nearest one first, and the stops from there to `state`; no poses where the model does not come to `state`.

        `trail`: states that the robot came by. A state farther off than the poses of the roadmap is come to by these.
        """
        inside = self._roadmap.within(FARTHEST)
        stops: list[Stop] = []
        start = self._roadmap.find(state, inside)
        if start is None:
            start, stops = self._along(trail, state, inside)
        return ([], []) if start is None else (self._hanging_together(start, inside), stops)

    def _along(
        self, trail: Sequence[LinearState], state: LinearState, inside: Collection[int]
    ) -> tuple[int | None, list[Stop]]:
        """Bring the model to `state` along a trail; return the pose that it came from and the stops on the way."""
        near = [k for k, passed in enumerate(trail) if self._roadmap.distance(passed.equilibrium) < FARTHEST]
        for first in sorted({0, *near[-1:]}, reverse=True) if trail else ():
            if (start := self._roadmap.find(trail[first], inside)) is None:
                continue
            stops = [(self.model.save(), trail[first])]
            with suppress(StepError, SceneError):
                for there in (*trail[first + 1 :: EVERY], state):
                    passed = self.model.follow(there.angles, shortest=SHORTEST / 2)
                    stops.append((self.model.save(), passed))
                if np.abs(passed.equilibrium - state.equilibrium).max() < SAME:
                    return start, stops[:-1]
        return None, []

    def _hanging_together(self, start: int, among: Collection[int]) -> list[int]:
        """Return the poses of `among` that hang together with `start`, that first, by poses within the limits.

        That is to a step of the grid; from a pose that is farther beyond them it may go on to one that is no farther.
        """
        found, seen = [start], {start}
        for number in found:
            for other in self._roadmap.poses[number].neighbours:
                allowed = self._beyond(other) <= max(SPACING, self._beyond(number))
                if other in among and other not in seen and allowed:
                    seen.add(other)
                    found.append(other)
        return found

    def closest(
        self,
        tasks: Sequence[Task],
        near: FloatArray,
        around: Collection[int] | None = None,
        most: int = PROGRAMS,
    ) -> Found:
        """Return the pose that meets `tasks` best; the model stands there.

        Several searches begin at different poses. The one goes on whose present pose promises most, by what a step
        may miss; the others are left as soon as they promise less than the best one has found,
        or have come to where another has been.

        Args:
            tasks: What to do.
            near: Of poses equally good the one nearest to these angles [rad] is taken, shape (s,).
            around: Poses of the roadmap that it has to hang together with; None for home.
            most: Programs to solve, at most.
        """
        if around is None:
            around, _ = self.around(self._roadmap.poses[0].state)
        inside = self._roadmap.within(FARTHEST)
        straight = [
            replace(task, curvature=0.0) if isinstance(task, PositionTask | TiltTask) else task
            for task in tasks
        ]
        todo = self._promising(straight, sorted(inside.intersection(around) or around))
        return self._best(tasks, straight, todo, near, most)

    def _best(
        self,
        tasks: Sequence[Task],
        straight: Sequence[Task],
        todo: list[tuple[Promise, Found]],
        near: FloatArray,
        most: int,
    ) -> Found:
        """Return the best end of the searches `todo`; `straight`: the tasks as a promise counts them."""
        best: Found | None = None  # of those that have ended
        most += self.count
        while todo and self.count < most:
            promised, found = min(todo, key=lambda search: search[0])
            if best and promised[0] > best.solution.residual + SAME / 100:
                break
            todo.remove((promised, found))
            after = self._descended(tasks, found)
            solution = after.solution
            if solution.outcome is Outcome.REACHED:
                best = after
                break
            others = [other for _, other in todo] + ([best] if best else [])
            if any(_alike(solution.state, state) for other in others for _, state in other.trail[1:]):
                continue
            gained = found.solution.residual - solution.residual
            if solution.outcome is Outcome.UNFINISHED and gained > GAIN * solution.residual:
                todo.append((self._promised(straight, solution.state)[0], after))
                continue
            after = replace(after, solution=replace(solution, outcome=Outcome.CLOSEST, reason=""))
            if best is None or _is_better(solution, best.solution, near):
                best = after
        ends = ([best] if best else []) + [found for _, found in todo if found.solution.iterations]
        end = min(ends, key=lambda found: found.solution.residual)
        self.model.restore(end.trail[-1][0])
        return end

    def _promising(self, tasks: Sequence[Task], numbers: Sequence[int]) -> list[tuple[Promise, Found]]:
        """Return poses from which a step leads near to what `tasks` ask, to different ends, and what it promises."""
        poses = self._roadmap.poses
        missed = foretold(tasks, [poses[n].state for n in numbers])
        some = [numbers[i] for i in np.argsort(missed, kind="stable")[:PROMISING]]
        promised = {n: self._promised(tasks, poses[n].state) for n in some}
        chosen: list[int] = []
        for number in sorted(some, key=lambda n: (promised[n][0], n)):
            near = {number, *poses[number].neighbours}  # and their neighbours: on one sheet
            near |= {m for n in near for m in poses[n].neighbours}
            if len(chosen) < SEEDS and all(
                np.abs(promised[number][1] - promised[n][1]).max() > APART for n in near.intersection(chosen)
            ):
                chosen.append(number)
        return [(promised[n][0], self._begun(tasks, n)) for n in chosen]

    def _begun(self, tasks: Sequence[Task], number: int) -> Found:
        """Return the search that begins at a pose of the roadmap, or at the nearest angles that are allowed."""
        pose = self._roadmap.poses[number]
        trail: tuple[Stop, ...] = ((pose.saved, pose.state),)
        inside = np.clip(pose.state.angles, self._low, self._high)
        if (inside != pose.state.angles).any():
            self.model.restore(pose.saved)
            with suppress(StepError, SceneError):
                self.model.follow(inside, shortest=SHORTEST)
                trail = (*trail, (self.model.save(), self.model.state()))
        return self._search(tasks, number, trail)

    def _search(self, tasks: Sequence[Task], number: int, trail: tuple[Stop, ...]) -> Found:
        """Return the search that begins at the end of a trail."""
        state = trail[-1][1]
        missed = _missed(tasks, state)
        solution = Solution(Outcome.UNFINISHED, "", state, missed, {}, (), 0.0, np.inf, 0, 0.0)
        return Found(solution, number, trail)

    def _promised(self, tasks: Sequence[Task], state: LinearState) -> tuple[Promise, FloatArray]:
        """Return what a step of the grid promises, and the angles that it leads to [rad].

        What is foretold of snaps does not count: for a step as long as that it is far too much.
        """
        problem = build_ik(state, tasks, [self._angles, StepLimit(SPACING)], self._row_limits)
        result = self._foretell.solve(problem)
        if not result.ok:
            return (total_distance(tasks, [r.error for r in problem.rows]), 0.0), state.angles
        square = float(np.sum((result.command - state.angles) ** 2))
        missed = max(0.0, result.residual - BEND / 2 * square - self._tolerance)
        steps = square / min(longest_step(state), LONGEST / 2) ** 2
        return (round(missed, 2 * DIGITS), round(steps, DIGITS)), result.command

    def _descended(self, tasks: Sequence[Task], found: Found) -> Found:
        """Continue a search."""
        self.model.restore(found.trail[-1][0])
        solution = self._solver.descend(tasks, CHUNK)
        self.count += solution.iterations
        if self._progress:
            self._progress(self.count, solution.residual)
        return Found(solution, found.number, (*found.trail, *self._solver.trail))

    def way(self, state: LinearState, tasks: Sequence[Task], trail: Sequence[LinearState] = ()) -> JointPath:
        """Return the way from `state` to the pose that meets `tasks` best; `NO_PATH` where the model does not come to
        `state`. It is a `PathSource` that answers at once.

        Of questions that are images of each other one is answered, so that the answers are images, too.
        """
        asked = [(self._roadmap.images[0], tuple(tasks))]
        if self._symmetric:
            seen = [(image, [image.task(task) for task in tasks]) for image in self._roadmap.images]
            asked = [(image, tuple(t for t in found if t)) for image, found in seen if all(found)] or asked
        image, tasks = max(asked, key=lambda question: _order(state, *question))
        way = self._way(image.state(state), tasks, [image.state(passed) for passed in trail])
        return replace(
            way,
            stops=np.array([image.back(stop) for stop in way.stops]).reshape(way.stops.shape),
            limits=image.names(way.limits, state.joint_names),
        ) if way is not NO_PATH else NO_PATH  # fmt: skip

    def _way(self, state: LinearState, tasks: Sequence[Task], trail: Sequence[LinearState]) -> JointPath:
        around, back = self.around(state, trail)
        if not around:
            return NO_PATH
        farthest = _missed(tasks, state) + DETOUR
        poses = self._roadmap.poses
        inside = {number for number in around[1:] if _missed(tasks, poses[number].state) <= farthest}
        near, here = self._hanging_together(around[0], inside), (self.model.save(), state)
        begin, count = [here, *reversed(back)], self.count
        begun = self._search(tasks, HERE, (here,))
        best = self._best(tasks, tasks, [((0.0, 0.0), begun)], state.angles, LEAST if back else 2 * CHUNK)
        if best.solution.outcome is not Outcome.REACHED:
            on, best = best, self.closest(tasks, state.angles, around)
            if back and on.solution.residual < best.solution.residual + SAME:
                best = on  # it is beyond the poses of the roadmap, and better goes on
        kept = self._shortened(*self._stops(best, around[0], around, begin))
        if len(near) < len(around) and max(_missed(tasks, stop) for _, stop in kept) > farthest:
            left = max(PROGRAMS - (self.count - count), LEAST)
            closer = self.closest(tasks, state.angles, near, left)
            if closer.solution.residual <= best.solution.residual + GAINED:
                best, kept = closer, self._shortened(*self._stops(closer, around[0], near, begin))
        return JointPath(
            np.array([stop.angles for _, stop in kept[1:]]),
            best.solution.residual,
            best.solution.active_limits,
            np.array([stop.stability_margin for _, stop in kept[1:]]),
            self._reason(tasks, state, best.solution, around),
        )

    def _stops(
        self, best: Found, start: int, among: Collection[int], back: Sequence[Stop]
    ) -> tuple[list[Stop], int]:
        """Return the stops from where the robot is to the end of a search, and how many of the last are the search's.

        Args:
            best: The search.
            start: The pose of the roadmap that the robot came from.
            among: Poses of the roadmap that the way may lead by.
            back: Where the robot is, and the stops from there to that pose.
        """
        rest = best.trail[1:]
        if best.number == HERE:
            return [back[0], *rest], len(rest)
        ways = self._roadmap.roads.ways(start, among)
        number, longest = best.number, ways.time(best.number) + time_of([found for _, found in best.trail])
        for time, other in self._roadmap.near(best.solution.state, among, ways):
            if time > longest - WORTH or other == best.number:
                break
            if self._roadmap.comes_to(best.solution.state, other):
                number, rest = other, best.trail[-1:]
                break
        poses = [self._roadmap.poses[n] for n in ways.to(number)]
        return [*back, *((p.saved, p.state) for p in poses), *rest], len(rest)

    def _reason(
        self, tasks: Sequence[Task], state: LinearState, solution: Solution, around: Sequence[int]
    ) -> str:
        """Return what limits of torques and effector have to do with what a solution misses; empty: nothing.

        Found by a search without them, where they were active or part poses from those of `around`.
        """
        if not self._row_limits or solution.residual <= GAINED:
            return ""
        free = Planner(self._roadmap, self._angles, tolerance=self._tolerance)
        all_around = free._hanging_together(around[0], self._roadmap.within(FARTHEST))
        names = {name for limit in self._row_limits for name in limit.rows(state).names}
        if len(all_around) == len(around) and names.isdisjoint(solution.active_limits):
            return ""
        other = free.closest(tasks, state.angles, all_around).solution
        self.count += free.count
        if other.residual > solution.residual - GAINED:
            return ""
        closer = f"{1e3 * (solution.residual - other.residual):.1f} mm closer"
        if needs := [
            limit.needs(other.state) for limit in self._row_limits if limits_passed(other.state, [limit])
        ]:
            return f"a pose {closer} needs {' and '.join(needs)}"
        return f"the path to a pose {closer} exceeds the limit of the {self._row_limits[0].what}"

    def _shortened(self, stops: Sequence[Stop], searched: int) -> list[Stop]:
        """Return stops without some of the first and last ones: where the way begins and ends is not on the grid.

        Of the last stops `searched` are those of a search.
        """
        last = len(stops) - 1

        def saves(k: int, after: int) -> bool:
            between = time_of([state for _, state in stops[k : after + 1]])
            saved = between - quickest(stops[k][1], stops[after][1])
            return saved > WORTH and self._time(stops[k], stops[after]) < between

        first = next((k for k in range(min(1 + CUT, last), 1, -1) if saves(0, k)), 1)
        grid = range(max(last - searched - CUT, first), min(last - searched + 1, last - 1))
        final = next((k for k in grid if saves(k, last)), last - 1)
        return [stops[k] for k in sorted({0, *range(first, final + 1), last})]

    def _time(self, start: Stop, end: Stop) -> float:
        """Return about how long the straight way from one pose to another takes [s]; infinite where there is none."""
        self.model.restore(start[0])
        passed = [start[1]]
        least_margin = WITHIN * max(
            LEAST_MARGIN, min(CALM, start[1].stability_margin, end[1].stability_margin)
        )
        try:
            self.model.follow(
                end[1].angles,
                least_margin=least_margin,
                shortest=SHORTEST / 2,
                longest=LONGEST,
                passed=passed,
            )
        except (StepError, SceneError):
            return np.inf
        there = np.abs(passed[-1].equilibrium - end[1].equilibrium).max() < SAME
        return time_of(passed) if there else np.inf


def foretold(tasks: Sequence[Task], states: Sequence[LinearState]) -> FloatArray:
    """Return how near [m] a linear step of at most the grid's spacing brings each of `states` to what `tasks` ask."""
    rows = [[task.rows(state) for task in tasks] for state in states]
    e = np.array([np.concatenate([r.weights * r.error for r in found]) for found in rows])
    J = np.array([np.concatenate([r.weights[:, None] * r.jacobian for r in found]) for found in rows])
    normal = J.transpose(0, 2, 1) @ J + DAMPING**2 * np.eye(J.shape[2])
    steps = np.linalg.solve(normal, (J.transpose(0, 2, 1) @ e[:, :, None]))[:, :, 0].clip(-SPACING, SPACING)
    return np.array([
        total_distance(tasks, [r.error - r.jacobian @ step for r in found])
        for found, step in zip(rows, steps, strict=True)
    ])  # fmt: skip


def _order(state: LinearState, image: Image, tasks: Sequence[Task]) -> tuple[float, ...]:
    """Return by what one of several images of a question is chosen: the largest angles first, then the target."""
    places = [task.rows(image.state(state)).error for task in tasks]
    return tuple(
        np.concatenate([state.angles[image.servos].round(3), *(e.round(6) for e in places)]).tolist()
    )


def _missed(tasks: Sequence[Task], state: LinearState) -> float:
    """Return what tasks miss in a state [m]."""
    return total_distance(tasks, [task.rows(state).error for task in tasks])


def _alike(state: LinearState, other: LinearState) -> bool:
    """Return whether two searches have come to where they go on to the same pose."""
    turn, move = state.angles - other.angles, state.equilibrium - other.equilibrium
    return bool(np.abs(turn).max() < APART and np.abs(move).max() < OFF)


def _is_better(solution: Solution, other: Solution, near: FloatArray) -> bool:
    """Return whether a solution is closer; of two equally close ones, nearer to the angles `near` [rad]."""
    gain = other.residual - solution.residual
    away, there = (float(np.linalg.norm(s.state.angles - near)) for s in (solution, other))
    return gain > SAME / 100 or (away < there and gain > -SAME / 100)
