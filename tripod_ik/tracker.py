"""Following a target: from each new state to the next command, with what must be remembered in between.

Pure: the caller gives the time.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import partial
from math import exp, hypot

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.arrays import frozen
from tripod_ik.branch import branch, is_beyond
from tripod_ik.feedback import ModelError
from tripod_ik.joint_path import PathSource
from tripod_ik.limits import AngleLimit, IntervalLimit, SpeedLimit, StepLimit
from tripod_ik.path_follower import PathFollower
from tripod_ik.problem import LONGEST_RELAXATION, IkProblem, build_ik, overshoots, seen_turning
from tripod_ik.row_limits import EffectorBox, RowLimit, TorqueLimit, tension_limits
from tripod_ik.smoothing import Smoothing
from tripod_ik.snap_through import (
    LEAST_MARGIN,
    SNAP,
    SOFTENING,
    SWING,
    SnapThroughLimit,
    firm_enough,
    longest_step,
)
from tripod_ik.solver import IkResult, IkSolver
from tripod_ik.state import LinearState
from tripod_ik.target_motion import TargetMotion
from tripod_ik.tasks import (
    TILT,
    PostureTask,
    Task,
    total_distance,
)
from tripod_ik.tracker_settings import TrackerSettings

LONGEST_DT = 0.1
"""Time between commands [s] that the speed limit grants at most: after a gap the robot does not leap."""

STUCK = 0.1
"""A step that is to remove less than this part of the error, with no limit on step or speed active, is at the
end.
"""


RETURN = 0.1
"""Time at a pose of the trail [s] after which a body that is still beyond the fold is led farther back."""

SPACING, TRAIL = 0.03, 200
"""Distance of the poses of the trail [rad], and how many of them are remembered."""

SHORTEST = 1e-5
"""To which the step limit shrinks [rad]."""

LASTING, FEW = 1.0, 10
"""Time [s] and updates without coming closer after which a pose counts as the closest, of robots with other joints than
servos."""

CALM = 1e-3
"""Distance from rest [m] up to which a pose is one to come back to."""

SMOOTH, AMPLE_MARGIN = 0.1, 0.2
"""Time [s] over which commands are smoothed, see `Tracker`; stability margin from which on it is not shorter."""

HALVINGS = 10
"""Lengths of a step that are tried beside hard limits."""


class Activity(IntEnum):
    """Values of tripod_msgs/IkStatus.state."""

    IDLE = 0
    TRACKING = 1
    CLOSEST = 2
    STALE = 3
    SOLVER_FAILED = 4
    SEARCHING = 5


@dataclass(frozen=True, eq=False)
class TrackerStep:
    """One step of the tracker.

    Attributes:
        activity: TRACKING, CLOSEST, SEARCHING or SOLVER_FAILED; send `result.command` unless it is the last. SEARCHING:
            no step comes closer, and the robot waits where it is until the guide has answered.
        reason: Why the guide knows no closer pose, in words; empty where nothing is known.
        target: What is being followed [m], shape (3,).
        error: Distance from the target to the effector as it is, not at rest [m]; tilts count by the lever.
        tilt_error: The tilt in it [rad]; 0 if only the position is followed.
        tilt_residual: What is left of the tilt after this command, at rest [rad].
        result: What inverse kinematics gave.
    """

    activity: Activity
    target: FloatArray
    error: float
    tilt_error: float
    tilt_residual: float
    result: IkResult
    reason: str


class Tracker:
    """Turns states into commands that bring the effector to the target.

    The first command after `start` equals the present angles, and without a target the tracker keeps the
    effector where it would come to rest: beginning to track moves nothing. A servo found above the torque
    limit is not moved to relieve it: what it bears then is its limit, until it is once below `torque_max`. An effector
    found outside of the box is not brought in either: where it is then is the side, until it is once inside.

    It stays on the branch of the pose that it began in, off its snap-throughs (`SnapThroughLimit`), and the farther the
    more the body swings (`firm_enough`). Where a state is found beyond
    a fold or a snap, the command goes back along the trail of poses that it came by, as far as need be, and steps are
    halved until the target moves: what remains is the closest pose on this side. Where the trail ends and the
    body is still beyond, the pose is taken as it is.

    Attributes:
        settings: How it moves the robot.
        more: What is to be done beside the target, such as targets of further places.
        correction: What is known of the model's error; fed with measurements by the caller, or left at zero.
    """

    def __init__(
        self,
        settings: TrackerSettings,
        correction: ModelError | None = None,
        guide: PathSource | None = None,
        smooth: float = 0.0,
    ) -> None:
        """Begin without a target.

        Args:
            settings: How it moves the robot.
            correction: For a closed loop.
            guide: Asked for the way where no step comes closer to the target, see `PathFollower`.
            smooth: Time over which commands are smoothed, see `Smoothing`, where the target stands still [s]: `SMOOTH`,
                for a robot that goes evenly from one command to the next; or 0 for one that is there at once. With a
                body that is less firm than `AMPLE_MARGIN` it is shorter, and none at `LEAST_MARGIN`: steps there are
                as short as `longest_step`, and what lags would make them slower.
        """
        self.settings = settings
        self.more: tuple[Task, ...] = ()
        self._smooth_over = smooth
        self._guidance = PathFollower(guide)
        self.correction = correction
        self._limits = (
            AngleLimit(settings.angle_min, settings.angle_max),
            SpeedLimit(settings.angle_speed),
        )
        self._limited = bool(np.isfinite(settings.torque_max))
        self._servos, self._cables = 0, 0
        self._torque_max: FloatArray | float = settings.torque_max
        self._motion = TargetMotion(settings.lead)
        self._target: FloatArray | None = None
        self.start()

    def resize(self, n: int, cables: int = 0) -> None:
        """Prepare for `n` joints, from the start where it had others; `update` does it where their number changes.

        `cables`: how many of them are cables that are commanded by length.
        """
        if self._servos:
            self.start()
        self._servos, self._cables = n, cables
        rows = 1 + (n if self._limited else 0) + (3 if self.settings.box else 0) + cables
        self._solver = IkSolver(n, rows=rows)

    def narrow(
        self, low: FloatArray, high: FloatArray, speed: float, torque_max: FloatArray | None = None
    ) -> None:
        """Keep to angles from `low` to `high` [rad], to `speed` [rad/s] and, where given, to torques up to `torque_max`
        [N m], infinite for none, else up to that of the settings, from now on; arrays of shape (n,).
        """
        self._limits = AngleLimit(low, high), SpeedLimit(speed)
        self._torque_max = self.settings.torque_max if torque_max is None else torque_max
        limited, self._limited = self._limited, bool(np.isfinite(self._torque_max).any())
        if limited != self._limited and self._servos:
            self.resize(self._servos, self._cables)

    def adopt(self, settings: TrackerSettings) -> None:
        """Take other weights, tolerance, lever, lead, step and effector_speed from now on; the rest is as before."""
        self.settings, self._motion.lead, self._trust = settings, settings.lead, settings.step

    @property
    def reach(self) -> tuple[AngleLimit, list[RowLimit]]:
        """Limits of the angles, and of torques and effector: within these the closest pose is looked for."""
        s = self.settings
        limits: list[RowLimit] = []
        if self._limited:
            limits.append(TorqueLimit(self._torque_max, hard=s.hard))
        if s.box is not None:
            limits.append(EffectorBox(*(np.array(side) for side in s.box), hard=s.hard))
        return self._limits[0], limits

    @property
    def target(self) -> FloatArray | None:
        """The target's position [m], shape (3,); None while there is none, then the tracker keeps the effector
        where it is. One that is set so stands still, with the normal that the effector has now.
        """
        return None if self._target is None else self._target[:3]

    @target.setter
    def target(self, target: FloatArray | None) -> None:
        if target is None:
            self._target = None
            self._motion.clear()
        else:
            self._motion.clear()
            self.aim(target, None, 0.0)

    def aim(self, position: FloatArray, normal: FloatArray | None, now: float) -> None:
        """Follow a target that comes at `now` [s] of the caller's steady clock.

        Args:
            position: [m], shape (3,).
            normal: Of the effector, shape (3,); None keeps the one that it has.
            now: [s]; several targets in a row make a motion, see `TargetMotion`.
        """
        upright = np.full(3, np.nan) if normal is None else frozen("normal", normal, (3,))
        target = np.concatenate([frozen("target", position, (3,)), upright])
        if self._target is None or not np.array_equal(target, self._target, equal_nan=True):
            self._trust, self._relax = self.settings.step, LONGEST_RELAXATION
        self._target = target
        self._motion.add(target, now)

    def start(self) -> None:
        """Begin again from the angles of the next state."""
        self._previous: FloatArray | None = None
        self._torque: FloatArray | None = None
        self._sides: tuple[FloatArray, FloatArray] | None = None
        self._time = 0.0
        self._kept: FloatArray | None = None
        self._side = 0.0
        self._trail: deque[LinearState] = deque(maxlen=TRAIL)
        self._back: float | None = None
        self._trust = self.settings.step
        self._least: float | None = None
        self._swing = 0.0
        self._smoothing = Smoothing()
        self._plan = False, False
        self._seen: LinearState | None = None
        self._turning, self._relax = 0.0, LONGEST_RELAXATION
        self._problem: IkProblem | None = None
        self._came = (
            float("inf"),
            0.0,
            0,
        )  # distance [m] at the last `STUCK` closer, when [s], updates since
        self._guidance.reset()
        if self.correction:
            self.correction.reset()

    def update(self, state: LinearState, now: float) -> TrackerStep:
        """Return the next command for `state`, received at `now` [s] of the caller's steady clock."""
        tension = self._fit(state)
        dt = 0.0 if self._previous is None else min(max(0.0, now - self._time), LONGEST_DT)
        if self._kept is None:
            self._kept = np.concatenate([state.equilibrium, state.equilibrium_rotation[:, 2]])
        over = dt if self._smooth_over > 0 else 0.0  # that is how long it takes to be where a command says
        wanted, aimed_at = self._wanted(now, 0.0), self._wanted(now, over)
        position, normal = self._corrected(aimed_at, state, now)
        wanted_tasks = (*self.settings.tasks(position, normal), *self.more)
        tasks: Sequence[Task] = wanted_tasks
        here = branch(state, tasks)
        aimed = np.concatenate([position, normal])
        self._swing = max(hypot(*state.equilibrium_offset[:3].tolist()), self._swing * exp(-dt / SWING))
        firm = firm_enough(self._swing)
        led, beyond = self._planned(state, here, aimed, firm, now, dt)
        if led is not None:
            tasks = (PostureTask(led, weight=1.0),)
        elif beyond:
            tasks = (PostureTask(self._trail[-1].angles, weight=1.0),)
        free = beyond or led is not None
        step = self.settings.step if free else min(self._trust, longest_step(state))
        limits = (self._limits[0], StepLimit(step), self._limits[1])
        row_limits = [*self._row_limits(state, dt, firm, led=led is not None), *tension]
        result = self._solved(state, tasks, limits, row_limits, dt)
        if self._trust < self.settings.step:  # what is left of the step is no way to go
            kept = tuple(name for name in result.active_limits if not name.endswith(" step"))
            if len(kept) < len(result.active_limits):
                result = replace(result, active_limits=(*kept, "branch"))
        if tasks is not wanted_tasks:  # the program solved was that of the way
            left = total_distance(wanted_tasks, [task.rows(state).error for task in wanted_tasks])
            residuals = {
                k: d for task in wanted_tasks for k, d in task.distances(task.rows(state).error).items()
            }
            more = ("branch",) if beyond else self._guidance.limits
            names = tuple(dict.fromkeys((*result.active_limits, *more)))
            result = replace(result, error=left, residual=left, residuals=residuals, active_limits=names)
        self._previous, self._time = result.command, max(self._time, now)
        if result.ok and self._smooth_over > 0:
            result = replace(
                result, command=self._smooth(result.command, state.stability_margin, beyond=beyond)
            )
        error, tilt = self._present_error(state, wanted)
        activity = self._activity(
            result, beyond=beyond, advances=bool(state.held) and self._advances(result, now)
        )
        before_snap = SNAP in result.active_limits and result.residual > self.settings.tolerance
        closest = activity is Activity.CLOSEST
        if not state.held:  # the planner knows servos alone
            self._guidance.look(
                state, wanted_tasks, aimed, result.residual, now, closest=closest, before_snap=before_snap,
                trail=tuple(self._trail),
            )  # fmt: skip
        if result.ok and self._guidance.waits and (closest or led is not None):
            activity = Activity.SEARCHING
        elif result.ok and led is not None and not self._guidance.arrived:
            activity = Activity.TRACKING
        left = result.residuals.get(TILT, 0.0)
        return TrackerStep(activity, wanted[:3], error, tilt, left, result, self._guidance.reason)

    def _fit(self, state: LinearState) -> tuple[RowLimit, ...]:
        """Resize to the joints of `state`, see how the Jacobian turned, and return the limits of tensions."""
        tension, n = tension_limits(state), len(state.angles)
        cables = sum(limit.size(n) for limit in tension)
        if (n, cables) != (self._servos, self._cables):
            self.resize(n, cables)
        if state.held:
            self._turning = max(self._turning / 2, seen_turning(self._seen or state, state))
            self._seen = state
        return tension

    def _wanted(self, now: float, more: float) -> FloatArray:
        """Return position [m] and normal that are followed, shape (6,); `more`: of the lead [s]."""
        assert self._kept is not None
        if self._target is None:
            return self._kept
        target = self._motion.at(now, more)
        return np.where(np.isfinite(target), target, self._kept)

    def _planned(
        self, state: LinearState, here: float, aimed: FloatArray, firm: float, now: float, dt: float
    ) -> tuple[FloatArray | None, bool]:
        """Return where the way leads [rad], None without one, and whether the way back is to be taken."""
        was_led, was_beyond = self._plan
        begin = self._previous if was_led else self._smoothing.place
        begin = self._previous if begin is None else begin
        led = self._guidance.command(
            state,
            state.angles if begin is None else begin,
            aimed,
            now,
            dt=dt,
            reach=self._limits[1].speed * dt,
            speed=self.settings.effector_speed,
            least_margin=firm,
        )
        beyond = led is None and self._is_beyond_fold(state, here, now)
        if led is not None:
            self._side, self._trust = 0.0, self.settings.step
            self._trail.clear()
        elif beyond:
            self._trust = max(self._trust / 2, SHORTEST)
        self._plan = led is not None, beyond
        if self._plan != (was_led, was_beyond):  # what was asked for before is no way to begin this one
            place = self._smoothing.cut()
            self._previous = self._previous if place is None else place
        return led, beyond

    def _solved(
        self,
        state: LinearState,
        tasks: Sequence[Task],
        limits: Sequence[IntervalLimit],
        row_limits: Sequence[RowLimit],
        dt: float,
    ) -> IkResult:
        """Return the result of a step that is not too fast for the effector and keeps off hard limits."""
        build = partial(
            build_ik, state, tasks, row_limits=row_limits, previous=self._previous, dt=dt, turning=self._turning,
            relax=self._relax,
        )  # fmt: skip
        problem = build(limits=limits)
        if self._problem and overshoots(self._problem, problem):
            self._relax = max(self._relax / 2, SHORTEST)
            problem = build(limits=limits, relax=self._relax)
        self._problem = problem
        result = self._solver.solve(problem)
        turn = result.command - problem.hold
        part = hypot(*(state.jacobian[:3] @ turn).tolist()) / max(self.settings.effector_speed * dt, 1e-12)
        if part > 1 + 1e-6 and dt > 0 and result.ok:
            limits = (*limits, SpeedLimit(float(np.abs(turn).max()) / (part * dt)))
            problem = build(limits=limits)
            result = self._solver.solve(problem)
        if self.settings.hard and result.ok:
            result = self._off_the_limits(problem, limits, row_limits, dt, result)
        return result

    def _off_the_limits(
        self,
        problem: IkProblem,
        limits: Sequence[IntervalLimit],
        row_limits: Sequence[RowLimit],
        dt: float,
        result: IkResult,
    ) -> IkResult:
        """Solve again, off the hard limits by what the linear model may miss in a step as long as that of `result`.

        Where little is then left of the step, it is tried half as long, which needs a quarter of the distance.
        """
        state, n = problem.state, len(problem.hold)
        longest = float(np.abs(result.command - state.angles).max())
        for _ in range(HALVINGS):
            if longest < SHORTEST:
                break
            within = build_ik(
                state, problem.tasks, (*limits, StepLimit(longest)), row_limits,
                previous=self._previous, dt=dt, ahead=np.sqrt(n) * longest, turning=self._turning, relax=self._relax,
            )  # fmt: skip
            shorter = self._solver.solve(within)
            names = (name for name in shorter.active_limits if not name.endswith(" step"))
            result = replace(shorter, active_limits=tuple(names))
            if not result.ok or np.abs(result.command - state.angles).max() >= longest / 2:
                break
            longest /= 2
        return result

    def _smooth(self, command: FloatArray, stability_margin: float, *, beyond: bool) -> FloatArray:
        """Return what is commanded on the way to `command`: where the target stands still a little later."""
        at_once = beyond or self._motion.moves(self._time)
        over = (
            0.0
            if at_once
            else self._smooth_over
            * min(max((stability_margin - LEAST_MARGIN) / (AMPLE_MARGIN - LEAST_MARGIN), 0.0), 1.0)
        )
        return self._smoothing.command(command, self._time, over, self._limits[1].speed)

    def _corrected(self, wanted: FloatArray, state: LinearState, now: float) -> tuple[FloatArray, FloatArray]:
        if self.correction is None:
            return wanted[:3], wanted[3:]
        self.correction.predict(state.equilibrium, state.equilibrium_rotation[:, 2], now)
        if self._target is None:  # what is kept is where the model is: measuring it moves nothing
            return wanted[:3], wanted[3:]
        return self.correction.corrected(wanted[:3], wanted[3:])

    def _is_beyond_fold(self, state: LinearState, here: float, now: float) -> bool:
        """Return whether the way back is to be taken; keep the trail that leads there."""
        calm = hypot(*state.equilibrium_offset[:3].tolist()) < CALM
        if self._side == 0:
            self._side = here
        if is_beyond(here, self._side) or state.stability_margin < min(0.0, self._least or 0.0):
            if not self._trail:
                self._side = here  # nowhere to go back to: the pose is taken as it is
                return False
            if self._back is None:
                self._back = now
            arrived = calm and np.abs(state.angles - self._trail[-1].angles).max() < SPACING / 10
            if arrived and now - self._back > RETURN:
                self._trail.pop()
                self._back = now
            return bool(self._trail)
        self._back = None
        if calm or not self._trail:  # the last pose is the present one, others are apart
            if len(self._trail) > 1 and np.abs(state.angles - self._trail[-2].angles).max() < SPACING:
                self._trail.pop()
            self._trail.append(state)
        return False

    def _present_error(self, state: LinearState, wanted: FloatArray) -> tuple[float, float]:
        here = state.as_it_is()
        tasks = (*self.settings.tasks(wanted[:3], wanted[3:]), *self.more)
        errors = [task.rows(here).error for task in tasks]
        distances = [task.distances(error) for task, error in zip(tasks, errors, strict=True)]
        return total_distance(tasks, errors), sum(d.get(TILT, 0.0) for d in distances)

    def _row_limits(self, state: LinearState, dt: float, firm: float, *, led: bool) -> list[RowLimit]:
        found = state.stability_margin
        self._least = LEAST_MARGIN if found >= LEAST_MARGIN else found if self._least is None else self._least
        snap = SnapThroughLimit(max(self._least, min(firm, found)), share=min(1.0, dt / SOFTENING))
        limits: list[RowLimit] = [
            SnapThroughLimit(-1.0) if led else snap
        ]  # the way is known to be firm enough
        if self._limited:
            limits.append(TorqueLimit(self._torque_ceiling(state), hard=self.settings.hard))
        if self.settings.box is not None:
            low, high = (np.array(side) for side in self.settings.box)
            here, before = state.equilibrium, self._sides or (state.equilibrium, state.equilibrium)
            low, high = np.where(here >= low, low, before[0]), np.where(here <= high, high, before[1])
            self._sides = low, high
            limits.append(EffectorBox(low, high, hard=self.settings.hard))
        return limits

    def _torque_ceiling(self, state: LinearState) -> FloatArray:
        found, maximum = np.abs(state.efforts), self._torque_max
        self._torque = np.where(found <= maximum, maximum, found if self._torque is None else self._torque)
        return self._torque

    def _advances(self, result: IkResult, now: float) -> bool:
        """Return whether the effector came closer lately: steps that are damped remove little of the error each."""
        distance, at, count = self._came
        if (
            result.error < (1 - STUCK) * distance or distance < (1 - STUCK) * result.error
        ):  # closer, or another target
            self._came = result.error, now, 0
            return True
        self._came = distance, at, count + 1
        return now - at < LASTING or count < FEW

    def _activity(self, result: IkResult, *, beyond: bool, advances: bool) -> Activity:
        if not result.ok:
            return Activity.SOLVER_FAILED
        if beyond:
            return Activity.CLOSEST
        on_the_way = (
            any(name.endswith((" speed", " step")) for name in result.active_limits)
            or result.residual < (1 - STUCK) * result.error
            or advances
        )
        return (
            Activity.TRACKING
            if result.residual <= self.settings.tolerance or on_the_way
            else Activity.CLOSEST
        )
