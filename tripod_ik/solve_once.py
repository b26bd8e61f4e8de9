"""One inverse kinematics, from a scene and a target to a summary: what `tripod ik --target` does.

It is the node's rule, `Tracker` and `Planner`, on a quasi-static model that is at each command at once: so command
and node have the same answer from the same start within the same limits.
"""

import time as clock
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from enum import StrEnum
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.arrays import frozen
from tripod_ik.errors import IkError
from tripod_ik.joint_path import NO_PATH, JointPath, why_closest
from tripod_ik.mesh_error import mesh_of
from tripod_ik.model import StaticModel
from tripod_ik.planner import Planner
from tripod_ik.roadmap import Roadmap
from tripod_ik.rotation import normal_of, roll_pitch
from tripod_ik.row_limits import effort_limits
from tripod_ik.state import LinearState
from tripod_ik.target import TargetBox
from tripod_ik.tasks import PositionTask, Task, total_distance
from tripod_ik.tracker import Activity, Tracker, TrackerStep
from tripod_ik.tracker_settings import Goal, TrackerSettings
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene
from tripod_sim.tables.fields import other_unit
from tripod_sim.tables.short_forms import effector_of, joints_of

FAR = 2.0
"""A target farther from the effector than so many sizes of the body is no pose that somebody wants."""

DT, STEPS = 0.05, 400
"""Time between commands [s], and how many there are at most."""

GAINED, RESTS = 1e-9, 10
"""So many commands that bring a robot at its closest pose no closer than this [m] end the motion."""

SHORTEST = 1e-4
"""Part of the way to a command [rad] below which the end of the equilibria is not looked for more closely."""


PARTS = (1.0, 0.3, 0.1, 0.03)
"""Parts of a command that are tried one after another."""


class Outcome(StrEnum):
    """How a motion to a target ended."""

    REACHED = "reached"
    CLOSEST = "closest pose: the target is out of reach"
    ENDED = "stopped: no equilibrium ahead"
    UNFINISHED = "not converged"
    FAILED = "not solved"


def solve_once(
    scene: Scene,
    target: Sequence[float],
    *,
    more: Mapping[str, Sequence[float]] | None = None,
    tilt: Sequence[float] = (0.0, 0.0),
    goal: Goal = Goal.POSITION,
    slide: float,
    start: Sequence[float] | None = None,
    torque_max: float = TrackerSettings.torque_max,
    hard: bool = False,
    box: tuple[FloatArray, FloatArray] | None = None,
    tolerance: float = TrackerSettings.tolerance,
    progress: Callable[[int, float], None] | None = None,
) -> dict[str, Any]:
    """Return angles, torques and what is missing for a target.

    Where the scene has cables, chambers or forces, no search over other poses helps on where no step comes closer, and
    actuators that the goal leaves free take the least energy, see `problem.least_energy`.

    Args:
        scene: Of the robot; solved without inertia. The ranges of its actuators are the limits.
        target: x, y, z of the effector at rest [m] in `world`.
        more: x, y, z [m] of places in `[[effector.more]]`, by name; others are free. They count by their weights.
        tilt: Roll and pitch [rad], where the goal has a tilt.
        goal: What of both is asked for.
        slide: Inward shift of the servo bodies [m].
        start: Commands [rad, m, N, Pa] from which the robot moves; None: see `StaticModel`.
        torque_max: Largest torque of servos [N m]; infinite for no limit. Tensions keep to `tension_max` of the cables.
        hard: Whether torques and box are hard limits.
        box: Smallest and largest corner of where the effector may be [m], or None.
        tolerance: What may be missing where the target counts as reached [m].
        progress: Called with the number of linearisations so far and with the least that was missing so far [m]; at
            last with those of the answer.

    Returns:
        outcome and reason (words), reached (bool), names and units of the joints, angles (commands) [rad, m, N, Pa],
        torques (efforts dV/dq) [N m, N, m, m³], position [m],
        places (positions by name [m]), roll and pitch [rad; None of a point or a set],
        error [m], with the scene's `mesh_error` that of the model there (effector, distance) [m], residuals (by task,
        with unit), active_limits, kkt [rad], iterations (linearisations), seconds, path (angles [rad] through which
        the servos go, each straight from the one before).

    Raises:
        IkError, SceneError: the input is refused.
        StepError: there is no way to the start.
    """
    position = frozen("target", target, (3,))
    roll, pitch = frozen("tilt", tilt, (2,))
    joints = joints_of(scene)
    begin = None if start is None else frozen("start", start, (joints.count if joints else 0,))
    effector = effector_of(scene)
    if goal is not Goal.POSITION and effector and not effector.is_disc:
        raise IkError(
            f"goal is {str(goal)!r}, but the effector of scene {scene.name!r} is a point or a set, which has no "
            "orientation; take goal 'position', or a disc as effector"
        )
    if begin is not None and joints:
        begin = begin / joints.spans
    settings = TrackerSettings(
        goal=goal, torque_max=torque_max, hard=hard, box=box and (tuple(box[0]), tuple(box[1])), tolerance=tolerance
    )  # fmt: skip
    model = StaticModel(scene, slide, begin)
    if joints is None:  # StaticModel has refused it
        raise StepError("the scene has no servos; add [servos]")
    places = {place.name: place.weight for place in effector.more} if effector else {}
    further = [
        PositionTask(frozen(f"target of {name}", at, (3,)), np.full(3, places[name]), name=name, place=name)
        for name, at in (more or {}).items()
        if _is_place(name, places)
    ]
    for wanted in (position, *(task.target for task in further)):
        _check_near(wanted, model)
    turns = not effector or effector.is_disc
    began, spans = clock.perf_counter(), joints.spans
    motion = _Motion(model, settings, further, progress)
    normal = normal_of(float(roll), float(pitch))
    outcome, step = motion.go(position, normal)
    state = motion.model.state()
    found = roll_pitch(state.equilibrium_rotation[:, 2])
    tasks = motion.tasks(position, normal)
    return {
        "outcome": str(outcome),
        "reason": "" if outcome is Outcome.REACHED else motion.reason,
        "reached": outcome is Outcome.REACHED,
        "names": [a.name for a in joints.actuators],
        "units": [a.unit for a in joints.actuators],
        "angles": (state.angles * spans).tolist(),
        "torques": (state.efforts / spans).tolist(),
        "position": state.equilibrium.tolist(),
        "places": {name: state.place(name)[0].tolist() for name in state.places},
        "roll": found[0] if turns else None,
        "pitch": found[1] if turns else None,
        "error": missed(tasks, state),
        **_mesh_error(model, state.angles),
        "residuals": {n: d for task in tasks for n, d in task.distances(task.rows(state).error).items()},
        "active_limits": [] if outcome is Outcome.REACHED else list(step.result.active_limits),
        "kkt": step.result.kkt,
        "iterations": motion.linearisations,
        "path": [(stop * spans).tolist() for stop in (*motion.path, state.angles)],
        "seconds": clock.perf_counter() - began,
    }


def missed(tasks: Sequence[Task], state: LinearState) -> float:
    """Return what tasks miss in a state [m]."""
    return total_distance(tasks, [task.rows(state).error for task in tasks])


class _Motion:
    """The motion of a model to a target, commanded as the node does.

    Attributes:
        model: The robot.
        reason: Why it does not come closer, in words.
        path: Angles [rad] through which it was led before the last.
    """

    def __init__(
        self,
        model: StaticModel,
        settings: TrackerSettings,
        more: Sequence[Task],
        progress: Callable[[int, float], None] | None,
    ) -> None:
        """`more`: tasks beside the target; `progress`: see `solve_once`."""
        joints = joints_of(model.scene)
        assert joints is not None
        self.model, self._progress, self._settings = model, progress, settings
        self._tracker = Tracker(settings, guide=self._way)
        self._tracker.more = tuple(more)
        self._tracker.resize(joints.count)
        self._tracker.narrow(
            joints.low / joints.spans, joints.high / joints.spans, settings.angle_speed,
            effort_limits(joints.actuators, settings.torque_max),
        )  # fmt: skip
        self._others = bool(joints.others)
        self._finder: Planner | None = None
        self._least = np.inf
        self.reason = ""
        self.path: list[FloatArray] = []

    @property
    def linearisations(self) -> int:
        """How many states of the robot were computed."""
        return self.model.linearisations + (self._finder.model.linearisations if self._finder else 0)

    def tasks(self, position: FloatArray, normal: FloatArray) -> tuple[Task, ...]:
        """Return all that is to be done."""
        return (*self._settings.tasks(position, normal), *self._tracker.more)

    def go(self, position: FloatArray, normal: FloatArray) -> tuple[Outcome, TrackerStep]:
        """Move to `position` [m] and `normal`, shape (3,) each; return how it ended, and the last command."""
        outcome, step = self._go(position, normal)
        self._least = missed(self.tasks(position, normal), self.model.state())
        self._tell(self._least)
        return outcome, step

    def _go(self, position: FloatArray, normal: FloatArray) -> tuple[Outcome, TrackerStep]:
        tasks = self.tasks(position, normal)
        self._tracker.aim(position, None if self._settings.goal is Goal.POSITION else normal, 0.0)
        state, rests, least = self.model.state(), 0, np.inf
        outcome = Outcome.UNFINISHED
        for k in range(STEPS):
            step = self._tracker.update(state, k * DT)
            if not step.result.ok:
                self.reason = step.result.status
                return Outcome.FAILED, step
            try:
                state = self._moved(step.result.command)
            except (StepError, SceneError) as error:
                self.reason = f"the next step towards the target has none: {error}"
                return Outcome.ENDED, step
            missing = missed(tasks, state)
            self._tell(missing)
            met = missing <= self._settings.tolerance
            ended = step.activity is Activity.CLOSEST or (met and step.activity is not Activity.SEARCHING)
            rests = rests + 1 if ended and missing > least - GAINED else 0
            least = min(least, missing)
            if rests == RESTS:
                outcome = Outcome.REACHED if met else Outcome.CLOSEST
                break
        else:
            self.reason = f"the robot did not come to rest within {STEPS} commands"
        if outcome is Outcome.CLOSEST:
            self.reason = why_closest(step.result.active_limits, self.reason, searched=not self._others)
        return outcome, step

    def _moved(self, command: FloatArray) -> LinearState:
        """Return the state after a move to `command` [rad], shape (n,); with actuators that are no servos after a part
        of the way where the whole has no equilibrium. Raises StepError where there is none.
        """
        begin = self.model.angles
        for part in PARTS if self._others else ():
            with suppress(StepError):
                return self.model.move(begin + part * (command - begin))
        return self.model.follow(command, shortest=SHORTEST)

    def _tell(self, missing: float) -> None:
        self._least = min(self._least, missing)
        if self._progress:
            self._progress(self.linearisations, self._least)

    def _way(self, state: LinearState, tasks: Sequence[Task], trail: Sequence[LinearState] = ()) -> JointPath:
        """Return the way to the closest pose: see `PathSource`."""
        try:
            if self._finder is None:
                roadmap = Roadmap.of(self.model.scene, self.model.slide, lambda _: self._tell(np.inf))
                self._finder = Planner(
                    roadmap, *self._tracker.reach, progress=lambda _, missing: self._tell(missing)
                )
            way = self._finder.way(state, tasks, trail)
        except (SceneError, StepError) as error:
            self.reason = f"there is no model with which to search further: {error}"
            return NO_PATH
        self.reason = way.reason
        self.path += [state.angles, *way.stops[:-1]]
        return way


def _mesh_error(model: StaticModel, angles: FloatArray) -> dict[str, Any]:
    """Return the error of the mesh at the effector at `angles` [m], where the scene asks for it; NaN if not known."""
    if not (mesh := mesh_of(model)):
        return {}
    model.move(angles)
    found = mesh.error(model.simulation.state)
    return {"mesh_error": {"effector": model.shown(found.effector).tolist(), "distance": found.distance}}


def _is_place(name: str, places: Mapping[str, float]) -> bool:
    """Return True; raise IkError unless the effector has a place of that name."""
    if name not in places:
        known = ", ".join(places) or "none"
        raise IkError(f"target of {name!r}: the scene has no such place in [[effector.more]]; known: {known}")
    return True


def _check_near(target: FloatArray, model: StaticModel) -> None:
    """Raise IkError for a target that is far off all that the robot could reach, as one in millimetres is."""
    pose = model.simulation.effector
    if pose is None:  # StaticModel has refused it
        return
    middle, far = np.asarray(pose.position), FAR * float(np.ptp(model.simulation.positions, axis=0).max())
    TargetBox(middle - far, middle + far).check_position(target, other_unit)
